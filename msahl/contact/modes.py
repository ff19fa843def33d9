"""Which contacts of a subsystem are closed, and what changes that: impacts, openings, rest.

At an event (the gap of an open contact is zero, a closed one would pull, the grip or the slip of
one with friction is used up) the velocities jump by the impulses of ``impact``; of the contacts
whose gaps are zero and stay so to first order, those are closed whose forces are positive in the
solution of

    b + W f >= 0,    f >= 0,    complementary           b   accelerations of the gaps for f = 0

or, with friction, in that of ``friction``, by the accelerations of the slips as well: those whose
slips are zero stick if their forces are in the cone of the static coefficient.

Rebounds that follow each other ever faster (an infinite number in a finite time, 2 v/(a (1 - e)) by
the speed v after an impact and the acceleration -a of the gap) end where that time and their height
v^2/(2 a) are below the accuracy asked for, or the height is below the round-off of positions: then
the contact closes, and the height is added to the error estimate.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from msahl.contact import friction
from msahl.contact import response as of_contacts
from msahl.contact.complementarity import NoSolution, solve
from msahl.contact.events import CLOSES, IMPACT, OPENS, SLIDES, STICKS, ContactEvent
from msahl.contact.friction import Cones, Jammed
from msahl.contact.impact import SeveralAtOnce, impulses
from msahl.contact.response import Response
from msahl.formulations.absolute.frames import first_multiplier
from msahl.start.redundancy import INDEPENDENT
from msahl.start.velocities import StartError, project, solve_accelerations
from msahl.system.arrays import State, System
from msahl.system.contacts import NEAR, Contacts, closed, set_closed, set_sticking, sticking
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
"""Rate of a gap or slip, over the largest speed so far, that is zero but for round-off."""
END = 1e-6
"""Slip at the event that ends it, over the largest speed, that is zero: where its direction changes
faster than steps resolve. The way that is left goes by its square."""
USED = 1e-6
"""Share of the grip that is none, where that of another contact is used up: those of an edge slip
together."""
SLIPS = 1e-9
"""Acceleration of a slip, over the largest one, that is not zero; likewise of a force at the edge
of its cone."""
CHANGING = ("friction", "toward", "still")
"""Arrays of the contacts with friction that change during a run."""
BEYOND = 1.5
"""Time, over that of the next rebound, in which a step looks for it."""
OVERLAP = 1e4
"""Overlap at t = 0, over the round-off of the gap, that is that of the digits a deck omits: 1e-9
of the size of the model."""


class ContactsUnsolved(Exception):  # noqa: N818 - an outcome
    """An impact, or the forces of contacts, have no solution; the message says where."""


class _After(NamedTuple):
    """What follows an impact, along the m directions of k contacts."""

    speed: np.ndarray  # (m,)
    force: np.ndarray  # (m,) of those that stay
    acceleration: np.ndarray  # (m,)
    sticks: np.ndarray  # (k,) whether the slip stays zero
    toward: np.ndarray  # (k, 2) direction of the slip of those that slide


class _Cause(NamedTuple):
    """What an event says of its contact beforehand, each the number among ``which`` or -1."""

    opens: int = -1  # its force has become zero
    slips: int = -1  # its grip is used up
    ends: int = -1  # its slip has become zero


def _rebounds(after: _After, e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the times (k,) [s] that all further rebounds take, and the heights of the next ones [m
    or rad]; infinite where there is none.
    """
    left, height = np.full((2, e.size), math.inf)
    v, a = after.speed[: e.size], -after.acceleration[: e.size]
    falls = (v > 0.0) & (a > 0.0)
    v, a = v[falls], a[falls]
    height[falls] = 0.5 * v * v / a
    with np.errstate(divide="ignore"):
        left[falls] = 2.0 * v / (a * (1.0 - e[falls]))
    return left, height


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
        self.length = float(contacts.round_off.max()) / NEAR
        self.fastest = 0.0  # largest speed so far, or that of falling by the model's size [m/s]
        self.gained = 0.0  # energy that impacts added [J], which Newton's law may do

    @property
    def key(self) -> bytes:
        """What differs from mode to mode."""
        modes = (self.closed, sticking(self.system), self.contacts.acts)
        return b"".join(array.tobytes() for array in modes)

    @property
    def closed(self) -> np.ndarray:
        """(c,) which contacts are closed."""
        return closed(self.system, self.contacts)

    @property
    def unknowns(self) -> Unknowns:
        """The unknowns of steps: the multipliers of closed contacts as well."""
        rows, first = self.rows, first_multiplier(self.system.frames)
        held = self.contacts.row[self.closed]
        if (group := self.system.forces.sliding) is not None:
            held = np.concatenate([held, group.tangent[sticking(self.system)].reshape(-1)])
        place = rows.place[held]
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
            self.contacts.limit[k] = value[self._coordinate[k]]
        self.resolve(None)

    @property
    def _coordinate(self) -> np.ndarray:
        """(c,) the contacts' coordinates."""
        return self.rows.coordinate[self.contacts.row, 0]

    def switch(self, own: np.ndarray, acts: bool) -> float:
        """Let the contacts ``own`` (c,) act from now on, or not any more; return by how much one
        overlaps [m or rad] that is therefore not to act, else 0. ``resolve`` is to follow.
        """
        value, gap, _ = self._gaps()
        if acts and (gap < -OVERLAP * self.contacts.round_off)[own].any():
            return float(-gap[own].min())
        self.contacts.acts[own] = acts
        group, stuck = self.system.forces.sliding, sticking(self.system)
        set_closed(self.system, self.contacts, self.closed & self.contacts.acts, value)
        if group is not None:
            released = np.isin(np.arange(stuck.size), self.contacts.sliding[~self.contacts.acts])
            set_sticking(self.system, stuck & ~released, value)
        return 0.0

    def resolve(self, event: int | None, jumped: bool = False) -> None:
        """Let the contacts open and close, stick and slide, and the velocities jump, at an
        ``event`` of the contact of this number, of the friction of one (behind them), or of none.
        They may have ``jumped`` already, by an event of the deck: then gaps of closed contacts may
        have rates. Raises ``ContactsUnsolved``.
        """
        _, gap, _ = self._gaps()
        was, near = self.closed, gap <= TOUCHING * self.contacts.round_off
        near &= self.contacts.acts
        if event is not None and event < was.size:
            near[event] = True
        which = np.flatnonzero(was | near)
        self.next_touch = math.inf
        self._count(which)
        if not which.size:
            return
        cause = _Cause() if event is None else self._cause(event, was, which)
        try:
            self._resolve(which, was, cause, jumped)
        except NoSolution as error:
            names = [self.names[int(k)] for k in which]
            raise ContactsUnsolved(_unsolved(float(self.state.time[0]), names, error)) from error

    def _cause(self, event: int, was: np.ndarray, which: np.ndarray) -> _Cause:
        """Return what an ``event`` says of its contact, one of ``which``."""
        if event < was.size:
            place = int(np.flatnonzero(which == event)[0])
            return _Cause(opens=place) if was[event] else _Cause()
        own = event - was.size
        place = int(np.flatnonzero(self.contacts.sliding[which] == own)[0])
        return _Cause(slips=place) if sticking(self.system)[own] else _Cause(ends=place)

    def _count(self, which: np.ndarray) -> None:
        """Raise ``ContactsUnsolved`` if events of the contacts ``which`` follow each other without
        an end at one time.
        """
        t = float(self.state.time[0])
        self.repeated = self.repeated + 1 if t == self.last_time else 0
        self.last_time = t
        if self.repeated > MOST_AT_ONCE:
            raise ContactsUnsolved(_endless(t, ", ".join(self.names[int(k)] for k in which)))

    def _resolve(self, which: np.ndarray, was: np.ndarray, cause: _Cause, jumped: bool) -> None:
        stuck = sticking(self.system)
        if cause.slips >= 0:  # forces of steps are means, or those of their start
            solve_accelerations(self.system, self.state, self.unknowns, None, self.work_arrays)
        unknowns = self.without if jumped else self.unknowns
        self._remove_violation(int(which[0]), unknowns, self._ended(which, cause))
        response = of_contacts.respond(
            self.system, self.contacts, which, self.state, self.without, self.work_arrays
        )
        self._lift(response)
        before = self._rates(response, cause)
        e, remaining = self.contacts.restitution[which].copy(), np.zeros(which.size)
        saved = self.state.v.copy(), self.state.w.copy(), self.state.work.copy()
        stays = np.arange(which.size) != cause.opens
        while True:
            impulse = impulses(self.law, response.W, before, e, self._cones(response))
            self._push(response, impulse, before)
            speed = self._rounded(before + response.W @ impulse)
            after = self._after(response, speed, stays, cause)
            left, height = _rebounds(after, e)
            ends = (impulse[: e.size] > 0.0) & (e > 0.0) & self._is_over(which, left, height)
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
            after = self._hold(response, after, unseen & stays, (stays, cause))
        self._note(response, (was, stuck), (before, impulse, after), remaining, cause)
        self._set_mode(response, after)
        v, a = after.speed[: which.size], -after.acceleration[: which.size]
        falls = (v > 0.0) & (a > 0.0)
        if falls.any():
            time = 2.0 * v[falls] / a[falls]
            self.next_touch = float(self.state.time[0] + BEYOND * time.min())

    def _rates(self, response: Response, cause: _Cause) -> np.ndarray:
        """Return the rates along the directions (m,), without round-off; a slip that has come to
        its end is removed.
        """
        _, _, rate = self._gaps()
        self.fastest = max(self.fastest, self._speed)
        given = response.sign * rate[self.rows.coordinate[response.row, 0]]
        found, push = self._rounded(given), np.zeros(given.size)
        for k, t in enumerate(response.tangent):
            near = (END if k == cause.ends else STILL) * self.fastest
            if t[0] >= 0 and np.hypot(*given[t]) <= near:
                push[t] = -np.linalg.lstsq(response.W[np.ix_(t, t)], given[t], rcond=None)[0]
                found[t] = 0.0
        if push.any():
            self._push(response, push, given)
        return found

    def _cones(
        self, response: Response, still: np.ndarray | None = None, grips: bool = False
    ) -> Cones | None:
        """Return the cones of friction, None without it; of the static coefficients if it
        ``grips``, where contacts are ``still`` (k,).
        """
        if response.row.size == response.which.size:
            return None
        which, group = response.which, self.system.forces.sliding
        assert group is not None
        mu = self.contacts.friction[which]
        if grips and still is not None:
            rough = still & (self.contacts.sliding[which] >= 0)
            mu = np.where(rough, group.grip[self.contacts.sliding[which]], mu)
        count = which.size
        return Cones(
            np.arange(count), response.tangent, mu, np.zeros(count), np.full((count, 2), np.nan)
        )

    @property
    def _coordinates(self) -> int:
        assert self.system.scalar is not None
        return int(self.system.scalar.coordinates.kind.size)

    def _gaps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return of_contacts.gaps(self.system, self.contacts, self.state, self.work_arrays)

    @property
    def _speed(self) -> float:
        """Largest speed of the bodies [m/s]."""
        start, length = self.work_arrays.start.frames, self.system.frames.length
        return float(np.abs(start.v).max() + (np.abs(start.W).max(axis=1) * length).max())

    def _rounded(self, rate: np.ndarray) -> np.ndarray:
        """Return rates, without those that are round-off."""
        return np.where(np.abs(rate) <= STILL * self.fastest, 0.0, rate)

    def _ended(self, which: np.ndarray, cause: _Cause) -> np.ndarray | None:
        """Return which contact with friction (k,) has come to the end of its slip, None without."""
        group = self.system.forces.sliding
        if cause.ends < 0 or group is None:
            return None
        own = self.contacts.sliding[which[cause.ends]]
        _, _, rate = self._gaps()
        slip = float(np.hypot(*rate[group.along[own]]))
        return np.arange(group.row.size) == own if slip <= END * self.fastest else None

    def _remove_violation(self, k: int, unknowns: Unknowns, ended: np.ndarray | None) -> None:
        """Project the velocities onto joints and closed contacts, whose multipliers are among the
        ``unknowns``: schemes of order 2 satisfy them to their error only, and impulses would do
        work on it. The energy counts as work of contact ``k``. Slips that have ``ended`` stay zero.
        """
        before = self._energy()
        if ended is not None:
            value, _, _ = self._gaps()
            set_sticking(self.system, sticking(self.system) | ended, value)
            unknowns = self.unknowns
        project(self.system, self.state, self.work_arrays, unknowns)
        self.state.work[self.contacts.column[k]] += self._energy() - before

    def _lift(self, response: Response) -> None:
        """Remove overlaps by round-off: an open contact must not begin with one."""
        _, gap, _ = self._gaps()
        k = np.flatnonzero(gap[response.which] < -LIFTED * self.contacts.round_off[response.which])
        if not k.size:
            return
        before = self._energy()
        push = np.zeros(response.row.size)
        W, depth = response.W[np.ix_(k, k)], -gap[response.which[k]]
        push[k] = np.linalg.lstsq(W, depth, rcond=None)[0]
        of_contacts.displace(self.system, response, push, self.state)
        column = self.contacts.column[response.which[k[0]]]
        self.state.work[column] += self._energy() - before

    def _energy(self) -> float:
        return energy(self.system, self.state, self.work_arrays)

    def _push(self, response: Response, impulse: np.ndarray, before: np.ndarray) -> None:
        """Apply an ``impulse`` (m,) at the rates ``before``, and count its work."""
        mean = before + 0.5 * (response.W @ impulse)
        np.add.at(self.state.work, response.column, impulse * mean)
        R = self.work_arrays.start.frames.R.copy()
        of_contacts.push(self.system, response, impulse, self.state, R)

    def _after(
        self, response: Response, speed: np.ndarray, stays: np.ndarray, cause: _Cause
    ) -> _After:
        """Find the forces of the contacts whose gaps may stay zero."""
        b, size = of_contacts.accelerations(
            self.system, response, self.state, self.without, self.work_arrays
        )
        b = np.where(np.abs(b) <= STILL * size, 0.0, b)
        self.fastest = max(self.fastest, float(np.sqrt(self.length * size)))
        count = stays.size
        rests = np.flatnonzero((speed[:count] == 0.0) & stays)
        force, toward = np.zeros(speed.size), np.zeros((count, 2))
        if speed.size == count:
            force[rests] = solve(response.W[np.ix_(rests, rests)], b[rests])
            sticks = np.zeros(count, dtype=bool)
        else:
            force, sticks, toward = self._with_friction(response, b, speed, rests, cause)
        after = b + response.W @ force
        self._note_shared(response.which[rests[np.abs(after[rests]) <= STILL * size]], response)
        return _After(speed, force, after, sticks, toward)

    def _with_friction(
        self,
        response: Response,
        b: np.ndarray,
        speed: np.ndarray,
        rests: np.ndarray,
        cause: _Cause,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the forces (m,) by accelerations ``b`` (m,) of the contacts that may stay closed,
        which of all stick (k,), and where to the others slip (k, 2).
        """
        count, t = response.which.size, response.tangent
        rough = t[:, 0] >= 0
        slip = np.where(rough[:, None], speed[t], 0.0)
        length = np.hypot(*slip.T)
        still, broken = rough & (length == 0.0), np.zeros(count, dtype=bool)
        toward = np.divide(slip, length[:, None], where=length[:, None] > 0.0, out=slip * np.nan)
        if cause.slips >= 0:
            for k in map(int, np.flatnonzero(still)):
                if k == cause.slips or self._grip_left(response, k) <= USED:
                    broken[k], toward[k] = True, self._impending(response, k)
        while True:
            cones = self._cones(response, still & ~broken, grips=True)
            assert cones is not None
            cones = cones._replace(toward=toward)
            force = self._solve_forces(response, b, cones, rests)
            radius = cones.friction * force[:count]
            sticks = still & ~broken & (force[:count] > 0.0)
            T = np.hypot(*np.where(rough[:, None], force[t], 0.0).T)
            a = b + response.W @ force
            moves = np.hypot(*np.where(rough[:, None], a[t], 0.0).T)
            size = float(np.abs(response.W * force).max(initial=0.0)) + float(np.abs(b).max())
            slips = sticks & (moves > SLIPS * size) & ((1.0 - SLIPS) * radius <= T)
            broken |= slips
            grips = cones.friction > self.contacts.friction[response.which]
            if not (slips.any() and grips.any()):
                begins = broken & np.isnan(toward[:, 0])
                toward[begins] = a[t[begins]] / moves[begins, None]
                return force, sticks & ~slips, toward

    def _held_by(self, response: Response, k: int) -> tuple[np.ndarray, float]:
        """Return the force (2,) that holds contact ``k``, and the largest one that can."""
        group = self.system.forces.sliding
        assert group is not None
        own = self.contacts.sliding[response.which[k]]
        N, *T = self.state.reaction[group.reaction[own], :3]
        return np.array(T), float(group.grip[own] * N)

    def _grip_left(self, response: Response, k: int) -> float:
        """Return the share of the grip of contact ``k`` that is not used."""
        T, most = self._held_by(response, k)
        return 1.0 - float(np.hypot(*T)) / most if most > 0.0 else math.inf

    def _impending(self, response: Response, k: int) -> np.ndarray:
        """Return the direction (2,) in which contact ``k`` begins to slip: against its force."""
        T, _ = self._held_by(response, k)
        return -T / float(np.hypot(*T))

    def _solve_forces(
        self, response: Response, b: np.ndarray, cones: Cones, rests: np.ndarray
    ) -> np.ndarray:
        """Return the forces (m,) of the contacts ``rests``."""
        count, t = response.which.size, cones.tangent[rests]
        used = np.concatenate([rests, t[t >= 0]])
        number = np.full(b.size + 1, -1)
        number[used] = np.arange(used.size)
        own = Cones(number[rests], number[t], *(part[rests] for part in cones[2:]))
        force = np.zeros(b.size)
        if (b[rests] < 0.0).any() or not np.isnan(cones.toward[rests]).all():
            try:
                force[used] = friction.solve(response.W[np.ix_(used, used)], b[used], own)
            except Jammed as error:
                raise Jammed(int(rests[error.contact]), *error.args[1:]) from error
        assert count <= b.size
        return force

    def _note_shared(self, together: np.ndarray, response: Response) -> None:
        """Note which contacts share their forces in many ways: more rest ``together`` than are
        independent.
        """
        k = np.flatnonzero(np.isin(response.which, together))
        W = response.gaps[np.ix_(k, k)]
        if k.size > np.linalg.matrix_rank(W, tol=INDEPENDENT * float(W.max(initial=0.0))):
            self.shared.update(self.names[int(c)] for c in together)

    def _hold(
        self,
        response: Response,
        after: _After,
        unseen: np.ndarray,
        given: tuple[np.ndarray, _Cause],
    ) -> _After:
        """Keep those contacts closed that would rebound ``unseen``: where several rock, the impact
        of one lifts the others, without an end.
        """
        k = np.flatnonzero(unseen | (after.speed[: unseen.size] == 0.0))
        push = np.zeros(after.speed.size)
        push[k] = -np.linalg.lstsq(response.W[np.ix_(k, k)], after.speed[k], rcond=None)[0]
        self._push(response, push, after.speed)
        speed = after.speed + response.W @ push
        speed[k] = 0.0
        return self._after(response, self._rounded(speed), *given)

    def _is_over(self, which: np.ndarray, left: np.ndarray, height: np.ndarray) -> np.ndarray:
        """(k,) whether rebounds may be omitted that take the time ``left``."""
        unseen = height <= HEIGHT * self.contacts.round_off[which]
        return unseen | ((height <= self.accuracy) & (left <= self.accuracy))

    def _note(
        self,
        response: Response,
        past: tuple[np.ndarray, np.ndarray],
        impact: tuple[np.ndarray, np.ndarray, _After],
        remaining: np.ndarray,
        cause: _Cause,
    ) -> None:
        """Add the events of the contacts that were closed and stuck in the ``past``."""
        before, impulse, after = impact
        work = 0.5 * impulse * (before + after.speed)
        gained = float(work.sum())
        self.gained += gained if gained > GAINED * float(np.abs(impulse * before).sum()) else 0.0
        t = float(self.state.time[0])
        for k, c in enumerate(response.which):
            v, w, name = float(before[k]), float(after.speed[k]), self.names[c]
            own = response.tangent[k]
            slip, slip_after, across, lost = 0.0, 0.0, 0.0, 0.0
            if own[0] >= 0:
                slip, slip_after, across = (
                    float(np.hypot(*of[own])) for of in (before, after.speed, impulse)
                )
                lost = 0.0 - float(work[own].sum())
            if impulse[k] > 0.0:
                self.impacts += 1
                L, total = float(impulse[k]), lost - float(work[k])
                given = (v, w, L, total, slip, slip_after, across, lost)
                self.events.append(ContactEvent(t, IMPACT, name, *given, 0.0))
            for kind in self._changes(k, int(c), past, after, k == cause.ends):
                left = float(remaining[k]) if kind == CLOSES else 0.0
                still = (w, w, 0.0, 0.0, slip_after, slip_after, 0.0, 0.0)
                self.events.append(ContactEvent(t, kind, name, *still, left))

    def _changes(
        self, k: int, c: int, past: tuple[np.ndarray, np.ndarray], after: _After, ended: bool
    ) -> list[str]:
        """Return the kinds of events by which contact ``c``, number ``k`` here, changes; its slip
        may have ``ended``, and begin again.
        """
        (was, stuck), now = past, after.force[k] > 0.0
        changes = [] if now == was[c] else [CLOSES if now else OPENS]
        own = self.contacts.sliding[c]
        if own < 0 or not now:
            return changes
        sticks = bool(after.sticks[k])
        if not was[c] or sticks != stuck[own] or (ended and not sticks):
            changes.append(STICKS if sticks else SLIDES)
        return changes

    def _set_mode(self, response: Response, after: _After) -> None:
        """Close the contacts that press, let them stick or slide, and set accelerations and forces
        to theirs.
        """
        system, state, which = self.system, self.state, response.which
        value, _, _ = self._gaps()
        presses = after.force[: which.size] > 0.0
        now = np.zeros(self.contacts.row.size, dtype=bool)
        now[which] = presses
        set_closed(system, self.contacts, now, value)
        if (group := system.forces.sliding) is not None:
            # What a decaying scheme remembers would move a slip that begins against its direction.
            state.v_rise[:], state.w_rise[:] = 0.0, 0.0
            sticks, own = np.zeros(group.row.size, dtype=bool), self.contacts.sliding[which]
            sticks[own[after.sticks & presses]] = True
            set_sticking(system, sticks, value)
            slides = presses & ~after.sticks & (own >= 0)
            group.friction[own[slides]] = self.contacts.friction[which[slides]]
            group.toward[own[slides]] = after.toward[slides]
            group.still[:] = STILL * self.fastest
            if sticks.any():
                self._remove_violation(int(which[0]), self.unknowns, None)
        for row in (self.contacts.row, *(() if group is None else (group.tangent.reshape(-1),))):
            place = self.rows.place[row]
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
            "friction": self._friction_counters(),
            "fastest": self.fastest,
            "shared": sorted(self.shared),
            "gained": self.gained,
        }

    def _friction_counters(self) -> dict[str, Any]:
        group = self.system.forces.sliding
        if group is None:
            return {}
        offset = self.rows.offset[group.tangent]
        arrays = {name: getattr(group, name).tolist() for name in CHANGING}
        return {**arrays, "sticks": sticking(self.system).tolist(), "offset": offset.tolist()}

    def restore(self, counters: dict[str, Any]) -> None:
        """Restore what ``counters`` returned; events after it are forgotten."""
        value, group = np.zeros(self._coordinates), self.system.forces.sliding
        value[self._coordinate] = counters["offset"]
        set_closed(self.system, self.contacts, np.array(counters["closed"]), value)
        if group is not None:
            of_friction = counters["friction"]
            value[self.rows.coordinate[group.tangent, 0]] = of_friction["offset"]
            set_sticking(self.system, np.array(of_friction["sticks"]), value)
            for name in CHANGING:
                getattr(group, name)[:] = of_friction[name]
        self.contacts.acts[:] = counters["acts"]
        self.omitted, self.impacts = [*counters["omitted"]], counters["impacts"]
        self.shared, self.gained = set(counters["shared"]), counters["gained"]
        self.fastest = counters["fastest"]
        self.next_touch = math.inf if counters["nextTouch"] is None else counters["nextTouch"]
        published, pending = counters["events"]
        if published == self.published:
            del self.events[pending:]
        else:  # of a run that is resumed, which had published all
            self.published, self.events = published, []
