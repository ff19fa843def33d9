"""Events: what can happen in a motion, who asks for it, and what follows when it does."""
