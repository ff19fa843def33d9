"""How contacts answer to impulses: the matrix of the complete mechanism, seen from their gaps.

    [ M  -G^T ] [ dv ]   [ n^T L ]          rates of gaps:  v+ = v- + W L,    W = n dv/dL
    [ G    0  ] [ mu ] = [   0   ]

by the matrix of the index-1 problem (``start.velocities``), with joints and prescribed motions but
without contacts. The same columns give the accelerations by forces of contacts.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, from_increment
from msahl.algebra.vector import at
from msahl.elements.constraints import scalar
from msahl.formulations.absolute.frames import (
    first_multiplier,
    moving_count,
    rotation_increment,
)
from msahl.start.velocities import solve_at_rest
from msahl.system import evaluate
from msahl.system.arrays import State, System, node_count
from msahl.system.contacts import Contacts, set_closed
from msahl.system.unknowns import Unknowns
from msahl.system.work_arrays import WorkArrays, jacobian_at_rest


class Response(NamedTuple):
    """Answers of the contacts ``which`` (k,) in one configuration."""

    which: np.ndarray
    motion: np.ndarray  # (k, nodes, 3) changes of the unknowns by a unit impulse along each gap
    gradient: np.ndarray  # (k, nodes, 3) of the gaps by the unknowns
    W: np.ndarray  # (k, k)
    values: np.ndarray  # block values of the matrix
    scale: np.ndarray  # (k,) gap's rate over what its equation has


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
    set_closed(system, contacts, chosen, np.zeros(chosen.size))
    values = jacobian_at_rest(system, state, work_arrays)
    rows, nodes = system.scalar.equations, node_count(system)
    motion, gradient = np.zeros((2, which.size, nodes, 3))
    scale = contacts.sign[which] / rows.scale[contacts.row[which]]
    for k, r in enumerate(contacts.row[which]):
        place, slot = rows.place[r]
        by_multiplier, by_unknown = _lines(system, values, int(place), int(slot))
        load = -contacts.sign[which[k]] / system.unit[place, slot] * by_multiplier
        motion[k] = solve_at_rest(system, state, load, unknowns, values)
        gradient[k] = scale[k] * by_unknown
    W = np.einsum("iab,jab->ij", gradient, motion)
    return Response(which, motion, gradient, 0.5 * (W + W.T), values, scale)


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
    """Return values of the contacts' coordinates, gaps and rates of the gaps (c,) in a state."""
    assert system.scalar is not None
    work_arrays.call(evaluate.prepare, system, state, work_arrays.start)
    value, rate = np.zeros((2, system.scalar.coordinates.kind.size))
    start = work_arrays.start
    scalar.values(system.scalar, start.scalar, start.frames, value, rate)
    q = system.scalar.equations.coordinate[contacts.row, 0]
    gap = contacts.sign * (value[q] - contacts.limit)
    return value[q], gap, contacts.sign * rate[q]


def accelerations(
    system: System,
    contacts: Contacts,
    response: Response,
    state: State,
    unknowns: Unknowns,
    work_arrays: WorkArrays,
) -> tuple[np.ndarray, float]:
    """Return the accelerations of the gaps (k,) without forces of contacts, and the largest number
    that they are sums of.
    """
    assert system.scalar is not None
    rows, Z = np.zeros((2, node_count(system), 3))
    work_arrays.call(evaluate.prepare, system, state, work_arrays.start)
    work_arrays.call(evaluate.free_acceleration, system, state, work_arrays.start, Z, rows)
    place = system.scalar.equations.place[contacts.row[response.which]]
    bend = rows[first_multiplier(system.frames) + place[:, 0], place[:, 1]]
    solution = solve_at_rest(system, state, rows, unknowns, response.values)
    terms = response.gradient * solution
    found = terms.sum(axis=(1, 2)) - response.scale * bend
    return found, float(max(np.abs(terms).max(initial=0.0), np.abs(bend).max(initial=0.0)))


def push(
    system: System, response: Response, impulse: np.ndarray, state: State, R: np.ndarray
) -> None:
    """Change the velocities of ``state`` by the ``impulse`` (k,) along the gaps, whose work on
    prescribed motions is added; ``R`` (n+1, 3, 3) are the bodies' matrices of rotation.
    """
    frames = system.frames
    change = np.einsum("k,kab->ab", impulse, response.motion)
    state.v[:] += change[frames.displacement]
    dW = change[frames.rotation] / frames.length[:, None]
    state.w[:] += np.einsum("bji,bj->bi", R, dW)
    scalar.motion_work(system.scalar, frames, state.time[0], 1.0, change, state.work)


def displace(system: System, response: Response, push: np.ndarray, state: State) -> None:
    """Move the bodies as an impulse ``push`` (k,) would change their velocities."""
    change = np.einsum("k,kab->ab", push, response.motion)
    state.x[:] += change[system.frames.displacement]
    for b in range(moving_count(system.frames)):
        Q = rotation_increment(system.frames, change, b)
        state.p[b] = compose(from_increment(Q), at(state.p, b))
