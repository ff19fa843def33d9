"""Constraint equations: products, coordinates, equations."""
