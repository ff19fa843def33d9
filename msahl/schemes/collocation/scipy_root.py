"""A step of higher degree by ``scipy.optimize.root``, as ``solve.root`` solves the others."""

from collections.abc import Callable

import numpy as np

from msahl.elements.constraints.scalar import clear_rate_violations
from msahl.elements.frames import first_multiplier
from msahl.jit.compiled import compiled
from msahl.linalg import dense
from msahl.schemes.collocation import newton, predictor
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.schemes.midpoint.scipy_root import hunt, polish
from msahl.schemes.midpoint.workspace import Workspace
from msahl.schemes.outcome import EVALUATION, Outcome

_probe = compiled(newton.probe)
_guess = compiled(predictor.predict)
_advance = compiled(newton.advance)


def take(
    subsystem: CollocationWorkspace, h: float, after: Callable[[int], None] = lambda work: None
) -> Outcome:
    """As ``root.take``, a step of higher degree; z holds the stages of each unknown together."""
    workspace, stages = subsystem.workspace, subsystem.stages
    free, s = workspace.unknowns.free, subsystem.y.shape[1]
    size, outcome, step_length = free.size, Outcome(0.0, -1), 0.0

    def fun(z: np.ndarray) -> np.ndarray:
        nonlocal outcome, step_length
        after(EVALUATION + (size * s) ** 3)
        f = np.empty((size, s))
        *judged, step_length = _probe(subsystem, h, z.reshape(size, s), f, False)
        outcome = Outcome(*judged)
        workspace.counts[0] += 1
        return f.reshape(-1)

    def jac(z: np.ndarray) -> np.ndarray:
        _probe(subsystem, h, z.reshape(size, s), np.empty((size, s)), True)
        workspace.counts[1] += 1
        return jacobian(subsystem)

    _guess(workspace.system, workspace.state, workspace.start, stages, h)
    z = stages.Z.reshape(s, -1)[:, free].T.reshape(-1)
    f = fun(z)
    guessed = step_length
    relaxed = workspace.system.relaxation > 0.0
    if not outcome.converged and not np.isnan(outcome.residual):
        z = hunt(fun, jac, z, f, lambda: outcome.converged)
        if relaxed and outcome.converged:
            held = _held(workspace)[:, np.newaxis]
            null = np.where(held, _relaxed(subsystem, z.reshape(size, s)), 0.0)
            part = np.linalg.lstsq(jac(z), null.reshape(-1), rcond=None)[0].reshape(size, s)
            z = polish(fun, jac, z - np.where(held, part, 0.0).reshape(-1), lambda: False)
    if dense.is_astray(workspace.system, guessed, step_length):
        return Outcome(np.inf, outcome.worst)
    if outcome.converged:
        A = jac(z) if relaxed else None
        _advance(
            workspace.system,
            workspace.state,
            workspace.start,
            stages,
            workspace.monitor,
            subsystem.instant,
            h,
        )
        if A is not None:
            _drop_gap(subsystem, A)
    return outcome


def _held(workspace: Workspace) -> np.ndarray:
    """(f,) which of the free unknowns are multipliers."""
    return workspace.unknowns.free >= 3 * first_multiplier(workspace.system.frames)


def _relaxed(subsystem: CollocationWorkspace, z: np.ndarray) -> np.ndarray:
    """What the relaxation makes of unknowns ``z`` (f, s) in the derivative, but for its sign."""
    return 2.0 * subsystem.workspace.system.relaxation * (z @ subsystem.stages.rule.chi.T)


def _drop_gap(subsystem: CollocationWorkspace, A: np.ndarray) -> None:
    """As ``high.drop_gap``, by the derivative ``A``."""
    workspace, rows = subsystem.workspace, np.zeros_like(subsystem.y)
    held, violation = _held(workspace), workspace.state.violation.reshape(-1)
    of = workspace.unknowns.free[held] - 3 * first_multiplier(workspace.system.frames)
    rows[held, -1] = violation[of]
    answer = np.linalg.lstsq(A, rows.reshape(-1), rcond=None)[0].reshape(rows.shape)
    violation[of] -= _relaxed(subsystem, answer)[held, -1]
    clear_rate_violations(workspace.system.scalar, workspace.state.violation)


def jacobian(subsystem: CollocationWorkspace) -> np.ndarray:
    """(f s, f s) the derivative evaluated last; the stages of each unknown stand together."""
    unknowns, stages, (f, s) = subsystem.workspace.unknowns, subsystem.stages, subsystem.y.shape
    A = np.zeros((f * f, s, s))
    A[unknowns.dense_to] = stages.values[stages.slot[unknowns.dense_from]]
    return A.reshape(f, f, s, s).transpose(0, 3, 1, 2).reshape(f * s, f * s)
