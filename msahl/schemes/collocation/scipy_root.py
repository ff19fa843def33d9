"""Solves collocation steps by ``scipy.optimize.root``, as ``midpoint.scipy_root`` does the others.

The unknowns z (f s,) hold the s stages of each free unknown next to each other.
"""

from collections.abc import Callable

import numpy as np

from msahl.elements.constraints.scalar import clear_rate_violations
from msahl.elements.frames import first_multiplier
from msahl.jit.compiled import Call, compiled
from msahl.schemes.collocation import newton, predictor
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.schemes.common.criteria import is_implausible
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.midpoint.scipy_root import find_root, polish
from msahl.schemes.outcome import EVALUATION, Outcome

_evaluate = compiled(newton.evaluate_free)
_predict = compiled(predictor.predict)
_accept_step = compiled(newton.accept_step)


class _Equations:
    """Residual and Jacobian of one step in the free unknowns, and how well it is solved."""

    def __init__(
        self, subsystem: CollocationWorkspace, h: float, count_work: Callable[[int], None]
    ) -> None:
        self.subsystem, self.h, self.count_work = subsystem, h, count_work
        self.shape = subsystem.y.shape  # (f, s)
        self.outcome, self.length = Outcome(0.0, -1), 0.0

    def residual(self, z: np.ndarray) -> np.ndarray:
        """(f s,) the free rows at ``z``."""
        self.count_work(EVALUATION + z.size**3)
        f = np.empty(self.shape)
        *judged, self.length = _evaluate(self.subsystem, self.h, z.reshape(self.shape), f, False)
        self.outcome = Outcome(*judged)
        self.subsystem.workspace.counts[0] += 1
        return f.reshape(-1)

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """(f s, f s) their derivative at ``z``."""
        _evaluate(self.subsystem, self.h, z.reshape(self.shape), np.empty(self.shape), True)
        self.subsystem.workspace.counts[1] += 1
        return jacobian(self.subsystem)

    def is_solved(self) -> bool:
        """Whether the rows evaluated last are solved."""
        return self.outcome.converged


def calls(subsystem: CollocationWorkspace) -> list[Call]:
    """Return the compiled functions that a step needs, with arguments; see ``Stepper.calls``."""
    workspace = subsystem.workspace
    z = np.empty((1, 1))
    parts = (workspace.system, workspace.state, workspace.start, subsystem.stages)
    return [
        (_evaluate, (subsystem, 0.0, z, z, True)),
        (_predict, (*parts, 0.0)),
        (_accept_step, (subsystem, 0.0)),
    ]


def take_step(
    subsystem: CollocationWorkspace,
    h: float,
    count_work: Callable[[int], None] = lambda work: None,
) -> Outcome:
    """Take a step of size ``h`` if it converges; ``count_work`` receives the work done."""
    workspace, stages = subsystem.workspace, subsystem.stages
    free, s = workspace.unknowns.free, subsystem.y.shape[1]
    step = _Equations(subsystem, h, count_work)
    _predict(workspace.system, workspace.state, workspace.start, stages, h)
    z = stages.Z.reshape(s, -1)[:, free].T.reshape(-1)
    f = step.residual(z)
    predicted = step.length
    relaxed = workspace.system.relaxation > 0.0
    if not step.outcome.converged and not np.isnan(step.outcome.residual):
        z = find_root(step.residual, step.jacobian, z, f, step.is_solved)
        if relaxed and step.outcome.converged:
            z = _remove_null_multipliers(step, z)
    if is_implausible(workspace.system, predicted, step.length):
        return Outcome(np.inf, step.outcome.worst)
    if step.outcome.converged:
        A = step.jacobian(z) if relaxed else None
        _accept_step(subsystem, h)
        if A is not None:
            _remove_null_violation(subsystem, A)
    return step.outcome


def _is_multiplier(workspace: Workspace) -> np.ndarray:
    """(f,) which of the free unknowns are multipliers."""
    return workspace.unknowns.free >= 3 * first_multiplier(workspace.system.frames)


def _relaxation_rows(subsystem: CollocationWorkspace, z: np.ndarray) -> np.ndarray:
    """(f, s) minus the relaxation part of the Jacobian times unknowns ``z`` (f, s)."""
    return 2.0 * subsystem.workspace.system.relaxation * (z @ subsystem.stages.tableau.chi.T)


def _remove_null_multipliers(step: _Equations, z: np.ndarray) -> np.ndarray:
    """The root ``z`` without what redundant constraints leave undetermined in its multipliers; see
    ``newton.remove_null_multipliers``.
    """
    held = _is_multiplier(step.subsystem.workspace)[:, np.newaxis]
    rows = np.where(held, _relaxation_rows(step.subsystem, z.reshape(step.shape)), 0.0)
    part = np.linalg.lstsq(step.jacobian(z), rows.reshape(-1), rcond=None)[0].reshape(step.shape)
    z = z - np.where(held, part, 0.0).reshape(-1)
    return polish(step.residual, step.jacobian, z, lambda: False)


def _remove_null_violation(subsystem: CollocationWorkspace, A: np.ndarray) -> None:
    """As ``newton.remove_null_violation``, by the Jacobian ``A``."""
    workspace, rows = subsystem.workspace, np.zeros_like(subsystem.y)
    held, violation = _is_multiplier(workspace), workspace.state.violation.reshape(-1)
    equations = workspace.unknowns.free[held] - 3 * first_multiplier(workspace.system.frames)
    rows[held, -1] = violation[equations]
    answer = np.linalg.lstsq(A, rows.reshape(-1), rcond=None)[0].reshape(rows.shape)
    violation[equations] -= _relaxation_rows(subsystem, answer)[held, -1]
    clear_rate_violations(workspace.system.scalar, workspace.state.violation)


def jacobian(subsystem: CollocationWorkspace) -> np.ndarray:
    """(f s, f s) the Jacobian evaluated last; the stages of each unknown are next to each other."""
    unknowns, stages, (f, s) = subsystem.workspace.unknowns, subsystem.stages, subsystem.y.shape
    A = np.zeros((f * f, s, s))
    A[unknowns.dense_to] = stages.values[stages.slot[unknowns.dense_from]]
    return A.reshape(f, f, s, s).transpose(0, 3, 1, 2).reshape(f * s, f * s)
