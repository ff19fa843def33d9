"""Beams: elements of any degree with stress resultants as multipliers."""
