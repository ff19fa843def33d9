"""Places where forces act, and the list of all forces of a system."""
