"""Random closed loops of bodies, with springs, dampers and an actuator with an auxiliary state."""

from msahl.expressions.syntax import parse
from msahl.model import JointActuator, JointSpring, Marker, Signal, SignalState, SpringDamper
from tests.support.element_samples import joint_between, random_frame
from tests.support.models import GROUND, build_model, random_body, random_vector

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
