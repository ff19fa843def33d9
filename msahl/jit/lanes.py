"""Lanes: vectors of four doubles, on which one instruction of the machine acts at once.

A kernel that does the same for several cases, such as the stages of a step, holds their numbers in
the lanes of one value. ``load`` takes them from a row of an array (n, LANES), ``store`` puts them
there; arithmetic between lanes, and between lanes and numbers, is written as for floats. Uncompiled
they are arrays of numpy; ``lanes_machine`` defines them for the compiler.
"""

from typing import Any

import numpy as np

LANES = 4
Lanes = Any
"""Where lanes stand a number may stand as well, the same for all of them."""


def load(rows: np.ndarray, k: int) -> Lanes:
    """Return row ``k`` of an array (n, LANES)."""
    return rows[k].copy()


def store(rows: np.ndarray, k: int, value: Lanes) -> None:
    """Write row ``k`` of an array (n, LANES)."""
    rows[k] = value


def spread(number: float) -> Lanes:
    """Return ``number`` in every lane."""
    return np.full(LANES, number)
