"""Bodies: the records of the deck and the laws of their motion."""
