"""A machine as robot files have it: links in a tree, each placed on its parent, and their joints.

All numbers are in SI. A link's frame is that of the file. Its joints move it, one after the other,
away from its ``pose`` on the parent; a link without joints is fixed there.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from msahl.deck.faults import Element


class Pose(NamedTuple):
    """A frame in another one: axes ``R`` (3, 3) and origin ``p`` (3,) [m]."""

    R: np.ndarray
    p: np.ndarray

    def after(self, inner: "Pose") -> "Pose":
        """Return the frame ``inner``, given in this one, in the frame that this one is given in."""
        return Pose(self.R @ inner.R, self.p + self.R @ inner.p)

    def inverse(self) -> "Pose":
        """Return the outer frame in this one."""
        return Pose(self.R.T, -self.R.T @ self.p)


HERE = Pose(np.eye(3), np.zeros(3))
"""The frame itself."""


class Inertia(NamedTuple):
    """Mass [kg], mass centre ``c`` (3,) [m] and inertia tensor ``J`` (3, 3) about it [kg m^2], in
    the axes of a link."""

    mass: float
    c: np.ndarray
    J: np.ndarray

    def seen_from(self, pose: Pose) -> "Inertia":
        """Return the same in the frame in which the link has this ``pose``."""
        return Inertia(self.mass, pose.p + pose.R @ self.c, pose.R @ self.J @ pose.R.T)


NOTHING = Inertia(0.0, np.zeros(3), np.zeros((3, 3)))
"""A link without mass."""


def together(parts: list[Inertia]) -> Inertia:
    """Return the inertia of several bodies that are one, by the parallel-axis theorem:

    J = sum J_i + m_i (d_i.d_i 1 - d_i d_i^T) ,    d_i = c_i - c
    """
    mass = sum(part.mass for part in parts)
    if len(parts) == 1 or mass == 0.0:
        return parts[0] if parts else NOTHING
    c = np.asarray(sum(part.mass * part.c for part in parts) / mass)
    return Inertia(
        mass, c, np.asarray(sum(part.J + about(part.mass, part.c - c) for part in parts))
    )


def about(mass: float, d: np.ndarray) -> np.ndarray:
    """Return m (d.d 1 - d d^T): what a mass at ``d`` adds to the tensor."""
    return np.asarray(mass * ((d @ d) * np.eye(3) - np.outer(d, d)))


@dataclass
class Look:
    """A shape of a link: ``kind``, ``size`` and ``file`` as in ``msahl.model.shapes``."""

    kind: str
    size: tuple[float, ...]
    pose: Pose
    colour: str
    file: str = ""


@dataclass
class Axis:
    """A joint of a link: hinge, slide, screw, ball, free or planar, along or about ``axis`` (3,)
    through ``point`` (3,), both in the link's frame; a screw advances by its ``pitch`` [m] in one
    revolution.

    The coordinate has the value ``zero`` where the link has its pose, and ``value`` at t = 0; of a
    ball ``rotated`` (3, 3) is its rotation at t = 0. ``damping`` and ``stiffness`` are those along
    the coordinate, the spring is unloaded at ``rest``; ``friction`` is the constant magnitude of
    dry friction and ``armature`` the inertia of a rotor, in units of N, m or N m, rad. Those of a
    ball act about each of the link's axes, those of a free joint along and about them. Stops at
    ``lower`` and ``upper`` [rad, m] are those of the element ``limit``; None: there are none.
    """

    name: str
    kind: str
    element: Element
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    zero: float = 0.0
    value: float = 0.0
    rate: float = 0.0
    rotated: np.ndarray = field(default_factory=lambda: np.eye(3))
    damping: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0
    friction: float = 0.0
    armature: float = 0.0
    lower: float | None = None
    upper: float | None = None
    limit: Element | None = None
    pitch: float = 0.0
    crosses: bool = False
    """Whether it and the next axis are those of a universal joint."""
    driven: bool = False
    """Whether an actuator or a relation refers to it."""
    placed: Pose | None = None
    """Of a free joint: where the link is at t = 0, inertial axes; None: at its pose."""
    velocity: tuple[np.ndarray, np.ndarray] = (HERE.p, HERE.p)
    """Of a free joint: velocity [m/s] in inertial axes, angular velocity [rad/s] in the link's;
    of a ball the latter alone."""

    @property
    def coordinate(self) -> str:
        """The name of the coordinate of a hinge, screw or slide."""
        return "slide" if self.kind == "slide" else "angle"


@dataclass
class Link:
    """A link on its ``parent`` ("": the ground)."""

    name: str
    element: Element
    parent: str = ""
    pose: Pose = HERE
    axes: list[Axis] = field(default_factory=list)
    inertia: Inertia = NOTHING
    looks: list[Look] = field(default_factory=list)
    frames: list[tuple[str, Pose]] = field(default_factory=list)
    compensated: float = 0.0
    """Share of its weight that a force at its mass centre takes off."""


@dataclass
class Relation:
    """``second`` = ``ratio`` ``first`` + ``offset`` between coordinates of two joints, by name."""

    first: str
    second: str
    ratio: float
    offset: float
    element: Element


@dataclass
class Closure:
    """A joint between two links ("": the ground) that closes a loop: ``kind`` is that of a joint of
    the deck, whose frame has the ``poses`` in the links where its coordinates are zero. ``axis`` is
    that of a joint with one coordinate, with its forces and stops; ``pitch`` [m] that of a
    screw."""

    name: str
    kind: str
    links: tuple[str, str]
    poses: tuple[Pose, Pose]
    element: Element
    axis: Axis | None = None
    pitch: float = 0.0


@dataclass
class Touch:
    """A contact: spheres of the ``radius`` [m] about the ``points`` (each (3,), axes of ``link``)
    stay above the plane through the origin of ``plane``, which is given in the axes of the link
    ``base``, with its z axis as the normal. ``friction`` is the coefficient of Coulomb's."""

    name: str
    link: str
    points: list[np.ndarray]
    radius: float
    base: str
    plane: Pose
    friction: float
    element: Element


Terms = list[tuple[str, tuple[float, ...]]]
"""A length l = sum c q: the coefficients c of coordinates q of joints, by their names. A hinge or a
slide has one, a ball three, of its rotation vector in the axes of the link."""


@dataclass
class Control:
    """A control of an actuator: a signal with a ``value``, for which {u} stands in expressions.
    With a ``rate`` the actuator has a state as well, for which {a} stands: it begins at
    ``activation`` and has this rate, an expression of both."""

    value: float = 0.0
    rate: str = ""
    activation: float = 0.0


@dataclass
class Drive:
    """A force f along a length l, the sum of ``terms``: it loads each coordinate by c f. f is the
    ``expression``, in which {l} and {v} stand for the length and its rate, and those of the
    ``control`` for its values; None: there is none."""

    name: str
    terms: Terms
    expression: str
    control: Control | None
    element: Element


@dataclass
class Thrust:
    """A ``force`` (3,) [N] at the origin of the frame ``place`` of a ``link`` and a ``moment`` (3,)
    [N m], both in the axes of that frame, times the ``expression`` of its ``control``."""

    name: str
    link: str
    place: Pose
    force: np.ndarray
    moment: np.ndarray
    expression: str
    control: Control
    element: Element


@dataclass
class Robot:
    """What a file says: links in an order in which parents come first."""

    name: str
    links: dict[str, Link]
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    relations: list[Relation] = field(default_factory=list)
    closures: list[Closure] = field(default_factory=list)
    drives: list[Drive] = field(default_factory=list)
    thrusts: list[Thrust] = field(default_factory=list)
    touches: list[Touch] = field(default_factory=list)
