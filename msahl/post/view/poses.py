"""Reduce the poses of a run to key poses, and pack them for the viewer.

A pose is x, y, z [m] of a body's reference point and its Euler parameters w, x, y, z. Between two
key poses each number is interpolated by the polynomial of degree 3 through the two key poses before
and the two after (at the ends through the four nearest), and the Euler parameters are normalised;
``motion.js`` does the same. Interpolation by straight lines would need a hundred times as many key
poses for the same error. Key poses are output times of the run, close together where the motion
changes quickly, so that the error at all output times is within a tolerance.
"""

from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import quaternions
from msahl.post.view.packing import pack_integers, pack_numbers
from msahl.records import record
from msahl.results.sample import Sample
from msahl.run.tables import STATES
from msahl.system.names import STATE_COLUMNS

WIDTH = 7
"""Numbers of a pose."""


class Accuracy(NamedTuple):
    """How exact poses are: the ``tolerance`` is the error of the interpolation of a coordinate,
    divided by the size of the motion, and twice that of an Euler parameter; coordinates (of a
    motion of size 1) and Euler parameters are rounded to ``length`` and ``euler``."""

    tolerance: float
    length: float
    euler: float


EXACT = Accuracy(tolerance=4e-7, length=2.0**-22, euler=2.0**-23)
"""Poses within 1e-6 of those of the run."""
LOOSER = 4.0
"""Factor of the tolerance while there are too many key poses."""
WIDEST = 64
"""Most output times from one key pose to the next."""
MOST_TIMES = 10_000
"""Most output times that a page contains; each takes about 4 bytes."""
BLOCK = 4096
"""Output times that are interpolated at once, to bound the memory."""


@record(slots=False)
class Poses:
    """Poses of all bodies: ``values`` (rows, bodies, 7) at ``time`` (rows,) [s]; Euler parameters
    do not change sign from row to row."""

    time: np.ndarray
    values: np.ndarray

    @property
    def middle(self) -> np.ndarray:
        """Return the middle (3,) of the box of all positions [m]."""
        return 0.5 * (self.values[..., :3].min(axis=(0, 1)) + self.values[..., :3].max(axis=(0, 1)))

    @property
    def reach(self) -> float:
        """Return the largest distance along an axis from the middle [m]."""
        return float(np.abs(self.values[..., :3] - self.middle).max())


@record(slots=False)
class KeyPoses:
    """The rows that are key poses, and the largest errors of the interpolation at all output times:
    of a position [m] and of an orientation [rad]."""

    rows: np.ndarray
    position: float
    orientation: float


def poses_of_run(sample: Sample) -> Poses:
    """Return the poses of a run at the output times that were read."""
    _, table = sample.tables[STATES]
    bodies = len(sample.model.bodies)
    states = table[:, 1:].reshape(len(table), bodies, len(STATE_COLUMNS))
    euler = quaternions(states[..., 3:6])
    flipped = (euler[1:] * euler[:-1]).sum(axis=-1) < 0.0
    signs = np.cumprod(np.where(flipped, -1.0, 1.0), axis=0)
    euler[1:] *= signs[..., None]
    return Poses(sample.time, np.concatenate([states[..., :3], euler], axis=-1))


def choose_keys(poses: Poses, size: float, most: int, accuracy: Accuracy = EXACT) -> KeyPoses:
    """Choose at most about ``most`` key poses, with the tolerance relative to ``size`` [m]; where
    that is too few, the tolerance is made larger until it is enough."""
    scale = np.ones(poses.values.shape[1:])
    scale[:, :3] /= size
    scale[:, 3:] *= 2.0
    values = (poses.values * scale).reshape(len(poses.time), -1)
    tolerance = accuracy.tolerance
    rows = _keys_within(poses.time, values, tolerance)
    while len(rows) > max(most, 2):
        tolerance *= LOOSER
        rows = _keys_within(poses.time, values, tolerance)
    return KeyPoses(rows, *_errors(poses, rows))


def interpolate(time: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Interpolate ``values`` (rows, n) at increasing times ``time`` (rows,) at the times ``at``:
    (times, n); Euler parameters are not normalised."""
    count = min(4, len(time))
    place = np.searchsorted(time, at, side="right") - 1
    first = np.clip(place - 1, 0, len(time) - count)
    nodes = first[:, None] + np.arange(count)
    t = time[nodes]
    result = np.zeros((len(at), values.shape[1]))
    for j in range(count):
        weight = np.ones(len(at))
        for k in range(count):
            if k != j:
                weight *= (at - t[:, k]) / (t[:, j] - t[:, k])
        result += weight[:, None] * values[nodes[:, j]]
    return result


def _keys_within(time: np.ndarray, values: np.ndarray, tolerance: float) -> np.ndarray:
    """Return key poses between which the interpolation is within the tolerance: intervals are
    halved, first by the error at their middle, in the end by that at all times within."""
    last = len(time) - 1
    if last < 2:
        return np.arange(last + 1)
    rows = np.unique(np.append(np.arange(0, last, WIDEST), last))
    at_all = False
    while True:
        middles = rows[:-1] + np.diff(rows) // 2
        tried = np.arange(len(time)) if at_all else middles
        bad = tried[_differences(time, values, rows, tried) > tolerance]
        found = np.searchsorted(rows, bad, side="right") - 1
        split = np.unique(found[(found < len(rows) - 1)])
        split = split[rows[split + 1] - rows[split] > 1]
        if split.size:
            rows = np.sort(np.append(rows, (rows[split] + rows[split + 1]) // 2))
        elif at_all:
            return rows
        else:
            at_all = True


def _differences(
    time: np.ndarray, values: np.ndarray, rows: np.ndarray, at: np.ndarray
) -> np.ndarray:
    """Return the largest error at each of the times ``at`` when ``rows`` are the key poses."""
    keys = values[rows]
    blocks = [at[start : start + BLOCK] for start in range(0, len(at), BLOCK)]
    found = [
        np.abs(interpolate(time[rows], keys, time[block]) - values[block]).max(axis=1)
        for block in blocks
    ]
    return np.concatenate(found)


def _errors(poses: Poses, rows: np.ndarray) -> tuple[float, float]:
    """Return the largest errors of a position [m] and an orientation [rad] at all rows."""
    keys = poses.values[rows].reshape(len(rows), -1)
    position = orientation = 0.0
    for start in range(0, len(poses.time), BLOCK):
        block = slice(start, start + BLOCK)
        given = poses.values[block]
        found = interpolate(poses.time[rows], keys, poses.time[block]).reshape(given.shape)
        away = np.linalg.norm(found[..., :3] - given[..., :3], axis=-1)
        e = found[..., 3:] / np.linalg.norm(found[..., 3:], axis=-1, keepdims=True)
        chord = np.linalg.norm(e - given[..., 3:], axis=-1)
        position = max(position, float(away.max()))
        orientation = max(orientation, float(4.0 * np.arcsin(np.minimum(chord / 2, 1.0)).max()))
    return position, orientation


def pack_poses(poses: Poses, rows: np.ndarray, accuracy: Accuracy = EXACT) -> dict[str, Any]:
    """Return the key poses as the viewer reads them: rounded to integers, and packed.

    A coordinate is ``middle`` + ``lengthUnit`` times its integer [m], an Euler parameter
    ``eulerUnit`` times its own. ``outputs`` are the times to step to, those of all rows unless
    they are very many; null: those of the key poses.
    """
    middle, reach = poses.middle, poses.reach
    units = (accuracy.length * (reach or 1.0), accuracy.euler)
    values = poses.values[rows].copy()
    values[..., :3] = (values[..., :3] - middle) / units[0]
    values[..., 3:] /= units[1]
    return {
        "bodies": values.shape[1],
        "middle": middle.tolist(),
        "lengthUnit": units[0],
        "eulerUnit": units[1],
        "time": pack_numbers(poses.time[rows]),
        "outputs": pack_numbers(poses.time) if len(rows) < len(poses.time) <= MOST_TIMES else None,
        "values": pack_integers(np.rint(values).astype(np.int64).reshape(len(rows), -1)),
    }
