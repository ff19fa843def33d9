"""The record of a subsystem's contacts: rows of events, and the figures of a run."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from msahl.contact.events import CLOSES, IMPACT, OPENS, SLIDES, STICKS, ContactEvent
from msahl.contact.response import Response
from msahl.contact.state import After
from msahl.start.redundancy import INDEPENDENT

GAINED = 1e-10
"""Energy that an impact adds, over what its impulses move, that is no round-off."""


class Before(NamedTuple):
    """What is known of contacts before an event."""

    closed: np.ndarray  # (c,) of all contacts
    sticks: np.ndarray  # (f,) of all with friction
    speed: np.ndarray  # (m,) along the directions of those that take part
    ends: int  # number of the one whose slip has become zero, -1 without


class ContactRecord:
    """What happened to the contacts ``names``, whose numbers among those with friction are
    ``sliding`` (c,).

    ``omitted`` are the times [s] at which rebounds were omitted and their heights [m].
    """

    def __init__(self, names: Sequence[str], sliding: np.ndarray) -> None:
        self.names, self.sliding = names, sliding
        self.omitted: list[list[float]] = []
        self.shared: set[str] = set()  # contacts whose forces are not unique
        self.events: list[ContactEvent] = []  # those not yet published
        self.published = self.impacts = 0
        self.gained = 0.0  # energy that impacts added [J], which Newton's law may do

    def note(
        self,
        t: float,
        response: Response,
        before: Before,
        impulse: np.ndarray,
        after: After,
        remaining: np.ndarray,
    ) -> None:
        """Add the events at ``t`` [s] of the contacts that take part, by an ``impulse`` (m,);
        omitted rebounds would take a ``remaining`` time (k,) [s].
        """
        self._note_shared(response, after)
        work = 0.5 * impulse * (before.speed + after.speed)
        gained = float(work.sum())
        moved = float(np.abs(impulse * before.speed).sum())
        self.gained += gained if gained > GAINED * moved else 0.0
        for k, c in enumerate(response.which):
            v, w, name = float(before.speed[k]), float(after.speed[k]), self.names[c]
            own = response.tangent[k]
            slip, slip_after, across, lost = 0.0, 0.0, 0.0, 0.0
            if own[0] >= 0:
                slip, slip_after, across = (
                    float(np.hypot(*of[own])) for of in (before.speed, after.speed, impulse)
                )
                lost = 0.0 - float(work[own].sum())
            if impulse[k] > 0.0:
                self.impacts += 1
                L, total = float(impulse[k]), lost - float(work[k])
                given = (v, w, L, total, slip, slip_after, across, lost)
                self.events.append(ContactEvent(t, IMPACT, name, *given, 0.0))
            for kind in self._changes(k, int(c), before, after):
                left = float(remaining[k]) if kind == CLOSES else 0.0
                still = (w, w, 0.0, 0.0, slip_after, slip_after, 0.0, 0.0)
                self.events.append(ContactEvent(t, kind, name, *still, left))

    def _changes(self, k: int, c: int, before: Before, after: After) -> list[str]:
        """Return the kinds of events by which contact ``c``, number ``k`` here, changes; its slip
        may have ended, and begin again.
        """
        now, was = after.force[k] > 0.0, before.closed[c]
        changes = [] if now == was else [CLOSES if now else OPENS]
        own = self.sliding[c]
        if own < 0 or not now:
            return changes
        sticks = bool(after.sticks[k])
        if not was or sticks != before.sticks[own] or (k == before.ends and not sticks):
            changes.append(STICKS if sticks else SLIDES)
        return changes

    def _note_shared(self, response: Response, after: After) -> None:
        """Note which contacts share their forces in many ways: more stay together than are
        independent.
        """
        k = np.flatnonzero(after.together)
        W = response.gaps[np.ix_(k, k)]
        if k.size > np.linalg.matrix_rank(W, tol=INDEPENDENT * float(W.max(initial=0.0))):
            self.shared.update(self.names[int(c)] for c in response.which[k])

    def forget_events(self) -> None:
        """Let the events so far count as published."""
        self.published += len(self.events)
        self.events = []

    @property
    def counters(self) -> dict[str, Any]:
        """What later steps depend on, as JSON can hold it."""
        return {
            "omitted": [*self.omitted],
            "events": [self.published, len(self.events)],
            "impacts": self.impacts,
            "shared": sorted(self.shared),
            "gained": self.gained,
        }

    def restore(self, counters: dict[str, Any]) -> None:
        """Restore what ``counters`` returned; events after it are forgotten."""
        self.omitted, self.impacts = [*counters["omitted"]], counters["impacts"]
        self.shared, self.gained = set(counters["shared"]), counters["gained"]
        published, pending = counters["events"]
        if published == self.published:
            del self.events[pending:]
        else:  # of a run that is resumed, which had published all
            self.published, self.events = published, []
