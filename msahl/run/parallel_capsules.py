"""Capsules that press on each other while they are parallel, which the error estimate cannot see.

The point of contact of two capsules is that of the nearest points u and w of their middle lines.
Side by side and parallel these are not unique: the point is arbitrary, or jumps from end to end,
in a run as in its companion. Between two output times in succession a pair

    presses    if its gap is closed at one of them or, of compliant capsules, would be by its rate
    was parallel    if the sine of the angle between its axes is below ``PARALLEL`` at one of them,
                    or if it has changed its sign:  (a x e)_0 . (a x e)_1 <= 0
"""

from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import cross, dot, rotated
from msahl.elements.constraints import segments
from msahl.elements.constraints.segments import PARALLEL
from msahl.joints.coordinates import point_motion
from msahl.model import Model
from msahl.model.contacts import CapsuleContact
from msahl.run.body_rows import body_motions, of_bodies, select

CLOSED = 1e-9
"""Gap, over the sum of the radii, of a contact that is closed: constraints leave less."""


class _Rows(NamedTuple):
    """Pairs of capsules (k) at m output times."""

    time: np.ndarray  # (m,) [s]
    across: np.ndarray  # (m, k, 3) a x e
    gap: np.ndarray  # (m, k) [m]
    rate: np.ndarray  # (m, k) of the gap [m/s]
    overlap: np.ndarray  # (m, k) length of one that is beside the other, if they are parallel [m]


class ParallelCapsules:
    """The capsules of a ``model`` at its output times, chunk by chunk; ``found`` has when each
    contact first pressed while it was parallel [s], by name.
    """

    def __init__(self, model: Model) -> None:
        self.found: dict[str, float] = {}
        self.contacts = contacts = [c for c in model.contacts if isinstance(c, CapsuleContact)]
        self.last: _Rows | None = None
        if not contacts:
            return
        names = [c.parent for c in contacts] + [c.child for c in contacts]
        self.bodies, places = select(model, names)
        self.sides = np.split(places, 2)
        self.points = [np.array([c.parent_point for c in contacts])]
        self.points.append(np.array([c.child_point for c in contacts]))
        self.axes = [np.array([c.parent_axis for c in contacts])]
        self.axes.append(np.array([c.axis for c in contacts]))
        self.limit = np.array([c.parent_radius + c.radius for c in contacts])
        self.half = np.array([(c.parent_half, c.half) for c in contacts])
        self.compliant = np.array([c.compliance is not None for c in contacts])

    def add(self, states: np.ndarray) -> None:
        """Add the rows ``states`` (m, columns) of the table of states, in their order."""
        if not self.contacts or not len(states):
            return
        rows = self._rows(states)
        if self.last is not None:
            rows = _Rows(*(np.concatenate(both) for both in zip(self.last, rows, strict=True)))
        doubtful = self._doubtful(rows)
        for k in np.flatnonzero(doubtful.any(axis=0)).tolist():
            first = float(rows.time[1 + int(np.argmax(doubtful[:, k]))])
            self.found.setdefault(self.contacts[k].name, first)
        self.last = _Rows(*(part[-1:] for part in rows))

    def numbers(self) -> dict[str, Any]:
        """What a run that is resumed needs, as JSON can hold it."""
        last = None if self.last is None else [part.tolist() for part in self.last]
        return {"found": dict(self.found), "last": last}

    def restore(self, numbers: dict[str, Any]) -> None:
        """Restore what ``numbers`` returned."""
        self.found = dict(numbers["found"])
        if numbers["last"] is not None:
            self.last = _Rows(*map(np.array, numbers["last"]))

    def _rows(self, states: np.ndarray) -> _Rows:
        motion = body_motions(states, None, self.bodies)
        ends = [
            point_motion(of_bodies(motion, side), points)
            for side, points in zip(self.sides, self.points, strict=True)
        ]
        R = [motion.R[:, side] for side in self.sides]
        a, e = (rotated(R[i], self.axes[i]) for i in range(2))
        D = ends[1].x - ends[0].x
        p, q, s = dot(D, a), dot(D, e), dot(a, e)
        feet = [
            [
                segments.feet(tuple(self.half[k]), m)[:2]
                for k, m in enumerate(zip(*row, strict=True))
            ]
            for row in zip(p, q, s, strict=True)
        ]
        u, w = (np.array(feet)[..., i, None] for i in range(2))
        E = D + w * e - u * a
        distance = np.sqrt(dot(E, E))
        spin = [motion.w[:, side] for side in self.sides]
        E_dot = ends[1].v - ends[0].v + w * cross(spin[1], e) - u * cross(spin[0], a)
        rate = dot(E, E_dot) / np.maximum(distance, CLOSED * self.limit)
        overlap = self.half.sum(axis=1) - np.abs(p)
        return _Rows(states[:, 0], cross(a, e), distance - self.limit, rate, overlap)

    def _doubtful(self, rows: _Rows) -> np.ndarray:
        """(m - 1, k) whether a pair pressed and was parallel between two rows in succession."""
        before, after = (_Rows(*(part[i : i - 1 or None] for part in rows)) for i in range(2))
        closed = CLOSED * self.limit
        h = (after.time - before.time)[:, None]
        presses = (before.gap <= closed) | (after.gap <= closed)
        approaches = (before.gap + before.rate * h <= 0.0) | (after.gap - after.rate * h <= 0.0)
        presses |= self.compliant & approaches
        sines = [dot(one.across, one.across) <= PARALLEL**2 for one in (before, after)]
        parallel = sines[0] | sines[1] | (dot(before.across, after.across) <= 0.0)
        beside = (before.overlap > 0.0) | (after.overlap > 0.0)
        found: np.ndarray = presses & parallel & beside
        return found
