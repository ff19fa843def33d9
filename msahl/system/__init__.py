"""The system: from the model to grouped flat arrays, and the state at t = 0."""
