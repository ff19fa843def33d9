"""Which contacts of a subsystem are closed, and what changes that: impacts, openings, rest.

At an event (the gap of an open contact is zero, a closed one would pull, the grip or the slip of
one with friction is used up) the velocities jump by the impulses of ``impact``; ``forces`` says
which of the contacts that touch then stay closed, stick or slide, and ``rebounds`` which series of
impacts are at their end.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from msahl.contact import response as of_contacts
from msahl.contact.complementarity import NoSolution
from msahl.contact.events import ContactEvent
from msahl.contact.forces import ending_slips, follow, hold
from msahl.contact.friction import Jammed
from msahl.contact.impact import Contradictory, SeveralAtOnce, impulses
from msahl.contact.rebounds import accuracy_of_end, rebounds, time_to_next, unseen
from msahl.contact.record import Before, ContactRecord
from msahl.contact.response import Response
from msahl.contact.state import OVERLAP, TOUCHING, After, Cause, ContactState
from msahl.start.velocities import StartError, solve_accelerations
from msahl.system.contacts import set_closed, set_sticking

MOST_AT_ONCE = 200
"""Most events at one time."""


class ContactsUnsolved(Exception):  # noqa: N818 - an outcome
    """An impact, or the forces of contacts, have no solution; the message says where."""


def _overlaps(name: str, depth: float) -> str:
    return (
        f"contact '{name}' overlaps by {depth:.4g} (m or rad) at t = 0; move one of its bodies, or "
        "change the limit"
    )


def _unsolved(t: float, names: Sequence[str], error: NoSolution) -> str:
    if isinstance(error, Jammed):
        return (
            f"at t = {t:.9g} s the contact '{names[error.contact]}' has no unique motion with this "
            f"friction (Painleve): its normal force would change the gap's acceleration by "
            f"{error.coefficient:.4g} per newton, and by {error.without:.4g} without friction"
        )
    named = ", ".join(names)
    if isinstance(error, SeveralAtOnce):
        return (
            f"at t = {t:.9g} s the contacts {named} take part in one impact, for which Stronge's "
            'law is not defined; use impactLaw="poisson"'
        )
    if isinstance(error, Contradictory):
        return (
            f"at t = {t:.9g} s the contacts {named} cannot all have the speeds after their "
            "impact that Newton's law asks for, the restitution times those before; "
            'use impactLaw="poisson", which has a solution always'
        )
    return f"at t = {t:.9g} s the impulses or forces of the contacts {named} have no solution"


def _along_a_line(t: float, name: str) -> str:
    return (
        f"at t = {t:.9g} s the capsules of contact '{name}' are parallel and touch along a line, "
        "where one point does not determine how they press; tilt one of them, or give the ends of "
        "each as the spheres of cylinderContacts whose <length> is that of the other"
    )


def _endless(t: float, named: str) -> str:
    return f"at t = {t:.9g} s events of the contacts {named} follow each other without an end"


class ContactModes:
    """The contacts ``held`` of one subsystem during a run, and the ``record`` of what happened to
    them; rebounds end at an ``accuracy`` [m and s], None for the default one.

    ``next_touch`` is a time [s] shortly after the next rebound that is expected.
    """

    def __init__(
        self, held: ContactState, names: Sequence[str], law: str, accuracy: float | None
    ) -> None:
        self.held, self.names, self.law = held, names, law
        self.record = ContactRecord(names, held.contacts.sliding)
        self.accuracy = accuracy_of_end(accuracy)
        self.next_touch = math.inf
        self.last_time, self.repeated = math.nan, 0  # of the last event, and how often at that time
        self.opened: set[int] = set()  # whose forces became zero at that time

    @property
    def events(self) -> list[ContactEvent]:
        """The events that are not yet published."""
        return self.record.events

    def forget_events(self) -> None:
        """Let the events so far count as published."""
        self.record.forget_events()

    def begin(self) -> None:
        """Find the contacts that are closed at t = 0, after impacts where they approach. Raises
        ``StartError`` if one overlaps.
        """
        value, gap, _ = self.held.gaps()
        contacts = self.held.contacts
        for k in map(int, np.flatnonzero((gap < 0.0) & contacts.acts)):
            if gap[k] < -OVERLAP * contacts.round_off[k]:
                raise StartError(_overlaps(self.names[k], -float(gap[k])))
            contacts.limit[k] = value[self.held.coordinate[k]]
        self.resolve(None)

    def switch(self, own: np.ndarray, acts: bool) -> float:
        """Let the contacts ``own`` (c,) act from now on, or not any more; return by how much one
        overlaps [m or rad] that is therefore not to act, else 0. ``resolve`` is to follow.
        """
        value, gap, _ = self.held.gaps()
        system, contacts, stuck = self.held.system, self.held.contacts, self.held.sticks
        if acts and (gap < -OVERLAP * contacts.round_off)[own].any():
            return float(-gap[own].min())
        contacts.acts[own] = acts
        set_closed(system, contacts, self.held.closed & contacts.acts, value)
        released = np.isin(np.arange(stuck.size), contacts.sliding[~contacts.acts])
        set_sticking(system, stuck & ~released, value)
        return 0.0

    def resolve(self, event: int | None, jumped: bool = False) -> None:
        """Let the contacts open and close, stick and slide, and the velocities jump, at an
        ``event`` of the contact of this number, of the friction of one (behind them), or of none.
        They may have ``jumped`` already, by an event of the deck: then gaps of closed contacts may
        have rates. Raises ``ContactsUnsolved``.
        """
        _, gap, _ = self.held.gaps()
        of_contacts.choose_tangents(self.held.system, self.held.work_arrays)
        contacts = self.held.contacts
        was, near = self.held.closed, gap <= TOUCHING * contacts.round_off
        near &= contacts.acts
        if event is not None and event < was.size:
            near[event] = True
        which = np.flatnonzero(was | near)
        which = which[~np.isin(which, self.held.needless(which))]
        self.next_touch = math.inf
        self._note_opening(event, was, jumped)
        self._count(which)
        if not which.size:
            return
        line = self.held.side_by_side(which)
        if line is not None:
            raise ContactsUnsolved(_along_a_line(self.time, self.names[line]))
        cause = Cause()
        if event is not None and event >= was.size:
            cause = self._cause(event - was.size, which)
        try:
            self._resolve(which, was, cause, jumped)
        except NoSolution as error:
            names = [self.names[int(k)] for k in which]
            raise ContactsUnsolved(_unsolved(self.time, names, error)) from error

    @property
    def time(self) -> float:
        """The time now [s]."""
        return float(self.held.state.time[0])

    def _cause(self, own: int, which: np.ndarray) -> Cause:
        """Return what an event says of the contact with friction number ``own``, if it is one of
        ``which``.
        """
        found = np.flatnonzero(self.held.contacts.sliding[which] == own)
        if not found.size:
            return Cause()
        place = int(found[0])
        slid = self.held.slides[which]
        return Cause(slips=place, slid=slid) if self.held.sticks[own] else Cause(ends=place)

    def begins_to_slip(self, event: int) -> bool:
        """Whether the contact of an ``event`` has begun to slip now, so that its slip, which is
        zero, does not end yet.
        """
        own, group = event - self.held.contacts.row.size, self.held.system.forces.sliding
        if group is None or own < 0 or self.held.sticks[own] or self.time != self.last_time:
            return False
        _, _, rate = self.held.gaps()
        slip = rate[group.along[own]]
        return not self.held.rounded(slip).any()

    def _note_opening(self, event: int | None, was: np.ndarray, jumped: bool) -> None:
        """Note the contact whose force has become zero at an ``event``. It stays open at that time,
        even if the forces of others become zero too: what is left of its own is round-off.
        """
        of_gap = event is not None and event < was.size
        if self.time != self.last_time or jumped or (of_gap and not was[event]):
            self.opened.clear()
        if event is not None and of_gap and was[event]:
            self.opened.add(event)

    def _count(self, which: np.ndarray) -> None:
        """Raise ``ContactsUnsolved`` if events of the contacts ``which`` follow each other without
        an end at one time.
        """
        self.repeated = self.repeated + 1 if self.time == self.last_time else 0
        self.last_time = self.time
        if self.repeated > MOST_AT_ONCE:
            named = ", ".join(self.names[int(k)] for k in which)
            raise ContactsUnsolved(_endless(self.time, named))

    def _resolve(self, which: np.ndarray, was: np.ndarray, cause: Cause, jumped: bool) -> None:
        held, stuck = self.held, self.held.sticks
        if cause.slips >= 0:  # forces of steps are means, or those of their start
            solve_accelerations(held.system, held.state, held.unknowns, None, held.work_arrays)
        unknowns = held.without if jumped else held.unknowns
        held.remove_violation(int(which[0]), unknowns, held.ended(which, cause))
        response = of_contacts.respond(
            held.system, held.contacts, which, held.state, held.without, held.work_arrays
        )
        held.lift(response)
        before = Before(was, stuck, held.rates(response, cause), cause.ends)
        stays = ~np.isin(which, list(self.opened))
        impulse, after, remaining = self._strike(response, before.speed, stays, cause)
        self.record.note(self.time, response, before, impulse, after, remaining)
        held.set_mode(response, after)
        self.next_touch = self.time + time_to_next(after, which.size)

    def _strike(
        self, response: Response, before: np.ndarray, stays: np.ndarray, cause: Cause
    ) -> tuple[np.ndarray, After, np.ndarray]:
        """Let the velocities jump from the rates ``before`` (m,); return the impulse (m,), what
        follows it, and the times (k,) [s] that omitted rebounds would take.
        """
        held, which = self.held, response.which
        e, remaining = held.contacts.restitution[which].copy(), np.zeros(which.size)
        round_off = held.contacts.round_off[which]
        moving = held.state.v, held.state.w, held.state.work
        saved = [array.copy() for array in moving]
        while True:
            impulse = impulses(self.law, response.W, before, e, held.cones(response))
            held.push(response, impulse, before)
            speed = held.rounded(before + response.W @ impulse)
            after = follow(held, response, speed, stays, cause)
            left, height = rebounds(after, e)
            over = unseen(height, round_off)
            over |= (height <= self.accuracy) & (left <= self.accuracy)
            ends = (impulse[: e.size] > 0.0) & (e > 0.0) & over
            if not ends.any():
                break
            self.record.omitted.append([self.time, float(height[ends].max())])
            e[ends], remaining[ends] = 0.0, left[ends]
            for array, old in zip(moving, saved, strict=True):
                array[:] = old
        small = np.zeros(before.size, dtype=bool)
        small[: e.size] = unseen(height, round_off) & stays
        for _ in range(1 + e.size):
            if small.any():
                after = hold(held, response, after, small, (stays, cause))
            small = ending_slips(response, after, round_off)
        return impulse, after, remaining

    @property
    def counters(self) -> dict[str, Any]:
        """What later steps depend on, as JSON can hold it."""
        return {
            **self.held.counters,
            **self.record.counters,
            "nextTouch": None if math.isinf(self.next_touch) else self.next_touch,
        }

    def restore(self, counters: dict[str, Any]) -> None:
        """Restore what ``counters`` returned; events after it are forgotten."""
        self.held.restore(counters)
        self.record.restore(counters)
        self.next_touch = math.inf if counters["nextTouch"] is None else counters["nextTouch"]
