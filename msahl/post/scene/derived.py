"""Derive shapes of bodies from the model: equivalent solids, links, wheels.

The equivalent solid of a body is the uniform solid with its mass and principal moments of inertia
I1, I2, I3 about the mass centre:

    all equal        sphere      r^2 = 5 I / (2 m)
    two equal (I_t)  cylinder    r^2 = 2 I_a / m,  h^2 = 6 (2 I_t - I_a) / m
    all different    box         a^2 = 6 (I2 + I3 - I1) / m, and so on

Links are rods from the mass centre to the points of joints. Bodies that roll or lie on something
have the radius that the joint gives them. Sizes are limited to what can be seen beside the rest of
the model: inertia of a deck is often that of a point mass.
"""

import math
from collections.abc import Sequence
from itertools import permutations

import numpy as np

from msahl.algebra.rotation_arrays import matrices
from msahl.joints.registry import KINDS
from msahl.model import Joint, RigidBody
from msahl.post.scene.geometry import Shape, along, floats, half_box, quaternion, shape

ROD_RADIUS, LEAST, LARGEST = 0.01, 0.02, 2.0
"""Radius of a rod, least half length and largest length of a solid, by the model's size."""
SAME = 1e-6
"""Relative difference of two principal moments that count as equal."""
THIN = 0.15
"""Width of a rolling disk, relative to its radius."""
LONG = 4.0
"""Length of a cylinder that touches another or a plane, relative to its radius."""
SHARE = 0.3
"""Radius of the sphere of a link, relative to the distance to its farthest joint."""
WIDE = 0.15
"""Width of a gear or pinion, relative to its radius."""
FLAT = 1.0
"""Length of a cylinder, relative to its radius, below which it is called a disc."""


def equivalent_solid(body: RigidBody) -> Shape:
    """Return the uniform solid with a body's mass and inertia."""
    moments, axes = principal_axes(np.array(body.inertia))
    spread = [abs(moments[i - 2] - moments[i - 1]) for i in range(3)]
    same = SAME * float(moments.max())
    if max(spread) <= same:
        return shape("sphere", [math.sqrt(2.5 * float(moments.mean()) / body.mass)], body.r_BG)
    a = int(np.argmin(spread))  # the moment whose two others differ least
    if spread[a] <= same:
        across = 0.5 * (moments[a - 2] + moments[a - 1])
        radius = math.sqrt(2.0 * moments[a] / body.mass)
        length = math.sqrt(max(6.0 * (2.0 * across - moments[a]), 0.0) / body.mass)
        kind = "disc" if length < FLAT * radius else "cylinder"
        return shape(kind, [radius, length], body.r_BG, quaternion(along(axes[:, a])))
    squares = 6.0 * (moments.sum() - 2.0 * moments) / body.mass
    return shape("box", np.sqrt(np.maximum(squares, 0.0)), body.r_BG, quaternion(axes))


def principal_axes(J: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return moments (3,) and axes, the columns of a rotation matrix (3, 3), of a symmetric tensor;
    of the possible orders and signs those nearest to the tensor's own axes."""
    moments, axes = np.linalg.eigh(J)
    order = max(permutations(range(3)), key=lambda p: sum(abs(axes[i, p[i]]) for i in range(3)))
    moments, axes = moments[list(order)], axes[:, list(order)]
    axes = axes * np.where(np.diagonal(axes) < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] = -axes[:, 2]
    return moments, axes


def visible(solid: Shape, size: float) -> Shape:
    """Return a solid whose dimensions are limited relative to the model's ``size`` [m]."""
    halves = half_box(solid)
    factor = min(1.0, 0.5 * LARGEST * size / halves.max()) if size > 0.0 else 1.0
    least = LEAST * size
    # Edges of a box; radius and length of a cylinder; radius of a sphere.
    lower = {1: [least], 2: [least, 2.0 * least], 3: [2.0 * least] * 3}[len(solid["size"])]
    limited = [max(factor * v, low) for v, low in zip(solid["size"], lower, strict=True)]
    return {**solid, "size": floats(limited)}


def marker_of_mass(solid: Shape, reach: float) -> Shape:
    """Return the solid of a link; a sphere, whose body is often given the moment about one axis
    only, at most in proportion to the ``reach`` [m] from the mass centre to its joints."""
    if solid["kind"] != "sphere" or reach == 0.0:
        return solid
    return solid | {"size": [min(solid["size"][0], SHARE * reach)]}


def wheel_radii(ratio: float, distance: float) -> tuple[float, float] | None:
    """Return the radii of two wheels that roll on each other, with their axes at a ``distance``:
    of the first and of the second, whose rate is ``ratio`` times the first's. None for wheels that
    cannot touch."""
    share = abs(ratio)
    if distance <= 0.0 or share == 0.0 or ratio == 1.0:
        return None
    second = distance / (1.0 + share) if ratio < 0.0 else distance / abs(share - 1.0)
    return share * second, second


def links(centre: Sequence[float], points: Sequence[Sequence[float]], radius: float) -> list[Shape]:
    """Return rods from the mass centre to each of the ``points``, in the axes of the body."""
    found: dict[tuple[float, ...], Shape] = {}
    for point in points:
        span = np.subtract(point, centre)
        length = float(np.sqrt(span @ span))
        if length > radius:
            middle = np.add(centre, 0.5 * span)
            found[tuple(point)] = shape("rod", [radius, length], middle, quaternion(along(span)))
    return list(found.values())


def inside(rod: Shape, solid: Shape) -> bool:
    """Return whether a rod lies within the box around a solid, both shapes of one body."""
    R = matrices(rod["orientation"])
    ends = [np.array(rod["position"]) + s * 0.5 * rod["size"][1] * R[:, 2] for s in (-1.0, 1.0)]
    local = [matrices(solid["orientation"]).T @ (end - solid["position"]) for end in ends]
    return all(bool(np.all(np.abs(end) <= half_box(solid))) for end in local)


def contact_shape(joint: Joint, side: str) -> Shape | None:
    """Return the round part by which a joint gives the ``side`` "parent" or "child" its radius;
    None without one, and for a hollow cylinder."""
    point = joint.parent_point if side == "parent" else joint.child_point
    axes = joint.parent_axes if side == "parent" else joint.child_axes
    upright = quaternion(along(axes[2]))
    parameters, solid = dict(joint.parameters), KINDS[joint.kind].solid
    radius = parameters.get(f"{side}Radius", 0.0)
    if side == "child" and "radius" in parameters:
        radius = parameters["radius"]
    if not solid or radius <= 0.0:
        return None
    if solid == "sphere":
        return shape(solid, [radius], point)
    width = THIN if solid == "disc" else LONG
    return shape(solid, [radius, width * radius], point, upright)
