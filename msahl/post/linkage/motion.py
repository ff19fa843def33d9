"""Choose view and instants of a motion by its extent, and place points of bodies in space.

The view is along an axis if the motion is planar, with gravity pointing down; else oblique, from
the side on which the picture is largest. Instants divide the motion from t = 0 until it has reached
nearly its full extent (half a period of a pendulum, one revolution of a crank) into equal parts of
its path, not of time, so that bodies at rest are not drawn on top of each other.
"""

import numpy as np
import pandas as pd

from msahl.algebra.rotation_arrays import rotations
from msahl.post.linkage.parts import GROUND, Parts, Scene, ground_points, outline, parts_of
from msahl.records import record

FLAT = 0.05
"""Extent in a direction, relative to the largest one, below which a motion is planar."""
REACHED = 0.97
"""Part of the full extent at which the first sweep of a motion ends."""
STILL = 0.02
"""Displacement, relative to the size of the picture, that is too small to be seen."""
FAR = 4.0
"""Mean displacement of bodies, relative to the mechanism, up to which the motion is drawn."""
SAMPLES = 2000
"""Most output times that are looked at."""
ELEVATION = np.radians(20.0)
AZIMUTHS = np.radians(np.arange(-75.0, 0.0, 10.0))
"""Oblique views that are tried, in this order: angles above the horizon, and about the vertical."""


@record(slots=False)
class Motion:
    """The motion of a scene: ``time`` (m,) [s]; of each body its reference point ``origins``
    (m, n, 3) [m] and its axes ``frames`` (m, n, 3, 3) in inertial axes; ``parts`` of the bodies,
    and points of the ``ground`` (k, 3)."""

    scene: Scene
    time: np.ndarray
    origins: np.ndarray
    frames: np.ndarray
    parts: list[Parts]
    ground: np.ndarray

    @staticmethod
    def of(scene: Scene, states: pd.DataFrame) -> "Motion":
        """Return the motion in the table ``states`` of the model of ``scene``, thinned; of a
        mechanism that travels far only the beginning, where it can be seen beside its path."""
        states = states.iloc[:: max(1, len(states) // SAMPLES)]
        names = [body["name"] for body in scene["bodies"]]
        vectors = [
            np.stack([states[[f"{n}.{c}" for c in columns]].to_numpy() for n in names], axis=1)
            for columns in (("x", "y", "z"), ("P1", "P2", "P3"))
        ]
        # One body may be small beside its path: it is a dot then.
        travelled = np.linalg.norm((vectors[0] - vectors[0][0]).mean(axis=1), axis=1)
        far = np.flatnonzero((travelled > FAR * scene["size"]) & (len(names) > 1))
        rows = slice(0, max(int(far[0]), 1)) if len(far) else slice(None)
        time, vectors = states["time"].to_numpy()[rows], [each[rows] for each in vectors]
        parts, ground = parts_of(scene), ground_points(scene)
        return Motion(scene, time, vectors[0], rotations(vectors[1]), parts, ground)

    def placed(self, body: int, points: np.ndarray, k: int) -> np.ndarray:
        """Return points (n, 3) of a body in inertial axes at output time ``k``."""
        if body == GROUND:
            return points
        return np.asarray(points @ self.frames[k, body].T + self.origins[k, body])

    def paths(self, body: int, points: np.ndarray) -> np.ndarray:
        """Return the paths (m, n, 3) of points (n, 3) of a body in inertial axes."""
        return self.origins[:, body, None] + np.einsum("tij,kj->tki", self.frames[:, body], points)

    def skeleton(self) -> np.ndarray:
        """Return the points (n, 3) of joints, springs and mass centres at all times."""
        found = [self.ground]
        for i, part in enumerate(self.parts):
            points = np.concatenate([part.skeleton(), [self.scene["bodies"][i]["centre"]]])
            found.append(self.paths(i, points).reshape(-1, 3))
        return np.concatenate(found)

    def corners(self) -> np.ndarray:
        """Return the paths (m, n, 3) of all points that are drawn of all bodies."""
        each = [self.paths(i, _few(part.points())) for i, part in enumerate(self.parts)]
        return np.concatenate(each, axis=1)


def _few(points: np.ndarray) -> np.ndarray:
    """Return at most some tens of points."""
    return points[:: max(1, len(points) // 40)]


def view(motion: Motion, plane: str = "") -> tuple[np.ndarray, str]:
    """Return the view (2, 3): unit vectors to the right and up, and the plane, such as "xz"; ""
    for an oblique one."""
    corners = np.concatenate([motion.corners().reshape(-1, 3), motion.ground])
    plane = plane or _plane(motion)
    up = np.array(motion.scene["up"])
    if plane:
        across, above = ("xyz".index(c) for c in plane)
        if abs(up[across]) > abs(up[above]):
            across, above = above, across
        sign = -1.0 if up[above] < -0.5 else 1.0
        return np.array([np.eye(3)[across], sign * np.eye(3)[above]]), plane
    frames = [_oblique(up, azimuth) for azimuth in AZIMUTHS]
    # Not from where bodies hide each other: the view with the largest picture.
    return max(
        frames, key=lambda frame: _area(corners[:: max(1, len(corners) // 3000)] @ frame.T)
    ), ""


def _plane(motion: Motion) -> str:
    """Return the plane of a planar motion; "" of a spatial one.

    Every body rotates about the normal only, and joints and mass centres extend little along it.
    """
    points = motion.skeleton()
    extent = np.ptp(points, axis=0)
    # R_t R_0^T n = n: what a rotation about n leaves.
    relative = motion.frames @ np.swapaxes(motion.frames[:1], 2, 3)
    fixed = [float(np.abs(relative[..., a] - np.eye(3)[a]).max()) < FLAT for a in range(3)]
    normal = motion.scene["normal"]
    for axis in sorted(range(3), key=lambda a: (extent[a] > FLAT * extent.max(), a != 1)):
        along_normal = normal is not None and abs(normal[axis]) > 1.0 - FLAT
        if fixed[axis] and (along_normal or extent[axis] <= FLAT * extent.max()):
            return "xyz".replace("xyz"[axis], "")
    return ""


def _oblique(up: np.ndarray, azimuth: float) -> np.ndarray:
    """Return the view from an angle about the vertical, above the horizon."""
    vertical = np.eye(3)[int(np.argmax(np.abs(up)))] * (1.0 if up.max() > 0.5 else -1.0)
    first = np.eye(3)[(int(np.argmax(np.abs(up))) + 1) % 3]
    second = np.cross(vertical, first)
    towards = np.cos(azimuth) * first + np.sin(azimuth) * second
    right = np.cross(vertical, towards)
    return np.array([right, np.cos(ELEVATION) * vertical - np.sin(ELEVATION) * towards])


def _area(points: np.ndarray) -> float:
    """Return the area of the outline of points (n, 2)."""
    x, y = outline(points).T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def moves(motion: Motion, frame: np.ndarray) -> bool:
    """Return whether a picture of the bodies shows something: points move, and in a plane."""
    corners = motion.corners()
    moved = float(np.ptp(corners, axis=0).max())
    extent = np.ptp(np.concatenate([corners.reshape(-1, 3), motion.ground]) @ frame.T, axis=0)
    return bool(moved > max(STILL * extent.max(), 1e-9) and extent.min() > 0.03 * extent.max())


def instants(motion: Motion, count: int) -> np.ndarray:
    """Return the indices of at most ``count`` output times, from t = 0 over the first sweep of the
    motion, at equal distances along the path of all points."""
    corners = motion.corners()
    last = _end_of_sweep(corners)
    steps = np.sqrt((np.diff(corners[: last + 1], axis=0) ** 2).sum(axis=2)).mean(axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    if way[-1] == 0.0:
        return np.array([0])
    return np.unique(np.searchsorted(way, np.linspace(0.0, way[-1], count) * (1.0 - 1e-12)))


def _end_of_sweep(corners: np.ndarray) -> int:
    """Return the index of the output time at which the box around the paths is nearly complete."""
    span = np.maximum.accumulate(corners, axis=0) - np.minimum.accumulate(corners, axis=0)
    full = span[-1].max(axis=0)
    # The path of each point along each axis, weighted by its extent: small ones do not count.
    part = (span * span[-1]).sum(axis=(1, 2)) / max(float((span[-1] ** 2).sum()), 1e-300)
    return int(np.argmax(part >= REACHED)) if full.any() else 0
