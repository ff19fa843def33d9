"""Published rows -> states, and what the element laws say of each.

    x_G = x_B + R r_BG          v_G = R (v_B + w x r_BG)          the inverse of ``rigid.publish``

Everything measured here is measured by the kernels the time loop runs, one row after the other.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import at, put
from msahl.elements import forces
from msahl.elements.constraints import coordinates
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace
from msahl.elements.frames import FramesWorkspace
from msahl.elements.rigid_body import RigidBodies, energy, read_states
from msahl.jit.compiled import compiled
from msahl.jit.kernel import kernel
from msahl.model import Model
from msahl.results.read import Run
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace
from msahl.system.build import build_system
from msahl.system.state import build_state


class History(NamedTuple):
    """States of m rows, the ground last: mass centres and orientations, inertial axes, velocities
    of mass centres, inertial axes, and angular velocities, body axes; each (m, n+1, 3).
    """

    x: np.ndarray
    p: np.ndarray
    v: np.ndarray
    w: np.ndarray


class Rows(NamedTuple):
    """What every row shows; m rows, n bodies, e joints, couplings and motions."""

    linear: np.ndarray  # (m, n) kinetic energy of translation [J]
    rotational: np.ndarray  # (m, n) kinetic energy of rotation about G [J]
    potential: np.ndarray  # (m, n) -m g.x_G [J]
    elastic: np.ndarray  # (m,) energy of all springs [J]
    violation: np.ndarray  # (m, e, 2) size of the violation [m] and [rad]; nan where none
    rate: np.ndarray  # (m, e, 2) size of its rate [m/s] and [rad/s]; likewise
    length: float  # longest arm or radius of gyration [m]
    history: History


def observe(run: Run) -> Rows:
    """What every row of ``run`` shows."""
    system = build_system(run.model)
    state = build_state(run.model, system)
    table = body_columns(run)
    m, n = len(table), len(run.model.bodies)
    history = History(*(np.zeros((m, n + 1, 3)) for _ in History._fields))
    violation, rate = np.zeros((2, m, *state.violation.shape))
    elastic = np.zeros(m)
    start = new_system_workspace(system, state)
    _observe(system, state, start, run.time, table, history, violation, rate, elastic)
    energies = [_energies_of(run.model, b, history) for b in range(n)]
    linear, rotational, potential = np.moveaxis(np.array(energies), 0, 2)
    used, holonomic = _slots(system)
    elements = len(run.model.joints) + len(run.model.couplings) + len(run.model.motions)
    return Rows(
        linear,
        rotational,
        potential,
        elastic,
        _sizes(system, violation, holonomic, elements),
        _sizes(system, rate, used, elements),
        float(system.frames.length[:n].max()),
        history,
    )


def _slots(system: System) -> tuple[np.ndarray, np.ndarray]:
    """(k, 3) whether there is an equation at a multipliers' node, and one of position."""
    used, holonomic = np.zeros((2, system.multipliers.node.size, 3), dtype=bool)
    points = system.coincide.a.size
    used[:points] = holonomic[:points] = True
    if system.scalar:
        rows = system.scalar.equations
        used[rows.place[:, 0], rows.place[:, 1]] = True
        holonomic[rows.place[:, 0], rows.place[:, 1]] = rows.holonomic
    return used, holonomic


def _sizes(system: System, values: np.ndarray, kept: np.ndarray, elements: int) -> np.ndarray:
    """(m, e, 2) lengths of the ``kept`` (k, 3) of ``values`` (m, k, 3), in m and in rad apart."""
    squares = (values * values).sum(axis=2, where=kept)
    total, seen = np.zeros((len(values), elements, 2)), np.zeros((elements, 2), dtype=bool)
    places = zip(system.multipliers.element, system.multipliers.rotational.astype(int), strict=True)
    for k, place in enumerate(places):
        total[:, *place] += squares[:, k]
        seen[place] |= kept[k].any()
    total[:, ~seen] = np.nan
    return np.sqrt(total)


def _energies_of(model: Model, b: int, history: History) -> np.ndarray:
    """(3, m) energies of body ``b``: those of a system of this body alone."""
    only = Model(model.gravity, model.grounds, (model.bodies[b],), (), (), model.simulation)
    alone = build_system(only).bodies
    of_b = History(*(np.ascontiguousarray(series[:, [b, -1]]) for series in history))
    energies = np.zeros((3, len(of_b.x)))
    _sum_energies(alone, of_b, np.zeros((2, 3)), energies)
    return energies


def body_columns(run: Run) -> np.ndarray:
    """(m, STATE_SIZE n) the states without their times."""
    return np.ascontiguousarray(run.states.to_numpy()[:, 1:])


@kernel
def _observe_rows(
    system: System,
    state: State,
    start: SystemWorkspace,
    time: np.ndarray,
    table: np.ndarray,
    history: History,
    violation: np.ndarray,
    rate: np.ndarray,
    elastic: np.ndarray,
) -> None:
    for row in range(table.shape[0]):
        read_states(system.bodies, table, row, state.x, state.p, state.v, state.w)
        h = time[row] - state.time[0] if row else 0.0
        state.time[0] = time[row]
        # ``start`` has the rates at the output time before until ``observe`` sets them.
        _expect(system.scalar, start.scalar, state.angle, 0.5 * h)
        evaluate.prepare(system, state, start)
        _count(system.scalar, start.scalar, start.frames, state.angle, 0.5 * h)
        evaluate.observe(system, state, start, violation[row], rate[row])
        elastic[row] = forces.elastic_energy(system.forces, start.forces, system.scalar)
        for b in range(state.x.shape[0]):
            put(history.x[row], b, at(state.x, b))
            put(history.p[row], b, at(state.p, b))
            put(history.v[row], b, at(state.v, b))
            put(history.w[row], b, at(state.w, b))


@kernel
def _expect(
    scalar: ScalarConstraints | None, start: ScalarWorkspace, angle: np.ndarray, h: float
) -> None:
    """Advance the angles by the coordinates' rates in ``start``, over ``h`` [s]."""
    if scalar is None:
        return
    for q in range(angle.size):
        angle[q] += h * start.rate[q]


@kernel
def _count(
    scalar: ScalarConstraints | None,
    start: ScalarWorkspace,
    frames: FramesWorkspace,
    angle: np.ndarray,
    h: float,
) -> None:
    """Set the counted angles to those of the prepared output time.

    Output times may be revolutions apart: the mean of the rates at both says how many.
    """
    if scalar is None:
        return
    coordinates.slopes(scalar.coordinates, start.coordinates)
    coordinates.rates(scalar.coordinates, start.coordinates, frames.v, frames.W, start.rate)
    _expect(scalar, start, angle, h)
    coordinates.count_rotations(scalar.coordinates, start.coordinates, angle)


@kernel
def _energies(
    bodies: RigidBodies, history: History, rest: np.ndarray, energies: np.ndarray
) -> None:
    # The same function for translation alone and for rotation alone.
    for row in range(history.x.shape[0]):
        x, v, w = history.x[row], history.v[row], history.w[row]
        energies[0, row], energies[2, row] = energy(bodies, x, v, rest)
        energies[1, row], _ = energy(bodies, x, rest, w)


_observe = compiled(_observe_rows)
_sum_energies = compiled(_energies)
