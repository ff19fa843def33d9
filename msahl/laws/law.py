"""What a law of force consists of, and the table of the numbers that it takes.

A law is a few kernels of plain numbers at one configuration. Where the force acts, and all forms in
which schemes need it, are in ``msahl.ports``. The table ``fields`` says what the deck must give:
the reader of decks, the check of models and the arrays of a system follow it.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from msahl.jit.kernel import kernel

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


@kernel
def no_tension(c: np.ndarray, q: float, free: float) -> tuple[float, float]:
    """Tension of a law that does not depend on its coordinate, and its derivative."""
    return 0.0, 0.0


@kernel
def no_potential(c: np.ndarray, q: float, free: float) -> float:
    """Potential of such a law."""
    return 0.0


@kernel
def no_mean_tension(c: np.ndarray, q: float, dq: float, free: float) -> tuple[float, float]:
    """Mean tension of such a law, and its derivative by dq."""
    return 0.0, 0.0


@kernel
def no_resistance(c: np.ndarray, rate: float, N: float) -> tuple[float, float]:
    """Resistance of a law that does not depend on the rate, and its derivative."""
    return 0.0, 0.0


class CoordinateLaw(NamedTuple):
    """A force along a coordinate q: a tension by its value and a resistance by its rate.

    The load is -(T + R) [N, or N m along an angle]. ``tension(c, q, free)`` returns T and dT/dq,
    ``potential(c, q, free)`` the integral of T from ``free`` to q; ``resistance(c, rate, N)`` R and
    its derivative by the rate, with N the magnitude of the joint's reaction force. ``c`` are the
    numbers of ``fields``. ``mean_tension(c, q, dq, free)``, the quotient of the potential's change
    and dq, with its derivative by dq, is computed from the other two where a law does not give it.
    ``by_reaction`` marks a resistance that depends on N, ``by_tension`` one whose N is the size of
    T instead, to which it is proportional; ``width`` names the number of a resistance that rises
    within a small rate: that rate.
    """

    name: str
    fields: tuple[Field, ...]
    tension: Kernel = no_tension
    potential: Kernel = no_potential
    mean_tension: Kernel | None = None
    resistance: Kernel = no_resistance
    by_reaction: bool = False
    by_tension: bool = False
    width: str | None = None

    @property
    def is_elastic(self) -> bool:
        """Whether the law has a potential."""
        return self.potential is not no_potential
