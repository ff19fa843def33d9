"""Choose key poses between which a motion is interpolated as glTF does, and say how exactly.

Between two key poses a position moves along a straight line and an orientation rotates about a
fixed axis at a constant rate. Key poses are output times of the run, chosen for each body alone, so
that the error at all output times is within a tolerance.
"""

from typing import NamedTuple

import numpy as np

TOLERANCE = 2e-6
"""Error of a position relative to the size of the motion, and of an orientation [rad]."""
WIDEST = 64
"""Most output times from one key pose to the next."""


class Keys(NamedTuple):
    """Rows of the key poses of one body, and the largest errors at all rows: of the position [m]
    and of the orientation [rad]."""

    rows: np.ndarray
    position: float
    orientation: float


def choose_keys(time: np.ndarray, poses: np.ndarray, size: float) -> Keys:
    """Return key poses of a body with the ``poses`` (rows, 7) at ``time`` (rows,): positions [m],
    relative to ``size`` [m], and unit quaternions without changes of sign."""
    last = len(time) - 1
    rows = np.unique(np.append(np.arange(0, last, WIDEST), last))
    if (poses == poses[0]).all():
        return Keys(rows[:1], 0.0, 0.0)
    while True:
        position, orientation = _errors(time, poses, rows)
        bad = (position > TOLERANCE * size) | (orientation > TOLERANCE)
        found = np.searchsorted(rows, np.flatnonzero(bad), side="right") - 1
        split = np.unique(found)
        if not split.size:
            return Keys(rows, float(position.max()), float(orientation.max()))
        rows = np.sort(np.append(rows, (rows[split] + rows[split + 1]) // 2))


def interpolate(time: np.ndarray, poses: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return poses (times, 7) at the times ``at`` between key ``poses`` (rows, 7) at ``time``."""
    if len(time) == 1:
        return np.repeat(poses, len(at), axis=0)
    place = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    share = ((at - time[place]) / (time[place + 1] - time[place]))[:, None]
    before, after = poses[place], poses[place + 1]
    cosine = (before[:, 3:] * after[:, 3:]).sum(axis=1, keepdims=True)
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6  # where both sines are as their angles
    sine = np.where(near, 1.0, sine)
    a = np.where(near, 1.0 - share, np.sin((1.0 - share) * angle) / sine)
    b = np.where(near, share, np.sin(share * angle) / sine)
    x = (1.0 - share) * before[:, :3] + share * after[:, :3]
    q = a * before[:, 3:] + b * after[:, 3:]
    return np.concatenate([x, q / np.linalg.norm(q, axis=1, keepdims=True)], axis=1)


def _errors(time: np.ndarray, poses: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the errors of position [m] and orientation [rad] at every row."""
    found = interpolate(time[rows], poses[rows], time)
    found[rows] = poses[rows]
    position = np.linalg.norm(found[:, :3] - poses[:, :3], axis=1)
    chord = np.linalg.norm(found[:, 3:] - poses[:, 3:], axis=1)
    return position, 4.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))
