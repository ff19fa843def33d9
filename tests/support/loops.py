"""Random closed loops of bodies, with springs, dampers and an actuator with an auxiliary state."""

import math
from itertools import pairwise

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.expressions.syntax import parse
from msahl.model import JointActuator, JointSpring, Marker, Signal, SignalState, SpringDamper
from tests.support.element_samples import joint_between, random_frame
from tests.support.models import GROUND, body, build_model, random_body, random_vector

MOTIONS = {"revolute": 1, "prismatic": 1, "cylindrical": 2, "spherical": 3}
PLANAR, SPATIAL = "planar", "spatial"


class Frame:
    """A point and axes in space."""

    def __init__(self, point, R):
        self.point, self.R = point, R


def random_loop(rng, kind):
    """A loop that moves: a four-bar in a tilted plane, three of whose equations are redundant, or
    joints of random kinds with seven to nine degrees of freedom between them.
    """
    if kind == PLANAR:
        kinds, tilted = ["revolute"] * 4, random_frame(rng).R
        frames = [Frame(tilted @ [*rng.normal(size=2), 0.0], tilted) for _ in kinds]
    else:
        kinds = []
        while sum(MOTIONS[k] for k in kinds) < 7 or len(kinds) < 4:
            kinds.append(str(rng.choice(list(MOTIONS))))
        kinds[0] = "revolute"
        while sum(MOTIONS[k] for k in kinds) < 7:
            kinds.append("spherical")
        frames = [random_frame(rng) for _ in kinds]
    bodies = [random_body(rng, f"B{k}") for k in range(len(kinds) - 1)]
    names = [GROUND.name, *(body.name for body in bodies), GROUND.name]
    joints = [
        joint_between(bodies, of, f"J{k}", names[k], names[k + 1], frames[k])
        for k, of in enumerate(kinds)
    ]
    ties = [
        SpringDamper(f"S{k}", GROUND.name, body.name, random_vector(rng), random_vector(rng), 9, 1)
        for k, body in enumerate(bodies[:2])
    ]
    loads = (
        *ties,
        JointSpring("Hub", "J0", "angle", 4.0, 0.3, 0.2),
        JointActuator("Motor", "J0", "angle", parse("2*current + 0.3*command")),
    )
    control = (
        Signal("command", parse("M.x - 0.5*J0.angleRate")),
        SignalState("current", parse("command - 2*current - J0.angleRate^2"), 0.4),
    )
    markers = (Marker("M", bodies[-1].name, random_vector(rng)),)
    return build_model(
        bodies,
        joints,
        loads,
        gravity=random_vector(rng, 5.0),
        signals=control,
        markers=markers,
        velocity="massWeighted",
    )


def bennett(angle=1.0, twists=(np.pi / 6.0, 7.0 * np.pi / 18.0)):
    """Bennett's linkage: four revolutes, two equations too many, one degree of freedom.

    Opposite links are alike, and lengths go with the sines of the twists of their axes.
    """
    alpha, beta = twists
    lengths = (1.0, math.sin(beta) / math.sin(alpha))
    quotient = math.sin(0.5 * (beta + alpha)) / math.sin(0.5 * (beta - alpha))
    other = 2.0 * math.atan(quotient / math.tan(0.5 * angle))
    frames, R, point = [], np.eye(3), np.zeros(3)
    for k, about_z in enumerate((angle, other, -angle, -other)):
        frames.append(Frame(point, R))
        R = R @ matrix((0.0, 0.0, 4.0 * math.tan(0.25 * about_z)))
        point = point + lengths[k % 2] * R[:, 0]
        R = R @ matrix((4.0 * math.tan(0.25 * twists[k % 2]), 0.0, 0.0))
    assert np.allclose(point, 0.0, atol=1e-14)
    places = [0.5 * (a.point + b.point) for a, b in pairwise(frames)]
    bodies = [
        body(name, mass=1.0 + k % 2, inertia=(0.02, 0.1, 0.1), position=tuple(place))
        for k, (name, place) in enumerate(zip("ABC", places, strict=True))
    ]
    ends = [("Earth", "A"), ("A", "B"), ("B", "C"), ("Earth", "C")]
    joints = [
        joint_between(bodies, "revolute", f"J{k}", *pair, frame)
        for k, (pair, frame) in enumerate(zip(ends, frames, strict=True))
    ]
    return build_model(bodies, joints, gravity=(0.0, 0.0, -9.81))
