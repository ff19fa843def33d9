"""What a solver says of one step."""

from collections.abc import Callable
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


class Stopped(Exception):  # noqa: N818 - a request, and not an error
    """A request to stop was answered in the middle of a step, which is not taken then."""


EVALUATION = 20_000
"""Work of an evaluation in Python, in units of about 5 ns; that of scipy's algebra is the third
power of its unknowns, that of a compiled step STEP_WORK times its unknowns at most."""
STEP_WORK = 500
ASKED_AFTER = 10_000_000
"""Work after which a hard step asks whether to stop: 0.05 s or so. It is counted and not timed, so
that a run asks at the same places on every machine."""


class Requests:
    """Asks ``stopped`` from time to time while hard steps are solved."""

    def __init__(self) -> None:
        self.stopped: Callable[[], bool] = lambda: False
        self._work = 0

    def after(self, work: int) -> None:
        """Count ``work`` done; raises ``Stopped`` if it is time to ask and a stop is wanted."""
        self._work += work
        if self._work > ASKED_AFTER:
            self._work = 0
            if self.stopped():
                raise Stopped
