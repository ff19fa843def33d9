"""Factorisation of the block-sparse Jacobians."""
