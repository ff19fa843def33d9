"""A step of higher degree by ``scipy.optimize.root``, as ``solve.root`` solves the others."""

import numpy as np

from msahl.compiled import compiled
from msahl.schemes import guess
from msahl.solve import dense, high
from msahl.solve.high import High
from msahl.solve.outcome import Outcome
from msahl.solve.root import hunt, polish

_probe = compiled(high.probe)
_guess = compiled(guess.predict)
_advance = compiled(high.advance)


def take(island: High, h: float) -> Outcome:
    """As ``root.take``, a step of higher degree; z holds the stages of each unknown together."""
    scene, stages = island.scene, island.stages
    free, s = scene.unknowns.free, island.y.shape[1]
    size, outcome, step_length = free.size, Outcome(0.0, -1), 0.0

    def fun(z: np.ndarray) -> np.ndarray:
        nonlocal outcome, step_length
        f = np.empty((size, s))
        *judged, step_length = _probe(island, h, z.reshape(size, s), f, False)
        outcome = Outcome(*judged)
        scene.counts[0] += 1
        return f.reshape(-1)

    def jac(z: np.ndarray) -> np.ndarray:
        _probe(island, h, z.reshape(size, s), np.empty((size, s)), True)
        scene.counts[1] += 1
        return jacobian(island)

    _guess(scene.system, scene.state, scene.start, stages, h)
    first = stages.Z.reshape(s, -1)[:, free].T.reshape(-1)
    f = fun(first)
    guessed = step_length
    if not outcome.converged and not np.isnan(outcome.residual):
        z = hunt(fun, jac, first, f, lambda: outcome.converged)
        if scene.system.relaxation > 0.0 and outcome.converged:
            null = np.zeros((size, s))
            held = free >= 6 * scene.system.bodies.inverse_mass.size
            null[held] = (
                2.0 * scene.system.relaxation * (z.reshape(size, s) @ stages.rule.chi.T)[held]
            )
            part = np.linalg.solve(jac(z), null.reshape(-1))
            z = z - np.where(np.repeat(held, s), part, 0.0)
            fun(polish(fun, jac, z, lambda: False))
    if dense.is_astray(scene.system, guessed, step_length):
        return Outcome(np.inf, outcome.worst)
    if outcome.converged:
        _advance(scene.system, scene.state, scene.start, stages, scene.watch, island.station, h)
    return outcome


def jacobian(island: High) -> np.ndarray:
    """(f s, f s) the derivative evaluated last; the stages of each unknown stand together."""
    unknowns, stages, (f, s) = island.scene.unknowns, island.stages, island.y.shape
    A = np.zeros((f * f, s, s))
    A[unknowns.dense_to] = stages.values[stages.slot[unknowns.dense_from]]
    return A.reshape(f, f, s, s).transpose(0, 3, 1, 2).reshape(f * s, f * s)
