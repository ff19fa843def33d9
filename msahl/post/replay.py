"""Published rows -> states, and what the element laws say of each.

    x_G = x_B + R r_BG          v_G = R (v_B + w x r_BG)   inverse of ``rigid_body.write_states``

Everything measured here is measured by the kernels the time loop runs, one row after the other.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.vector import at, put
from msahl.elements.beams import instant
from msahl.elements.constraints import coordinates
from msahl.elements.constraints.equations import is_active
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace
from msahl.formulations.absolute.frames import FramesWorkspace
from msahl.formulations.absolute.rigid_body import RigidBodies, energy, read_states
from msahl.jit.compiled import compiled
from msahl.jit.kernel import kernel
from msahl.model import Model
from msahl.ports import forces
from msahl.results.read import Run
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace
from msahl.system.build import build_system
from msahl.system.state import build_state
from msahl.system.switches import build_released


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
    elastic: np.ndarray  # (m,) energy of all springs and beams [J]
    violation: np.ndarray  # (m, e, 2) size of the violation [m] and [rad]; nan where none, and of
    # what events release or engage
    rate: np.ndarray  # (m, e, 2) size of its rate [m/s] and [rad/s]; likewise
    length: float  # longest arm or radius of gyration [m]


PART = 20_000
"""Rows times bodies whose history is in memory at once: of a long run it would take most memory."""


def observe(run: Run, visit: Callable[[slice, History], None]) -> Rows:
    """What every row of ``run`` shows.

    ``visit`` gets consecutive rows and their history, in arrays that the next part overwrites and
    that may be longer; each part begins with the last row of the part before, so that differences
    of rows can be taken within parts.
    """
    model, system = run.model, build_released(run.model)
    state = build_state(model, system)
    start = new_system_workspace(system, state)
    m, n = len(run.time), len(model.bodies)
    elements = len(model.constrained)
    alone = [_system_of_one(model, b) for b in range(n)]
    energies, elastic = np.zeros((3, m, n)), np.zeros(m)
    violation, rate = np.zeros((2, m, elements, 2))
    used, holonomic = _slots(system)
    parts = list(_parts(m, n))
    # Calls keep the groups that they have got: one of each serves all parts.
    history, of_one = (_new_history(parts[0].stop + 1, bodies) for bodies in (n, 1))
    for part in parts:
        table = body_columns(run, part)
        found, changing = np.zeros((2, len(table), *state.violation.shape))
        stored = elastic[part]
        _observe(system, state, start, run.time[part], table, history, found, changing, stored)
        for b, bodies in enumerate(alone):
            for one, series in zip(of_one, history, strict=True):
                one[:] = series[:, [b, -1]]
            energies[:, part, b] = _energies_of(bodies, of_one)[:, : len(table)]
        violation[part] = _sizes(system, found, holonomic, elements)
        rate[part] = _sizes(system, changing, used, elements)
        visit(part, history)
    length = float(system.frames.length[:n].max())
    linear, rotational, potential = energies
    return Rows(linear, rotational, potential, elastic, violation, rate, length)


def _parts(rows: int, bodies: int) -> Iterator[slice]:
    """Yield consecutive rows, each part with the last row of the part before."""
    length = max(PART // bodies, 2)
    for begin in range(0, rows, length):
        yield slice(max(begin - 1, 0), min(begin + length, rows))


def _slots(system: System) -> tuple[np.ndarray, np.ndarray]:
    """(k, 3) whether there is an equation at a multipliers' node, and one of position."""
    used, holonomic = np.zeros((2, system.multipliers.node.size, 3), dtype=bool)
    points = system.coincide.a.size
    used[:points] = holonomic[:points] = True
    if system.scalar:
        rows = system.scalar.equations
        active = is_active(rows)
        used[rows.place[:, 0], rows.place[:, 1]] = active
        holonomic[rows.place[:, 0], rows.place[:, 1]] = rows.holonomic & active
    return used, holonomic


def _sizes(system: System, values: np.ndarray, kept: np.ndarray, elements: int) -> np.ndarray:
    """(m, e, 2) lengths of the ``kept`` (k, 3) of ``values`` (m, k, 3), in m and in rad apart."""
    squares = (values * values).sum(axis=2, where=kept)
    total, seen = np.zeros((len(values), elements, 2)), np.zeros((elements, 2), dtype=bool)
    places = zip(system.multipliers.element, system.multipliers.rotational.astype(int), strict=True)
    for k, place in enumerate(places):
        if place[0] >= elements:
            continue  # a strain of a beam
        total[:, *place] += squares[:, k]
        seen[place] |= kept[k].any()
    total[:, ~seen] = np.nan
    return np.sqrt(total)


def _system_of_one(model: Model, b: int) -> RigidBodies:
    """The bodies of a system of body ``b`` alone."""
    only = Model(model.gravity, model.grounds, (model.bodies[b],), (), (), model.simulation)
    return build_system(only).bodies


def _new_history(rows: int, bodies: int) -> History:
    return History(*(np.zeros((rows, bodies + 1, 3)) for _ in History._fields))


def _energies_of(alone: RigidBodies, history: History) -> np.ndarray:
    """(3, m) energies of the only body of ``alone``."""
    energies = np.zeros((3, len(history.x)))
    _sum_energies(alone, history, np.zeros((2, 3)), energies)
    return energies


def body_columns(run: Run, part: slice) -> np.ndarray:
    """(m, STATE_SIZE n) the states without their times, of a range of rows."""
    return np.ascontiguousarray(run.states.to_numpy()[part, 1:])


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
        instant.set_strains(system.beams, start.beams)
        elastic[row] += instant.energy(system.beams, start.beams)
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


def count_to(
    system: System, state: State, start: SystemWorkspace, t: float, call: Callable[..., Any]
) -> None:
    """Count the angles of a ``state`` at ``t``, whose angles, and the rates in ``start``, are those
    of an earlier row; kernels are run by ``call``.
    """
    h, state.time[0] = t - state.time[0], t
    call(_expect, system.scalar, start.scalar, state.angle, 0.5 * h)
    call(evaluate.prepare, system, state, start)
    call(_count, system.scalar, start.scalar, start.frames, state.angle, 0.5 * h)


_observe = compiled(_observe_rows)
_sum_energies = compiled(_energies)
