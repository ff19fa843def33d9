"""Joints: one module a kind, built from primitives that hold the equations."""
