"""Events of the deck during a run: what they release and engage, and the impulses of that."""
