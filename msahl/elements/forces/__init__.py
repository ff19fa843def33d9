"""Force laws: loads, springs, drag, friction."""
