"""A step of higher degree by ``scipy.optimize.root``, as ``solve.root`` solves the others."""

from collections.abc import Callable

import numpy as np

from msahl.elements.along import settle
from msahl.jit.compiled import compiled
from msahl.linalg import dense
from msahl.schemes.collocation import newton, predictor
from msahl.schemes.collocation.newton import High
from msahl.schemes.midpoint.scipy_root import hunt, polish
from msahl.schemes.midpoint.workspace import Scene
from msahl.schemes.outcome import EVALUATION, Outcome

_probe = compiled(newton.probe)
_guess = compiled(predictor.predict)
_advance = compiled(newton.advance)


def take(island: High, h: float, after: Callable[[int], None] = lambda work: None) -> Outcome:
    """As ``root.take``, a step of higher degree; z holds the stages of each unknown together."""
    scene, stages = island.scene, island.stages
    free, s = scene.unknowns.free, island.y.shape[1]
    size, outcome, step_length = free.size, Outcome(0.0, -1), 0.0

    def fun(z: np.ndarray) -> np.ndarray:
        nonlocal outcome, step_length
        after(EVALUATION + (size * s) ** 3)
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
    z = stages.Z.reshape(s, -1)[:, free].T.reshape(-1)
    f = fun(z)
    guessed = step_length
    relaxed = scene.system.relaxation > 0.0
    if not outcome.converged and not np.isnan(outcome.residual):
        z = hunt(fun, jac, z, f, lambda: outcome.converged)
        if relaxed and outcome.converged:
            held = _held(scene)[:, np.newaxis]
            null = np.where(held, _relaxed(island, z.reshape(size, s)), 0.0)
            part = np.linalg.lstsq(jac(z), null.reshape(-1), rcond=None)[0].reshape(size, s)
            z = polish(fun, jac, z - np.where(held, part, 0.0).reshape(-1), lambda: False)
    if dense.is_astray(scene.system, guessed, step_length):
        return Outcome(np.inf, outcome.worst)
    if outcome.converged:
        A = jac(z) if relaxed else None
        _advance(scene.system, scene.state, scene.start, stages, scene.watch, island.station, h)
        if A is not None:
            _drop_gap(island, A)
    return outcome


def _held(scene: Scene) -> np.ndarray:
    """(f,) which of the free unknowns are multipliers."""
    return scene.unknowns.free >= 6 * scene.system.bodies.inverse_mass.size


def _relaxed(island: High, z: np.ndarray) -> np.ndarray:
    """What the relaxation makes of unknowns ``z`` (f, s) in the derivative, but for its sign."""
    return 2.0 * island.scene.system.relaxation * (z @ island.stages.rule.chi.T)


def _drop_gap(island: High, A: np.ndarray) -> None:
    """As ``high.drop_gap``, by the derivative ``A``."""
    scene, rows = island.scene, np.zeros_like(island.y)
    held, gap = _held(scene), scene.state.gap.reshape(-1)
    of = scene.unknowns.free[held] - 6 * scene.system.bodies.inverse_mass.size
    rows[held, -1] = gap[of]
    answer = np.linalg.lstsq(A, rows.reshape(-1), rcond=None)[0].reshape(rows.shape)
    gap[of] -= _relaxed(island, answer)[held, -1]
    settle(scene.system.along, scene.state.gap)


def jacobian(island: High) -> np.ndarray:
    """(f s, f s) the derivative evaluated last; the stages of each unknown stand together."""
    unknowns, stages, (f, s) = island.scene.unknowns, island.stages, island.y.shape
    A = np.zeros((f * f, s, s))
    A[unknowns.dense_to] = stages.values[stages.slot[unknowns.dense_from]]
    return A.reshape(f, f, s, s).transpose(0, 3, 1, 2).reshape(f * s, f * s)
