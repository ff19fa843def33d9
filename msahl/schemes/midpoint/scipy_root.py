"""Solves steps of order 2 by ``scipy.optimize.root``: as the reference, and where Newton fails.

Powell's hybrid method with the analytic Jacobian. It stops on the relative change of the iterate
and reports a failure at rounding errors, so the relative residual of ``free_equations`` decides
whether the step is solved.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import root

from msahl.elements.frames import first_multiplier
from msahl.jit.compiled import Call, compiled
from msahl.schemes.common.criteria import is_implausible
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.midpoint import free_equations, load_moments, newton
from msahl.schemes.outcome import EVALUATION, Outcome

STEP_TOLERANCE = 1e-11
"""Relative change at which ``hybr`` stops; it converges superlinearly, so the residual is far
smaller by then."""
REPAIRS = 3
"""Newton steps after ``hybr``. Each gains at least three digits: the relaxation relative to the
compliances of the joints."""

_set_loads = compiled(load_moments.set_loads)
_predict = compiled(free_equations.predict)
_residual = compiled(free_equations.residual)
_jacobian = compiled(free_equations.jacobian)
_accept_step = compiled(newton.accept_step)

Function = Callable[[np.ndarray], np.ndarray]


class Equations:
    """Residual and Jacobian of one step in the free unknowns, and how well it is solved."""

    def __init__(self, workspace: Workspace, h: float, count_work: Callable[[int], None]) -> None:
        self.workspace, self.h, self.count_work = workspace, h, count_work
        self.size = workspace.unknowns.free.size
        self.outcome, self.length = Outcome(0.0, -1), 0.0

    def residual(self, z: np.ndarray) -> np.ndarray:
        """The free rows at ``z``."""
        self.count_work(EVALUATION + self.size**3)
        f = np.empty(self.size)
        *judged, self.length = _residual(self.workspace, self.h, z, f)
        self.outcome = Outcome(*judged)
        self.workspace.counts[0] += 1
        return f

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """(f, f) their derivative at ``z``."""
        A = np.empty(self.size * self.size)
        _jacobian(self.workspace, self.h, z, A)
        self.workspace.counts[1] += 1
        return A.reshape(self.size, self.size)

    def is_solved(self) -> bool:
        """Whether the rows evaluated last are solved."""
        return self.outcome.converged


def calls(workspace: Workspace) -> list[Call]:
    """Return the compiled functions that a step needs, with arguments; see ``Stepper.calls``."""
    z = np.empty(0)
    return [
        (_set_loads, (workspace, 0.0)),
        (_predict, (workspace, 0.0, z)),
        (_residual, (workspace, 0.0, z, z)),
        (_jacobian, (workspace, 0.0, z, z)),
        (_accept_step, (workspace, 0.0, 0.0)),
    ]


def take_step(
    workspace: Workspace,
    h: float,
    share: float,
    count_work: Callable[[int], None] = lambda work: None,
) -> Outcome:
    """Take a step of size ``h``, a ``share`` of the requested one, if it converges; ``count_work``
    receives the work done.
    """
    step, z = Equations(workspace, h, count_work), np.empty(workspace.unknowns.free.size)
    _set_loads(workspace, h)
    _predict(workspace, h, z)
    f = step.residual(z)
    predicted = step.length
    # An infinite residual is that of a system at rest: any force is large relative to no motion.
    if not step.outcome.converged and not np.isnan(step.outcome.residual):
        z = find_root(step.residual, step.jacobian, z, f, step.is_solved)
        if workspace.system.relaxation > 0.0 and step.outcome.converged:
            remove_null_parts(step, z)
    if is_implausible(workspace.system, predicted, step.length):
        return Outcome(np.inf, step.outcome.worst)
    if step.outcome.converged:
        _accept_step(workspace, h, share)
    return step.outcome


def remove_null_parts(step: Equations, z: np.ndarray) -> None:
    """Remove from the solution ``z`` what redundant constraints leave undetermined in multipliers
    and violation; see ``newton.remove_null_multipliers`` and ``newton.remove_null_violation``.

    Powell's updates drift where the residual does not see them; steps of Newton's method repair
    what the smallest multipliers cost the others.
    """
    workspace, free = step.workspace, step.workspace.unknowns.free
    relaxation = workspace.system.relaxation
    is_multiplier = free >= 3 * first_multiplier(workspace.system.frames)
    A = step.jacobian(z)
    part = np.linalg.solve(A, np.where(is_multiplier, -relaxation * z, 0.0))
    z -= np.where(is_multiplier, part, 0.0)
    f = step.residual(z)
    for _ in range(REPAIRS):
        z -= np.linalg.solve(A, f)
        f = step.residual(z)
    multipliers = free[is_multiplier]
    violation = np.linalg.solve(A, f)[-multipliers.size :]
    workspace.F.reshape(-1)[multipliers] += relaxation * violation


def find_root(
    fun: Function, jac: Function, z: np.ndarray, f: np.ndarray, is_solved: Callable[[], bool]
) -> np.ndarray:
    """Root of ``fun`` found by ``hybr`` from the prediction ``z``, where its value is ``f``, and
    improved by Newton's method.
    """
    # hybr's trust region starts at a multiple of its unknowns. As these are taken the changes of
    # the prediction, relative to the step's own lengths: they start at zero and are of order one.
    unit = max(np.abs(z).max(), np.abs(f).max())
    # Distant trial points may overflow; their residual is infinite and they are rejected.
    with np.errstate(all="ignore"):
        found = root(
            lambda y: fun(z + unit * y) / unit,
            np.zeros(z.size),
            jac=lambda y: jac(z + unit * y),
            method="hybr",
            options={"xtol": STEP_TOLERANCE},
        )
        return polish(fun, jac, z + unit * found.x, is_solved)


def polish(
    fun: Function, jac: Function, z: np.ndarray, is_solved: Callable[[], bool]
) -> np.ndarray:
    """Improve a root by a few steps of Newton's method; ``fun`` is evaluated last at the result.

    ``hybr`` scales all unknowns by the largest row: beside that of a stiff spring all motion is
    small, and its digits are missing.
    """
    f = fun(z)
    for _ in range(REPAIRS):
        if is_solved() or not np.isfinite(f).all():
            break
        A = jac(z)
        if not np.isfinite(A).all():
            break
        z = z - np.linalg.lstsq(A, f, rcond=None)[0]
        f = fun(z)
    return z
