"""Time elements: how one step follows from the last."""
