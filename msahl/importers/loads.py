"""Springs, dampers, friction, rotors and gears along the joints of a robot.

Armature is the inertia a of a rotor that a transmission rotates with the joint's coordinate q: its
energy is a q_dot^2/2. The deck has such a rotor: a body on a bearing of the ground with the inertia
a, geared to the joint one to one (for a slide, by a pinion of the radius 1 m).
"""

import numpy as np

from msahl.deck.faults import Element
from msahl.expressions.syntax import parse, quoted
from msahl.importers.joints import Start
from msahl.importers.made import Along, Made
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log
from msahl.importers.robot import Relation
from msahl.importers.spatial_loads import add_ball_loads
from msahl.model import Coupling, Joint, JointActuator, JointSpring, RigidBody

ROTOR_RADIUS = 1.0
"""Radius of gyration [m] of a rotor, which determines its mass. It rotates about its mass centre on
the ground, so its mass is of no effect, but for the sums over all bodies."""


def add_forces(made: Made, options: ImportOptions, log: Log) -> None:
    """Add spring, damper, friction and rotor of every axis."""
    for place in made.along.values():
        axis = place.axis
        if axis.damping or axis.stiffness:
            _add_spring(place, made)
        if axis.friction:
            _add_friction(place, made, options, log)
        if axis.armature:
            add_rotor(place, axis.armature, made)
    for ball in made.balls.values():
        width = options.friction_width[0]
        add_ball_loads(ball, width, made)
        if ball.axis.friction:
            note_friction(ball.axis.element, f"{width:g} rad/s", log)


def _add_spring(place: Along, made: Made) -> None:
    """Add a spring-damper; in a loop, where the coordinate at the start is found by the deck, the
    spring is an expression of the coordinate."""
    axis, name = place.axis, made.names.unique(f"{place.axis.name} spring")
    loose = place.start.approximate and axis.stiffness
    along = name, place.joint, place.coordinate
    if axis.damping or not loose:
        k = 0.0 if loose else axis.stiffness
        free = axis.rest - axis.value if k else 0.0
        made.loads.append(JointSpring(*along, k, axis.damping, free))
    if loose:
        q = quoted(f"{place.joint}.{place.coordinate}")
        add_actuator(name, place, f"-{axis.stiffness!r}*({q} - ({axis.rest!r}))", made)


def _add_friction(place: Along, made: Made, options: ImportOptions, log: Log) -> None:
    """Add dry friction of constant magnitude, regularised by tanh as friction in decks is."""
    width = options.friction_width[place.coordinate != "angle"]
    v = quoted(f"{place.joint}.{place.coordinate}Rate")
    name = f"{place.axis.name} friction"
    add_actuator(name, place, f"-{place.axis.friction!r}*tanh({v}/{width!r})", made)
    unit = "rad/s" if place.coordinate == "angle" else "m/s"
    note_friction(place.axis.element, f"{width:g} {unit}", log)


def note_friction(element: Element, rate: str, log: Log) -> None:
    """Note that the dry friction of an element rises with the rate, and what its width is."""
    message = f"dry friction is regularised: it rises to 76 % of its limit at {rate}"
    log.changed(element, message)


def add_actuator(name: str, place: Along, text: str, made: Made) -> None:
    """Add a load along a coordinate: an expression."""
    name = made.names.unique(name)
    made.loads.append(JointActuator(name, place.joint, place.coordinate, parse(text)))


def add_rotor(place: Along, inertia: float, made: Made) -> str:
    """Add a rotor that rotates with a coordinate, and return the name of its bearing."""
    name = made.body_names.unique(f"{place.axis.name} rotor")
    bearing = made.names.unique(f"{place.axis.name} bearing")
    diagonal = tuple(map(tuple, (inertia * np.eye(3)).tolist()))
    rest = ((0.0, 0.0, 0.0),) * 5
    made.bodies.append(RigidBody(name, inertia / ROTOR_RADIUS**2, rest[0], diagonal, *rest[1:]))  # type: ignore[arg-type]
    made.joints.append(Joint(bearing, "revolute", made.ground, name, *rest[:2]))
    rate = place.start.rates.get(f"{place.coordinate}Rate", 0.0)
    made.starts[bearing] = Start({"angle": 0.0}, {"angleRate": rate} if rate else {})
    kind = "gear" if place.coordinate == "angle" else "rackAndPinion"
    gear = made.names.unique(f"{place.axis.name} transmission")
    made.couplings.append(Coupling(gear, kind, bearing, place.joint, 1.0))
    made.rotors[place.axis.name] = bearing
    return bearing


def add_relation(relation: Relation, made: Made, inertia: float, log: Log) -> None:
    """Add the gear that makes one coordinate proportional to another: the offset is in the start.
    Between two slides it is a shaft with two pinions, of this small ``inertia`` [kg m^2]."""
    ends = [made.along.get(name) for name in (relation.first, relation.second)]
    first, second = ends
    if first is None or second is None:
        log.lost(relation.element, "one of its joints has no coordinate of its own in the deck")
        return
    if relation.ratio == 0.0:
        log.lost(relation.element, "its multiplier is zero: the joint moves freely instead")
        return
    name = made.names.unique(f"{relation.second} follows {relation.first}")
    kinds = first.coordinate, second.coordinate
    if kinds == ("angle", "angle"):
        coupling = Coupling(name, "gear", first.joint, second.joint, relation.ratio)
    elif kinds == ("angle", "slide"):
        coupling = Coupling(name, "rackAndPinion", first.joint, second.joint, relation.ratio)
    elif kinds == ("slide", "angle"):
        coupling = Coupling(name, "rackAndPinion", second.joint, first.joint, 1.0 / relation.ratio)
    else:
        shaft = made.rotors.get(relation.first) or add_rotor(first, inertia, made)
        coupling = Coupling(name, "rackAndPinion", shaft, second.joint, relation.ratio)
        message = f"slides are coupled by a shaft of {inertia:.3g} kg-m^2 with pinions of 1 m"
        log.changed(relation.element, message)
    made.couplings.append(coupling)
