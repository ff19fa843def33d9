"""The model: frozen records of what a deck says, in SI units; a table of them for the importer."""

from msahl.algebra.functions import Law
from msahl.model.bodies import Ground, RigidBody
from msahl.model.couplings import Coupling
from msahl.model.joints import Joint
from msahl.model.loads import (
    Bushing,
    ConcentratedLoad,
    Drag,
    Friction,
    JointSpring,
    Load,
    SpringDamper,
)
from msahl.model.model import (
    INSTANTANEOUS,
    MEAN,
    Limits,
    Model,
    Simulation,
    decay_of,
    decays,
    degree_of,
    is_exponential,
    local_tolerance_of,
    order_of,
    reactions_of,
    scheme_of,
    tolerance_of,
)
from msahl.model.motions import JointMotion, PointMotion

__all__ = [
    "INSTANTANEOUS",
    "MEAN",
    "Bushing",
    "ConcentratedLoad",
    "Coupling",
    "Drag",
    "Friction",
    "Ground",
    "Joint",
    "JointMotion",
    "JointSpring",
    "Law",
    "Limits",
    "Load",
    "Model",
    "PointMotion",
    "RigidBody",
    "Simulation",
    "SpringDamper",
    "decay_of",
    "decays",
    "degree_of",
    "is_exponential",
    "local_tolerance_of",
    "order_of",
    "reactions_of",
    "scheme_of",
    "tolerance_of",
]
