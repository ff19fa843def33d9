"""Represent every body of a scene by few lines and faces, in the body's axes.

A body with two joints is a line between them, with more the polygon that they span. With one joint
it is the line from there through the mass centre: to the end of a rod, or to a bob with the outline
of its shape. Free bodies, round bodies that roll, and bodies with shapes in the deck have outlines.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from msahl.algebra.rotation_arrays import matrices
from msahl.post.scene.geometry import along, half_box, quaternion
from msahl.post.scene.geometry import shape as derived_shape

GROUND = -1
RIM = np.linspace(0.0, 2.0 * np.pi, 41)
NEAR = 1e-6
"""Points nearer to each other than this are one, relative to the size of the model."""
ROD = 0.75
"""A body with one joint is a rod if the joint is at least so far from the mass centre, relative to
the distance from there to the surface."""
OVERHANG = 1.15
"""Distance of a mass centre from the middle of the body's points from which it is drawn, relative
to the largest such distance of these points."""

BLOCK = 0.07
"""Width of the block of a joint that slides, relative to the size of the model."""

Scene = dict[str, Any]
Slide = tuple[dict[str, Any], str]
"""A joint of a scene, and "parent" or "child"."""


@dataclass
class Parts:
    """What is drawn of one body, in its axes [m]: ``lines`` (n, 3); ``faces``, points (n, 3) whose
    outline in the picture is filled; ``spokes`` (2, 3), thin lines that show the rotation of round
    faces; ``dots``, mass centres; ``pins`` (n, 3), points of joints; ``places`` (n, 3), those of
    joints and springs."""

    lines: list[np.ndarray] = field(default_factory=list)
    faces: list[np.ndarray] = field(default_factory=list)
    spokes: list[np.ndarray] = field(default_factory=list)
    pins: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    dots: list[np.ndarray] = field(default_factory=list)
    places: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def points(self) -> np.ndarray:
        """Return all points (n, 3)."""
        return np.concatenate([*self.lines, *self.faces, *self.spokes, self.places])

    def skeleton(self) -> np.ndarray:
        """Return the points (n, 3) of joints, springs, lines and mass centres."""
        return np.concatenate([*self.lines, *map(np.atleast_2d, self.dots), self.places])

    def add_shapes(self, shapes: Iterable[dict[str, Any]]) -> None:
        """Add the outlines of shapes, and spokes of round ones."""
        for shape in shapes:
            self.faces.append(surface(shape))
            if shape["kind"] in ("cylinder", "disc", "sphere", "capsule", "cone"):
                self.spokes.append(spoke(shape))


def parts_of(scene: Scene) -> list[Parts]:
    """Return the parts of each body of a scene."""
    pins, places = _ends(scene)
    rolling = {
        joint["child"]
        for joint in scene["joints"]
        if any(name.lower().endswith("radius") for name in joint["parameters"])
    } - {GROUND}
    found = []
    for index, body in enumerate(scene["bodies"]):
        parts = Parts(
            pins=distinct(pins[index], scene["size"]), places=distinct(places[index], scene["size"])
        )
        if body["beam"] is None and not body["hidden"]:
            _fill(parts, body, _slides(scene, index), scene["size"], index in rolling)
        elif not len(parts.places):
            parts.places = np.zeros((1, 3))  # so that the picture is large enough for the beam
        found.append(parts)
    return found


def _slides(scene: Scene, index: int) -> list[Slide]:
    """Return the joints along which a body slides, with the end that it is on."""
    found = []
    for joint in scene["joints"]:
        side = "parent" if joint["child"] == GROUND else "child"
        if joint["glyph"] in ("slide", "cylinder", "thread") and joint[side] == index:
            found.append((joint, side))
    return found


def _block(joint: dict[str, Any], side: str, size: float) -> dict[str, Any]:
    """Return the block of a joint that slides, along its axis."""
    axis = joint["axis"] if side == "parent" else joint["childAxis"]
    lengths = size * np.array([BLOCK, BLOCK, 1.7 * BLOCK])
    return derived_shape("box", lengths, joint[f"{side}Point"], quaternion(along(axis)))


def ground_points(scene: Scene) -> np.ndarray:
    """Return the points (n, 3) of the ground at which joints and springs act."""
    return distinct(_ends(scene)[1].get(GROUND, ()), scene["size"])


def _ends(scene: Scene) -> tuple[dict[int, list[Any]], dict[int, list[Any]]]:
    """Return the points of joints, and those of joints and springs, by body."""
    bodies = range(GROUND, len(scene["bodies"]))
    pins: dict[int, list[Any]] = {index: [] for index in bodies}
    for joint in scene["joints"]:
        if joint["joints"] is None and joint["glyph"] not in ("contact", "roll", "knife", "plane"):
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


def _fill(
    parts: Parts, body: dict[str, Any], slides: Sequence[Slide], size: float, rolling: bool
) -> None:
    """Add what is drawn of a body to its points of joints and springs."""
    centre = np.array(body["centre"])
    given = [shape for shape in body["shapes"] if not shape["derived"]]
    solids = [shape for shape in body["shapes"] if shape["derived"] and shape["kind"] != "rod"]
    if given or rolling:
        parts.add_shapes(given or solids)
        return
    if slides:
        solids = [_block(joint, side, size) for joint, side in slides]
        parts.faces = [surface(block) for block in solids]
    if len(parts.places) == 0:
        parts.add_shapes(solids)
    elif len(parts.places) == 1:
        _add_hanging(parts, centre, [] if slides else solids, size)
    else:
        (parts.lines if len(parts.places) == 2 else parts.faces).append(parts.places)
        _add_overhang(parts, centre)


def _add_overhang(parts: Parts, centre: np.ndarray) -> None:
    """Add the line to a mass centre that is far beyond the points of joints and springs."""
    apart = np.linalg.norm(parts.places - centre, axis=1)
    middle = parts.places.mean(axis=0)
    if (
        np.linalg.norm(centre - middle)
        > OVERHANG * np.linalg.norm(parts.places - middle, axis=1).max()
    ):
        parts.lines.append(np.array([parts.places[apart.argmin()], centre]))
        parts.dots.append(centre)


def _add_hanging(
    parts: Parts, centre: np.ndarray, solids: Sequence[dict[str, Any]], size: float
) -> None:
    """Add the line from the only joint through the mass centre, and what hangs there."""
    (pin,) = parts.places
    arm = centre - pin
    length = float(np.linalg.norm(arm))
    reach = max((_reach(shape, arm / length) for shape in solids), default=0.0) if length else 0.0
    if length <= NEAR * size:
        parts.add_shapes(solids)
    elif ROD * reach <= length <= reach / ROD:
        parts.lines.append(np.array([pin, centre + arm * reach / length]))
    else:
        parts.lines.append(np.array([pin, centre]))
        parts.dots.append(centre)
        if reach < length:
            parts.add_shapes(solids)


def _reach(shape: dict[str, Any], direction: np.ndarray) -> float:
    """Return the distance from the middle of a shape to the box around it along a unit vector."""
    local = np.abs(matrices(shape["orientation"]).T @ direction)
    return float(np.min(half_box(shape) / np.maximum(local, 1e-12)))


def surface(shape: dict[str, Any]) -> np.ndarray:
    """Return points (n, 3) on a shape, in the axes of its body, that have its outline in every
    direction: corners, rims, or circles about a sphere."""
    points = _local(shape)
    return np.asarray(points @ matrices(shape["orientation"]).T + np.array(shape["position"]))


def spoke(shape: dict[str, Any]) -> np.ndarray:
    """Return a line (2, 3) from the middle of a round shape's end to its rim, body axes."""
    height = 0.0 if shape["kind"] == "sphere" else 0.5 * shape["size"][1]
    if shape["kind"] == "cone":
        height = -height
    line = np.array([[0.0, 0.0, height], [shape["size"][0], 0.0, height]])
    return np.asarray(line @ matrices(shape["orientation"]).T + np.array(shape["position"]))


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
            while len(chain) > 1 and _double_area(chain[-2], chain[-1], p) <= 0.0:
                chain.pop()
            chain.append(p)
        halves.append(chain[:-1])
    return np.array(halves[0] + halves[1])


def _double_area(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> float:
    """Return twice the area of a triangle, positive if counter-clockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
