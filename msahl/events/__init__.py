"""Events: what is watched in a motion, by whom, and what follows when it happens."""
