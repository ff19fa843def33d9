"""The model: frozen records of what a deck says, in SI units; a table of them for the importer."""

from msahl.algebra.functions import Law
from msahl.model.bodies import Ground, RigidBody
from msahl.model.couplings import Coupling
from msahl.model.joints import Joint
from msahl.model.loads import (
    Actuator,
    Bushing,
    ConcentratedLoad,
    Drag,
    Friction,
    JointActuator,
    JointSpring,
    Load,
    MarkerActuator,
    SpringDamper,
)
from msahl.model.markers import Marker
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
from msahl.model.signals import Signal, SignalState, SignalTable, Stop

__all__ = [
    "INSTANTANEOUS",
    "MEAN",
    "Actuator",
    "Bushing",
    "ConcentratedLoad",
    "Coupling",
    "Drag",
    "Friction",
    "Ground",
    "Joint",
    "JointActuator",
    "JointMotion",
    "JointSpring",
    "Law",
    "Limits",
    "Load",
    "Marker",
    "MarkerActuator",
    "Model",
    "Options",
    "PointMotion",
    "RigidBody",
    "RunSettings",
    "Signal",
    "SignalState",
    "SignalTable",
    "Simulation",
    "SpringDamper",
    "Stop",
    "resolve",
]
