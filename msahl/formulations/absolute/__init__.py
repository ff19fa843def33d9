"""Absolute coordinates: position and orientation of every frame, a multiplier per constraint."""
