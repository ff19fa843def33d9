"""The model: what the deck says, complete, in SI units, with every basis resolved.

Vectors are tuples, so two models compare with ``==``. Frames: I, the inertial axes, which are those
of every ground; B, a body's own axes at its reference point B.
"""

from collections.abc import Mapping
from dataclasses import field
from typing import TypeAlias

from msahl.algebra.vector import Vector
from msahl.model.beams import Beam
from msahl.model.bodies import Ground, RigidBody
from msahl.model.contact_sides import ContactSide, sides_of
from msahl.model.contacts import Contact
from msahl.model.couplings import Coupling
from msahl.model.elastic import ElasticBody
from msahl.model.events import Event
from msahl.model.joints import Joint
from msahl.model.loads import Actuator, ConcentratedLoad, Load
from msahl.model.markers import Group, Marker, Sensor
from msahl.model.motions import JointMotion, PointMotion
from msahl.model.settings import Simulation
from msahl.model.shapes import BeamShape, Shape
from msahl.model.signals import AnySignal, SignalState, Stop
from msahl.records import record

Constrained: TypeAlias = Joint | Coupling | JointMotion | PointMotion | ContactSide


@record
class Model:
    """A complete deck.

    ``gravity`` [m/s^2] in I. Names are unique across bodies and grounds, across joints, couplings,
    motions and contacts, and across loads; those of bodies, markers, sensors and groups differ as
    well. ``unit_system`` names the deck's default units. ``position`` and ``velocity`` say how the
    state at t = 0 is made consistent with the joints.
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
    contacts: tuple[Contact, ...] = ()
    events: tuple[Event, ...] = ()
    released: tuple[
        str, ...
    ] = ()  # names of what events may engage, and which does not act at t = 0
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
    elastic_bodies: tuple[ElasticBody, ...] = ()  # of bodies that follow one another
    places: Mapping[str, str] = field(default_factory=dict, compare=False, repr=False)
    """File and line of motions, contacts, loads and signals by name, for messages; empty without a
    deck."""

    @property
    def rigid_contacts(self) -> tuple[Contact, ...]:
        """The contacts that are constraints, in their order."""
        return tuple(contact for contact in self.contacts if contact.compliance is None)

    @property
    def compliant_contacts(self) -> tuple[Contact, ...]:
        """The contacts that are forces, in their order."""
        return tuple(contact for contact in self.contacts if contact.compliance is not None)

    @property
    def contact_sides(self) -> tuple[ContactSide, ...]:
        """The sides of all rigid contacts, in their order."""
        return tuple(side for contact in self.rigid_contacts for side in sides_of(contact))

    @property
    def compliant_sides(self) -> tuple[ContactSide, ...]:
        """The sides of all compliant contacts, likewise."""
        return tuple(side for contact in self.compliant_contacts for side in sides_of(contact))

    @property
    def hidden(self) -> Mapping[str, str]:
        """The elastic body of each rigid body that tables and views do not show, by name."""
        elastic = self.elastic_bodies
        return {follower.body: body.name for body in elastic for follower in body.hidden}

    @property
    def shown_bodies(self) -> tuple[RigidBody, ...]:
        """The bodies that tables and views show, in their order."""
        hidden = self.hidden
        return tuple(b for b in self.bodies if b.name not in hidden) if hidden else self.bodies

    @property
    def switched(self) -> frozenset[str]:
        """Names of the joints, couplings, motions and contacts that do not always act."""
        named = (name for event in self.events for name in event.elements)
        return frozenset((*self.released, *named))

    @property
    def constrained(
        self,
    ) -> "tuple[Constrained, ...]":
        """All that has constraint equations, in the order in which they are numbered."""
        return (*self.joints, *self.couplings, *self.motions, *self.contact_sides)

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

    @property
    def states(self) -> tuple[SignalState, ...]:
        """The auxiliary states, in the order of the signals."""
        return tuple(signal for signal in self.signals if isinstance(signal, SignalState))


def in_deck(model: Model, name: str) -> str:
    """Return where an element stands, in brackets for a message; "" if that is not known."""
    return f" ({model.places[name]})" if name in model.places else ""
