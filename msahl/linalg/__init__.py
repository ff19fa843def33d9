"""Factorises block-sparse Jacobians; moves entries between nodes and vectors."""
