"""Auxiliary states of expressions along a known motion: s' = f(q(t), v(t), t, s).

Between two rows positions, velocities and orientations follow from their values and first two
derivatives at both (polynomials of degree 5, orientations as quaternions). The states take one step
of the method of Radau with three stages (order 5, also for states that settle quickly):

    S_i = s + h sum_j A_ij f(t + c_j h, S_j) ,   s(t + h) = S_3
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import matrices, product, quaternions
from msahl.analysis.inverse.drives import InverseError
from msahl.analysis.kinematics.configuration import Equations, copy_to
from msahl.elements.constraints import scalar
from msahl.ports import forces
from msahl.system import evaluate
from msahl.system.arrays import State

MOST_ITERATIONS = 30
NO_CHANGE = 1e-14
"""Change of the stages, relative to their size, that is round-off."""
NEARLY = 1e-9
"""Likewise of one that does not become smaller any more."""
NUDGE = 1e-7
"""Relative change of a state by which rates are differentiated."""
ROOT = np.sqrt(6.0)
NODES = np.array([(4.0 - ROOT) / 10.0, (4.0 + ROOT) / 10.0, 1.0])


def _integrals() -> np.ndarray:
    """(3, 3) integrals from 0 to c_i of the Lagrange polynomial of c_j."""
    powers = np.arange(3)
    vandermonde = NODES[:, None] ** powers
    return (NODES[:, None] ** (powers + 1) / (powers + 1)) @ np.linalg.inv(vandermonde)


INTEGRALS = _integrals()


class Between(NamedTuple):
    """The motion between two rows, h [s] apart, by polynomials of all bodies."""

    begin: float
    h: float
    coefficients: np.ndarray  # (6, 7 n) by powers of the time over h: places, then quaternions


def between(before: State, after: State) -> Between:
    """Return the motion from one state to the next; both have accelerations."""
    h = float(after.time[0] - before.time[0])
    places = [(s.x[:-1], h * s.v[:-1], h * h * s.a[:-1]) for s in (before, after)]
    rotations = [_quaternion(s, h) for s in (before, after)]
    sign = np.sign(np.sum(rotations[0][0] * rotations[1][0], axis=1, keepdims=True))
    rotations[1] = tuple(sign * part for part in rotations[1])
    both = [_hermite(*parts).reshape(6, -1) for parts in (places, rotations)]
    return Between(float(before.time[0]), h, np.concatenate(both, axis=1))


def _quaternion(state: State, h: float) -> tuple[np.ndarray, ...]:
    """Quaternions (n, 4) and their derivatives by the time over ``h``."""
    q, w = quaternions(state.p[:-1]), state.w[:-1]
    alpha = np.einsum("bji,bj->bi", matrices(q), state.alpha[:-1])
    pure, pure_rate = (np.concatenate([np.zeros((len(a), 1)), a], axis=1) for a in (w, alpha))
    rate = 0.5 * product(q, pure)
    return q, h * rate, h * h * 0.5 * (product(q, pure_rate) + product(rate, pure))


def _hermite(before: tuple[np.ndarray, ...], after: tuple[np.ndarray, ...]) -> np.ndarray:
    """(6, ...) coefficients of the polynomial with these values and two derivatives at 0 and 1."""
    (a, b, c), (d, e, f) = before, after
    rest, slope, curve = d - a - b - 0.5 * c, e - b - c, f - c
    return np.stack([
        a,
        b,
        0.5 * c,
        10.0 * rest - 4.0 * slope + 0.5 * curve,
        -15.0 * rest + 7.0 * slope - curve,
        6.0 * rest - 3.0 * slope + 0.5 * curve,
    ])  # fmt: skip


def set_motion(motion: Between, share: float, state: State) -> None:
    """Set positions, velocities and time of ``state`` after the ``share`` of the interval."""
    powers = share ** np.arange(6)
    rates = np.arange(6) * np.concatenate([[0.0], powers[:-1]]) / motion.h
    n = len(state.x) - 1
    values, slopes = np.stack([powers, rates]) @ motion.coefficients
    q, rate = (part[3 * n :].reshape(n, 4) for part in (values, slopes))
    size = np.linalg.norm(q, axis=1, keepdims=True)
    back = np.concatenate([q[:, :1], -q[:, 1:]], axis=1) / size**2
    state.w[:-1] = 2.0 * product(back, rate)[:, 1:]
    e = q / size
    e = np.where(e[:, :1] < 0.0, -e, e)
    state.p[:-1] = 4.0 * e[:, 1:] / (1.0 + e[:, :1])
    state.x[:-1], state.v[:-1] = (part[: 3 * n].reshape(n, 3) for part in (values, slopes))
    state.time[0] = motion.begin + share * motion.h


def advance(of: Equations, before: State, after: State, seen: State) -> None:
    """Set the auxiliary states of ``after`` by those of ``before`` and the motion between them, in
    which the arrays of ``seen`` are used.
    Raises ``InverseError`` where they cannot be found.
    """
    s = before.auxiliary
    if not s.size:
        return
    motion = between(before, after)
    copy_to(seen, before)
    stages = np.tile(s, (3, 1))
    slopes = _slopes(of, motion, seen, s)
    matrix = np.eye(stages.size) - motion.h * np.kron(INTEGRALS, slopes)
    last = np.inf
    for _ in range(MOST_ITERATIONS):
        at = zip(NODES.tolist(), stages, strict=True)
        rates = np.array([_rates(of, motion, c, seen, each) for c, each in at])
        wrong = stages - s - motion.h * INTEGRALS @ rates
        change = np.linalg.solve(matrix, wrong.reshape(-1)).reshape(stages.shape)
        stages = stages - change
        size = float((np.abs(change) / (np.abs(stages) + np.abs(motion.h * rates) + 1e-300)).max())
        if size <= NO_CHANGE or (size <= NEARLY and size >= 0.5 * last):
            after.auxiliary[:] = stages[-1]
            return
        last = size
    raise InverseError(
        f"the auxiliary states of the deck cannot be followed from {motion.begin:.9g} s to "
        f"{motion.begin + motion.h:.9g} s; give more rows"
    )


def _rates(of: Equations, motion: Between, share: float, seen: State, s: np.ndarray) -> np.ndarray:
    """(n,) rates of the auxiliary states ``s`` within the interval."""
    set_motion(motion, share, seen)
    seen.auxiliary[:] = s
    group, own = of.system.forces.signals, of.start.forces
    of.call(evaluate.prepare, of.system, seen, of.start)
    scalar.count_rotations(of.system.scalar, of.start.scalar, seen.angle)
    of.call(forces.set_expressions, group, own, of.system.scalar)
    assert group is not None
    return np.asarray(own.signals.values.value[group.rate])


def _slopes(of: Equations, motion: Between, seen: State, s: np.ndarray) -> np.ndarray:
    """(n, n) derivatives of the rates by the states, in the middle of the interval."""
    at = _rates(of, motion, 0.5, seen, s)
    columns = []
    for k in range(s.size):
        nudge = NUDGE * max(1.0, abs(float(s[k])))
        moved = s.copy()
        moved[k] += nudge
        columns.append((_rates(of, motion, 0.5, seen, moved) - at) / nudge)
    return np.stack(columns, axis=1)
