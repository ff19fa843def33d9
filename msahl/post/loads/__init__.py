"""Loads of the bodies of a run for finite elements."""
