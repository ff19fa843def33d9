"""A step solved by ``scipy.optimize.root``: the reference, and the rescue of hard steps.

Powell's hybrid method with the analytic Jacobian. It stops on the relative change of the iterate
and calls round-off a failure; whether the step is solved is decided by our own residual.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import root

from msahl.elements.frames import first_multiplier
from msahl.jit.compiled import compiled
from msahl.linalg import dense
from msahl.schemes.midpoint import load_moments, workspace
from msahl.schemes.midpoint.workspace import Workspace
from msahl.schemes.outcome import EVALUATION, Outcome
from msahl.system.arrays import System
from msahl.system.unknowns import Unknowns

STEP_TOLERANCE = 1e-11
"""Where ``hybr`` stops; its convergence is superlinear, so the residual is far below by then."""

REPAIRS = 3
"""Each gains at least three digits: the relaxation against the joints' compliances."""

_load = compiled(load_moments.load)
_guess = compiled(dense.guess)
_residual = compiled(dense.residual)
_jacobian = compiled(dense.jacobian)
_accept = compiled(workspace.accept)


def take(
    workspace: Workspace, h: float, share: float, after: Callable[[int], None] = lambda work: None
) -> Outcome:
    """Take a step of size ``h``, a ``share`` of the whole one, if it converges; ``after`` is told
    of the work done.
    """
    system, unknowns, state, start = (
        workspace.system,
        workspace.unknowns,
        workspace.state,
        workspace.start,
    )
    size = unknowns.free.size
    guess, outcome, step_length = np.empty(size), Outcome(0.0, -1), 0.0

    def fun(z: np.ndarray) -> np.ndarray:
        nonlocal outcome, step_length
        after(EVALUATION + size**3)
        f = np.empty(size)
        given = (system, unknowns, state, start, h, z, workspace.Z)
        *judged, step_length = _residual(*given, f, workspace.F)
        outcome = Outcome(*judged)
        workspace.counts[0] += 1
        return f

    def jac(z: np.ndarray) -> np.ndarray:
        A = np.empty(size * size)
        _jacobian(
            system, unknowns, state, start, h, z, workspace.Z, workspace.F, workspace.values, A
        )
        workspace.counts[1] += 1
        return A.reshape(size, size)

    _load(workspace, h)
    _guess(system, unknowns, state, start, h, workspace.Z, guess)
    f = fun(guess)
    guessed = step_length
    # An infinite residual is that of a guess at rest: any force is large against no motion.
    if not outcome.converged and not np.isnan(outcome.residual):
        z = hunt(fun, jac, guess, f, lambda: outcome.converged)
        if system.relaxation > 0.0 and outcome.converged:
            # Powell's updates wander where the residual does not see them; steps of Newton's
            # method repair what the smallest multipliers cost the others.
            A = jac(z)
            z -= _null_part(system, unknowns, A, z)
            f = fun(z)
            for _ in range(REPAIRS):
                z -= np.linalg.solve(A, f)
                f = fun(z)
            # As ``newton.drop_gap``.
            multipliers = unknowns.free[unknowns.free >= 3 * first_multiplier(system.frames)]
            open_part = np.linalg.solve(A, f)[-multipliers.size :]
            workspace.F.reshape(-1)[multipliers] += system.relaxation * open_part
    if dense.is_astray(system, guessed, step_length):
        return Outcome(np.inf, outcome.worst)
    if outcome.converged:
        _accept(workspace, h, share)
    return outcome


def hunt(
    fun: Callable[[np.ndarray], np.ndarray],
    jac: Callable[[np.ndarray], np.ndarray],
    guess: np.ndarray,
    f: np.ndarray,
    solved: Callable[[], bool],
) -> np.ndarray:
    """Where ``hybr`` comes to from the ``guess``, whose residual is ``f``, and polished."""
    # hybr's trust region starts at a multiple of its unknowns: the change of the guess, in
    # units of the step's own lengths, starts at zero and is of order one.
    unit = max(np.abs(guess).max(), np.abs(f).max())
    # Trial points far out may overflow; the residual there says so and they are given up.
    with np.errstate(all="ignore"):
        found = root(
            lambda y: fun(guess + unit * y) / unit,
            np.zeros(guess.size),
            jac=lambda y: jac(guess + unit * y),
            method="hybr",
            options={"xtol": STEP_TOLERANCE},
        )
        return polish(fun, jac, guess + unit * found.x, solved)


def polish(
    fun: Callable[[np.ndarray], np.ndarray],
    jac: Callable[[np.ndarray], np.ndarray],
    z: np.ndarray,
    solved: Callable[[], bool],
) -> np.ndarray:
    """Digits that hybr leaves, as its unit is that of the largest row: beside a stiff spring's all
    motion is small. A few steps of Newton's method, evaluated last where they end.
    """
    f = fun(z)
    for _ in range(REPAIRS):
        if solved() or not np.isfinite(f).all():
            break
        A = jac(z)
        if not np.isfinite(A).all():
            break
        z = z - np.linalg.lstsq(A, f, rcond=None)[0]
        f = fun(z)
    return z


def _null_part(system: System, unknowns: Unknowns, A: np.ndarray, z: np.ndarray) -> np.ndarray:
    """What the joints' redundancy leaves open in the multipliers (see ``newton.drop_null``)."""
    multipliers = unknowns.free >= 3 * first_multiplier(system.frames)
    part = np.linalg.solve(A, np.where(multipliers, -system.relaxation * z, 0.0))
    return np.where(multipliers, part, 0.0)
