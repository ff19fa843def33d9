"""Reports how well a step is solved, and when a hard step must ask whether to stop."""

from collections.abc import Callable
from typing import NamedTuple

TARGET = 3e-15
"""Residual relative to the length of the step at which an iteration stops. Rounding errors leave
about 5e-16; a residual r lets the energy drift by less than 2 r times the kinetic energy per step.
"""
TOLERANCE = 1e-12
"""Residual that counts as solved where rounding errors prevent a smaller one."""


class Outcome(NamedTuple):
    """Largest residual relative to the length of the step, and the equation that has it."""

    residual: float
    worst: int  # index among the flat equations, -1 if all residuals vanish

    @property
    def converged(self) -> bool:
        """Whether the step is solved; a nan is not."""
        return self.residual <= TOLERANCE


class Stopped(Exception):  # noqa: N818 - a request, and not an error
    """The run is to be stopped; raised within a step, which is not taken then."""


EVALUATION = 20_000
"""Work of one evaluation called from Python, in units of about 5 ns. The work of scipy's algebra is
the third power of the number of unknowns."""
STEP_WORK = 500
"""Largest work of a compiled step per unknown, in the same units."""
ASKED_AFTER = 10_000_000
"""Work after which a hard step asks whether to stop, about 0.05 s. It is counted and not timed, so
that a run asks at the same points on every machine."""


class Requests:
    """Calls ``stopped`` after every ``ASKED_AFTER`` of work while hard steps are solved."""

    def __init__(self) -> None:
        self.stopped: Callable[[], bool] = lambda: False
        self._work = 0

    def after(self, work: int) -> None:
        """Count ``work``; raise ``Stopped`` if it is time to ask and the run is to be stopped."""
        self._work += work
        if self._work > ASKED_AFTER:
            self._work = 0
            if self.stopped():
                raise Stopped
