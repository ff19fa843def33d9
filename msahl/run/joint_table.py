"""The table of joints' coordinates, rates and accelerations, from the motion of bodies.

An angle is counted over all revolutions: between two output times it changes by the difference of
its values within one revolution, and by as many revolutions as bring this nearest to the time
between them multiplied by the mean of the rates at both. At t = 0 it is within half a revolution of
zero.
"""

import math
from typing import Any

import numpy as np

from msahl.joints.coordinates import Geometry, columns, coordinates, is_angle, relative, stacked
from msahl.joints.coordinates import values_and_rates as measured
from msahl.model import Joint, Model
from msahl.run.body_rows import TablesOfSteppers, of_bodies, read_motions, select

REVOLUTION = 2.0 * math.pi


class JointTable:
    """Computes ``joints.csv``, one chunk of output times after the other."""

    def __init__(self, model: Model, levels: int) -> None:
        joints = [joint for joint in model.joints if coordinates(joint)]
        names = [joint.parent for joint in joints] + [joint.child for joint in joints]
        self.bodies, places = select(model, names)
        parents, children = np.split(places, 2)
        self.levels, self.width = levels, 1
        by_kind: dict[str, list[tuple[Joint, int, int, int]]] = {}
        for joint, parent, child in zip(joints, parents, children, strict=True):
            entry = joint, int(parent), int(child), self.width
            by_kind.setdefault(joint.kind, []).append(entry)
            self.width += sum(len(columns(joint, level)) for level in range(levels))
        self.groups = [_Group(entries, levels) for entries in by_kind.values()]
        self.last_time = 0.0
        self.counted: list[tuple[np.ndarray, ...]] = []  # of each group; empty before t = 0

    def rows(self, tables: TablesOfSteppers) -> np.ndarray:
        """Return the rows (m, columns) that follow those of the last call."""
        bodies, time = read_motions(tables, self.bodies), tables["states"][:, 0]
        found = np.zeros((len(time), self.width))
        found[:, 0] = time
        counted: list[tuple[np.ndarray, ...]] = []
        for g, group in enumerate(self.groups):
            motion = relative(
                group.geometry, of_bodies(bodies, group.parent), of_bodies(bodies, group.child)
            )
            values = measured(group.geometry, motion)
            if group.angles.size:
                angles, rates = (part[..., group.angles] for part in values[:2])
                before = self.counted[g] if self.counted else (angles[0], rates[0], angles[0] * 0.0)
                times = np.concatenate([[self.last_time], time])
                revolutions = count_revolutions(times, angles, rates, before)
                values[0][..., group.angles] = angles + REVOLUTION * revolutions
                counted.append((angles[-1], rates[-1], revolutions[-1]))
            else:
                counted.append(())
            for level, columns_of in enumerate(group.columns):
                found[:, columns_of] = values[level]
        self.last_time, self.counted = float(time[-1]), counted
        return found

    def numbers(self) -> dict[str, Any]:
        """Return for a snapshot what the next rows depend on."""
        counted = [[part.tolist() for part in group] for group in self.counted]
        return {"time": self.last_time, "counted": counted}

    def restore(self, numbers: dict[str, Any]) -> None:
        """Restore what ``numbers`` returned."""
        self.last_time = numbers["time"]
        self.counted = [tuple(np.array(part) for part in group) for group in numbers["counted"]]


class _Group:
    """Joints of one kind: their geometry, bodies, and columns of the table."""

    def __init__(self, entries: list[tuple[Joint, int, int, int]], levels: int) -> None:
        joints = [joint for joint, *_ in entries]
        self.geometry: Geometry = stacked(joints)
        self.parent = np.array([parent for _, parent, _, _ in entries])
        self.child = np.array([child for _, _, child, _ in entries])
        first = np.array([column for *_, column in entries])
        self.angles = np.flatnonzero([is_angle(name) for name in columns(joints[0], 0)])
        width = len(columns(joints[0], 0))
        self.columns = [
            first[:, None] + np.arange(level * width, (level + 1) * width)
            for level in range(levels)
        ]


def count_revolutions(
    times: np.ndarray, angles: np.ndarray, rates: np.ndarray, before: tuple[np.ndarray, ...]
) -> np.ndarray:
    """Return the revolutions (m, ...) to be added to ``angles`` (m, ...) within one revolution.

    ``times`` (m+1,) begin with that of ``before``, which is (angle, rate, revolutions).
    """
    angle, rate, revolutions = before
    changes = np.diff(angles, axis=0, prepend=angle[None])
    both = np.concatenate([rate[None], rates])
    spans = np.diff(times).reshape(-1, *[1] * (angles.ndim - 1))
    expected = 0.5 * spans * (both[1:] + both[:-1])
    return np.asarray(revolutions + np.cumsum(np.round((expected - changes) / REVOLUTION), axis=0))
