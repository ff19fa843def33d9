"""Expressions of a deck: their syntax, their values, and the dimensions of these."""
