"""The elements of the deck that a robot has become so far."""

from dataclasses import dataclass, field

from msahl.algebra.vector import Matrix
from msahl.importers.joints import Start
from msahl.importers.names import Names
from msahl.importers.robot import Axis
from msahl.model import Coupling, Joint, Marker, RigidBody, Signal, SignalState
from msahl.model.loads import Load


@dataclass
class Along:
    """The coordinate of the deck's joint that an axis of the file is, and its start."""

    axis: Axis
    joint: str
    coordinate: str
    start: Start


@dataclass
class Ball:
    """A ball joint of the deck between bodies by name; ``frame`` are the axes that the link has
    with the coordinate zero, in the parent's, as rows. ``found`` are texts of components that loads
    have needed so far, by what they are of."""

    axis: Axis
    parent: str
    child: str
    frame: Matrix
    found: dict[str, list[str]] = field(default_factory=dict)


@dataclass
class Made:
    """Elements of the deck so far; ``names`` of joints, loads and signals, ``body_names``."""

    ground: str
    names: Names
    body_names: Names
    bodies: list[RigidBody] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    starts: dict[str, Start] = field(default_factory=dict)
    start_of: dict[str, Start] = field(default_factory=dict)
    """Starts of joints by the names of the axes that they have."""
    couplings: list[Coupling] = field(default_factory=list)
    loads: list[Load] = field(default_factory=list)
    signals: list[Signal | SignalState] = field(default_factory=list)
    markers: list[Marker] = field(default_factory=list)
    along: dict[str, Along] = field(default_factory=dict)
    balls: dict[str, Ball] = field(default_factory=dict)
    rotors: dict[str, str] = field(default_factory=dict)
    """Bearings of rotors, by the names of the axes."""
