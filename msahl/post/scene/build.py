"""Build the scene of a model from its records; the package's docstring has the format."""

import math
from collections.abc import Container, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from msahl.algebra.rotation_arrays import matrices, quaternions
from msahl.model import Model, RigidBody
from msahl.model.elastic import node_places
from msahl.post.scene.beams import beam_entries, node_beams
from msahl.post.scene.curves import curve_shapes
from msahl.post.scene.derived import (
    ROD_RADIUS,
    WIDE,
    contact_shape,
    equivalent_solid,
    inside,
    links,
    marker_of_mass,
    visible,
    wheel_radii,
)
from msahl.post.scene.elastic import skins
from msahl.post.scene.geometry import Shape, along, corners, floats, half_box, quaternion, shape
from msahl.post.scene.glyphs import (
    GROUND,
    Entry,
    joint_entries,
    load_entries,
    marker_entries,
    motion_entries,
    numbers,
    sensor_entries,
    spring_entries,
)
from msahl.post.scene.shapes import given_shapes

PALETTE = (
    "#4e79a7", "#f28e2b", "#59a14f", "#e15759", "#76b7b2",
    "#edc948", "#b07aa1", "#ff9da7", "#9c755f", "#86bcb6",
)  # fmt: skip
"""Colours of bodies in turn."""
PARALLEL = 1e-6
"""Sine of the angle between axes that count as parallel."""

LONG = ("coil", "damper", "strut")
"""Glyphs of springs that are as long as the distance between their ends."""
SHORT, VISIBLE = 0.08, 0.25
"""Lengths of a spring that is too short to be seen, and of one drawn in its place, by ``size``."""
IN_PLANE = ("fixed", "slide", "rack", "cam")
"""Glyphs of joints that take no part in deciding whether a mechanism is planar."""


def build_scene(model: Model, title: str = "", folders: Sequence[Path] = ()) -> dict[str, Any]:
    """Return the scene of a model at t = 0; its title is that of the simulation, or ``title``.

    Files of meshes are looked for in ``folders``. One that cannot be read is omitted, with a note.
    """
    body = numbers(model)
    joints = joint_entries(model, body)
    place = {joint["name"]: index for index, joint in enumerate(joints)}
    springs = spring_entries(model, body, joints)
    markers = marker_entries(model, body)
    poses = [pose(record) for record in model.bodies]
    points = _points(model, poses, joints, springs, markers)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if size == 0.0:  # bodies at one point: their inertia alone has a length
        size = max(2.0 * float(half_box(equivalent_solid(b)).max()) for b in model.bodies)
    for spring in springs:
        if spring["joint"] is not None and spring["glyph"] in LONG:
            spring["aPoint"] = _foot(model, spring, poses, size)
    given, errors = given_shapes(model, folders)
    elastic, notes = skins(model, body, folders, PALETTE)
    shapes = derived_shapes(model, joints, poses, size, {entry["name"] for entry in elastic})
    shapes |= {body[name]: given_here for name, given_here in given.items()}
    around = [points, *(_placed(corners(s), poses, b) for b in shapes for s in shapes[b])]
    around += [_placed(np.reshape(e["points"], (-1, 3)), poses, e["frame"]) for e in elastic]
    corner = np.concatenate(around)
    return {
        "title": model.simulation.title or title,
        "bodies": _body_entries(model, poses, shapes),
        "beams": beam_entries(model, body, PALETTE),
        "elastic": elastic,
        "ground": {"names": [g.name for g in model.grounds], "shapes": shapes[GROUND]},
        "joints": joints,
        "motions": motion_entries(model, body, place),
        "springs": springs,
        "loads": load_entries(model, body, place),
        "markers": markers,
        "sensors": sensor_entries(model),
        "extent": [floats(corner.min(axis=0)), floats(corner.max(axis=0))],
        "size": size,
        "gravity": floats(model.gravity),
        "up": _up(model),
        "normal": _normal(joints, poses),
        "notes": [*map(str, errors), *notes],
    }


def _body_entries(
    model: Model, poses: Sequence[list[float]], shapes: dict[int, list[Shape]]
) -> list[Entry]:
    """Return the bodies."""
    beam_of, hidden = node_beams(model), model.hidden
    return [
        {
            "name": record.name,
            "pose": poses[index],
            "centre": floats(record.r_BG),
            "mass": record.mass,
            "colour": _colour(shapes[index], index),
            "shapes": shapes[index],
            "beam": beam_of.get(record.name),
            "hidden": record.name in hidden,
        }
        for index, record in enumerate(model.bodies)
    ]


def _foot(
    model: Model, spring: Entry, poses: Sequence[Sequence[float]], size: float
) -> list[float]:
    """Return where a spring along a joint's axis ends on its first body. At t = 0 the points of the
    joint may coincide: then beside its mass centre, or at a length that can be seen."""
    point, axis = np.array(spring["aPoint"]), np.array(spring["axis"])
    apart = _placed(np.array(spring["bPoint"]), poses, spring["b"]) - _placed(
        point, poses, spring["a"]
    )
    if np.linalg.norm(apart) >= SHORT * size:
        return floats(point)
    if spring["a"] != GROUND:
        shift = float((np.array(model.bodies[spring["a"]].r_BG) - point) @ axis)
        if abs(shift) >= SHORT * size:
            return floats(point + shift * axis)
    inwards = _placed(np.array(model.bodies[spring["b"]].r_BG), poses, spring["b"]) - _placed(
        point, poses, spring["a"]
    )
    outwards = _placed(point + axis, poses, spring["a"]) - _placed(point, poses, spring["a"])
    return floats(point - math.copysign(VISIBLE * size, float(inwards @ outwards)) * axis)


def _colour(shapes: Sequence[Shape], index: int) -> str:
    """Return the first colour that the deck gives the shapes of a body, or the next of a list."""
    return next((s["colour"] for s in shapes if s["colour"]), PALETTE[index % len(PALETTE)])


def pose(body: RigidBody) -> list[float]:
    """Return [x, y, z, w, x, y, z]: a body's reference point and orientation at t = 0."""
    return floats([*body.position, *quaternions(np.array(body.orientation))])


def derived_shapes(
    model: Model,
    joints: Sequence[Entry],
    poses: Sequence[Sequence[float]],
    size: float,
    skinned: Container[str] = (),
) -> dict[int, list[Shape]]:
    """Return the shapes of every body and of the ground that follow from inertia and joints;
    elastic bodies that are ``skinned`` need none from their frame to their nodes."""
    body = numbers(model)
    ends: dict[int, list[list[float]]] = {index: [] for index in range(GROUND, len(model.bodies))}
    shapes: dict[int, list[Shape]] = {index: [] for index in ends}
    for joint in joints[: len(model.joints)]:
        for side in ("parent", "child"):
            ends[joint[side]].append(joint[f"{side}Point"])
    for record in model.joints:
        for side, name in (("parent", record.parent), ("child", record.child)):
            round_part = contact_shape(record, side)
            if round_part is not None:
                shapes[body[name]].append(round_part)
    for b, wheel in _wheels(model, joints, poses):
        shapes[b].append(wheel)
    for b, part in curve_shapes(model, body, ROD_RADIUS * size):
        shapes[b].append(part)
    shapeless = {*node_beams(model), *(n for one in model.elastic_bodies for n in one.bodies)}
    for elastic in model.elastic_bodies:
        if elastic.name not in skinned:
            ends[body[elastic.name]] += map(list, node_places(elastic))
    for index, record_of_body in enumerate(model.bodies):
        rods = links(record_of_body.r_BG, ends[index], ROD_RADIUS * size)
        if not shapes[index] and record_of_body.name not in shapeless:
            reach = max((math.dist(record_of_body.r_BG, end) for end in ends[index]), default=0.0)
            solid = visible(marker_of_mass(equivalent_solid(record_of_body), reach), size)
            shapes[index].append(solid)
            rods = [rod for rod in rods if not inside(rod, solid)]
        shapes[index] += rods
    return shapes


def _wheels(
    model: Model, joints: Sequence[Entry], poses: Sequence[Sequence[float]]
) -> Iterator[tuple[int, Shape]]:
    """Yield bodies and the gears or pinions that couplings of their joints make of them."""
    place = {joint.name: index for index, joint in enumerate(model.joints)}
    for coupling in model.couplings:
        first, second = (joints[place[name]] for name in (coupling.first, coupling.second))
        radii: tuple[float, ...] | None = None
        if coupling.kind == "rackAndPinion":
            radii = (abs(coupling.ratio),)
        elif coupling.kind == "gear":
            axes, centres = zip(*(_axis(joint, poses) for joint in (first, second)), strict=True)
            if np.linalg.norm(np.cross(*axes)) < PARALLEL:
                apart = centres[1] - centres[0]
                across = apart - (apart @ axes[0]) * axes[0]
                radii = wheel_radii(coupling.ratio, float(np.linalg.norm(across)))
        for joint, radius in zip((first, second), radii or (), strict=False):
            if joint["child"] != GROUND and radius > 0.0:
                upright = quaternion(along(joint["childAxis"]))
                size = [radius, WIDE * radius]
                yield joint["child"], shape("disc", size, joint["childPoint"], upright)


def _axis(joint: Entry, poses: Sequence[Sequence[float]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the axis of a joint on its parent and its point, inertial axes, t = 0."""
    point = _placed(np.array(joint["parentPoint"]), poses, joint["parent"])
    tip = _placed(np.add(joint["parentPoint"], joint["axis"]), poses, joint["parent"])
    return tip - point, point


def _points(
    model: Model,
    poses: Sequence[Sequence[float]],
    joints: Sequence[Entry],
    springs: Sequence[Entry],
    markers: Sequence[Entry],
) -> np.ndarray:
    """Return mass centres and the points of all elements (n, 3), inertial axes, t = 0."""
    given = [(index, body.r_BG) for index, body in enumerate(model.bodies)]
    for joint in joints:
        given += [(joint[side], joint[f"{side}Point"]) for side in ("parent", "child")]
    for spring in springs:
        given += [(spring[end], spring[f"{end}Point"]) for end in ("a", "b")]
    given += [(marker["body"], marker["point"]) for marker in markers]
    return np.array([_placed(np.array(point), poses, index) for index, point in given])


def _placed(points: np.ndarray, poses: Sequence[Sequence[float]], index: int) -> np.ndarray:
    """Return points (..., 3) of a body in inertial axes."""
    if index == GROUND:
        return points
    x, q = np.array(poses[index][:3]), poses[index][3:]
    return np.asarray(points @ matrices(q).T + x)


def _up(model: Model) -> list[float]:
    g = np.array(model.gravity)
    return floats(-g / np.sqrt(g @ g)) if g.any() else [0.0, 0.0, 1.0]


def _normal(joints: Sequence[Entry], poses: Sequence[Sequence[float]]) -> list[float] | None:
    """Return the common direction of the axes of all revolute joints, inertial axes, t = 0; None
    without such joints, if they differ, or if other joints allow motion out of the plane."""
    found: list[np.ndarray] = []
    for joint in joints:
        if joint["glyph"] in ("axis", "gear"):
            q = [1.0, 0.0, 0.0, 0.0] if joint["parent"] == GROUND else poses[joint["parent"]][3:]
            found.append(matrices(q) @ joint["axis"])
        elif joint["glyph"] not in IN_PLANE:
            return None
    if not found or any(np.linalg.norm(np.cross(found[0], a)) > PARALLEL for a in found):
        return None
    return floats(found[0])
