"""Vectors, rotations and functions of one variable."""
