"""Linearised accelerations against differences of the nonlinear equations, along a random motion.

The model is displaced and given other velocities, its joints are closed, and its accelerations are
solved for, as at the start of a run; the differences are of order 4.
"""

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import at
from msahl.analysis.linearised.coefficients import Coefficients
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.projection import close, move
from msahl.analysis.linearised.settle import settle
from msahl.analysis.linearised.variations import FOURTH, Variations
from msahl.formulations.absolute.frames import moving_count
from msahl.start.velocities import StartError, make_consistent
from msahl.system.arrays import State, node_count

STEP = 1e-3
"""Rotation [rad], displacement over a length, or change of a velocity over one, of a step."""
SHORT_STEP, CURVED = 1e-5, 1e-8
"""Step for laws that change much over the first one, as regularised friction does, and the
disagreement above which it is tried as well."""


def disagreement(point: Point, found: Coefficients, changes: Variations) -> float:
    """Return the largest difference of accelerations by a random motion, rotations times a length,
    relative to the largest that there is; nan if the joints cannot be closed beside the point.
    """
    m = len(changes.into)
    if not m:
        return 0.0
    y = np.random.default_rng(0).normal(size=m)
    try:
        apart = _difference(point, found, changes, y, STEP)
        if apart > CURVED:
            apart = min(apart, _difference(point, found, changes, y, SHORT_STEP))
    except StartError:
        return float("nan")
    return apart


def _difference(
    point: Point, found: Coefficients, changes: Variations, y: np.ndarray, step: float
) -> float:
    """The difference along the motion ``y``, with steps of a length ``step``."""
    m, typical = y.size, float(np.mean(found.length[found.rotational]))
    dq, dv = changes.places[:, :m] @ y, changes.rates[:, :m] @ y
    lengths = np.where(found.rotational, typical, 1.0)
    size = max(float(np.abs(lengths * part).max()) for part in (dq, dv)) / typical
    share = step / size
    expected = changes.accelerations[:, :m] @ y
    measured = np.zeros_like(expected)
    for steps, weight in FOURTH:
        for sign in (1.0, -1.0):
            other = _beside(point, found, changes, sign * steps * share * y)
            measured += sign * weight / share * _accelerations(point, found, other)
    # The motion itself has accelerations of the size of its rates squared by a length.
    present = (expected, measured, size * found.acceleration)
    largest = max(float(np.abs(lengths * array).max()) for array in present)
    apart = float(np.abs(lengths * (measured - expected)).max())
    return apart / max(largest, typical * size**2)


def _beside(point: Point, found: Coefficients, changes: Variations, y: np.ndarray) -> State:
    """Return the consistent state displaced by ``y``, with its accelerations."""
    system, state, m = point.system, point.state, y.size
    place, rate = np.zeros((2, node_count(system), 3))
    place.reshape(-1)[found.coordinate] = changes.places[:, :m] @ y
    rate.reshape(-1)[found.coordinate] = changes.rates[:, :m] @ y
    saved = {name: getattr(state, name).copy() for name in ("force", "a", "alpha", "reaction")}
    moved = close(system, move(system, state._replace(**saved), place), point.unknowns)
    v, w = state.v.copy(), moved.w.copy()
    for f in range(moving_count(system.frames)):
        v[f] += rate[system.frames.displacement[f]]
        w[f] += np.array(matrix(at(moved.p, f))).T @ rate[system.frames.rotation[f]]
    moved = moved._replace(v=v, w=w, auxiliary=state.auxiliary + changes.states[:, :m] @ y)
    make_consistent(system, moved, point.unknowns.free, "massWeighted")
    settle(system, moved, point.unknowns)
    return moved


def _accelerations(point: Point, found: Coefficients, state: State) -> np.ndarray:
    """(n,) accelerations of a state."""
    frames, out = point.system.frames, np.zeros((node_count(point.system), 3))
    for f in range(moving_count(frames)):
        out[frames.displacement[f]], out[frames.rotation[f]] = state.a[f], state.alpha[f]
    accelerations: np.ndarray = out.reshape(-1)[found.coordinate]
    return accelerations
