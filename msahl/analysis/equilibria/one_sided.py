"""Equilibria of beams with contacts: which contacts press is found by trying.

    an equilibrium with some contacts closed, as constraints
    ->  close those that overlap there, or else open the one that pulls most
    ->  until none overlaps and none pulls

Bodies without beams need no trial: their search closes and opens contacts from step to step
(``equilibrium``). That of beams begins with their unloaded shape, where nothing presses.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from msahl.analysis.equilibria.equilibrium import Solution
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.touching import in_mode
from msahl.contact.response import gaps
from msahl.contact.state import TOUCHING
from msahl.start.velocities import StartError
from msahl.system.work_arrays import new_work_arrays

MOST_TRIALS = 50
PULLS = 1e-9
"""Force over the largest of all contacts by which one pulls."""


def trials(
    point: Point, first: Callable[[Point], Solution], next_: Callable[[Point], Solution]
) -> Solution:
    """Return the equilibrium from a ``point`` in which no contact overlaps and none pulls: by the
    method ``first`` without contacts, then by ``next_`` from each trial. Raises ``StartError``.
    """
    assert point.touching is not None
    _require_smooth(point)
    solution, method = first(point), next_
    for _ in range(MOST_TRIALS):
        if not solution.converged:
            return solution
        there = _examined(solution.place.point)
        place = solution.place._replace(point=there)
        assert there.touching is not None
        closed = _changed(there)
        if np.array_equal(closed, there.touching.closed):
            return solution._replace(place=place)
        system, unknowns = in_mode(there.system, there.touching.contacts, there.state, closed)
        touching = there.touching._replace(closed=closed)
        solution = method(replace(there, system=system, known=unknowns, touching=touching))
    raise StartError("contacts close and open in turn, without an end")


def _require_smooth(point: Point) -> None:
    """Raise ``StartError`` if a contact has friction."""
    assert point.touching is not None
    if (point.touching.contacts.sliding >= 0).any():
        name = point.touching.names[int(np.argmax(point.touching.contacts.sliding >= 0))]
        raise StartError(
            f"contact '{name}' has friction, which equilibria of beams do not know; omit it, or "
            "let a run with damping come to rest"
        )


def _examined(point: Point) -> Point:
    """Return the ``point`` with the forces of its closed contacts, and which touch."""
    touching = point.touching
    assert touching is not None
    assert point.system.scalar is not None
    contacts, place = touching.contacts, point.system.scalar.equations.place
    own = place[contacts.row]
    force = np.where(touching.closed, contacts.sign * point.state.force[own[:, 0], own[:, 1]], 0.0)
    return replace(point, touching=touching._replace(force=force, touches=touching.closed))


def _changed(point: Point) -> np.ndarray:
    """(c,) which contacts are closed in the next trial."""
    touching = point.touching
    assert touching is not None
    contacts, closed, force = touching.contacts, touching.closed, touching.force
    work_arrays = new_work_arrays(point.system, point.state)
    _, gap, _ = gaps(point.system, contacts, point.state, work_arrays)
    overlap = contacts.acts & ~closed & (gap < -TOUCHING * contacts.round_off)
    if overlap.any():
        return closed | overlap
    if (force < -PULLS * np.abs(force).max(initial=0.0)).any():
        return closed & (np.arange(closed.size) != int(np.argmin(force)))
    return closed
