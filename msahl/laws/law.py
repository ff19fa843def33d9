"""What a law of force consists of, and the table of the numbers that it takes.

A law is a few kernels of plain numbers at one configuration. Where the force acts, and all forms in
which schemes need it, are in ``msahl.ports``. The table ``fields`` says what the deck must give:
the reader of decks, the check of models and the arrays of a system follow it.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

Kernel = Callable[..., Any]


class Field(NamedTuple):
    """A number that a law takes.

    ``quantity`` is the physical quantity of its unit, or those along a slide and along an angle;
    None: along that coordinate the law has no such number, and takes 1. Without ``default`` it must
    be given; ``least`` and ``above`` are its bounds.
    """

    name: str
    quantity: str | tuple[str | None, str | None] = ""
    default: float | None = None
    least: float = -math.inf
    above: float = -math.inf

    def quantity_along(self, coordinate: str) -> str | None:
        """Return the physical quantity along a ``coordinate`` of a joint, "slide" or "angle"."""
        if isinstance(self.quantity, str):
            return self.quantity
        return self.quantity[coordinate == "angle"]


class PointLaw(NamedTuple):
    """A force at a point of a body, by the velocity V of the point (inertial axes).

    ``load(c, V)`` returns the force [N], ``slope(c, V)`` its derivative (3, 3) by V; ``c`` are the
    numbers of ``fields``. ``name`` is that of the element in the deck.
    """

    name: str
    load: Kernel
    slope: Kernel
    fields: tuple[Field, ...]
