"""Contacts in one configuration: which of them are closed, which of these stick, and their forces.

Contacts whose gap is zero, and stays so to first order, press with the forces f >= 0 by which their
gaps have accelerations w >= 0,

    w = W f + b,    w . f = 0           b   accelerations without forces of contacts

or, with friction, by those in Coulomb's cone (``contact.friction``). Those with w = 0 that press in
any such solution are closed: they are constraints until the model is moved. With friction they
stick if their slips have no acceleration, and slide otherwise, with friction if they slip already.
Where their forces are not unique, those are given that the solution has: of contacts without
friction of as few as are independent.
"""

from typing import NamedTuple

import numpy as np

from msahl.analysis.linearised.pressing import Held, held
from msahl.analysis.linearised.projection import close
from msahl.analysis.linearised.settle import settle
from msahl.contact.complementarity import NoSolution
from msahl.contact.response import Response, accelerations, gaps, respond
from msahl.contact.state import OVERLAP, TOUCHING
from msahl.formulations.absolute.frames import first_multiplier
from msahl.start.velocities import StartError
from msahl.system import evaluate
from msahl.system.arrays import State, System, node_count
from msahl.system.contacts import NEAR, Contacts, set_closed, set_sticking
from msahl.system.reductions import all_unknowns
from msahl.system.unknowns import Unknowns, choose
from msahl.system.work_arrays import WorkArrays, new_work_arrays

STILL = 1e-9
"""Rate of a gap or slip, over the largest speed or that of falling by the size of the model, that
is none: closed joints leave 1e-12."""
MOST_CLOSED = 20
"""Rounds in which contacts that overlap after a step are closed."""


class Touching(NamedTuple):
    """The c contacts of a system in one configuration; k have friction."""

    contacts: Contacts
    names: tuple[str, ...]
    touches: np.ndarray  # (c,) whether the gap is zero and stays so
    closed: np.ndarray  # (c,) whether it presses as well
    sticks: np.ndarray  # (k,)
    force: np.ndarray  # (c,) along the gap [N or N m]
    friction: np.ndarray  # (c,) across it [N]
    unique: bool = True  # whether there are no other forces


class InTouch(NamedTuple):
    """A system whose equations are those of its closed contacts as well."""

    system: System
    state: State
    unknowns: Unknowns
    touching: Touching


def apart(contacts: Contacts, names: tuple[str, ...]) -> Touching:
    """Return ``contacts`` of which none touches."""
    c, k = contacts.row.size, int(contacts.sliding.max(initial=-1)) + 1
    no, zeros = np.zeros(c, dtype=bool), np.zeros(c)
    return Touching(contacts, names, no, no, np.zeros(k, dtype=bool), zeros, zeros)


def touch(system: System, state: State, before: Touching) -> InTouch:
    """Return what touches in a ``state`` that satisfies the constraints of joints, and set the
    accelerations and multipliers of the state. Raises ``StartError`` if a contact overlaps or is
    about to have an impact, or forces have no solution.
    """
    contacts, names = before.contacts, before.names
    system, unknowns = in_mode(system, contacts, state)
    work_arrays = new_work_arrays(system, state)
    _, gap, _ = gaps(system, contacts, state, work_arrays)
    _require_apart(contacts, names, gap)
    near = np.flatnonzero(contacts.acts & (gap <= TOUCHING * contacts.round_off))
    if not near.size:
        settle(system, state, unknowns)
        return InTouch(system, state, unknowns, apart(contacts, names))
    response = respond(system, contacts, near, state, unknowns, work_arrays)
    b, size = accelerations(system, response, state, unknowns, work_arrays)
    _, _, rate = gaps(system, contacts, state, work_arrays)  # those of closed contacts
    length = float(contacts.round_off.max()) / NEAR
    still = STILL * max(_largest_speed(system, work_arrays), float(np.sqrt(length * size)))
    speed = response.sign * rate[_coordinates(system, response.row)]
    if np.abs(speed).max() <= still >= _largest_speed(system, work_arrays):
        state.v[:], state.w[:] = 0.0, 0.0  # what has come to rest
    _require_no_impact(names, near, speed, still)
    stays = speed[: near.size] <= still
    if not stays.all():
        response = respond(system, contacts, near[stays], state, unknowns, work_arrays)
        b, size = accelerations(system, response, state, unknowns, work_arrays)
        speed = response.sign * rate[_coordinates(system, response.row)]
    try:
        found = held(system, contacts, response, (b, size), (speed, still))
    except NoSolution as error:
        named = ", ".join(names[int(k)] for k in response.which)
        raise StartError(f"the forces of the contacts {named} have no solution here") from error
    return _with_forces(system, state, before, (response, found), still)


def _require_no_impact(
    names: tuple[str, ...], near: np.ndarray, speed: np.ndarray, still: float
) -> None:
    """Raise ``StartError`` if a contact of those ``near`` approaches."""
    for name, rate in zip((names[int(k)] for k in near), speed.tolist(), strict=False):
        if rate < -still:
            raise StartError(
                f"contact '{name}' is about to have an impact at {-rate:.4g} (m/s or rad/s); "
                "choose a time after it, or an equilibrium"
            )


def _require_apart(contacts: Contacts, names: tuple[str, ...], gap: np.ndarray) -> None:
    """Raise ``StartError`` if a contact overlaps."""
    for k in map(int, np.flatnonzero(contacts.acts & (gap < -OVERLAP * contacts.round_off))):
        raise StartError(
            f"contact '{names[k]}' overlaps by {-gap[k]:.4g} (m or rad); move one of its bodies, "
            "or change the limit"
        )


def close_contacts(at: InTouch) -> InTouch:
    """Return the nearest state whose joints and closed contacts are closed, and those as well that
    would overlap. Raises ``StartError``.
    """
    system, state, unknowns, touching = at
    contacts, closed = touching.contacts, touching.closed
    for _ in range(MOST_CLOSED):
        state = close(system, state, unknowns)
        _, gap, _ = gaps(system, contacts, state, new_work_arrays(system, state))
        more = contacts.acts & ~closed & (gap < -TOUCHING * contacts.round_off)
        if not more.any():
            return InTouch(system, state, unknowns, touching._replace(closed=closed))
        closed = closed | more
        system, unknowns = in_mode(system, contacts, state, closed, touching.sticks)
    raise StartError("contacts overlap one after the other, without an end")


def in_mode(
    system: System,
    contacts: Contacts,
    state: State,
    closed: np.ndarray | None = None,
    sticks: np.ndarray | None = None,
) -> tuple[System, Unknowns]:
    """Return the ``system`` with the contacts ``closed`` (c,), those with friction that ``sticks``
    (k,) says held where they are, and all others open; and its unknowns.
    """
    system = _own_arrays(system)
    closed = np.zeros(contacts.row.size, dtype=bool) if closed is None else closed
    value, _, _ = gaps(system, contacts, state, new_work_arrays(system, state))
    at_end = value.copy()
    at_end[_coordinates(system, contacts.row)[closed]] = contacts.limit[closed]
    set_closed(system, contacts, closed, at_end)
    if sticks is not None:
        set_sticking(system, sticks, value)
    return system, choose(system, all_unknowns(system))


def _own_arrays(system: System) -> System:
    """Return the system with those arrays of its own that say how contacts are."""
    assert system.scalar is not None
    rows, group = system.scalar.equations, system.forces.sliding
    coords = system.scalar.coordinates._replace(idle=system.scalar.coordinates.idle.copy())
    own = rows._replace(coefficient=rows.coefficient.copy(), offset=rows.offset.copy())
    scalar = system.scalar._replace(coordinates=coords, equations=own)
    system = system._replace(scalar=scalar)
    if group is None:
        return system
    copies = {name: getattr(group, name).copy() for name in ("friction", "toward", "still")}
    return system._replace(forces=system.forces._replace(sliding=group._replace(**copies)))


def _with_forces(
    system: System,
    state: State,
    before: Touching,
    answer: tuple[Response, Held],
    still: float,
) -> InTouch:
    """Return the system with the contacts closed that press; set accelerations and multipliers."""
    contacts, (response, found) = before.contacts, answer
    which, own = response.which, contacts.sliding[response.which]
    closed, touches = np.zeros((2, contacts.row.size), dtype=bool)
    touches[which], closed[which] = True, found.presses
    sticks = np.zeros(before.sticks.size, dtype=bool)
    sticks[own[found.presses & found.sticks]] = True
    system, unknowns = in_mode(system, contacts, state, closed, sticks)
    slides = found.presses & ~np.isnan(found.toward[:, 0])
    if (group := system.forces.sliding) is not None:
        group.friction[own[slides]] = contacts.friction[which[slides]]
        group.toward[own[slides]] = found.toward[slides]
        group.still[:] = still
    settle(system, state, unknowns)
    if not found.unique:
        _apply(system, response, found.force, state)
    force = _along(system, response, state)
    normal, across = np.zeros((2, contacts.row.size))
    normal[which] = force[: which.size]
    rough = response.tangent[:, 0] >= 0
    across[which[rough]] = np.hypot(*force[response.tangent[rough]].T)
    touching = Touching(
        *(contacts, before.names, touches, closed, sticks, normal, across), unique=found.unique
    )
    return InTouch(system, state, unknowns, touching)


def _along(system: System, response: Response, state: State) -> np.ndarray:
    """(m,) the multipliers of a state along the directions [N or N m]."""
    assert system.scalar is not None
    place = system.scalar.equations.place[response.row]
    found: np.ndarray = response.sign * state.force[place[:, 0], place[:, 1]]
    return found


def _apply(system: System, response: Response, force: np.ndarray, state: State) -> None:
    """Change the multipliers of a ``state`` to those with the forces (m,) of contacts: others of
    the same motion.
    """
    assert system.scalar is not None
    more = force - _along(system, response, state)
    change = np.einsum("k,kab->ab", more, response.motion)[first_multiplier(system.frames) :]
    place = system.scalar.equations.place[response.row]
    state.force[:] += change * system.unit
    state.force[place[:, 0], place[:, 1]] = response.sign * force
    start = new_work_arrays(system, state).start
    evaluate.prepare(system, state, start)
    evaluate.set_reactions(system, state, start, np.zeros((node_count(system), 3)))


def _coordinates(system: System, row: np.ndarray) -> np.ndarray:
    """Return the coordinates of equations."""
    assert system.scalar is not None
    found: np.ndarray = system.scalar.equations.coordinate[row, 0]
    return found


def _largest_speed(system: System, work_arrays: WorkArrays) -> float:
    """Largest speed of a body [m/s], by prepared work arrays."""
    start, length = work_arrays.start.frames, system.frames.length
    return float(np.abs(start.v).max() + (np.abs(start.W).max(axis=1) * length).max())
