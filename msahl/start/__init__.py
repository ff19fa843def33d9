"""Consistent initial positions, velocities and accelerations."""
