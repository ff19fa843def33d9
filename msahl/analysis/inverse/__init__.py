"""Inverse dynamics: the loads of drives that produce a given motion."""
