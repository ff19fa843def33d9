"""The XML schema of msahl decks, as package data."""
