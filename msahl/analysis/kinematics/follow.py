"""Follows the positions of a model that is moved completely by prescribed motions, in time.

From positions, velocities v and accelerations a at t0, those at t0 + h are predicted to second
order, and corrected by Newton's method. The step is taken if the first correction z is small,

    |z| <= REACH sigma l        sigma  smallest singular value of G that the rank counts
                                l      smallest length of a body [m]

so that the prediction lies where Newton's method is known to converge to one solution only, which
then is the one on the same branch (Kantorovich); else half of it is tried. Near a singular position
sigma falls in proportion to the distance in time, and the prediction's error with its third power:
steps from one side to the other pass the test, and the branch is the one with smooth velocities.
"""

from typing import NamedTuple

import numpy as np

from msahl.analysis.kinematics.configuration import (
    EPSILON,
    Equations,
    Solved,
    close,
    copied,
    jacobian,
    predict,
    set_accelerations,
    set_velocities,
)
from msahl.formulations.absolute.frames import moving_count
from msahl.system.arrays import State

REACH = 0.1
"""Largest first correction, over the smallest singular value times the smallest length."""
ROTATION = 0.5
"""Largest predicted rotation of a body in one step [rad]."""
SHORTEST = 1e-13
"""Shortest step, relative to the end of the motion."""
FARTHEST = 64.0
"""Largest distance behind an output time, over that before it, at which the motion is taken up
again where the output time itself is singular."""


class Instant(NamedTuple):
    """Positions, velocities and accelerations at one time, and G there."""

    state: State
    G: np.ndarray  # (c, n)
    solved: Solved  # the singular values and vectors of G
    rank: int  # of G at regular positions
    iterations: int
    violation: float  # [m]
    contradiction: float  # what is left of velocity equations, relative to the largest speed

    @property
    def time(self) -> float:
        """The time [s]."""
        return float(self.state.time[0])

    @property
    def sigma(self) -> float:
        """Smallest singular value of G but for those that redundant equations make zero."""
        return float(self.solved.values[self.rank - 1])

    @property
    def condition(self) -> float:
        """Condition number of G."""
        return float(self.solved.values[0]) / max(self.sigma, 1e-300)


class LostError(Exception):
    """The positions cannot be followed any further in time."""


class Follower:
    """Positions on one branch, from an instant on, in steps to times that are asked for.

    ``passed`` are the instants of the last steps.
    """

    def __init__(self, of: Equations, state: State, rank: int, end: float) -> None:
        self.of, self.rank, self.end = of, rank, end
        self.length = float(of.system.frames.length[: moving_count(of.system.frames)].min())
        self.steps = self.iterations = 0
        first = self.instant(state, 0.0, near=False)
        if first is None:
            raise LostError("the joints and motions cannot be closed")
        self.last = first
        self.h = end
        self.passed = [first]

    def forget(self) -> None:
        """Drop all instants passed but the last three, with which the next ones are compared."""
        del self.passed[:-3]

    def go_to(self, time: float) -> Instant | None:
        """Return the instant at a ``time`` [s] after the last one; None if it is singular, and the
        motion goes on behind it. Raises ``LostError``.
        """
        while self.last.time < time:
            left = time - self.last.time
            h = min(self.h, left, self._longest())
            found = self._step(h, time if h == left else self.last.time + h)
            if found is None:
                self.h = 0.5 * h
                if h == left and self._pass(time, left):
                    return None
                if self.h < SHORTEST * self.end:
                    raise LostError(f"the positions cannot be followed behind {self.last.time} s")
                continue
            self._take(found)
            self.h = max(self.h, 2.0 * h)
        return self.last if self.last.time == time else None

    def _take(self, found: Instant) -> None:
        self.last = found
        self.passed.append(found)
        self.steps += 1
        self.iterations += found.iterations

    def _longest(self) -> float:
        """Longest step in which no body rotates by more than ``ROTATION``."""
        spin = float(np.linalg.norm(self.last.state.w[:-1], axis=1).max(initial=0.0))
        return ROTATION / spin if spin > 0.0 else np.inf

    def _pass(self, time: float, left: float) -> bool:
        """Try steps to times behind a ``time`` that was not reached; return whether one is taken.

        Only from near, so that a time is not omitted because a step was too long.
        """
        if left > 1e-3 * self.end:
            return False
        factor = 1.0
        while factor <= FARTHEST and time + factor * left <= self.end * (1.0 + 1e-9):
            found = self._step(left * (1.0 + factor), time + factor * left)
            if found is not None:
                self._take(found)
                return True
            factor *= 2.0
        return False

    def _step(self, h: float, time: float) -> Instant | None:
        """Return the instant at ``time``, a step ``h`` from the last one; None if it is unsure."""
        return self.instant(self.last.state, h, time=time)

    def instant(
        self, base: State, h: float, near: bool = True, time: float | None = None
    ) -> Instant | None:
        """Return the instant a time ``h`` from a ``base``; None if Newton's method fails, or, where
        it has to be ``near``, if the prediction is too far from it.
        """
        of, rank, state = self.of, self.rank, copied(base)
        predict(of, state, h)
        state.time[0] = float(base.time[0]) + h if time is None else time

        with np.errstate(all="ignore"):
            closed = close(of, state)
            if not closed.converged:
                return None
            found = complete(of, state, rank, closed.iterations, closed.violation)
        floor = 16.0 * EPSILON * of.size
        if near and found and closed.first > REACH * found.sigma * self.length + floor:
            return None
        return found


def complete(
    of: Equations, state: State, rank: int, iterations: int = 0, violation: float = 0.0
) -> Instant | None:
    """Return the instant of positions that satisfy the equations; None if it is not finite."""
    G = jacobian(of, state)
    solved = set_velocities(of, state, G)
    set_accelerations(of, state, G, solved)
    if not (np.isfinite(state.a).all() and np.isfinite(state.alpha).all()):
        return None
    speed = float(np.abs(solved.z).max(initial=0.0))
    contradiction = solved.remaining / speed if speed > 0.0 else 0.0
    return Instant(state, G, solved, rank, iterations, violation, contradiction)
