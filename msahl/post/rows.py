"""Published rows -> states, and what the element laws say of each.

    x_G = x_B + R r_BG          v_G = R (v_B + w x r_BG)          the inverse of ``rigid.publish``

Everything measured here is measured by the kernels the time loop runs, one row after the other.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from msahl.bodies.rigid import Bodies, energy
from msahl.compiled import compiled
from msahl.kernel import kernel
from msahl.model import Model
from msahl.results.read import Run
from msahl.rotation import matrix
from msahl.schemes import preserving
from msahl.system.arrays import Start, State, System, new_start
from msahl.system.build import build_state, build_system
from msahl.system.names import FORCE_COLUMNS
from msahl.vector import Vector, add, at, cross, dot, put, scale, times


class Rows(NamedTuple):
    """What every row shows; m rows, n bodies, k joints."""

    linear: np.ndarray  # (m, n) kinetic energy of translation [J]
    rotational: np.ndarray  # (m, n) kinetic energy of rotation about G [J]
    potential: np.ndarray  # (m, n) -m g.x_G [J]
    gap: np.ndarray  # (m, k, 3) child point minus parent point, inertial axes [m]
    rate: np.ndarray  # (m, k, 3) velocity of child point relative to parent point [m/s]
    length: float  # longest arm or radius of gyration in the scene [m]


class History(NamedTuple):
    """Mass centres, inertial axes, and body axes' angular velocities, (m, n+1, 3); ground last."""

    x: np.ndarray
    v: np.ndarray
    w: np.ndarray


def observe(run: Run) -> Rows:
    """What every row of ``run`` shows."""
    system = build_system(run.model)
    state = build_state(run.model, system)
    table = _body_columns(run)
    m, n, k = len(table), len(run.model.bodies), len(run.model.joints)
    history = History(*(np.zeros((m, n + 1, 3)) for _ in range(3)))
    gap, rate = np.zeros((m, k, 3)), np.zeros((m, k, 3))
    _observe(system, state, new_start(system, state), table, history, gap, rate)
    energies = [_energies_of(run.model, b, history) for b in range(n)]
    linear, rotational, potential = np.moveaxis(np.array(energies), 0, 2)
    return Rows(linear, rotational, potential, gap, rate, float(system.bodies.length[:n].max()))


def _energies_of(model: Model, b: int, history: History) -> np.ndarray:
    """(3, m) energies of body ``b``: those of a scene that holds nothing else."""
    alone = build_system(replace(model, bodies=(model.bodies[b],), joints=(), loads=())).bodies
    of_b = History(*(np.ascontiguousarray(series[:, [b, -1]]) for series in history))
    energies = np.zeros((3, len(of_b.x)))
    _sum_energies(alone, of_b, np.zeros((2, 3)), energies)
    return energies


def joint_forces(run: Run) -> np.ndarray:
    """(m, k, 3) force of the parent on the child, mean over the step, inertial axes [N]."""
    if run.reactions is None:
        return np.zeros((len(run.time), 0, 3))
    names = [f"{joint.name}.{c}" for joint in run.model.joints for c in FORCE_COLUMNS]
    return np.ascontiguousarray(run.reactions[names].to_numpy()).reshape(len(run.time), -1, 3)


def child_work(run: Run) -> np.ndarray:
    """(m - 1, k) force . mean velocity . dt of every step and joint (see ``measure.JointWork``)."""
    child = build_system(run.model).coincide.b
    force = joint_forces(run)
    work = np.zeros((len(run.time) - 1, force.shape[1]))
    _sum_work(child, _body_columns(run), np.diff(run.time), force, work)
    return work


def _body_columns(run: Run) -> np.ndarray:
    """(m, 12 n) the states without their times."""
    return np.ascontiguousarray(run.states.to_numpy()[:, 1:])


@kernel
def recall(bodies: Bodies, table: np.ndarray, row: int, state: State) -> None:
    """Set x, p, v, w of ``state`` to those published in a ``row`` of ``table``, 12 a body."""
    for b in range(bodies.inverse_mass.size - 1):
        p = _three(table, row, 12 * b + 3)
        w = _three(table, row, 12 * b + 9)
        R = matrix(p)
        r = at(bodies.r_BG, b)
        put(state.x, b, add(_three(table, row, 12 * b), times(R, r)))
        put(state.p, b, p)
        put(state.v, b, times(R, add(_three(table, row, 12 * b + 6), cross(w, r))))
        put(state.w, b, w)


@kernel
def _three(table: np.ndarray, row: int, column: int) -> Vector:
    return (table[row, column], table[row, column + 1], table[row, column + 2])


@kernel
def _observe_rows(
    system: System,
    state: State,
    start: Start,
    table: np.ndarray,
    history: History,
    gap: np.ndarray,
    rate: np.ndarray,
) -> None:
    for row in range(table.shape[0]):
        recall(system.bodies, table, row, state)
        preserving.prepare(system, state, start)
        preserving.observe(system, state, start, gap[row], rate[row])
        for b in range(state.x.shape[0]):
            put(history.x[row], b, at(state.x, b))
            put(history.v[row], b, at(state.v, b))
            put(history.w[row], b, at(state.w, b))


@kernel
def _energies(bodies: Bodies, history: History, rest: np.ndarray, energies: np.ndarray) -> None:
    # One law, asked twice: of the body as if it did not turn, and as if it did not move.
    for row in range(history.x.shape[0]):
        x, v, w = history.x[row], history.v[row], history.w[row]
        energies[0, row], energies[2, row] = energy(bodies, x, v, rest)
        energies[1, row], _ = energy(bodies, x, rest, w)


@kernel
def _child_work(
    child: np.ndarray, table: np.ndarray, dt: np.ndarray, force: np.ndarray, work: np.ndarray
) -> None:
    ground = table.shape[1] // 12
    for row in range(1, table.shape[0]):
        for k in range(child.size):
            if child[k] == ground:  # it has no velocity
                continue
            before = _three(table, row - 1, 12 * child[k] + 6)
            after = _three(table, row, 12 * child[k] + 6)
            C = matrix(_three(table, row, 12 * child[k] + 3))
            V = times(C, scale(0.5, add(before, after)))
            work[row - 1, k] = dt[row - 1] * dot(at(force[row], k), V)


_observe = compiled(_observe_rows)
_sum_energies = compiled(_energies)
_sum_work = compiled(_child_work)
