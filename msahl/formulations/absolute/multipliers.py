"""Multipliers of scalar equations: where they stand among the unknowns, and in which scale.

    unknown     c lam/(m s)     a length [m]: at one configuration c is 1, over a step dt2
    equation    s g             a length [m]

lam   multiplier [N, or N m of an equation in radians]
m     mass [kg]
s     a length [m] for an equation in radians, 1 for one in metres

``rows`` is any group of such equations: constraint equations, springs in the compliance form.
"""

from typing import Protocol

import numpy as np

from msahl.formulations.absolute.frames import Frames, first_multiplier
from msahl.jit.kernel import kernel


class Rows(Protocol):
    """What a group of scalar equations with multipliers has."""

    @property
    def place(self) -> np.ndarray:
        """(r, 2) of multiplier and equation: which of the multipliers' nodes, and its slot."""

    @property
    def mass(self) -> np.ndarray:
        """(r,) m [kg]."""

    @property
    def scale(self) -> np.ndarray:
        """(r,) s [m] or 1."""


@kernel
def place_of(rows: Rows, frames: Frames, r: int) -> tuple[int, int]:
    """Return the node of equation ``r`` and of its multiplier, and the slot in it."""
    return first_multiplier(frames) + rows.place[r, 0], rows.place[r, 1]


@kernel
def multiplier(rows: Rows, frames: Frames, Z: np.ndarray, factor: float, r: int) -> float:
    """Return lam where ``Z`` holds ``factor`` times the multipliers by mass."""
    node, slot = place_of(rows, frames, r)
    return Z[node, slot] * rows.mass[r] * rows.scale[r] / factor


@kernel
def by_unknown(rows: Rows, factor: float, r: int) -> float:
    """Return the derivative of lam by its unknown, likewise; of a step's ``factor`` -dt2 the size
    counts.
    """
    return rows.mass[r] * rows.scale[r] / abs(factor)
