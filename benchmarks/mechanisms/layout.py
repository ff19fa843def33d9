"""A model at t = 0 in inertial axes, from which every other program's model is set up.

Local axes of all bodies are inertial at t = 0 and their origins are the mass centres, so a point of
a body is given by its place at t = 0. The joints are divided into a spanning tree, which programs
of minimal coordinates build, and those that close its loops. Joints that such a program has as
coordinates enter the tree first, and of these the ones on the ground; ball joints, whose closing
takes three equations only, last.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.model import ConcentratedLoad, Joint, JointSpring, Model, RigidBody, SpringDamper

RANK = {"revolute": 0, "prismatic": 0, "universal": 1, "spherical": 2, "pointOnLine": 3}
PARALLEL = 1e-12
"""Largest component of a unit vector along another that counts as zero."""


@dataclass(frozen=True, slots=True)
class Mass:
    """A body at its mass centre."""

    name: str
    mass: float
    inertia: np.ndarray  # about the mass centre [kg m^2]
    x: np.ndarray
    v: np.ndarray
    w: np.ndarray


@dataclass(frozen=True, slots=True)
class Hinge:
    """A joint from the body ``inner``, nearer to the ground if it is in the tree, to ``outer``.

    ``axis`` belongs to the inner body; ``second``, of a universal joint, to the outer one. In a
    plane, "pointOnLine" is a hinge too, by those of its equations that others do not imply.
    """

    name: str
    kind: str
    inner: str
    outer: str
    point: np.ndarray
    axis: np.ndarray
    second: np.ndarray
    damping: float  # [N m s/rad]

    @property
    def axes(self) -> list[np.ndarray]:
        """The axes about which, or along which, it moves; none of a ball joint."""
        if self.kind == "spherical":
            return []
        return [self.axis, self.second] if self.kind == "universal" else [self.axis]


@dataclass(frozen=True, slots=True)
class Spring:
    """A spring-damper between a point of each of two bodies."""

    pair: tuple[str, str]
    points: tuple[np.ndarray, np.ndarray]
    stiffness: float
    damping: float
    free: float


@dataclass(frozen=True, slots=True)
class Gear:
    """The outer angle of the joint ``second`` is ``ratio`` times that of ``first``."""

    first: str
    second: str
    ratio: float


@dataclass(frozen=True, slots=True)
class Layout:
    """All of a model; the ground's name is empty."""

    gravity: np.ndarray
    masses: dict[str, Mass]
    tree: tuple[Hinge, ...]  # from the ground outward
    closing: tuple[Hinge, ...]
    springs: tuple[Spring, ...]
    moments: dict[str, np.ndarray]  # on bodies, constant in inertial axes [N m]
    gears: tuple[Gear, ...]

    def closing_points(self, hinge: Hinge) -> list[np.ndarray]:
        """Points at which ball constraints close a loop as the joint does."""
        second = hinge.kind == "revolute" and self.normal is None
        return [hinge.point, hinge.point + hinge.axis] if second else [hinge.point]

    @property
    def normal(self) -> np.ndarray | None:
        """Normal of the plane if all joints are hinges along it and nothing moves it away."""
        hinges = (*self.tree, *self.closing)
        normal = hinges[0].axis
        along = [h.axis for h in hinges] + [mass.w for mass in self.masses.values()]
        across = [mass.v for mass in self.masses.values()] + [self.gravity]
        flat = all(np.linalg.norm(np.cross(a, normal)) < PARALLEL for a in along)
        flat &= all(abs(a @ normal) < PARALLEL for a in across)
        flat &= all(h.kind in ("revolute", "pointOnLine") for h in hinges)
        return normal if flat else None

    def place(self, name: str) -> np.ndarray:
        """Mass centre of a body, origin of the ground [m]."""
        return self.masses[name].x if name else np.zeros(3)

    def local(self, name: str, point: np.ndarray) -> np.ndarray:
        """A point from the body's mass centre."""
        offset: np.ndarray = point - self.place(name)
        return offset

    def rates(self, hinge: Hinge) -> np.ndarray:
        """Rates at t = 0 of the joint's coordinates; inertial components of a ball joint's."""
        zero = np.zeros(3)
        inner, outer = (
            (m.x, m.v, m.w) if (m := self.masses.get(name)) else (zero, zero, zero)
            for name in (hinge.inner, hinge.outer)
        )
        if hinge.kind == "prismatic":
            speeds = [v + np.cross(w, hinge.point - x) for x, v, w in (inner, outer)]
            return np.array([hinge.axis @ (speeds[1] - speeds[0])])
        relative = outer[2] - inner[2]
        return np.array([a @ relative for a in hinge.axes]) if hinge.axes else relative


@lru_cache(maxsize=2)
def layout(model: Model) -> Layout:
    """Return the layout of ``model``."""
    places = {body.name: _placed(body) for body in model.bodies}
    grounds = [ground.name for ground in model.grounds]
    frames = places | {name: (np.zeros(3), np.eye(3)) for name in grounds}
    names = dict.fromkeys(grounds, "") | {name: name for name in places}
    chosen, closing = _spanning_tree(model.joints, names)
    hinges = {
        joint.name: _hinge(joint, names, frames, _damping(model, joint))
        for joint in (*chosen, *closing)
    }
    return Layout(
        np.array(model.gravity),
        {body.name: _mass(body) for body in model.bodies},
        _outward([hinges[joint.name] for joint in chosen]),
        tuple(hinges[joint.name] for joint in closing),
        tuple(_spring(s, names, frames) for s in model.loads if isinstance(s, SpringDamper)),
        {load.body: np.array(load.moment) for load in model.loads
         if isinstance(load, ConcentratedLoad)},
        tuple(Gear(c.first, c.second, c.ratio) for c in model.couplings),
    )  # fmt: skip


Frame = tuple[np.ndarray, np.ndarray]
"""Origin and axes of a body or of the ground at t = 0."""


def _placed(body: RigidBody) -> Frame:
    return np.array(body.position), np.array(matrix(body.orientation))


def _mass(body: RigidBody) -> Mass:
    x, R = _placed(body)
    v, w, r = (R @ np.array(a) for a in (body.velocity, body.angular_velocity, body.r_BG))
    inertia = R @ np.array(body.inertia) @ R.T
    return Mass(body.name, body.mass, inertia, x + r, v + np.cross(w, r), w)


def _spanning_tree(
    joints: tuple[Joint, ...], names: dict[str, str]
) -> tuple[list[Joint], list[Joint]]:
    """The joints of the tree of smallest ranks (Kruskal's algorithm), and all others."""
    group = {name: name for name in names.values()}
    chosen: list[Joint] = []
    closing: list[Joint] = []

    def rank(joint: Joint) -> tuple[int, bool]:
        return RANK[joint.kind], bool(names[joint.parent] and names[joint.child])

    for joint in sorted(joints, key=rank):
        one, other = group[names[joint.parent]], group[names[joint.child]]
        (closing if one == other else chosen).append(joint)
        group = {name: one if root == other else root for name, root in group.items()}
    return chosen, closing


def _outward(hinges: list[Hinge]) -> tuple[Hinge, ...]:
    """Those of the tree such that the inner end of each is known when it is reached."""
    known, ordered, left = {""}, [], list(hinges)
    while left:
        ready = next(hinge for hinge in left if known & {hinge.inner, hinge.outer})
        left.remove(ready)
        if ready.inner not in known:
            ready = _from_outer(ready)
        known.add(ready.outer)
        ordered.append(ready)
    return tuple(ordered)


def _from_outer(hinge: Hinge) -> Hinge:
    """The same joint seen from its other end."""
    return Hinge(hinge.name, hinge.kind, hinge.outer, hinge.inner, hinge.point,
                 hinge.second, hinge.axis, hinge.damping)  # fmt: skip


def _hinge(joint: Joint, names: dict[str, str], frames: dict[str, Frame], damping: float) -> Hinge:
    (x, R), (_, R_child) = frames[joint.parent], frames[joint.child]
    axis = R @ np.array(joint.parent_axes[2])
    second = R_child @ np.array(joint.child_axes[2]) if joint.kind == "universal" else axis
    point = x + R @ np.array(joint.parent_point)
    if joint.kind == "prismatic":
        origin, axes = frames[joint.child]
        point = origin + axes @ np.array(joint.child_point)
    ends = names[joint.parent], names[joint.child]
    return Hinge(joint.name, joint.kind, *ends, point, axis, second, damping)


def _damping(model: Model, joint: Joint) -> float:
    loads = (load for load in model.loads if isinstance(load, JointSpring))
    return sum(load.damping for load in loads if load.joint == joint.name)


def _spring(spring: SpringDamper, names: dict[str, str], frames: dict[str, Frame]) -> Spring:
    ends = ((spring.parent, spring.parent_point), (spring.child, spring.child_point))
    one, other = (frames[name][0] + frames[name][1] @ np.array(point) for name, point in ends)
    free = spring.free_length
    if free is None:
        free = float(np.linalg.norm(other - one))
    pair = names[spring.parent], names[spring.child]
    return Spring(pair, (one, other), spring.stiffness, spring.damping, free)
