"""Factorises block-sparse Jacobians and banded matrices; moves entries between arrays."""
