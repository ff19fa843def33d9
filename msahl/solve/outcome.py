"""What a solver says of one step."""

from typing import NamedTuple

TARGET = 3e-15
"""Residual, relative to the step's own length, at which an iteration stops. Round-off leaves about
5e-16; a residual r lets the energy drift by less than 2 r of the kinetic energy a step."""
TOLERANCE = 1e-12
"""Residual that counts as solved where round-off lets an iteration come no further."""


class Outcome(NamedTuple):
    """How near a solver came: the worst row relative to the step's length, and which it is."""

    residual: float
    worst: int  # index among the flat rows, -1 if all vanish

    @property
    def converged(self) -> bool:
        """Whether the step is solved; a nan is not."""
        return self.residual <= TOLERANCE
