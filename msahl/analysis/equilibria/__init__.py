"""Equilibria: searches, paths under growing loads, stability, decks that begin there."""
