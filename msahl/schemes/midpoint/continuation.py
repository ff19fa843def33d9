"""Solves a step of order 2 that Newton's method does not solve from any start, along a path.

    F(z, s h) = 0        0 < s <= 1

is the step of the size s h. For small s Newton's method solves it, and from there the curve of its
solutions is followed to s = 1 by its arc length, also where it turns back in s: a point is
predicted along the tangent and corrected by Newton's method across it.

The curve must arrive there in a conservative system without constraints. Velocities at the end of a
step are limited by the energy, so solutions of all s are limited; for small s there is but one,
and a curve of solutions can neither end within nor return there.
Source: E. L. Allgower, K. Georg, Introduction to Numerical Continuation Methods (2003), chapters
2, 6 and 11.
"""

from typing import NamedTuple, Protocol

import numpy as np

from msahl.jit.compiled import compiled
from msahl.schemes.common.criteria import DIVERGED, STUCK
from msahl.schemes.common.scipy_root import CountWork
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.midpoint import load_moments
from msahl.schemes.midpoint.newton import LONG_TARGET
from msahl.schemes.midpoint.scipy_root import Equations
from msahl.schemes.outcome import TOLERANCE, Outcome

FIRST, SMALLEST = 0.25, 2.0**-10
"""Size of the step that begins the path relative to the given one, and the smallest that is tried;
each is a quarter of the one before."""
FEW, MOST_CORRECTIONS, LAST = 2, 5, 12
"""Iterations after which the next distance may be longer; that end a corrector without success; and
that end Newton's method at s = 1."""
LONGER, SHORTER, SHORTEST = 2.0, 0.5, 1e-6
"""Factors of the distance along the path, and the shortest distance."""
FIRST_DISTANCE, MOST_POINTS = 0.1, 150
CLOSE = 1e-7
"""Residual, relative to the length of the step, of a point on the path."""
DIFFERENCE = 1e-7
"""Relative change of s in the derivative by it."""


_set_loads = compiled(load_moments.set_loads)


class Steps(Protocol):
    """The equations of steps of any size, in the free unknowns."""

    def residual_of(self, z: np.ndarray, s: float) -> np.ndarray:
        """Rows (f,) of the step that is ``s`` of the given one."""

    def jacobian_of(self, z: np.ndarray, s: float) -> np.ndarray:
        """Their derivative (f, f)."""

    def predicted(self, s: float) -> np.ndarray:
        """The free unknowns (f,) that the state at the start predicts."""

    def relative(self) -> float:
        """Residual evaluated last, relative to the length of its step."""


class _Steps:
    """``Steps`` from the state of a ``workspace``, of the size ``h`` and below."""

    def __init__(self, workspace: Workspace, h: float, share: float, count_work: CountWork) -> None:
        self.workspace, self.h, self.share, self.count_work = workspace, h, share, count_work
        self.s, self.step = 0.0, Equations(workspace, 0.0, 0.0, count_work)

    def residual_of(self, z: np.ndarray, s: float) -> np.ndarray:
        """See ``Steps``."""
        self._set_size(s)
        return self.step.residual(z)

    def jacobian_of(self, z: np.ndarray, s: float) -> np.ndarray:
        """See ``Steps``."""
        self._set_size(s)
        return self.step.jacobian(z)

    def predicted(self, s: float) -> np.ndarray:
        """See ``Steps``."""
        self._set_size(s)
        return self.step.predict()

    def relative(self) -> float:
        """See ``Steps``."""
        return self.step.outcome.residual

    def _set_size(self, s: float) -> None:
        """Set the loads to those of the step ``s`` h."""
        if s != self.s:
            h, share = s * self.h, s * self.share
            self.s, self.step = s, Equations(self.workspace, h, share, self.count_work)
            _set_loads(self.workspace, h)


def take_step(workspace: Workspace, h: float, share: float, count_work: CountWork) -> Outcome:
    """Take a step of size ``h``, a ``share`` of the requested one, if the path leads to it;
    ``count_work`` receives the work done.
    """
    steps = _Steps(workspace, h, share, count_work)
    z = follow(steps)
    if z is None:
        return Outcome(np.inf, steps.step.outcome.worst)
    if workspace.system.relaxation > 0.0:
        steps.step.remove_null_parts(z)
    if steps.step.outcome.converged:
        steps.step.accept(z)
    return steps.step.outcome


class _Point(NamedTuple):
    """A point y = (z/unit, s) of the path, and its tangent (f + 1,) of length one."""

    y: np.ndarray
    tangent: np.ndarray


def follow(equations: Steps) -> np.ndarray | None:
    """Return the solution (f,) of the complete step to which the path leads, evaluated last; None
    if it does not.
    """
    with np.errstate(all="ignore"):
        try:
            return _follow(equations)
        except np.linalg.LinAlgError:
            return None


def _follow(equations: Steps) -> np.ndarray | None:
    first = _begin(equations)
    if first is None:
        return None
    z, s = first
    path = _Path(equations, max(float(np.abs(z).max()) / s, np.finfo(float).tiny))
    upwards = np.append(np.zeros(z.size), 1.0)
    point = path.point(np.append(z / path.unit, s), upwards)
    distance = FIRST_DISTANCE
    for _ in range(MOST_POINTS):
        left = (1.0 - point.y[-1]) / point.tangent[-1] if point.tangent[-1] > 0.0 else np.inf
        if distance >= left:
            found = path.end(point.y + left * point.tangent)
            if found is not None:
                return found
            distance = SHORTER * left
        corrected, iterations = path.corrected(point, distance)
        if corrected is None:
            distance *= SHORTER
            if distance < SHORTEST:
                return None
            continue
        point = path.point(corrected, point.tangent)
        distance *= LONGER if iterations <= FEW else 1.0
    return None


def _begin(equations: Steps) -> tuple[np.ndarray, float] | None:
    """Return the solution of a short step, and its size relative to the given one."""
    s = FIRST
    while s >= SMALLEST:
        z = equations.predicted(s)
        if _newton(equations, z, s, CLOSE):
            return z, s
        s *= FIRST
    return None


def _newton(equations: Steps, z: np.ndarray, s: float, target: float) -> bool:
    """Improve ``z`` in place until its relative residual is at most ``target``, or as far as
    rounding errors permit; return whether it is.
    """
    f, least = equations.residual_of(z, s), np.inf
    for _ in range(LAST):
        residual = equations.relative()
        stuck = residual > STUCK * least and residual <= TOLERANCE
        if residual <= target or stuck or not residual <= DIVERGED * least:
            break
        least = min(least, residual)
        z -= np.linalg.solve(equations.jacobian_of(z, s), f)
        f = equations.residual_of(z, s)
    return equations.relative() <= max(target, TOLERANCE)


class _Path:
    """The curve of the solutions y = (z/unit, s)."""

    def __init__(self, equations: Steps, unit: float) -> None:
        self.equations, self.unit = equations, unit

    def point(self, y: np.ndarray, before: np.ndarray) -> _Point:
        """The point ``y`` with the tangent that continues that ``before`` it."""
        f = self.equations.residual_of(self.unit * y[:-1], y[-1])
        right = np.append(np.zeros(y.size - 1), 1.0)
        tangent = np.linalg.solve(self._bordered(y, f, before), right)
        return _Point(y, tangent / np.linalg.norm(tangent))

    def corrected(self, point: _Point, distance: float) -> tuple[np.ndarray | None, int]:
        """The point at a ``distance`` along the tangent of ``point``, and the iterations for it."""
        y = point.y + distance * point.tangent
        for iteration in range(MOST_CORRECTIONS):
            if not y[-1] > 0.0:
                break
            f = self.equations.residual_of(self.unit * y[:-1], y[-1])
            if self.equations.relative() <= CLOSE:
                return y, iteration
            if not np.isfinite(f).all():
                break
            off = np.append(f, point.tangent @ (y - point.y) - distance)
            y = y - np.linalg.solve(self._bordered(y, f, point.tangent), off)
        return None, MOST_CORRECTIONS

    def end(self, y: np.ndarray) -> np.ndarray | None:
        """The solution of the complete step, by Newton's method from ``y``; None if it fails."""
        z = self.unit * y[:-1]
        return z if _newton(self.equations, z, 1.0, LONG_TARGET) else None

    def _bordered(self, y: np.ndarray, f: np.ndarray, last: np.ndarray) -> np.ndarray:
        """Derivative (f + 1, f + 1) of the equations by y, above the row ``last``; ``f`` are their
        residuals at ``y``.
        """
        n, z, s = f.size, self.unit * y[:-1], y[-1]
        A = np.empty((n + 1, n + 1))
        step = DIFFERENCE * s
        A[:n, n] = (self.equations.residual_of(z, s + step) - f) / step
        A[:n, :n] = self.unit * self.equations.jacobian_of(z, s)
        A[n] = last
        return A
