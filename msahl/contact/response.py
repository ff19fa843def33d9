"""How contacts answer to impulses: the matrix of the complete mechanism, seen from their gaps.

With friction it is seen from their slips as well. Both are *directions* of a contact, m in all; the
gaps are the first k of them.

    [ M  -G^T ] [ dv ]   [ n^T L ]          rates of gaps:  v+ = v- + W L,    W = n dv/dL
    [ G    0  ] [ mu ] = [   0   ]

by the matrix of the index-1 problem (``start.velocities``), with joints and prescribed motions but
without contacts. The same columns give the accelerations by forces of contacts.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, from_increment
from msahl.algebra.vector import at, scale
from msahl.elements.constraints import scalar, surfaces
from msahl.elements.constraints.kinks import has_kinks
from msahl.formulations.absolute.frames import (
    first_multiplier,
    moving_count,
    rotation_increment,
)
from msahl.start.redundancy import INDEPENDENT
from msahl.start.velocities import add_to_velocities, factor_at_rest, solve_at_rest
from msahl.system import evaluate
from msahl.system.arrays import State, System, node_count
from msahl.system.contacts import Contacts, set_closed, set_sticking
from msahl.system.unknowns import Unknowns
from msahl.system.work_arrays import WorkArrays, rigid_at_rest


class Response(NamedTuple):
    """Answers of the contacts ``which`` (k,) in one configuration."""

    which: np.ndarray
    row: np.ndarray  # (m,) equation of each direction
    sign: np.ndarray  # (m,)
    tangent: np.ndarray  # (k, 2) directions of the slip of each contact, -1 without friction
    column: np.ndarray  # (m,) of the table of work
    motion: np.ndarray  # (m, nodes, 3) changes of the unknowns by a unit impulse
    gradient: np.ndarray  # (m, nodes, 3) of gaps and slips by the unknowns
    W: np.ndarray  # (m, m)
    values: np.ndarray  # block values of the matrix
    factor: np.ndarray  # of it
    scale: np.ndarray  # (m,) rate over what its equation has
    unit: np.ndarray  # (m,) force over its multiplier [kg or kg m]

    @property
    def gaps(self) -> np.ndarray:
        """(k, k) the part of W that is of the gaps."""
        count = self.which.size
        return self.W[:count, :count]


def respond(
    system: System,
    contacts: Contacts,
    which: np.ndarray,
    state: State,
    unknowns: Unknowns,
    work_arrays: WorkArrays,
) -> Response:
    """Return the response of the contacts ``which`` (k,); ``unknowns`` are those without contacts.
    All of them are left closed.
    """
    assert system.scalar is not None
    chosen = np.zeros(contacts.row.size, dtype=bool)
    chosen[which] = True
    nothing = np.zeros(system.scalar.coordinates.kind.size)
    set_closed(system, contacts, chosen, nothing)
    row, sign, tangent, column = _directions(system, contacts, which)
    if row.size > which.size:
        group = system.forces.sliding
        assert group is not None
        set_sticking(system, np.isin(group.tangent[:, 0], row), nothing)
    values = rigid_at_rest(system, state, work_arrays)
    factor = factor_at_rest(values, unknowns)
    rows, nodes = system.scalar.equations, node_count(system)
    motion, gradient = np.zeros((2, row.size, nodes, 3))
    scale = sign / rows.scale[row]
    unit = system.unit[*rows.place[row].T]
    for k, r in enumerate(row):
        place, slot = rows.place[r]
        by_multiplier, by_unknown = _lines(system, values, int(place), int(slot))
        load = -sign[k] / unit[k] * by_multiplier
        motion[k] = solve_at_rest(system, state, load, unknowns, values, factor)
        gradient[k] = scale[k] * by_unknown
    W = np.einsum("iab,jab->ij", gradient, motion)
    parts = which, row, sign, tangent, column
    return Response(*parts, motion, gradient, 0.5 * (W + W.T), values, factor, scale, unit)


def _directions(
    system: System, contacts: Contacts, which: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return rows, signs, tangents and columns of a ``Response``."""
    row, sign, column = contacts.row[which], contacts.sign[which], contacts.column[which]
    tangent, group = np.full((which.size, 2), -1), system.forces.sliding
    rough = np.flatnonzero(contacts.sliding[which] >= 0)
    if group is not None and rough.size:
        tangent[rough] = which.size + np.arange(2 * rough.size).reshape(-1, 2)
        row = np.concatenate([row, group.tangent[contacts.sliding[which[rough]]].reshape(-1)])
        sign = np.concatenate([sign, np.ones(2 * rough.size)])
        column = np.concatenate([column, np.repeat(column[rough], 2)])
    return row, sign, tangent, column


def _lines(
    system: System, values: np.ndarray, place: int, slot: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the column of a multiplier and the row of its equation in the matrix, (nodes, 3)."""
    node = first_multiplier(system.frames) + place
    blocks, (row, column) = values.reshape(-1, 3, 3), system.blocks.T
    by_multiplier, by_unknown = np.zeros((2, node_count(system), 3))
    down, right = np.flatnonzero(column == node), np.flatnonzero(row == node)
    np.add.at(by_multiplier, row[down], blocks[down, :, slot])
    np.add.at(by_unknown, column[right], blocks[right, slot, :])
    return by_multiplier, by_unknown


def gaps(
    system: System, contacts: Contacts, state: State, work_arrays: WorkArrays
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return values (q,) of all coordinates, gaps (c,), and rates (q,) of the coordinates in a
    state.
    """
    assert system.scalar is not None
    work_arrays.call(evaluate.prepare, system, state, work_arrays.start)
    value, rate = np.zeros((2, system.scalar.coordinates.kind.size))
    start = work_arrays.start
    given = system.scalar, start.scalar, start.frames, value, rate
    work_arrays.call(scalar.values, *given)
    q = system.scalar.equations.coordinate[contacts.row, 0]
    return value, contacts.sign * (value[q] - contacts.limit), rate


def choose_tangents(system: System, work_arrays: WorkArrays) -> None:
    """Take tangents of the contacts for an event, in the configuration of the last ``gaps``."""
    assert system.scalar is not None
    m = system.scalar.coordinates.products
    products = work_arrays.start.scalar.coordinates.products
    work_arrays.call(surfaces.choose_axes, m.surfaces, m, products)


def accelerations(
    system: System,
    response: Response,
    state: State,
    unknowns: Unknowns,
    work_arrays: WorkArrays,
) -> tuple[np.ndarray, float]:
    """Return the accelerations along the directions (m,) without forces of contacts, and the
    largest number that they are sums of.
    """
    assert system.scalar is not None
    rows, Z = np.zeros((2, node_count(system), 3))
    work_arrays.call(evaluate.prepare, system, state, work_arrays.start)
    work_arrays.call(evaluate.free_acceleration, system, state, work_arrays.start, Z, rows)
    place = system.scalar.equations.place[response.row]
    bend = rows[first_multiplier(system.frames) + place[:, 0], place[:, 1]]
    solution = solve_at_rest(system, state, rows, unknowns, response.values, response.factor)
    terms = response.gradient * solution
    found = terms.sum(axis=(1, 2)) - response.scale * bend
    return found, float(max(np.abs(terms).max(initial=0.0), np.abs(bend).max(initial=0.0)))


def at_kink(
    system: System, contacts: Contacts, which: np.ndarray, near: float, work_arrays: WorkArrays
) -> bool:
    """Return whether the curvature of the gap of one of the contacts ``which`` may jump in the
    configuration of the last ``gaps``, or where distances [m] are ``near`` to those in it.
    """
    assert system.scalar is not None
    group, place = system.scalar, work_arrays.start.scalar
    q = group.equations.coordinate[contacts.row[which], 0]
    bends = q[has_kinks(group.coordinates)[q]]
    return any(abs(work_arrays.call(scalar.kink, group, place, int(k))) <= near for k in bends)


def shortly_after(system: System, state: State, t: float) -> State:
    """Return the ``state`` with bodies that have moved on by their velocities for the time ``t``
    [s].
    """
    after = state._replace(x=state.x + t * state.v, p=state.p.copy())
    for b in range(moving_count(system.frames)):
        after.p[b] = compose(at(state.p, b), from_increment(scale(t, at(state.w, b))))
    return after


def push(
    system: System, response: Response, impulse: np.ndarray, state: State, R: np.ndarray
) -> None:
    """Change the velocities of ``state`` by the ``impulse`` (m,), whose work on prescribed motions
    is added; ``R`` (n+1, 3, 3) are the bodies' matrices of rotation.
    """
    change = np.einsum("k,kab->ab", impulse, response.motion)
    add_to_velocities(system, state, change, R)
    scalar.motion_work(system.scalar, system.frames, state.time[0], 1.0, change, state.work)


def displace(system: System, response: Response, push: np.ndarray, state: State) -> None:
    """Move the bodies as an impulse ``push`` (m,) would change their velocities."""
    change = np.einsum("k,kab->ab", push, response.motion)
    state.x[:] += change[system.frames.displacement]
    for b in range(moving_count(system.frames)):
        Q = rotation_increment(system.frames, change, b)
        state.p[b] = compose(from_increment(Q), at(state.p, b))


def stopping(W: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the impulse (n,) that takes the ``rate`` (n,) away, of the matrix ``W`` (n, n).

    Rates of redundant contacts contradict each other by what steps leave of them; to take that away
    as well needs impulses that are larger by the inverse of round-off.
    """
    found: np.ndarray = -np.linalg.lstsq(W, rate, rcond=INDEPENDENT)[0]
    return found
