"""What a table gives, as functions of the configuration: values, derivatives, accelerations.

    y = h(q)        y' = H z'        y'' = H z'' + c(q, z')

    z       displacements of all frames [m], and rotations times the frames' lengths [m]
    y       coordinates of joints and of points; of an orientation the rotation vector from the
            configuration to the given one, in the rotating axes: zero where they agree

H is evaluated by unit velocities and c by zero accelerations, both by the functions that write the
tables of a run. Rows of angles are multiplied by a length, so that all are in metres.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import cross, euler_parameters, matrices, rotated, rotations
from msahl.algebra.vector import ZERO, Vector
from msahl.analysis.inverse.table import Track
from msahl.analysis.linearised.coefficients import skews
from msahl.analysis.linearised.plain_units import coordinate_numbers
from msahl.joints.coordinates import (
    ORIENTATION,
    Geometry,
    Motion,
    columns,
    relative,
    stacked,
    values_and_rates,
)
from msahl.model import Joint, Model
from msahl.run.body_rows import GROUND, numbers_of_bodies
from msahl.system.arrays import State, System, node_count

UNITS = 12
"""Unit velocities of two bodies."""


class Bodies(NamedTuple):
    """All bodies, the ground last: places, and arms that carry velocities to reference points."""

    x: np.ndarray  # (n + 1, 3) reference points B [m]
    R: np.ndarray  # (n + 1, 3, 3)
    arm: np.ndarray  # (n + 1, 3) from the mass centres to B, inertial axes [m]
    v: np.ndarray  # (n + 1, 3) of the mass centres [m/s]
    W: np.ndarray  # (n + 1, 3) inertial axes [rad/s]


class _Joints(NamedTuple):
    """Joints of one kind, of which some coordinates are given."""

    geometry: Geometry
    parent: np.ndarray  # (j,) bodies
    child: np.ndarray
    rows: list[tuple[int, int, int, bool]]  # row of y, joint, column of rates, is an orientation


class _Points(NamedTuple):
    """Coordinates of points of bodies, one ``axis`` each."""

    row: np.ndarray  # (k,) of y
    body: np.ndarray  # (k,)
    s: np.ndarray  # (k, 3) from B, body axes [m]
    axis: np.ndarray  # (k,)


class _Axes(NamedTuple):
    """Axes that are fixed in bodies."""

    row: np.ndarray  # (k,) first of three of y
    body: np.ndarray  # (k,)
    axes: np.ndarray  # (k, 3, 3) rows, body axes


class Measures:
    """The given coordinates of a model, in the order of the tracks: ``size`` rows of y."""

    def __init__(self, model: Model, system: System, tracks: Sequence[Track]) -> None:
        self.system, self.tracks = system, tuple(tracks)
        self.coordinate = coordinate_numbers(system)
        self.names = [body.name for body in model.bodies]
        self.hidden = model.hidden
        self.number = numbers_of_bodies(model)
        widths = [3 if track.coordinate == ORIENTATION else 1 for track in tracks]
        ends = np.cumsum([0, *widths])
        self.rows = [slice(a, b) for a, b in pairwise(ends.tolist())]
        self.size = int(ends[-1])
        self.scale = np.ones(self.size)
        self.r_BG = np.zeros((len(model.bodies) + 1, 3))
        self.r_BG[:-1] = [body.r_BG for body in model.bodies]
        lengths = system.frames.length[:-1]
        typical = float(lengths.mean()) if lengths.size else 1.0
        for track, rows in zip(tracks, self.rows, strict=True):
            self.scale[rows] = typical if track.rotates else 1.0
        self.joints = self._joints(model)
        self.points, self.axes = self._points(model)
        first = np.cumsum([0, *(track.values.shape[1] for track in tracks)])
        self.first = np.zeros(self.size, dtype=int)  # given value of each row's track
        for rows, column in zip(self.rows, first, strict=False):
            self.first[rows] = column
        periodic = [track.rotates and not _is_orientation(track) for track in tracks]
        self.periodic = np.repeat(periodic, widths)

    def _joints(self, model: Model) -> list[_Joints]:
        """Return the joints of which coordinates are given, by kind."""
        of_name = {joint.name: joint for joint in model.joints}
        wanted: dict[str, list[Joint]] = {}
        for track in self.tracks:
            if track.kind == "joint":
                joint = of_name[track.element]
                group = wanted.setdefault(joint.kind, [])
                if joint not in group:
                    group.append(joint)
        found = []
        for group in wanted.values():
            numbers = [[self.number[name] for name in (j.parent, j.child)] for j in group]
            parent, child = np.array(numbers).T
            rows = [
                (
                    self.rows[t].start,
                    at,
                    columns(joint, 1).index(_rate_name(track)),
                    _is_orientation(track),
                )
                for t, track in enumerate(self.tracks)
                for at, joint in enumerate(group)
                if track.kind == "joint" and track.element == joint.name
            ]
            found.append(_Joints(stacked(group), parent, child, rows))
        return found

    def _points(self, model: Model) -> tuple[_Points, _Axes]:
        """Return the points and axes of bodies that are given."""
        markers = {marker.name: marker for marker in model.markers}
        points = list[tuple[int, int, Vector, int]]()
        frames = list[tuple[int, int, np.ndarray]]()
        for track, rows in zip(self.tracks, self.rows, strict=True):
            if track.kind == "marker":
                marker = markers[track.element]
                body, s, axes = self.number[marker.body], marker.point, np.array(marker.axes)
            elif track.kind == "body":
                body, s, axes = self.number[track.element], ZERO, np.eye(3)
            else:
                continue
            if _is_orientation(track):
                frames.append((rows.start, body, axes))
            else:
                points.append((rows.start, body, s, "xyz".index(track.coordinate)))
        of_points = _Points(
            row=_integers([point[0] for point in points]),
            body=_integers([point[1] for point in points]),
            s=np.array([point[2] for point in points]).reshape(-1, 3),
            axis=_integers([point[3] for point in points]),
        )
        return of_points, _Axes(
            row=_integers([frame[0] for frame in frames]),
            body=_integers([frame[1] for frame in frames]),
            axes=np.array([frame[2] for frame in frames]).reshape(-1, 3, 3),
        )

    def bodies(self, state: State) -> Bodies:
        """Return the bodies in a ``state``."""
        R = rotations(state.p)
        R[GROUND] = np.eye(3)
        arm = -rotated(R, self.r_BG)
        return Bodies(state.x + arm, R, arm, state.v, rotated(R, state.w))

    def difference(self, bodies: Bodies, given: np.ndarray) -> np.ndarray:
        """(size,) given values less those of the configuration, in metres; ``given`` holds the
        values of the tracks one after the other, orientations as quaternions.
        """
        y = given[self.first]
        oriented, R = (
            list(self.axes.row),
            [bodies.R[self.axes.body] @ self.axes.axes.swapaxes(1, 2)],
        )
        for group in self.joints:
            parent, child = (_still(bodies, each) for each in (group.parent, group.child))
            motion = relative(group.geometry, parent, child)
            present = values_and_rates(group.geometry, motion)[0]
            for row, joint, column, spatial in group.rows:
                if spatial:
                    oriented.append(row)
                    R.append(motion.R[joint : joint + 1])
                else:
                    y[row] -= present[joint, column]
        points = self.points
        place = bodies.x[points.body] + rotated(bodies.R[points.body], points.s)
        y[points.row] -= place[np.arange(len(place)), points.axis]
        if oriented:
            first, three = np.array(oriented)[:, None], np.arange(4)
            vectors = _rotations_to(np.concatenate(R), given[self.first[first] + three])
            y[first + three[:3]] = vectors
        y[self.periodic] = np.remainder(y[self.periodic] + np.pi, 2.0 * np.pi) - np.pi
        return y * self.scale

    def jacobian(self, bodies: Bodies) -> np.ndarray:
        """(size, n) H by the unknowns z."""
        frames = self.system.frames
        H = np.zeros((self.size, node_count(self.system), 3))
        nodes = (frames.displacement, frames.rotation)
        for group in self.joints:
            rates = _unit_rates(group, bodies)  # (12, j, c)
            for row, joint, column, spatial in group.rows:
                width = 3 if spatial else 1
                part = rates[:, joint, column : column + width].T.reshape(width, 2, 2, 3)
                for side, body in enumerate((group.parent[joint], group.child[joint])):
                    for which in range(2):
                        node = nodes[which][body]
                        H[row : row + width, node] += part[:, side, which]
        points, axes = self.points, self.axes
        r = rotated(bodies.R[points.body], points.s) + bodies.arm[points.body]
        H[points.row, nodes[0][points.body]] = np.eye(3)[points.axis]
        H[points.row, nodes[1][points.body]] = -skews(r)[np.arange(len(r)), points.axis]
        rows = axes.row[:, None] + np.arange(3)
        H[rows, nodes[1][axes.body][:, None]] = axes.axes @ bodies.R[axes.body].swapaxes(1, 2)
        H[:, frames.rotation] /= frames.length[:, None]
        return self.scale[:, None] * H.reshape(self.size, -1)[:, self.coordinate]

    def drift(self, bodies: Bodies) -> np.ndarray:
        """(size,) c: accelerations without those of the bodies, in metres."""
        c = np.zeros(self.size)
        for group in self.joints:
            parent, child = (_drifting(bodies, each) for each in (group.parent, group.child))
            values = values_and_rates(group.geometry, relative(group.geometry, parent, child))[2]
            for row, joint, column, spatial in group.rows:
                width = 3 if spatial else 1
                c[row : row + width] = values[joint, column : column + width]
        points = self.points
        W = bodies.W[points.body]
        r = rotated(bodies.R[points.body], points.s) + bodies.arm[points.body]
        c[points.row] = cross(W, cross(W, r))[np.arange(len(r)), points.axis]
        return c * self.scale


def _is_orientation(track: Track) -> bool:
    return track.coordinate == ORIENTATION


def _integers(numbers: Sequence[int]) -> np.ndarray:
    return np.array(numbers, dtype=int)


def _rate_name(track: Track) -> str:
    """Return the first column of the rates of a joint's coordinate."""
    return "wx" if _is_orientation(track) else f"{track.coordinate}Rate"


def _still(bodies: Bodies, chosen: np.ndarray) -> Motion:
    """The motion of bodies at rest."""
    zero = np.zeros((len(chosen), 3))
    return Motion(bodies.x[chosen], bodies.R[chosen], zero, zero)


def _drifting(bodies: Bodies, chosen: np.ndarray) -> Motion:
    """The motion whose mass centres have no accelerations, and no angular ones."""
    W, arm = bodies.W[chosen], bodies.arm[chosen]
    spin = cross(W, arm)
    return Motion(
        bodies.x[chosen],
        bodies.R[chosen],
        bodies.v[chosen] + spin,
        W,
        cross(W, spin),
        np.zeros_like(W),
    )


def _unit_rates(group: _Joints, bodies: Bodies) -> np.ndarray:
    """(12, j, c) rates for unit velocities: of the parents' mass centres, their angular velocities,
    and the same of the children.
    """
    motions = []
    for side, chosen in enumerate((group.parent, group.child)):
        v, W = np.zeros((2, UNITS, len(chosen), 3))
        for i in range(3):
            v[6 * side + i, :, i] = 1.0
            W[6 * side + 3 + i, :, i] = 1.0
        v += cross(W, np.broadcast_to(bodies.arm[chosen], W.shape))
        x = np.broadcast_to(bodies.x[chosen], v.shape)
        R = np.broadcast_to(bodies.R[chosen], (*v.shape, 3))
        motions.append(Motion(x, R, v, W))
    return values_and_rates(group.geometry, relative(group.geometry, *motions))[1]


def _rotations_to(R: np.ndarray, quaternions: np.ndarray) -> np.ndarray:
    """(k, 3) rotation vectors, in the axes ``R`` (k, 3, 3), from these to those of quaternions."""
    e = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    q = euler_parameters(R.swapaxes(1, 2) @ matrices(e))
    sine = np.linalg.norm(q[:, 1:], axis=1, keepdims=True)
    return np.asarray(2.0 * np.arctan2(sine, q[:, :1]) * q[:, 1:] / np.where(sine > 0.0, sine, 1.0))
