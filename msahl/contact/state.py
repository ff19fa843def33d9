"""The contacts of a subsystem during a run: what is closed and sticks, and the bodies' motion.

Impulses, and what removes round-off from positions and velocities, change the motion here, with
the work of each; ``forces`` and ``modes`` decide what happens.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.vector import Vector
from msahl.contact import response as of_contacts
from msahl.contact.complementarity import NoSolution, solve
from msahl.contact.cones import Cones
from msahl.contact.response import Response
from msahl.elements.constraints import segments
from msahl.elements.constraints.coordinates import product_rates
from msahl.formulations.absolute.frames import first_multiplier
from msahl.start.velocities import project, solve_accelerations
from msahl.system.arrays import State, System
from msahl.system.contacts import NEAR, Contacts, closed, set_closed, set_sticking, sticking
from msahl.system.unknowns import Unknowns, choose
from msahl.system.work_arrays import PlainFirst, new_work_arrays
from msahl.system.work_arrays import energy as energy_of

LIFTED = 0.5
"""Overlap, over the round-off of the gap, that is removed at an event."""
STILL = 1e-12
"""Rate of a gap or slip, over the largest speed so far, that is zero but for round-off."""
UNDIRECTED = 1e-10
"""Slip, over the largest speed so far, that keeps its direction from before: relative to a smaller
one, the noise that velocities have within a step does not let the iteration settle. Such a slip
covers its square over twice its acceleration, 1e-20 m."""
UNSEEN = 4.0
"""Height of rebounds or way of a slip, over the round-off of the gap, that is too small to be
resolved."""
END = 1e-6
"""Slip at the event that ends it, over the largest speed, that is zero: where its direction changes
faster than steps resolve. The way that is left goes by its square."""
CHANGING = ("friction", "toward", "still")
"""Arrays of the contacts with friction that change during a run."""
TOUCHING = 10.0
"""Gap, over its round-off, of a contact that touches: closed joints leave one of it."""
BEYOND = 1e5
"""Distance from where the curvature of a gap jumps, over the round-off of gaps, that is none: where
steps pass it by this, 1e-8 of the model's size, multipliers are noise, and edges of boxes count as
crossing from 1e-7 of an edge on (``segments.PARALLEL``)."""
OVERLAP = 1e4
"""Overlap at t = 0, over the round-off of the gap, that is that of the digits a deck omits: 1e-9
of the size of the model."""


Lines = tuple[int, tuple[float, float], Vector, Vector]
"""A contact between segments: its number, their half lengths [m], ``m`` and its rates."""


class After(NamedTuple):
    """What follows an impact, along the m directions of k contacts."""

    speed: np.ndarray  # (m,)
    force: np.ndarray  # (m,) of those that stay
    acceleration: np.ndarray  # (m,)
    sticks: np.ndarray  # (k,) whether the slip stays zero
    toward: np.ndarray  # (k, 2) direction of the slip of those that slide
    together: np.ndarray  # (k,) whether the gap stays zero


class Cause(NamedTuple):
    """What an event says of the friction of its contact beforehand, each the number among ``which``
    or -1.
    """

    slips: int = -1  # its grip is used up
    ends: int = -1  # its slip has become zero
    slid: np.ndarray | bool = False  # (k,) which of the contacts slid up to then


class ContactState:
    """The contacts of one subsystem, and its motion; ``without`` are the unknowns without them."""

    def __init__(
        self, contacts: Contacts, system: System, state: State, unknowns: Unknowns
    ) -> None:
        self.contacts = contacts
        assert system.scalar is not None
        self.system, self.state, self.without = system, state, unknowns
        self.rows = system.scalar.equations
        # The matrix at rest has no part of what a decaying scheme remembers of velocities.
        rises = {name: np.zeros_like(state.v_rise) for name in ("v_rise", "w_rise")}
        still = state._replace(**rises)
        self.work_arrays = new_work_arrays(system, still)._replace(call=PlainFirst(system))
        self.length = float(contacts.round_off.max()) / NEAR
        self.fastest = 0.0  # largest speed so far, or that of falling by the model's size [m/s]

    @property
    def key(self) -> bytes:
        """What differs from mode to mode."""
        modes = (self.closed, self.sticks, self.contacts.acts)
        return b"".join(array.tobytes() for array in modes)

    @property
    def shares(self) -> bool:
        """Whether all contacts that share forces are closed, and not only independent ones."""
        return self.system.relaxation > 0.0

    @property
    def closed(self) -> np.ndarray:
        """(c,) which contacts are closed."""
        return closed(self.system, self.contacts)

    @property
    def sticks(self) -> np.ndarray:
        """(f,) which contacts with friction stick."""
        return sticking(self.system)

    @property
    def slides(self) -> np.ndarray:
        """(c,) which contacts are closed and slide."""
        group, own = self.system.forces.sliding, self.contacts.sliding
        if group is None:
            return np.zeros(own.size, dtype=bool)
        slides: np.ndarray = (group.friction != 0.0) & ~self.sticks
        return self.closed & (own >= 0) & slides[own]

    @property
    def unknowns(self) -> Unknowns:
        """The unknowns of steps: the multipliers of closed contacts as well."""
        rows, first = self.rows, first_multiplier(self.system.frames)
        held = self.contacts.row[self.closed]
        if (group := self.system.forces.sliding) is not None:
            held = np.concatenate([held, group.tangent[self.sticks].reshape(-1)])
        place = rows.place[held]
        flat = 3 * (first + place[:, 0]) + place[:, 1]
        return (
            choose(self.system, np.union1d(self.without.free, flat)) if flat.size else self.without
        )

    @property
    def coordinate(self) -> np.ndarray:
        """(c,) the contacts' coordinates."""
        return self.rows.coordinate[self.contacts.row, 0]

    @property
    def _coordinates(self) -> int:
        assert self.system.scalar is not None
        return int(self.system.scalar.coordinates.kind.size)

    def gaps(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return values (q,) and rates (q,) of all coordinates, and between them the gaps (c,)."""
        return of_contacts.gaps(self.system, self.contacts, self.state, self.work_arrays)

    @property
    def _speed(self) -> float:
        """Largest speed of the bodies [m/s]."""
        start, length = self.work_arrays.start.frames, self.system.frames.length
        return float(np.abs(start.v).max() + (np.abs(start.W).max(axis=1) * length).max())

    def accelerations(self, response: Response) -> tuple[np.ndarray, float]:
        """Return what ``response.accelerations`` does. Where the curvature of a gap jumps they are
        those that follow, by a displacement that is more than round-off.
        """
        state, speed = self.state, self._speed
        near = BEYOND * float(self.contacts.round_off.max())
        self.gaps()
        given = self.system, self.contacts, response.which
        if speed > 0.0 and of_contacts.at_kink(*given, near, self.work_arrays):
            state = of_contacts.shortly_after(self.system, state, 2.0 * near / speed)
        return of_contacts.accelerations(
            self.system, response, state, self.without, self.work_arrays
        )

    def rounded(self, rate: np.ndarray) -> np.ndarray:
        """Return rates, without those that are round-off."""
        return np.where(np.abs(rate) <= STILL * self.fastest, 0.0, rate)

    def rates(self, response: Response, cause: Cause) -> np.ndarray:
        """Return the rates along the directions (m,), without round-off; a slip that has come to
        its end is removed.
        """
        _, _, rate = self.gaps()
        self.fastest = max(self.fastest, self._speed)
        given = response.sign * rate[self.rows.coordinate[response.row, 0]]
        found, push = self.rounded(given), np.zeros(given.size)
        for k, t in enumerate(response.tangent):
            near = (END if k == cause.ends else STILL) * self.fastest
            if t[0] >= 0 and np.hypot(*given[t]) <= near:
                push[t] = -np.linalg.lstsq(response.W[np.ix_(t, t)], given[t], rcond=None)[0]
                found[t] = 0.0
        if push.any():
            self.push(response, push, given)
        return found

    def cones(
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
            mu = np.where(rough, np.abs(group.grip[self.contacts.sliding[which]]), mu)
        count = which.size
        return Cones(
            np.arange(count), response.tangent, mu, np.zeros(count), np.full((count, 2), np.nan)
        )

    def ended(self, which: np.ndarray, cause: Cause) -> np.ndarray | None:
        """Return which contact with friction (k,) has come to the end of its slip, None without."""
        group = self.system.forces.sliding
        if cause.ends < 0 or group is None:
            return None
        own = self.contacts.sliding[which[cause.ends]]
        _, _, rate = self.gaps()
        slip = float(np.hypot(*rate[group.along[own]]))
        return np.arange(group.row.size) == own if slip <= END * self.fastest else None

    def remove_violation(self, k: int, unknowns: Unknowns, ended: np.ndarray | None) -> None:
        """Project the velocities onto joints and closed contacts, whose multipliers are among the
        ``unknowns``: schemes of order 2 satisfy them to their error only, and impulses would do
        work on it. The energy counts as work of contact ``k``. Slips that have ``ended`` stay zero.
        """
        before = self.energy()
        if ended is not None:
            value, _, _ = self.gaps()
            set_sticking(self.system, self.sticks | ended, value)
            unknowns = self.unknowns
        project(self.system, self.state, self.work_arrays, unknowns)
        self.state.work[self.contacts.column[k]] += self.energy() - before

    def side_by_side(self, which: np.ndarray) -> int | None:
        """Return the first of the contacts ``which`` that is of two capsules that touch along a
        line, in the configuration of the last ``gaps``; None without one.
        """
        found = (k for k, half, m, _ in self._segments(which) if segments.side_by_side(half, m))
        return next(found, None)

    def needless(self, which: np.ndarray) -> list[int]:
        """Return those of the contacts ``which`` that are between edges of boxes that do not cross
        in the configuration of the last ``gaps``: contacts of corners stand for them.
        """
        edges = which[self.contacts.between_edges[which]]
        return [k for k, half, m, dm in self._segments(edges) if not segments.cross(half, m, dm)]

    def _segments(self, which: np.ndarray) -> Iterator[Lines]:
        """Yield what ``Lines`` says of those of the contacts ``which`` that are of segments."""
        assert self.system.scalar is not None
        group, start = self.system.scalar.coordinates, self.work_arrays.start
        own, motion = start.scalar.coordinates, (start.frames.v, start.frames.W)
        for k in which.tolist():
            q = self.coordinate[k]
            if group.ends is not None and group.kind[q] == segments.SEGMENTS:
                first = int(group.first[q])
                m = segments.last_three(own.products.value, first)
                rates = [product_rates(group, own, *motion, first + i)[0] for i in (3, 4, 5)]
                yield k, segments.half_lengths(group.ends, q), m, (rates[0], rates[1], rates[2])

    def lift(self, response: Response) -> None:
        """Remove overlaps by round-off, of which no other contact that touches gets one: an open
        contact must not begin with one.
        """
        _, gap, _ = self.gaps()
        gap, near = gap[response.which], LIFTED * self.contacts.round_off[response.which]
        if not (gap < -near).any():
            return
        before, push = self.energy(), np.zeros(response.row.size)
        push[: gap.size] = _apart(response.gaps, gap, near)
        of_contacts.displace(self.system, response, push, self.state)
        column = self.contacts.column[response.which[gap.argmin()]]
        self.state.work[column] += self.energy() - before

    def energy(self) -> float:
        """Return kinetic and potential energy [J]."""
        return energy_of(self.system, self.state, self.work_arrays)

    def push(self, response: Response, impulse: np.ndarray, before: np.ndarray) -> None:
        """Apply an ``impulse`` (m,) at the rates ``before``, and count its work."""
        mean = before + 0.5 * (response.W @ impulse)
        np.add.at(self.state.work, response.column, impulse * mean)
        R = self.work_arrays.start.frames.R.copy()
        of_contacts.push(self.system, response, impulse, self.state, R)

    def set_mode(self, response: Response, after: After) -> None:
        """Close the contacts that press, let them stick or slide, and set accelerations and forces
        to theirs.
        """
        system, state, which = self.system, self.state, response.which
        value, _, _ = self.gaps()
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
            signed = self.contacts.sign * self.contacts.friction
            group.friction[own[slides]] = signed[which[slides]]
            group.toward[own[slides]] = after.toward[slides]
            group.still[:] = UNDIRECTED * self.fastest
            if sticks.any():
                self.remove_violation(int(which[0]), self.unknowns, None)
        for row in (self.contacts.row, *(() if group is None else (group.tangent.reshape(-1),))):
            place = self.rows.place[row]
            state.violation[place[:, 0], place[:, 1]] = 0.0
        solve_accelerations(system, state, self.unknowns, None, self.work_arrays)
        for trend in (state.a_trend, state.alpha_trend, state.force_trend):
            trend[:] = 0.0

    @property
    def counters(self) -> dict[str, Any]:
        """What later steps depend on, as JSON can hold it."""
        return {
            "closed": self.closed.tolist(),
            "acts": self.contacts.acts.tolist(),
            "offset": self.rows.offset[self.contacts.row].tolist(),
            "friction": self._friction_counters(),
            "fastest": self.fastest,
        }

    def _friction_counters(self) -> dict[str, Any]:
        group = self.system.forces.sliding
        if group is None:
            return {}
        offset = self.rows.offset[group.tangent]
        arrays = {name: getattr(group, name).tolist() for name in CHANGING}
        return {**arrays, "sticks": self.sticks.tolist(), "offset": offset.tolist()}

    def restore(self, counters: dict[str, Any]) -> None:
        """Restore what ``counters`` returned."""
        value, group = np.zeros(self._coordinates), self.system.forces.sliding
        value[self.coordinate] = counters["offset"]
        set_closed(self.system, self.contacts, np.array(counters["closed"]), value)
        if group is not None:
            of_friction = counters["friction"]
            value[self.rows.coordinate[group.tangent, 0]] = of_friction["offset"]
            set_sticking(self.system, np.array(of_friction["sticks"]), value)
            for name in CHANGING:
                getattr(group, name)[:] = of_friction[name]
        self.contacts.acts[:] = counters["acts"]
        self.fastest = counters["fastest"]


def _apart(W: np.ndarray, gap: np.ndarray, near: np.ndarray) -> np.ndarray:
    """Return the push (k,) of contacts by which no ``gap`` (k,) is less than zero any more. Where
    they can not all be met, those that are less than ``-near`` are removed.
    """
    try:
        return solve(W, gap)
    except NoSolution:
        push, k = np.zeros(gap.size), np.flatnonzero(gap < -near)
        push[k] = of_contacts.stopping(W[np.ix_(k, k)], gap[k])
        return push
