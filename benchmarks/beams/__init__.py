"""Beams: error against seconds, beside Exudyn."""
