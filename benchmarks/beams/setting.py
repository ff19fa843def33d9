"""How a program is set for one run, and what it finds."""

from typing import NamedTuple

import numpy as np


class Setting(NamedTuple):
    """One run of a program; ``step`` is None of a configuration at rest."""

    family: str  # the curve that it belongs to
    elements: int
    step: float | None = None  # [s]

    @property
    def words(self) -> str:
        step = "" if self.step is None else f", {1e3 * self.step:.3g} ms"
        return f"{self.elements} elements{step}"


class Outcome(NamedTuple):
    """Positions (outputs + 1, points, 3) [m], without the start of a configuration at rest, and
    seconds of the solver alone and of what precedes it."""

    points: np.ndarray
    seconds: float
    preparation: float
    iterations: int


class FailedRunError(Exception):
    """A program gave no solution."""
