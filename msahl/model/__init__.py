"""The model: frozen records of what a deck says, in SI units; a table of them for the importer."""

from msahl.algebra.functions import Law
from msahl.model.beams import Beam, Section
from msahl.model.bodies import Ground, RigidBody
from msahl.model.contact_sides import ContactSide
from msahl.model.contacts import (
    BoxContact,
    BoxesContact,
    CapsuleContact,
    Compliance,
    DistanceLimit,
    JointLimit,
    PinContact,
    PlaneContact,
    SphereContact,
)
from msahl.model.couplings import Coupling
from msahl.model.curves import Curve, CurvePart
from msahl.model.elastic import ElasticBody, Follower
from msahl.model.events import Event
from msahl.model.joints import Joint
from msahl.model.loads import (
    Actuator,
    Bushing,
    ConcentratedLoad,
    JointActuator,
    JointLoad,
    JointSpring,
    Load,
    MarkerActuator,
    PointLoad,
    SpringDamper,
)
from msahl.model.markers import Group, Marker, MarkerAngle, MarkerDistance
from msahl.model.model import Model
from msahl.model.motions import JointMotion, PointMotion
from msahl.model.settings import (
    INSTANTANEOUS,
    MEAN,
    Limits,
    Options,
    RunSettings,
    Simulation,
    resolve,
)
from msahl.model.shapes import BeamShape, Shape
from msahl.model.signals import Signal, SignalState, SignalTable, Stop

__all__ = [
    "INSTANTANEOUS",
    "MEAN",
    "Actuator",
    "Beam",
    "BeamShape",
    "BoxContact",
    "BoxesContact",
    "Bushing",
    "CapsuleContact",
    "Compliance",
    "ConcentratedLoad",
    "ContactSide",
    "Coupling",
    "Curve",
    "CurvePart",
    "DistanceLimit",
    "ElasticBody",
    "Event",
    "Follower",
    "Ground",
    "Group",
    "Joint",
    "JointActuator",
    "JointLimit",
    "JointLoad",
    "JointMotion",
    "JointSpring",
    "Law",
    "Limits",
    "Load",
    "Marker",
    "MarkerActuator",
    "MarkerAngle",
    "MarkerDistance",
    "Model",
    "Options",
    "PinContact",
    "PlaneContact",
    "PointLoad",
    "PointMotion",
    "RigidBody",
    "RunSettings",
    "Section",
    "Shape",
    "Signal",
    "SignalState",
    "SignalTable",
    "Simulation",
    "SphereContact",
    "SpringDamper",
    "Stop",
    "resolve",
]
