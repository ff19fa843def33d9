"""Which contacts of a subsystem are closed, and what changes that: impacts, openings, rest.

At an event (the gap of an open contact is zero, or a closed one would pull) the velocities jump by
the impulses of ``impact``; of the contacts whose gaps are zero and stay so to first order, those
are closed whose forces are positive in the solution of

    b + W f >= 0,    f >= 0,    complementary           b   accelerations of the gaps for f = 0

Rebounds that follow each other ever faster (an infinite number in a finite time, 2 v/(a (1 - e)) by
the speed v after an impact and the acceleration -a of the gap) end where that time and their height
v^2/(2 a) are below the accuracy asked for, or the height is below the round-off of positions: then
the contact closes, and the height is added to the error estimate.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from msahl.contact import response as of_contacts
from msahl.contact.complementarity import NoSolution, solve
from msahl.contact.events import CLOSES, IMPACT, OPENS, ContactEvent
from msahl.contact.impact import impulses
from msahl.contact.response import Response
from msahl.formulations.absolute.frames import first_multiplier
from msahl.start.redundancy import INDEPENDENT
from msahl.start.velocities import StartError, project, solve_accelerations
from msahl.system.arrays import State, System
from msahl.system.contacts import Contacts, closed, set_closed
from msahl.system.unknowns import Unknowns, choose
from msahl.system.work_arrays import PlainFirst, energy, new_work_arrays

TOUCHING = 10.0
"""Gap, over its round-off, of a contact that takes part in an event of another."""
HEIGHT = 4.0
"""Height of rebounds, over the round-off of the gap, that is too small to be resolved."""
SHARE = 0.1
"""Share of the accuracy asked for that omitted rebounds may take."""
ACCURACY = 1e-9
"""Accuracy [m and s] of the end of a series of rebounds if none is asked for."""
LIFTED = 0.5
"""Overlap, over the round-off of the gap, that is removed at an event."""
MOST_AT_ONCE = 200
"""Most events at one time."""
GAINED = 1e-10
"""Energy that an impact adds, over what its impulses move, that is no round-off."""
STILL = 1e-12
"""Rate of a gap, over the largest speed, that is zero but for round-off."""
BEYOND = 1.5
"""Time, over that of the next rebound, in which a step looks for it."""
OVERLAP = 1e4
"""Overlap at t = 0, over the round-off of the gap, that is that of the digits a deck omits: 1e-9
of the size of the model."""


class ContactsUnsolved(Exception):  # noqa: N818 - an outcome
    """An impact, or the forces of contacts, have no solution; the message says where."""


class _After(NamedTuple):
    """What follows an impact, of k contacts."""

    speed: np.ndarray  # (k,) rates of the gaps
    force: np.ndarray  # (k,) of those that stay
    acceleration: np.ndarray  # (k,) of the gaps


def _rebounds(after: _After, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (k,) [s] that all further rebounds take, and the heights of the next ones [m
    or rad]; infinite where there is none.
    """
    left, height = np.full((2, e.size), math.inf)
    falls = (after.speed > 0.0) & (after.acceleration < 0.0)
    v, a = after.speed[falls], -after.acceleration[falls]
    height[falls] = 0.5 * v * v / a
    with np.errstate(divide="ignore"):
        left[falls] = 2.0 * v / (a * (1.0 - e[falls]))
    return left, height


def _overlaps(name: str, depth: float) -> str:
    return (
        f"contact '{name}' overlaps by {depth:.4g} (m or rad) at t = 0; move one of its bodies, or "
        "change the limit"
    )


def _unsolved(t: float, named: str) -> str:
    return f"at t = {t:.9g} s the impulses or forces of the contacts {named} have no solution"


def _endless(t: float, named: str) -> str:
    return f"at t = {t:.9g} s events of the contacts {named} follow each other without an end"


class ContactModes:
    """The contacts of one subsystem during a run, of which ``unknowns`` are those without them.

    ``omitted`` are the times [s] at which rebounds were omitted and their heights [m],
    ``next_touch`` is a time [s] shortly after the next rebound that is expected.
    """

    def __init__(
        self,
        contacts: Contacts,
        names: Sequence[str],
        law: str,
        accuracy: float | None,
        system: System,
        state: State,
        unknowns: Unknowns,
    ) -> None:
        self.contacts, self.names, self.law = contacts, names, law
        self.accuracy = ACCURACY if accuracy is None else SHARE * accuracy
        assert system.scalar is not None
        self.system, self.state, self.without = system, state, unknowns
        self.rows = system.scalar.equations
        # The matrix at rest has no part of what a decaying scheme remembers of velocities.
        rises = {name: np.zeros_like(state.v_rise) for name in ("v_rise", "w_rise")}
        still = state._replace(**rises)
        self.work_arrays = new_work_arrays(system, still)._replace(call=PlainFirst(system))
        self.omitted: list[list[float]] = []
        self.next_touch = math.inf
        self.shared: set[str] = set()  # contacts whose forces are not unique
        self.events: list[ContactEvent] = []  # those not yet published
        self.published = self.impacts = 0
        self.last_time, self.repeated = math.nan, 0  # of the last event, and how often at that time
        self.gained = 0.0  # energy that impacts added [J], which Newton's law may do

    @property
    def key(self) -> bytes:
        """What differs from mode to mode."""
        return self.closed.tobytes() + self.contacts.acts.tobytes()

    @property
    def closed(self) -> np.ndarray:
        """(c,) which contacts are closed."""
        return closed(self.system, self.contacts)

    @property
    def unknowns(self) -> Unknowns:
        """The unknowns of steps: the multipliers of closed contacts as well."""
        rows, first = self.rows, first_multiplier(self.system.frames)
        place = rows.place[self.contacts.row[self.closed]]
        flat = 3 * (first + place[:, 0]) + place[:, 1]
        return (
            choose(self.system, np.union1d(self.without.free, flat)) if flat.size else self.without
        )

    def begin(self) -> None:
        """Find the contacts that are closed at t = 0, after impacts where they approach. Raises
        ``StartError`` if one overlaps.
        """
        value, gap, _ = self._gaps()
        for k in map(int, np.flatnonzero((gap < 0.0) & self.contacts.acts)):
            if gap[k] < -OVERLAP * self.contacts.round_off[k]:
                raise StartError(_overlaps(self.names[k], -float(gap[k])))
            self.contacts.limit[k] = value[k]
        self.resolve(None)

    def switch(self, own: np.ndarray, acts: bool) -> float:
        """Let the contacts ``own`` (c,) act from now on, or not any more; return by how much one
        overlaps [m or rad] that is therefore not to act, else 0. ``resolve`` is to follow.
        """
        value, gap, _ = self._gaps()
        if acts and (gap < -OVERLAP * self.contacts.round_off)[own].any():
            return float(-gap[own].min())
        self.contacts.acts[own] = acts
        set_closed(self.system, self.contacts, self.closed & self.contacts.acts, value)
        return 0.0

    def resolve(self, event: int | None, jumped: bool = False) -> None:
        """Let the contacts open and close, and the velocities jump, at an ``event`` of the contact
        of this number, or of none. They may have ``jumped`` already, by an event of the deck: then
        gaps of closed contacts may have rates. Raises ``ContactsUnsolved``.
        """
        _, gap, _ = self._gaps()
        was, near = self.closed, gap <= TOUCHING * self.contacts.round_off
        near &= self.contacts.acts
        if event is not None:
            near[event] = True
        which = np.flatnonzero(was | near)
        self.next_touch = math.inf
        self._count(which)
        if not which.size:
            return
        opened = event if event is not None and was[event] else None
        try:
            self._remove_violation(int(which[0]), self.without if jumped else self.unknowns)
            self._resolve(which, was, opened)
        except NoSolution as error:
            named = ", ".join(self.names[int(k)] for k in which)
            raise ContactsUnsolved(_unsolved(float(self.state.time[0]), named)) from error

    def _count(self, which: np.ndarray) -> None:
        """Raise ``ContactsUnsolved`` if events of the contacts ``which`` follow each other without
        an end at one time.
        """
        t = float(self.state.time[0])
        self.repeated = self.repeated + 1 if t == self.last_time else 0
        self.last_time = t
        if self.repeated > MOST_AT_ONCE:
            raise ContactsUnsolved(_endless(t, ", ".join(self.names[int(k)] for k in which)))

    def _resolve(self, which: np.ndarray, was: np.ndarray, opened: int | None) -> None:
        response = of_contacts.respond(
            self.system, self.contacts, which, self.state, self.without, self.work_arrays
        )
        self._lift(response)
        value, _, _ = self._gaps()
        _, _, rate = self._gaps()
        before = self._rounded(rate[which])
        e, remaining = self.contacts.restitution[which].copy(), np.zeros(which.size)
        saved = self.state.v.copy(), self.state.w.copy(), self.state.work.copy()
        stays = which != opened
        while True:
            impulse = impulses(self.law, response.W, before, e)
            self._push(response, impulse, before)
            after = self._after(response, self._rounded(before + response.W @ impulse), stays)
            left, height = _rebounds(after, e)
            ends = (impulse > 0.0) & (e > 0.0) & self._is_over(which, left, height)
            if not ends.any():
                break
            self.omitted.append([float(self.state.time[0]), float(height[ends].max())])
            e[ends], remaining[ends] = 0.0, left[ends]
            for array, old in zip(
                (self.state.v, self.state.w, self.state.work), saved, strict=True
            ):
                array[:] = old
        unseen = height <= HEIGHT * self.contacts.round_off[which]
        if (unseen & stays).any():
            after = self._hold(response, after, unseen & stays, stays)
        self._note(which, was, (before, impulse, after), remaining)
        now = np.zeros(was.size, dtype=bool)
        now[which] = after.force > 0.0
        self._set_mode(now, value)
        falls = (after.speed > 0.0) & (after.acceleration < 0.0)
        if falls.any():
            time = 2.0 * after.speed[falls] / -after.acceleration[falls]
            self.next_touch = float(self.state.time[0] + BEYOND * time.min())

    def _gaps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return of_contacts.gaps(self.system, self.contacts, self.state, self.work_arrays)

    def _rounded(self, rate: np.ndarray) -> np.ndarray:
        """Return rates of gaps, without those that are round-off."""
        start, length = self.work_arrays.start.frames, self.system.frames.length
        speed = np.abs(start.v).max() + (np.abs(start.W).max(axis=1) * length).max()
        return np.where(np.abs(rate) <= STILL * speed, 0.0, rate)

    def _remove_violation(self, k: int, unknowns: Unknowns) -> None:
        """Project the velocities onto joints and closed contacts, whose multipliers are among the
        ``unknowns``: schemes of order 2 satisfy them to their error only, and impulses would do
        work on it. The energy counts as work of contact ``k``.
        """
        before = self._energy()
        project(self.system, self.state, self.work_arrays, unknowns)
        self.state.work[self.contacts.column[k]] += self._energy() - before

    def _lift(self, response: Response) -> None:
        """Remove overlaps by round-off: an open contact must not begin with one."""
        _, gap, _ = self._gaps()
        k = np.flatnonzero(gap[response.which] < -LIFTED * self.contacts.round_off[response.which])
        if not k.size:
            return
        before = self._energy()
        push = np.zeros(response.which.size)
        W, depth = response.W[np.ix_(k, k)], -gap[response.which[k]]
        push[k] = np.linalg.lstsq(W, depth, rcond=None)[0]
        of_contacts.displace(self.system, response, push, self.state)
        column = self.contacts.column[response.which[k[0]]]
        self.state.work[column] += self._energy() - before

    def _energy(self) -> float:
        return energy(self.system, self.state, self.work_arrays)

    def _push(self, response: Response, impulse: np.ndarray, before: np.ndarray) -> None:
        """Apply an ``impulse`` (k,) at the rates ``before``, and count its work."""
        mean = before + 0.5 * (response.W @ impulse)
        self.state.work[self.contacts.column[response.which]] += impulse * mean
        R = self.work_arrays.start.frames.R.copy()
        of_contacts.push(self.system, response, impulse, self.state, R)

    def _after(self, response: Response, speed: np.ndarray, stays: np.ndarray) -> _After:
        """Find the forces of the contacts whose gaps may stay zero."""
        b, size = of_contacts.accelerations(
            self.system, self.contacts, response, self.state, self.without, self.work_arrays
        )
        rests = np.flatnonzero((speed == 0.0) & stays)
        q = np.where(np.abs(b[rests]) <= STILL * size, 0.0, b[rests])
        force, W = np.zeros(speed.size), response.W[np.ix_(rests, rests)]
        force[rests] = solve(W, q)
        after = b + response.W @ force
        self._note_shared(response.which[rests[np.abs(after[rests]) <= STILL * size]], response)
        return _After(speed, force, after)

    def _note_shared(self, together: np.ndarray, response: Response) -> None:
        """Note which contacts share their forces in many ways: more rest ``together`` than are
        independent.
        """
        k = np.flatnonzero(np.isin(response.which, together))
        W = response.W[np.ix_(k, k)]
        if k.size > np.linalg.matrix_rank(W, tol=INDEPENDENT * float(W.max(initial=0.0))):
            self.shared.update(self.names[int(c)] for c in together)

    def _hold(
        self, response: Response, after: _After, unseen: np.ndarray, stays: np.ndarray
    ) -> _After:
        """Keep those contacts closed that would rebound ``unseen``: where several rock, the impact
        of one lifts the others, without an end.
        """
        k = np.flatnonzero(unseen | (after.speed == 0.0))
        push = np.zeros(unseen.size)
        push[k] = -np.linalg.lstsq(response.W[np.ix_(k, k)], after.speed[k], rcond=None)[0]
        self._push(response, push, after.speed)
        speed = after.speed + response.W @ push
        speed[k] = 0.0
        return self._after(response, self._rounded(speed), stays)

    def _is_over(self, which: np.ndarray, left: np.ndarray, height: np.ndarray) -> np.ndarray:
        """(k,) whether rebounds may be omitted that take the time ``left``."""
        unseen = height <= HEIGHT * self.contacts.round_off[which]
        return unseen | ((height <= self.accuracy) & (left <= self.accuracy))

    def _note(
        self,
        which: np.ndarray,
        was: np.ndarray,
        impact: tuple[np.ndarray, np.ndarray, _After],
        remaining: np.ndarray,
    ) -> None:
        """Add the events of the contacts ``which``."""
        before, impulse, after = impact
        gained = 0.5 * float(impulse @ (before + after.speed))
        self.gained += gained if gained > GAINED * float(np.abs(impulse * before).sum()) else 0.0
        t = float(self.state.time[0])
        for k, c in enumerate(which):
            v, w, name = float(before[k]), float(after.speed[k]), self.names[c]
            if impulse[k] > 0.0:
                self.impacts += 1
                lost = 0.0 - 0.5 * float(impulse[k]) * (v + w)
                self.events.append(
                    ContactEvent(t, IMPACT, name, v, w, float(impulse[k]), lost, 0.0)
                )
            if (after.force[k] > 0.0) != was[c]:
                kind = OPENS if was[c] else CLOSES
                self.events.append(ContactEvent(t, kind, name, w, w, 0.0, 0.0, float(remaining[k])))

    def _set_mode(self, now: np.ndarray, value: np.ndarray) -> None:
        """Close the contacts ``now`` (c,), and set accelerations and forces to theirs."""
        system, state = self.system, self.state
        set_closed(system, self.contacts, now, value)
        place = self.rows.place[self.contacts.row]
        state.violation[place[:, 0], place[:, 1]] = 0.0
        solve_accelerations(system, state, self.unknowns, None, self.work_arrays)
        for trend in (state.a_trend, state.alpha_trend, state.force_trend):
            trend[:] = 0.0

    def forget_events(self) -> None:
        """Let the events so far count as published."""
        self.published += len(self.events)
        self.events = []

    @property
    def counters(self) -> dict[str, Any]:
        """What later steps depend on, as JSON can hold it."""
        return {
            "closed": self.closed.tolist(),
            "acts": self.contacts.acts.tolist(),
            "offset": self.rows.offset[self.contacts.row].tolist(),
            "omitted": [*self.omitted],
            "nextTouch": None if math.isinf(self.next_touch) else self.next_touch,
            "events": [self.published, len(self.events)],
            "impacts": self.impacts,
            "shared": sorted(self.shared),
            "gained": self.gained,
        }

    def restore(self, counters: dict[str, Any]) -> None:
        """Restore what ``counters`` returned; events after it are forgotten."""
        set_closed(
            self.system, self.contacts, np.array(counters["closed"]), np.array(counters["offset"])
        )
        self.contacts.acts[:] = counters["acts"]
        self.omitted, self.impacts = [*counters["omitted"]], counters["impacts"]
        self.shared, self.gained = set(counters["shared"]), counters["gained"]
        self.next_touch = math.inf if counters["nextTouch"] is None else counters["nextTouch"]
        published, pending = counters["events"]
        if published == self.published:
            del self.events[pending:]
        else:  # of a run that is resumed, which had published all
            self.published, self.events = published, []
