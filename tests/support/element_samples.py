"""One random model of two or three bodies for every kind of element, and its degrees of freedom.

A new kind of joint needs one entry in ``JOINTS``; a new load, motion or coupling one in the table
of its own.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.algebra.surfaces import Surface
from msahl.algebra.vector import ZERO
from msahl.check.directions import frame
from msahl.expressions.syntax import Call, Lookup, Name, parse
from msahl.laws.registry import JOINT_LAWS, POINT_LAWS
from msahl.model import (
    BoxContact,
    Bushing,
    CapsuleContact,
    Compliance,
    ConcentratedLoad,
    Coupling,
    Curve,
    CurvePart,
    DistanceLimit,
    Joint,
    JointActuator,
    JointLimit,
    JointLoad,
    JointMotion,
    JointSpring,
    Law,
    Marker,
    MarkerActuator,
    PinContact,
    PlaneContact,
    PointLoad,
    PointMotion,
    Signal,
    SignalState,
    SignalTable,
    SphereContact,
    SpringDamper,
)
from tests.support.models import (
    GROUND,
    build_model,
    free_bodies,
    friction,
    jointed,
    loaded,
    random_body,
    random_vector,
    tensor,
)

X, Y, Z = np.eye(3)
HERE = np.zeros(3)

# Joints ------------------------------------------------------------------------------------------


@dataclass
class Screw:
    """A finite motion: a rotation about ``axis`` through ``point``, with ``lead`` [m/rad] along it.

    A rotation of zero with a lead is a slide: ``rotating`` says which.
    """

    axis: np.ndarray
    point: np.ndarray
    lead: float = 0.0
    rotating: bool = True

    def twist(self):
        """(6,) velocity of the origin's material point, and spin."""
        if not self.rotating:
            return np.concatenate([self.axis, HERE])
        return np.concatenate([self.lead * self.axis - np.cross(self.axis, self.point), self.axis])

    def displacement(self, amount):
        """Matrix and shift of a motion by ``amount`` [rad or m]: x -> A x + c."""
        if not self.rotating:
            return np.eye(3), amount * self.axis
        A = np.array(matrix(from_axis_angle(tuple(self.axis), amount)))
        return A, self.point - A @ self.point + amount * self.lead * self.axis


def rotation(axis, point=HERE, lead=0.0):
    return Screw(np.asarray(axis), np.asarray(point), lead)


def rotations(point=HERE):
    return [rotation(axis, point) for axis in (X, Y, Z)]


def slide(axis):
    return Screw(np.asarray(axis), HERE, rotating=False)


@dataclass
class Sample:
    """A joint in the axes of the parent's frame: the child's point, x, y, z of its frame, what it
    may do."""

    free: list[Screw]
    at: np.ndarray = field(default_factory=lambda: HERE)
    axes: tuple = (X, Y, Z)
    parameters: tuple[tuple[str, float], ...] = ()
    on_ground: bool = False
    of_rates: bool = False  # its degrees of freedom are not to be added up to finite ones


TILT = np.sin(0.7) * X + np.cos(0.7) * Z
TILTED = (np.cross(Y, TILT), Y, TILT)
LYING = (Y, Z, X)
SKEW = 0.5 * Y + 0.4 * Z + 0.3 * TILT
HUB = 0.5 * np.sin(0.7) * Z
RIM = 0.5 * np.cos(0.7) * X

JOINTS = {
    "rigid": Sample([]),
    "revolute": Sample([rotation(Z)]),
    "prismatic": Sample([slide(Z)], 0.2 * Z),
    "cylindrical": Sample([rotation(Z), slide(Z)], 0.2 * Z),
    "spherical": Sample(rotations()),
    "planar": Sample([slide(X), slide(Y), rotation(Z)], 0.5 * X - 0.3 * Y),
    "parallelCylinders": Sample(
        [rotation(Z), rotation(Z, 0.5 * X), slide(Z)],
        0.5 * X + 0.7 * Z,
        parameters=(("parentRadius", 0.3), ("childRadius", 0.2)),
    ),
    "edgeSlider": Sample(
        [slide(X), slide(Y), rotation(Z), rotation(X, 0.3 * Y)], 0.5 * X + 0.3 * Y, LYING
    ),
    "cylindricalSlider": Sample(
        [slide(X), slide(Y), rotation(Z), rotation(X, 0.3 * Y + 0.3 * Z)],
        0.5 * X + 0.3 * Y + 0.3 * Z,
        LYING,
        (("radius", 0.3),),
    ),
    "pointSlider": Sample([slide(X), slide(Y), *rotations(0.5 * X)], 0.5 * X),
    "sphericalSlider": Sample(
        [slide(X), slide(Y), *rotations(0.5 * X + 0.3 * Z)],
        0.5 * X + 0.3 * Z,
        parameters=(("radius", 0.3),),
    ),
    "crossedCylinders": Sample(
        [slide(Z), slide(TILT), rotation(Z), rotation(TILT, SKEW), rotation(Y)],
        SKEW,
        TILTED,
        (("parentRadius", 0.3), ("childRadius", 0.2)),
    ),
    "universal": Sample([rotation(Z), rotation(X)], axes=LYING),
    "screw": Sample([rotation(Z, lead=0.3 / (2 * np.pi))], 0.2 * Z, parameters=(("pitch", 0.3),)),
    "distance": Sample(
        [*rotations(0.9 * X), rotation(Y), rotation(Z)], 0.9 * X, parameters=(("length", 0.9),)
    ),
    "pointOnLine": Sample([slide(Z), *rotations(0.2 * Z)], 0.2 * Z),
    "knifeEdge": Sample(
        [slide(X), slide(Y), *rotations(0.5 * X)], 0.5 * X, on_ground=True, of_rates=True
    ),
    "rollingDisk": Sample(
        rotations(RIM), HUB, TILTED, (("radius", 0.5),), on_ground=True, of_rates=True
    ),
}


@dataclass
class Frame:
    """The frame of a joint in space: its point, and the matrix whose columns are x, y, z."""

    point: np.ndarray
    R: np.ndarray


def random_matrix(rng):
    return np.array(matrix(from_axis_angle(random_vector(rng), rng.uniform(-np.pi, np.pi))))


def random_frame(rng):
    return Frame(rng.normal(size=3), random_matrix(rng))


def vector(array):
    return tuple(float(x) for x in array)


def end(bodies, name, point, R):
    """A point and axes (columns of ``R``) in space as those of a body: (point, axes as rows)."""
    for own in bodies:
        if own.name == name:
            A = np.array(matrix(own.orientation))
            return vector(A.T @ (point - np.array(own.position))), tensor((A.T @ R).T)
    return vector(point), tensor(R.T)


def joint_between(bodies, kind, name, parent, child, frame, sample=None):
    """The joint ``kind`` of its sample at ``frame``."""
    sample = sample or JOINTS[kind]
    R = frame.R @ np.column_stack(sample.axes)
    parent_point, parent_axes = end(bodies, parent, frame.point, frame.R)
    child_point, child_axes = end(bodies, child, frame.point + frame.R @ sample.at, R)
    return Joint(
        name,
        kind,
        parent,
        child,
        parent_point,
        child_point,
        parent_axes,
        child_axes,
        sample.parameters,
    )


def joint_model(kind, rng, gravity=True):
    """Two bodies, or one on the ground, between them the joint."""
    sample = JOINTS[kind]
    bodies = [random_body(rng, name) for name in ("A", "B")]
    frame = random_frame(rng)
    bodies = bodies[1:] if sample.on_ground else bodies
    parent = GROUND.name if sample.on_ground else "A"
    joint = joint_between(bodies, kind, "J", parent, "B", frame)
    return build_model(bodies, [joint], gravity=random_vector(rng, 5.0) if gravity else ZERO)


# Couplings, motions, loads -----------------------------------------------------------------------

WAVE = Law("polynomial", (0.2, 0.7, -0.4, 0.3))
CAM = Law(
    "periodic",
    (*(2 * np.pi * k / 6 for k in range(7)), 0.0, 0.1, 0.25, 0.3, 0.2, 0.05, 0.0),
)
TABLE = Law("cubic", (-9.0, -3.0, -1.0, 0.0, 1.0, 2.0, 9.0, -40.0, -9.0, -2.0, 0.3, 1.5, 6.0, 50.0))


def jointed_bodies(rng, gravity, *kinds):
    """A free base ``A`` that holds a body by each kind of joint: bodies B0, B1, joints J0, J1."""
    bodies = [random_body(rng, name) for name in ("A", *(f"B{k}" for k in range(len(kinds))))]
    joints = [
        joint_between(bodies, kind, f"J{k}", "A", f"B{k}", random_frame(rng))
        for k, kind in enumerate(kinds)
    ]
    return build_model(bodies, joints, gravity=random_vector(rng, 5.0) if gravity else ZERO)


def coupled(kind, first, second, **numbers):
    def make(rng, gravity=True):
        model = jointed_bodies(rng, gravity, first, second)
        return replace(model, couplings=(Coupling("C", kind, "J0", "J1", **numbers),))

    return make


def driven(kind, coordinate, law):
    def make(rng, gravity=True):
        model = jointed_bodies(rng, gravity, kind)
        return replace(model, motions=(JointMotion("D", "J0", coordinate, law),))

    return make


def point_moved(rng, gravity=True):
    model = free_bodies(rng, 1, gravity)
    law = Law("sine", (0.3, 2.0, 0.4, 0.1))
    direction = np.array(random_vector(rng))
    motion = PointMotion(
        "P", "B0", random_vector(rng), vector(direction / np.linalg.norm(direction)), law
    )
    return replace(model, motions=(motion,))


def along_joint(kind, *loads):
    def make(rng, gravity=True):
        return replace(jointed_bodies(rng, gravity, kind), loads=loads)

    return make


def between(make_load):
    """Two free bodies and a load between them."""

    def make(rng, gravity=True):
        model = free_bodies(rng, 2, gravity)
        return replace(model, loads=(make_load(rng, model),))

    return make


def spring(rng, model, **numbers):
    return SpringDamper("S", "B0", "B1", random_vector(rng), random_vector(rng), **numbers)


def bushing(rng, model):
    frame = random_frame(rng)
    (a, a_axes), (b, b_axes) = (end(model.bodies, f"B{k}", frame.point, frame.R) for k in range(2))
    stiffness, damping = ((vector(rng.uniform(0, s, size=6))) for s in (9.0, 1.0))
    return Bushing("S", "B0", "B1", a, b, a_axes, b_axes, stiffness, damping)


def at_a_point(law):
    """A body with a force by a law of the velocity of one of its points."""

    def make(rng, gravity=True):
        model, parameters = free_bodies(rng, 1, gravity), sample_parameters(law)
        return replace(
            model, loads=(PointLoad("P", law.name, "B0", random_vector(rng), parameters),)
        )

    return make


def on_a_joint(law):
    """A force by a law along each coordinate of a cylindrical joint."""
    return along_joint(
        "cylindrical",
        *(
            JointLoad(name, law.name, "J0", name, sample_parameters(law, name))
            for name in ("slide", "angle")
        ),
    )


def sample_parameters(law, coordinate=""):
    """Numbers of a law, different ones between its bounds."""
    values = (
        (field, 1.0 if field.quantity_along(coordinate) is None else 0.6 + 0.1 * k)
        for k, field in enumerate(law.fields)
    )
    bounds = ((field, max(field.least, field.above), value) for field, value in values)
    return tuple((field.name, max(value, bound + value)) for field, bound, value in bounds)


def pushed_by_a_law(rng, gravity=True):
    model = jointed(rng, 2, gravity)
    push = ConcentratedLoad(
        *("L", "B0", random_vector(rng), random_vector(rng, 4.0), "B1"),
        *(random_vector(rng), "B0", Law("sine", (1.0, 5.0, 0.3, 0.5))),
    )
    return replace(model, loads=(push,))


CONTROL = (
    Signal("error", parse("J1.slide - 0.3*sin(2*t) + 0.2*J0.angle^2")),
    SignalState("i", parse("error - 0.5*i + 0.1*J1.slideRate*k"), 0.3),
    SignalState("k", parse("-k^3 - i*J0.angleRate"), -0.2),
    SignalTable("cam", CAM),
    SignalTable(
        "map",
        Surface(
            "cubic",
            (-4.0, -1.0, 1.0, 5.0),
            (-9.0, 0.0, 9.0),
            ((1.0, 2.0, -1.0), (0.0, 1.5, 2.0), (3.0, -1.0, 0.0), (0.5, 0.2, 1.0)),
        ),
    ),
)


def controlled(rng, gravity=True):
    """Two joints with actuators by each other's coordinates, by auxiliary states and tables."""
    loads = (
        JointActuator("Motor", "J0", "angle", parse("-4*error*J0.angleRate - 3*i + cam(J0.angle)")),
        JointActuator("Ram", "J1", "slide", parse("2*k*J0.angle - J1.slideRate*map(error, k)")),
    )
    model = jointed_bodies(rng, gravity, "revolute", "prismatic")
    return replace(model, loads=loads, signals=CONTROL)


def steered(rng, gravity=True):
    """Two free bodies with an actuator between markers, by all values of markers."""
    model = free_bodies(rng, 2, gravity)
    markers = tuple(
        Marker(name, body, random_vector(rng), tensor(random_matrix(rng)))
        for name, body in (("M", "B0"), ("N", "B1"))
    )
    values = "M.x*N.y - M.z*N.vx + N.vy*M.vz - M.q0*N.q1 + M.q2*N.q3 + N.wx*M.wy - M.wz"
    states = (SignalState("s", parse("N.wx - s*M.q1"), 0.1), Signal("all", parse(values)))
    push = MarkerActuator("P", "M", "N", parse("3*all + 0.7*s"))
    return replace(model, loads=(push,), markers=markers, signals=states)


def pushed_by_an_expression(rng, gravity=True):
    """A load on one body, in the axes of another one, by the motion of both."""
    model = jointed(rng, 2, gravity)
    push = ConcentratedLoad(
        *("L", "B0", random_vector(rng), random_vector(rng, 4.0), "B1"),
        *(random_vector(rng), "B0", None, parse("0.4 + M.vx*s - N.q2*M.wz")),
    )
    markers = tuple(
        Marker(name, body, random_vector(rng)) for name, body in (("M", "B0"), ("N", "B1"))
    )
    states = (SignalState("s", parse("N.vy - s*M.q1"), 0.1),)
    return replace(model, loads=(push,), markers=markers, signals=states)


SPRING = {"stiffness": 20.0, "damping": 0.5}
COUPLINGS = {
    "gear": coupled("gear", "revolute", "revolute", ratio=-0.7),
    "gear, cylindrical": coupled("gear", "cylindrical", "screw", ratio=1.3),
    "rackAndPinion": coupled("rackAndPinion", "revolute", "prismatic", ratio=0.4),
    "camFollower": coupled("camFollower", "revolute", "prismatic", lift=CAM),
}
MOTIONS = {
    "jointMotion": driven("revolute", "angle", WAVE),
    "jointMotion, slide": driven("prismatic", "slide", Law("sine", (0.3, 3.0, 0.0, 0.0))),
    "jointMotion, cylindrical": driven("cylindrical", "angle", Law("ramp", (0.0, 1.0, 0.0, 0.4))),
    "jointMotion, table": driven(
        "revolute", "angle", Law("cubic", (0.0, 0.3, 0.5, 1.0, 0.0, 0.2, 0.1, 0.9))
    ),
    "pointMotion": point_moved,
}
LOADS = {
    "concentrated": loaded,
    "concentrated, law": pushed_by_a_law,
    "concentrated, expression": pushed_by_an_expression,
    "springDamper": between(
        lambda rng, model: spring(rng, model, **SPRING, free_length=0.8, preload=0.5)
    ),
    "springDamper, as it is": between(lambda rng, model: spring(rng, model, **SPRING)),
    "springDamper, table": between(
        lambda rng, model: spring(
            rng, model, stiffness=0.0, damping=0.3, free_length=1.0, table=TABLE
        )
    ),
    "springDamper, compliance": between(
        lambda rng, model: spring(
            rng, model, **SPRING, free_length=0.8, preload=0.5, compliance=True
        )
    ),
    "torsionalSpringDamper": along_joint(
        "cylindrical",
        JointSpring("S", "J0", "angle", 7.0, 0.4, 0.3, 0.5),
        JointSpring("T", "J0", "angle", 0.0, 0.0, 0.1, 0.0, TABLE),
    ),
    "slideSpringDamper": along_joint(
        "prismatic",
        JointSpring("S", "J0", "slide", 40.0, 0.4, 0.3, 0.5),
        JointSpring("T", "J0", "slide", 0.0, 0.2, 0.1, 0.0, TABLE),
    ),
    "torsionalSpringDamper, compliance": along_joint(
        "cylindrical", JointSpring("S", "J0", "angle", 7.0, 0.4, 0.3, 0.5, compliance=True)
    ),
    "slideSpringDamper, compliance": along_joint(
        "prismatic", JointSpring("S", "J0", "slide", 40.0, 0.4, 0.3, 0.5, compliance=True)
    ),
    "bushing": between(bushing),
    "bushing, compliance": between(
        lambda rng, model: replace(bushing(rng, model), compliance=True)
    ),
    **{name: at_a_point(law) for name, law in POINT_LAWS.items()},
    "actuator": controlled,
    "actuator, markers": steered,
    **{name: on_a_joint(law) for name, law in JOINT_LAWS.items()},
    "friction": along_joint("revolute", friction("F", "J0", "angle", 0.3, 0.1, 0.5)),
    "friction, slide": along_joint("prismatic", friction("F", "J0", "slide", 0.2, 1.0, 0.5)),
    "friction, cylindrical": along_joint(
        "cylindrical",
        friction("F", "J0", "slide", 0.2, 1.0, 0.5),
        friction("G", "J0", "angle", 0.2, 0.1, 0.5),
    ),
}


SOFT = {"restitution": 0.6, "compliance": Compliance(3.0, 1.5, 20.0)}
"""Of contacts that are so deep that random motions do not leave them."""
ROUGH = {"restitution": 0.6, "compliance": Compliance(3.0, 1.5, 20.0, 0.5), "friction": 0.4}
"""The same with friction, whose width random slips pass."""
FAST = ROUGH | {"compliance": Compliance(3.0, 1.5, 20.0, 20.0)}
"""Likewise of a rim and of capsules, which slip by many m/s: tests resolve this width."""


def in_contact(contact):
    """Two free bodies, or two with a cylindrical joint, and a compliant contact."""

    def make(rng, gravity=True):
        is_limit = isinstance(contact, JointLimit)
        model = (
            jointed_bodies(rng, gravity, "cylindrical")
            if is_limit
            else free_bodies(rng, 2, gravity)
        )
        return replace(model, contacts=(contact,))

    return make


PIN = PinContact(
    *("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2)),
    Curve((0.5, 0.0), (CurvePart("arc", ((0.0, 0.5), (-0.5, 0.0))),), closed=True),
    6.0,
    axes=frame((0.6, 0.0, 0.8)),
    reference=(0.0, 0.6, 0.8),
    **SOFT,
)
CAPSULES = (
    *("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2)),
    *((0.6, 0.0, 0.8), (0.0, 0.6, 0.8), 0.3, 0.4, 4.0, 2.0),
)
CONTACTS = {
    "jointLimit": in_contact(JointLimit("C", "J0", "slide", 5.0, None, **SOFT)),
    "jointLimit, angle": in_contact(JointLimit("C", "J0", "angle", None, -5.0, **SOFT)),
    "distanceLimit": in_contact(
        DistanceLimit("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2), lower=6.0, **SOFT)
    ),
    "planeContact": in_contact(
        PlaneContact(
            *("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2), (0.6, 0.0, 0.8)),
            radius=6.0,
            **SOFT,
        )
    ),
    "sphereContact": in_contact(
        SphereContact("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2), 4.0, 2.0, **SOFT)
    ),
    "cylinderContact": in_contact(
        SphereContact(
            *("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2), 4.0, 2.0, (0.6, 0.0, 0.8)),
            **SOFT,
        )
    ),
    "sphereContact, hollow": in_contact(
        SphereContact("C", "B0", "B1", (3.0, 0.2, -0.3), (0.4, 0.0, 0.2), -0.3, 0.1, **SOFT)
    ),
    "boxContact": in_contact(
        BoxContact("C", "B0", "B1", (3.0, 0.2, -0.3), (0.4, 0.0, 0.2), (0.3, 0.5, 0.2), 6.0, **SOFT)
    ),
    "boxContact, friction": in_contact(
        BoxContact(
            *("C", "B0", "B1", (3.0, 0.2, -0.3), (0.4, 0.0, 0.2), (0.3, 0.5, 0.2)), 6.0, **ROUGH
        )
    ),
    "capsuleContact": in_contact(CapsuleContact(*CAPSULES, **SOFT)),
    "capsuleContact, friction": in_contact(CapsuleContact(*CAPSULES, **FAST)),
    "pinContact": in_contact(PIN),
    "pinContact, friction": in_contact(replace(PIN, **ROUGH)),
    "planeContact, disk": in_contact(
        PlaneContact(
            *("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2), (0.6, 0.0, 0.8)),
            radius=9.0,
            axis=(0.0, 0.6, 0.8),
            **SOFT,
        )
    ),
    "planeContact, disk with friction": in_contact(
        PlaneContact(
            *("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2), (0.6, 0.0, 0.8)),
            radius=9.0,
            axis=(0.0, 0.6, 0.8),
            **FAST,
        )
    ),
    "planeContact, friction": in_contact(
        PlaneContact(
            *("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2), (0.6, 0.0, 0.8)),
            radius=6.0,
            **ROUGH,
        )
    ),
    "sphereContact, friction": in_contact(
        SphereContact("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2), 4.0, 2.0, **ROUGH)
    ),
    "cylinderContact, friction": in_contact(
        SphereContact(
            *("C", "B0", "B1", (0.1, 0.2, -0.3), (0.4, 0.0, 0.2), 4.0, 2.0, (0.6, 0.0, 0.8)),
            **ROUGH,
        )
    ),
}


def of_kind(kind: str) -> Callable:
    return lambda rng, gravity=True: joint_model(kind, rng, gravity)


POINTS = {
    "rigidBody": free_bodies,
    "ground": jointed,
    "chain": lambda rng, gravity=True: jointed(rng, 5, gravity, grounded=False),
}
"""Bodies and what holds them to each other and the ground at points."""

ELEMENTS = {
    **POINTS,
    **{kind: of_kind(kind) for kind in JOINTS},
    **COUPLINGS,
    **MOTIONS,
    **LOADS,
    **CONTACTS,
}


def everything(rng, gravity=True):
    """All of the above in one model, held together by weak springs: one subsystem."""
    complete, leaders = side_by_side([make(rng, gravity) for make in ELEMENTS.values()])
    ties = [
        SpringDamper(f"Tie{k}", a, b, random_vector(rng), random_vector(rng), 0.5, 0.01)
        for k, (a, b) in enumerate(pairwise(leaders))
    ]
    return replace(complete, loads=(*complete.loads, *ties))


def side_by_side(parts):
    """All ``parts`` in one model, with the gravity of the first, and their first bodies' names."""
    renamed = [_renamed(part, f"{k}") for k, part in enumerate(parts)]
    kinds = ("bodies", "joints", "couplings", "motions", "contacts", "loads", "markers", "signals")
    everyone = {
        kind: tuple(element for part in renamed for element in getattr(part, kind))
        for kind in kinds
    }
    return replace(parts[0], **everyone), [part.bodies[0].name for part in renamed]


REFERENCES = ("name", "parent", "child", "body", "joint", "first", "second", "start", "end")
EXPRESSIONS = ("expression", "rate")
BASES = ("force_basis", "moment_basis")


def _renamed(model, mark):
    """The model with ``mark`` behind every name but the ground's."""

    def new(element):
        keys = [key for key in (*REFERENCES, *BASES) if hasattr(element, key)]
        old = {key: getattr(element, key) for key in keys}
        trees = {
            key: _marked(getattr(element, key), mark)
            for key in EXPRESSIONS
            if hasattr(element, key)
        }
        return replace(
            element,
            **{key: n if n == GROUND.name else f"{n}.{mark}" for key, n in old.items()},
            **trees,
        )

    fields = ("bodies", "joints", "couplings", "motions", "contacts", "loads", "markers", "signals")
    return replace(model, **{f: tuple(new(e) for e in getattr(model, f)) for f in fields})


def _marked(tree, mark):
    """The expression with ``mark`` behind every name of an element."""
    if isinstance(tree, Name) and tree.text != "t":
        element, point, value = tree.text.rpartition(".")
        return Name(f"{element}.{mark}.{value}" if point else f"{value}.{mark}")
    if isinstance(tree, Call | Lookup):
        arguments = tuple(_marked(argument, mark) for argument in tree.arguments)
        if isinstance(tree, Lookup):
            return Lookup(f"{tree.table}.{mark}", arguments)
        return Call(tree.function, arguments)
    return tree
