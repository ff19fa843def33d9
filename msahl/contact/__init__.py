"""Contacts during a run: impacts, and which contacts are closed after them."""
