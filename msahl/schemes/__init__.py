"""Time elements: how one step follows from the last."""

SCHEMES = ("preserving",)
"""Names of the schemes a run can choose; the first is the default."""
