"""The model: what the deck says, complete, in SI units, with every basis resolved.

Vectors are tuples, so two models compare with ``==``. Frames: I, the inertial axes, which are those
of every ground; B, a body's own axes at its reference point B.
"""

from collections.abc import Mapping
from dataclasses import field

from msahl.algebra.vector import Vector
from msahl.model.beams import Beam
from msahl.model.bodies import Ground, RigidBody
from msahl.model.couplings import Coupling
from msahl.model.joints import Joint
from msahl.model.loads import Actuator, ConcentratedLoad, Load
from msahl.model.markers import Group, Marker, Sensor
from msahl.model.motions import JointMotion, PointMotion
from msahl.model.settings import Simulation
from msahl.model.shapes import BeamShape, Shape
from msahl.model.signals import AnySignal, Stop
from msahl.records import record


@record
class Model:
    """A complete deck.

    ``gravity`` [m/s^2] in I. Names are unique across bodies and grounds, across joints, couplings
    and motions, and across loads; those of bodies, markers, sensors and groups differ as well.
    ``unit_system`` names the deck's default units. ``position`` and
    ``velocity`` say how the state at t = 0 is made consistent with the joints.
    """

    gravity: Vector
    grounds: tuple[Ground, ...]
    bodies: tuple[RigidBody, ...]
    joints: tuple[Joint, ...]
    loads: tuple[Load, ...]
    simulation: Simulation
    unit_system: str = "SI"
    couplings: tuple[Coupling, ...] = ()
    motions: tuple[JointMotion | PointMotion, ...] = ()
    position: str = "check"  # or "project": correct the positions by Newton's method
    velocity: str = "keepAngular"  # or "massWeighted", "asGiven", "refuse"
    markers: tuple[Marker, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    groups: tuple[Group, ...] = ()
    signals: tuple[AnySignal, ...] = ()
    stops: tuple[Stop, ...] = ()
    shapes: tuple[Shape, ...] = ()  # of bodies and grounds, for views
    beams: tuple[Beam, ...] = ()  # between bodies that are their nodes
    beam_shapes: tuple[BeamShape, ...] = ()  # of beams, for views
    places: Mapping[str, str] = field(default_factory=dict, compare=False, repr=False)
    """File and line of motions, loads and signals by name, for messages; empty without a deck."""

    @property
    def actuators(self) -> tuple[Actuator, ...]:
        """The actuators, in the order of the loads."""
        return tuple(load for load in self.loads if isinstance(load, Actuator))

    @property
    def concentrated(self) -> tuple[ConcentratedLoad, ...]:
        """The concentrated loads that are constant or have a law of time, likewise."""
        loads = (load for load in self.loads if isinstance(load, ConcentratedLoad))
        return tuple(load for load in loads if load.expression is None)

    @property
    def controlled(self) -> tuple[ConcentratedLoad, ...]:
        """Those whose factor is an expression; the results of the signals are the loads of the
        ``actuators`` and then these factors.
        """
        loads = (load for load in self.loads if isinstance(load, ConcentratedLoad))
        return tuple(load for load in loads if load.expression is not None)


def in_deck(model: Model, name: str) -> str:
    """Return where an element stands, in brackets for a message; "" if that is not known."""
    return f" ({model.places[name]})" if name in model.places else ""
