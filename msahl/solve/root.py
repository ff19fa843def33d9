"""A step solved by ``scipy.optimize.root``: the reference, and the rescue of hard steps.

Powell's hybrid method with the analytic Jacobian. It stops on the relative change of the iterate
and calls round-off a failure; whether the step is solved is decided by our own residual.
"""

import numpy as np
from scipy.optimize import root

from msahl.compiled import compiled
from msahl.solve import dense, step
from msahl.solve.outcome import Outcome
from msahl.solve.step import Scene

STEP_TOLERANCE = 1e-11
"""Where ``hybr`` stops; its convergence is superlinear, so the residual is far below by then."""

_guess = compiled(dense.guess)
_residual = compiled(dense.residual)
_jacobian = compiled(dense.jacobian)
_accept = compiled(step.accept)


def take(scene: Scene, h: float, share: float) -> Outcome:
    """Take a step of size ``h``, a ``share`` of the whole one, if it converges."""
    system, unknowns, state, start = scene.system, scene.unknowns, scene.state, scene.start
    size = unknowns.free.size
    outcome = Outcome(0.0, -1)

    def fun(z: np.ndarray) -> np.ndarray:
        nonlocal outcome
        f = np.empty(size)
        outcome = Outcome(*_residual(system, unknowns, state, start, h, z, scene.Z, f, scene.F))
        scene.counts[0] += 1
        return f

    def jac(z: np.ndarray) -> np.ndarray:
        A = np.empty(size * size)
        _jacobian(system, unknowns, state, start, h, z, scene.Z, scene.F, scene.values, A)
        scene.counts[1] += 1
        return A.reshape(size, size)

    guess = np.empty(size)
    _guess(system, unknowns, state, start, h, scene.Z, guess)
    fun(guess)
    # An infinite residual is that of a guess at rest: any force is large against no motion.
    if not outcome.converged and not np.isnan(outcome.residual):
        # Trial points far out may overflow; the residual there says so and they are given up.
        with np.errstate(all="ignore"):
            found = root(fun, guess, jac=jac, method="hybr", options={"xtol": STEP_TOLERANCE})
        fun(found.x)
    if outcome.converged:
        _accept(scene, h, share)
    return outcome
