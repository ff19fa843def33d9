"""Springs and dampers between two points: surfaces of length 1 along z, and how they are moved.

At each time the node of a surface is at the first end, its z points to the second one, and it is
stretched along z by their distance. Orientations follow one another without rotation about z.
"""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import matrices, product
from msahl.post.glb.animation import choose_keys
from msahl.post.scene.geometry import along, quaternion, ring_faces, smallest_rotation
from msahl.post.scene.triangles import Triangles, revolved, straight

WINDINGS, PER_WINDING, AROUND = 9, 16, 8
STRAIGHT = 0.1
"""Share of a coil's length that is straight, at each end."""
COIL, WIRE, DAMPER, STRUT = 0.022, 0.0045, 0.02, 0.011
"""Radii relative to the size of the scene, as the viewer has them: of a coil and its wire, of a
damper alone and of one within a coil."""
CYLINDER = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.16), (1.0, 0.16), (1.0, 0.64), (0.3, 0.64), (0.3, 1.0))
"""Outline (r, z) of a damper, in parts of its radius and its length."""
FLAT = 1e-6
"""Least length of a spring, by the size of the scene: a scale of zero has no inverse."""


class Stretched(NamedTuple):
    """The motion of a spring: ``poses`` (rows, 7) of its surfaces, ``lengths`` (rows,) [m]."""

    poses: np.ndarray
    lengths: np.ndarray


def surfaces(glyph: str, size: float, length: float) -> list[Triangles]:
    """Return what a spring with a ``glyph`` is drawn as in a scene of a ``size`` [m]; nothing if
    it is not as long as the distance of its ends. The wire is round at a ``length`` [m].
    """
    coil = _tube(_helix(COIL * size), WIRE * size, WIRE * size / length)
    return {
        "coil": [coil],
        "strut": [coil, _damper(STRUT * size)],
        "damper": [_damper(DAMPER * size)],
    }.get(glyph, [])


def ends(spring: Mapping[str, Any], poses: np.ndarray) -> np.ndarray:
    """(rows, 2, 3) ends of a spring [m] at the ``poses`` (rows, bodies, 7) of all bodies."""
    found = np.empty((len(poses), 2, 3))
    for k, end in enumerate("ab"):
        body, point = spring[end], np.asarray(spring[f"{end}Point"], dtype=float)
        found[:, k] = point
        if body >= 0:
            found[:, k] = poses[:, body, :3] + matrices(poses[:, body, 3:]) @ point
    return found


def motion(ends: np.ndarray, size: float) -> Stretched:
    """Return the motion of a spring with these ``ends`` (rows, 2, 3) [m]; ``size`` as above."""
    apart = ends[:, 1] - ends[:, 0]
    lengths = np.linalg.norm(apart, axis=1)
    poses = np.empty((len(ends), 7))
    poses[:, :3] = ends[:, 0]
    d, q = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0, 0.0])
    if lengths[0] > 0.0:
        d = apart[0] / lengths[0]
        q = np.array(quaternion(along(d)))
    for k, length in enumerate(lengths):
        if length > 0.0:
            before, d = d, apart[k] / length
            q = product(smallest_rotation(before, d), q)
            q /= np.linalg.norm(q)
        poses[k, 3:] = q
    return Stretched(poses, np.maximum(lengths, FLAT * size))


def choose_spring_keys(time: np.ndarray, stretched: Stretched, size: float) -> np.ndarray:
    """Rows of the key poses of a spring: those of its pose, and of its length."""
    lengths = np.zeros((len(time), 7))
    lengths[:, 2], lengths[:, 3] = stretched.lengths, 1.0
    keys = (choose_keys(time, poses, size) for poses in (stretched.poses, lengths))
    return np.unique(np.concatenate([key.rows for key in keys]))


def _helix(radius: float) -> np.ndarray:
    """(n, 3) centre of the wire of a coil, whose first and last half winding grow from the axis."""
    part = np.linspace(0.0, 1.0, WINDINGS * PER_WINDING + 1)
    r = radius * np.minimum(1.0, 2.0 * WINDINGS * np.minimum(part, 1.0 - part))
    angle, z = 2.0 * math.pi * WINDINGS * part, STRAIGHT + (1.0 - 2.0 * STRAIGHT) * part
    middle = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
    return np.concatenate([[(0.0, 0.0, 0.0)], middle, [(0.0, 0.0, 1.0)]])


def _tube(centre: np.ndarray, radius: float, along_z: float) -> Triangles:
    """A tube along the ``centre`` (n, 3): rings of a ``radius``, which is ``along_z`` along z."""
    out = np.column_stack([centre[:, 0], centre[:, 1], np.zeros(len(centre))])
    size = np.linalg.norm(out, axis=1, keepdims=True)
    x = np.where(size > 0.0, out / np.where(size > 0.0, size, 1.0), (1.0, 0.0, 0.0))
    angle = 2.0 * math.pi * np.arange(AROUND) / AROUND
    up = np.where(size > 0.0, (0.0, 0.0, 1.0), (0.0, 1.0, 0.0))  # across the straight ends
    rings = np.cos(angle)[:, None] * x[:, None] + np.sin(angle)[:, None] * up[:, None]
    vertices = (centre[:, None] + (radius, radius, along_z) * rings).reshape(-1, 3)
    return Triangles(vertices, rings.reshape(-1, 3), ring_faces(len(centre), AROUND))


def _damper(radius: float) -> Triangles:
    """The surface of revolution of a cylinder with its rod."""
    outline = [(r * radius, z) for r, z in CYLINDER]
    return revolved([straight(a, b) for a, b in pairwise(outline)])
