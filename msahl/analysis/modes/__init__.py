"""Eigenvalues and modes at one configuration and over a parameter."""
