"""Models with events, and the numbers that follow from closed forms."""

from msahl.algebra.functions import Law
from msahl.expressions.conditions import margin
from msahl.expressions.syntax import parse
from msahl.model import Coupling, Event, Group, Joint, JointMotion, JointSpring, Marker
from tests.support.models import GROUND, body, build_model

DOWN = (0.0, 0.0, -9.81)
ORIGIN = (0.0, 0.0, 0.0)
Z_AXIS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
Y_AXIS = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def event(name, condition, releases=(), engages=(), **others):
    return Event(name, condition, margin(parse(condition)), releases, engages, **others)


def revolute(name, parent, child, parent_point=ORIGIN, child_point=ORIGIN, axes=Z_AXIS):
    return Joint(name, "revolute", parent, child, parent_point, child_point, axes, axes)


def pendulum(condition, kind="spherical", **others):
    """A bob of 1 kg at 1 m, let go from the horizontal and released at a condition."""
    bodies = [body("Bob", 1.0, 0.01, (1.0, 0.0, 0.0))]
    if kind == "revolute":
        joint = revolute("Pivot", GROUND.name, "Bob", child_point=(-1.0, 0.0, 0.0), axes=Y_AXIS)
    else:
        joint = Joint("Pivot", kind, GROUND.name, "Bob", ORIGIN, (-1.0, 0.0, 0.0))
    markers = (Marker("Tip", "Bob", ORIGIN, Z_AXIS),)
    events = (event("LetGo", condition, ("Pivot",)),)
    given = {"gravity": DOWN, "markers": markers, "events": events, "t_final": 1.0} | others
    return build_model(bodies, [joint], **given)


def flywheels(condition="t >= 0.5", ratio=1.0, **others):
    """Two flywheels on one axis, and a clutch between them; the first has 10 rad/s."""
    bodies = [
        body("First", 2.0, 0.02, angular_velocity=(0.0, 0.0, 10.0)),
        body("Second", 1.0, 0.03, (0.0, 0.0, 1.0)),
    ]
    joints = [
        revolute("A", GROUND.name, "First"),
        revolute("B", GROUND.name, "Second", parent_point=(0.0, 0.0, 1.0)),
    ]
    clutch = Coupling("Clutch", "gear", "A", "B", ratio)
    events = (event("Shift", condition, engages=("Clutch",)),)
    given = {"couplings": (clutch,), "events": events, "released": ("Clutch",), "t_final": 1.0}
    return build_model(bodies, joints, **(given | others))


def catch(**others):
    """A mass of 1 kg falls by 0.5 m on a plate of 2 kg on a spring, which catches it."""
    bodies = [body("Plate", 2.0, 0.01), body("Mass", 1.0, 0.01, (0.0, 0.0, 0.5))]
    joints = [
        Joint("Guide", "prismatic", GROUND.name, "Plate", ORIGIN, ORIGIN, Z_AXIS, Z_AXIS),
        Joint("Way", "prismatic", "Plate", "Mass", ORIGIN, (0.0, 0.0, -0.5), Z_AXIS, Z_AXIS),
    ]
    loads = [JointSpring("Spring", "Guide", "slide", 400.0, 0.0, 2.0 * 9.81 / 400.0)]
    motions = (JointMotion("Latch", "Way", "slide", Law("constant", (0.0,))),)
    events = (event("Catch", "Way.slide <= -0.5", engages=("Latch",)),)
    given = {"motions": motions, "events": events, "released": ("Latch",), "t_final": 1.0}
    return build_model(bodies, joints, loads, gravity=DOWN, **(given | others))


def docking(**others):
    """Two free bodies whose points meet; there a ball joint is engaged."""
    bodies = [
        body("A", 1.0, (0.02, 0.03, 0.04), velocity=(1.0, 0.0, 0.0)),
        body("B", 2.0, (0.05, 0.04, 0.03), (1.0, 0.2, 0.1), velocity=(-0.5, 0.3, 0.0)),
    ]
    # Both points are at (0.5, 0, 0.1) at 0.3 s: bodies without rotation move evenly.
    meet, t = (0.5, 0.0, 0.1), 0.3
    s_a = tuple(p - (x + t * v) for p, x, v in zip(meet, (0.0,) * 3, (1.0, 0.0, 0.0), strict=True))
    s_b = tuple(
        p - (x + t * v) for p, x, v in zip(meet, (1.0, 0.2, 0.1), (-0.5, 0.3, 0.0), strict=True)
    )
    joints = [Joint("Dock", "spherical", "A", "B", s_a, s_b)]
    markers = (Marker("PA", "A", s_a, Z_AXIS), Marker("PB", "B", s_b, Z_AXIS))
    events = (event("Meet", "PB.x <= PA.x", engages=("Dock",)),)
    given = {"markers": markers, "events": events, "released": ("Dock",), "t_final": 1.0}
    given["groups"] = (Group("All", ("A", "B")),)
    return build_model(bodies, joints, **(given | others))


def door(*events):
    """A door of 5 kg on two hinges with one axis, in an oblique field of gravity, and a brake."""
    hinges = [
        revolute(name, GROUND.name, "Door", (0.0, 0.0, z), (-0.5, 0.0, z))
        for name, z in (("Low", -0.5), ("High", 0.5))
    ]
    brake = JointMotion("Brake", "High", "angle", Law("constant", (0.0,)))
    return build_model(
        [body("Door", 5.0, (0.5, 0.6, 0.7), (0.5, 0.0, 0.0))],
        hinges,
        gravity=(3.0, 5.0, -8.0),
        motions=(brake,),
        events=events,
        released=("Brake",),
    )
