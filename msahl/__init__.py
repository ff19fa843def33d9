"""msahl: spatial multibody systems by Hamilton's weak principle, with their error bars."""

__version__ = "0.1.0"
