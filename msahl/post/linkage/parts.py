"""Represent every body of a scene by few lines and faces, in the body's axes.

A body with two joints is a line between them, with more the polygon that they span. With one joint
it is the line from there through the mass centre: to the end of a rod, or to a bob with the outline
of its shape. Free bodies, round bodies that roll, and bodies with shapes in the deck have outlines.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from msahl.post.scene.geometry import half_box, rotation

GROUND = -1
RIM = np.linspace(0.0, 2.0 * np.pi, 41)
NEAR = 1e-6
"""Points nearer to each other than this are one, relative to the size of the model."""
ROD = 0.75
"""A body with one joint is a rod if the joint is at least so far from the mass centre, relative to
the distance from there to the surface."""

Scene = dict[str, Any]


@dataclass
class Parts:
    """What is drawn of one body, in its axes [m]: ``lines`` (n, 3); ``faces``, points (n, 3) whose
    outline in the picture is filled; ``pins`` (n, 3), points of joints; ``dots``, mass centres."""

    lines: list[np.ndarray] = field(default_factory=list)
    faces: list[np.ndarray] = field(default_factory=list)
    pins: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    dots: list[np.ndarray] = field(default_factory=list)
    places: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def points(self) -> np.ndarray:
        """Return all points (n, 3)."""
        return np.concatenate([*self.lines, *self.faces, self.places, np.zeros((0, 3))])


def parts_of(scene: Scene) -> list[Parts]:
    """Return the parts of each body of a scene."""
    pins, places = _ends(scene)
    rolling = {
        joint["child"]
        for joint in scene["joints"]
        if any(name.lower().endswith("radius") for name in joint["parameters"])
    } - {GROUND}
    return [
        _body(body, pins[index], places[index], scene["size"], index in rolling)
        for index, body in enumerate(scene["bodies"])
    ]


def ground_points(scene: Scene) -> np.ndarray:
    """Return the points (n, 3) of the ground at which joints and springs act."""
    return distinct(_ends(scene)[1].get(GROUND, ()), scene["size"])


def _ends(scene: Scene) -> tuple[dict[int, list[Any]], dict[int, list[Any]]]:
    """Return the points of joints, and those of joints and springs, by body."""
    bodies = range(GROUND, len(scene["bodies"]))
    pins: dict[int, list[Any]] = {index: [] for index in bodies}
    for joint in scene["joints"]:
        if joint["joints"] is None and joint["glyph"] not in ("contact", "roll", "knife", "planar"):
            pins[joint["parent"]].append(joint["parentPoint"])
            pins[joint["child"]].append(joint["childPoint"])
    places = {index: list(points) for index, points in pins.items()}
    for spring in scene["springs"]:
        if spring["joint"] is None:
            places[spring["a"]].append(spring["aPoint"])
            places[spring["b"]].append(spring["bPoint"])
    return pins, places


def distinct(points: Iterable[Sequence[float]], size: float) -> np.ndarray:
    """Return points (n, 3) without repetitions, in their order."""
    found: list[np.ndarray] = []
    for point in map(np.asarray, points):
        if all(np.linalg.norm(point - other) > NEAR * size for other in found):
            found.append(point)
    return np.array(found) if found else np.zeros((0, 3))


def _body(
    body: dict[str, Any], pins: Sequence[Any], places: Sequence[Any], size: float, rolling: bool
) -> Parts:
    """Return the parts of one body."""
    parts = Parts(pins=distinct(pins, size), places=distinct(places, size))
    centre = np.array(body["centre"])
    given = [shape for shape in body["shapes"] if not shape["derived"]]
    solids = [shape for shape in body["shapes"] if shape["derived"] and shape["kind"] != "rod"]
    if given or rolling:
        parts.faces = [surface(shape) for shape in given or solids]
        return parts
    if len(parts.places) == 0:
        parts.faces = [surface(shape) for shape in solids]
    elif len(parts.places) == 1:
        _add_hanging(parts, centre, solids, size)
    elif len(parts.places) == 2:
        parts.lines.append(parts.places)
    else:
        parts.faces.append(parts.places)
    return parts


def _add_hanging(
    parts: Parts, centre: np.ndarray, solids: Sequence[dict[str, Any]], size: float
) -> None:
    """Add the line from the only joint through the mass centre, and what hangs there."""
    (pin,) = parts.places
    arm = centre - pin
    length = float(np.linalg.norm(arm))
    reach = max((_reach(shape, arm / length) for shape in solids), default=0.0) if length else 0.0
    if length <= NEAR * size:
        parts.faces += [surface(shape) for shape in solids]
    elif ROD * reach <= length <= reach / ROD:
        parts.lines.append(np.array([pin, centre + arm * reach / length]))
    else:
        parts.lines.append(np.array([pin, centre]))
        parts.dots.append(centre)
        if reach < length:
            parts.faces += [surface(shape) for shape in solids]


def _reach(shape: dict[str, Any], direction: np.ndarray) -> float:
    """Return the distance from the middle of a shape to the box around it along a unit vector."""
    local = np.abs(rotation(shape["orientation"]).T @ direction)
    return float(np.min(half_box(shape) / np.maximum(local, 1e-12)))


def surface(shape: dict[str, Any]) -> np.ndarray:
    """Return points (n, 3) on a shape, in the axes of its body, that have its outline in every
    direction: corners, rims, or circles about a sphere."""
    points = _local(shape)
    return np.asarray(points @ rotation(shape["orientation"]).T + np.array(shape["position"]))


def _local(shape: dict[str, Any]) -> np.ndarray:
    """Return these points in the axes of the shape."""
    kind, size = shape["kind"], shape["size"]
    if kind == "mesh":
        return np.reshape(shape["vertices"], (-1, 3))
    if kind == "box":
        signs = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
        return np.array(signs) * size
    circle = size[0] * np.stack([np.cos(RIM), np.sin(RIM), 0.0 * RIM], axis=1)
    if kind in ("sphere", "capsule"):
        ball = np.concatenate([_tilted(circle, angle) for angle in np.linspace(0.0, np.pi, 13)])
        middle = np.array([0.0, 0.0, 0.5 * size[1] if kind == "capsule" else 0.0])
        return np.concatenate([ball + middle, ball - middle])
    half = np.array([0.0, 0.0, 0.5 * size[1]])
    top = half[None] if kind == "cone" else circle + half
    return np.concatenate([circle - half, top])


def _tilted(circle: np.ndarray, angle: float) -> np.ndarray:
    """Return a circle about z rotated about x."""
    x, y, _ = circle.T
    return np.stack([x, y * np.cos(angle), y * np.sin(angle)], axis=1)


def outline(points: np.ndarray) -> np.ndarray:
    """Return the corners (n, 2) of the smallest convex polygon around points (m, 2), in order
    (Andrew's monotone chain); of points on a line its two ends."""
    ordered = [tuple(p) for p in np.unique(np.round(points, 12), axis=0)]
    if len(ordered) < 3:
        return np.array(ordered)
    halves: list[list[tuple[float, ...]]] = []
    for sequence in (ordered, ordered[::-1]):
        chain: list[tuple[float, ...]] = []
        for p in sequence:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], p) <= 0.0:
                chain.pop()
            chain.append(p)
        halves.append(chain[:-1])
    return np.array(halves[0] + halves[1])


def _turn(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> float:
    """Return twice the area of a triangle, positive if counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
