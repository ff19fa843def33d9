"""List the elements of a model by what they act between, before they become arrays.

A joint becomes coinciding points and scalar constraint equations between coordinates, a coupling
and a prescribed motion one equation each, springs and friction loads along a coordinate. Elements
that act along the same coordinate of the same joint share it. The lists hold indices of frames and
the numbers of the model side by side; ``topology`` takes the indices, ``parameters`` the numbers.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from msahl.algebra.functions import Law
from msahl.algebra.vector import IDENTITY, ZERO, Vector, add, cross, dot, scale, sub
from msahl.check import directions
from msahl.elements.beams.build import node_shares
from msahl.elements.constraints import contact_points
from msahl.elements.constraints.coordinate_kinds import PLAIN
from msahl.elements.constraints.products import SURFACE
from msahl.joints.coordinates import angle_offset
from msahl.joints.joint import (
    GROUND,
    PARENT,
    Coincide,
    Coordinate,
    Equation,
    Product,
    Surface,
    X,
    Y,
    Z,
    box_distance,
    curve_distance,
    curve_slip,
    distance,
    distance_across,
    in_plane,
    perpendicular,
    rim_height,
    roll,
    segment_distance,
)
from msahl.joints.named_coordinates import joint_coordinate
from msahl.joints.registry import KINDS
from msahl.laws.contact import CONTACT
from msahl.laws.law import CoordinateLaw
from msahl.laws.registry import COORDINATE_LAWS, JOINT_LAWS, Parameters
from msahl.laws.restitution import damping_of
from msahl.laws.spring import SPRING
from msahl.model import Model, resolve
from msahl.model.beams import Beam, is_damped
from msahl.model.contact_sides import ContactSide, sides_of
from msahl.model.contacts import (
    BetweenPoints,
    BoxContact,
    CapsuleContact,
    Contact,
    JointLimit,
    PinContact,
    PlaneContact,
    SphereContact,
    friction_of,
)
from msahl.model.couplings import COORDINATES, Coupling
from msahl.model.elastic import AXES, ElasticBody, Follower
from msahl.model.joints import Joint
from msahl.model.loads import (
    Bushing,
    ConcentratedLoad,
    JointLoad,
    JointSpring,
    PointLoad,
    SpringDamper,
)
from msahl.model.markers import Marker
from msahl.model.motions import JointMotion, PointMotion
from msahl.ports.coordinate import NO_JOINT, OWN_TENSION
from msahl.system.signal_inputs import SignalCollector, SignalEntries

FAR = 10.0
"""Arms of amplitudes, by the farthest point of the body: what places in inertial axes may be."""
SQUARE = Law("polynomial", (0.0, 0.0, 1.0))
"""Square [m] of an amplitude [m], of those of elastic bodies."""
IDLE = Law("constant", (0.0,))
"""Law of time of prescribed motions that are released; the last law of a system with events."""


class Pair(NamedTuple):
    """Two frames, and on each a point [m] from its origin, its own axes."""

    a: int
    b: int
    s_a: Vector
    s_b: Vector


class EquationEntry(NamedTuple):
    """A scalar constraint equation, see ``elements.constraints.equations``; -1 is none."""

    element: int  # number of the joint, coupling, motion or side of a contact
    first: int  # coordinate
    second: int  # coordinate or -1
    coefficient: float  # of the second
    equation: Equation
    function: int = -1  # law of the second coordinate
    law: int = -1  # law of time
    column: int = -1  # of the table of work
    first_coefficient: float = 1.0  # of the first; 0 of contacts, which are open
    more: tuple[tuple[int, float], ...] = ()  # further coordinates and their weights

    @property
    def is_open(self) -> bool:
        """Whether it is that of a contact."""
        return self.first_coefficient == 0.0


class CoordinateEntry(NamedTuple):
    """A force along a coordinate, see ``ports.coordinate``."""

    law: CoordinateLaw
    coordinate: int
    parameters: Parameters
    column: int  # of the table of work
    damping: float = 0.0
    origin: float = 0.0  # nan: the coordinate at t = 0
    free: float = 0.0  # nan: likewise
    table: int = -1  # law in place of the tension
    decay: float = 0.0
    joint: int = NO_JOINT  # whose reaction it depends on, or ``OWN_TENSION``
    element: int = -1  # number behind those of beams' elements, where its load is an unknown


class BeamEntry(NamedTuple):
    """A beam, see ``elements.beams``."""

    beam: Beam
    frames: tuple[int, ...]  # of its nodes
    element: int  # number of its first element, behind those of all others
    column: int  # of the table of work; -1 without damping


class SlidingEntry(NamedTuple):
    """A contact with friction, see ``ports.sliding``."""

    row: int  # equation of the gap
    along: tuple[int, int]  # coordinates of the slip; their equations follow that of the gap
    column: int  # of the table of work
    grip: float  # coefficient of static friction, times the sign of the gap


class RubbingEntry(NamedTuple):
    """A compliant contact with friction, see ``ports.rubbing``."""

    normal: CoordinateEntry
    along: tuple[int, int]  # coordinates of the slip
    friction: float
    width: float


class ConcentratedEntry(NamedTuple):
    """A force and a moment at a point, see ``ports.concentrated``."""

    load: ConcentratedLoad
    law: int  # or -1
    column: int  # of the table of work


@dataclass
class Elements:
    """All elements of a model."""

    model: Model
    frame: dict[str, int]  # of each body and ground, by name
    arms: list[list[float]]  # lengths of the arms of all points on each body [m]
    points: list[tuple[int, Pair]] = field(default_factory=list)  # element, points that coincide
    coordinates: list[tuple[Coordinate, Pair]] = field(default_factory=list)
    equations: list[EquationEntry] = field(default_factory=list)
    first_equation: list[int] = field(default_factory=lambda: [0])  # of each joint, and the last
    load_equation: list[int] = field(default_factory=list)  # of couplings, motions, contacts
    along: list[CoordinateEntry] = field(default_factory=list)  # in the order of the laws
    concentrated: list[ConcentratedEntry] = field(default_factory=list)
    at_points: list[tuple[int, PointLoad]] = field(default_factory=list)  # column of work
    laws: list[Law] = field(default_factory=list)
    controlled: list[ConcentratedEntry] = field(default_factory=list)
    signals: SignalEntries | None = None
    beams: list[BeamEntry] = field(default_factory=list)
    sliding: list[SlidingEntry] = field(default_factory=list)
    rubbing: list[RubbingEntry] = field(default_factory=list)

    @property
    def ground(self) -> int:
        """Index of the ground's frame."""
        return len(self.model.bodies)

    def r_BG(self, frame: int) -> Vector:
        """Mass centre from the reference point of a frame's body [m]; zero for the ground."""
        return ZERO if frame == self.ground else self.model.bodies[frame].r_BG

    def add_law(self, law: Law | None) -> int:
        """Add a law and return its number, -1 for none."""
        if law is None:
            return -1
        self.laws.append(law)
        return len(self.laws) - 1

    def add_point(self, frame: int, point: Vector) -> Vector:
        """Return a point of a body, given from its reference point, from its mass centre [m]."""
        arm = sub(point, self.r_BG(frame))
        row = np.array(arm)
        self.arms[frame].append(math.sqrt(row.dot(row)))  # as numpy.linalg.norm, in half the time
        return arm


def frame_index(model: Model) -> dict[str, int]:
    """Return the index of the frame of each body by name; every ground has the last one."""
    index = {body.name: i for i, body in enumerate(model.bodies)}
    return index | {ground.name: len(model.bodies) for ground in model.grounds}


def collect(model: Model) -> Elements:
    """Return the elements of ``model``."""
    return _Collector(model).elements


def equations_of(joint: Joint, switched: bool) -> list[Coincide | Equation]:
    """Return the equations of a joint. One that is ``switched`` by events has scalar equations
    alone, whose coefficients can be zero: points that coincide are at zero distance along three
    axes of the parent.
    """
    equations = KINDS[joint.kind].equations(joint)
    if not switched:
        return equations
    together = [in_plane(axis) for axis in IDENTITY]
    split = (together if isinstance(one, Coincide) else [one] for one in equations)
    return [equation for each in split for equation in each]


class _Collector:
    """Goes through a model once."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.elements = Elements(
            model=model,
            frame=frame_index(model),
            arms=[[] for _ in range(len(model.bodies) + 1)],
        )
        self.joints = {joint.name: joint for joint in model.joints}
        self.number = {joint.name: i for i, joint in enumerate(model.joints)}
        self.shared: dict[tuple[str, str], int] = {}
        self.switched = model.switched
        for element, joint in enumerate(model.joints):
            self._joint(element, joint)
        for element, coupling in enumerate(model.couplings, start=len(model.joints)):
            self._coupling(element, coupling)
        first = len(model.joints) + len(model.couplings)
        for i, motion in enumerate(model.motions):
            self._motion(first + i, len(model.loads) + i, motion)
        first, column = first + len(model.motions), len(model.loads) + len(model.motions)
        for i, side in enumerate(model.contact_sides):
            self._contact(first + i, column + i, side)
        # Springs in the compliance form are numbered behind the elements of beams.
        sides = len(model.contact_sides)
        columns = sides + len(model.events)
        for i, contact in enumerate(model.compliant_contacts):
            self._compliant_contact(column + columns + i, contact)
        columns += len(model.compliant_contacts)
        self.unknown = self._beams(first + sides, column + columns)
        column_of_elastic = column + columns + sum(map(is_damped, model.beams))
        for column, load in enumerate(model.loads):
            self._load(column, load)
        for i, body in enumerate(model.elastic_bodies):
            self._elastic_body(column_of_elastic + i, body)
        order = [*COORDINATE_LAWS]
        self.elements.along.sort(key=lambda entry: order.index(entry.law.name))
        for column, load in enumerate(model.loads):
            if isinstance(load, ConcentratedLoad):
                law = self.elements.add_law(load.law)
                controlled = load.expression is not None
                into = self.elements.controlled if controlled else self.elements.concentrated
                into.append(ConcentratedEntry(load, law, column))
            if isinstance(load, ConcentratedLoad | PointLoad):
                self.elements.add_point(self.elements.frame[load.body], load.point)
        self._impulses()
        if self.switched:
            self.elements.add_law(IDLE)
        known = len(self.elements.coordinates)
        collector = SignalCollector(model, self._joint_coordinate, self._marker_distance, known)
        self.elements.signals = collector.entries()

    def _impulses(self) -> None:
        """Add the points on which impulses act: bodies with points do not fly freely."""
        markers = {marker.name: marker for marker in self.model.markers}
        for impulse in (each for event in self.model.events for each in event.impulses):
            if impulse.marker:
                marker = markers[impulse.marker]
                self.elements.add_point(self.elements.frame[marker.body], marker.point)

    def _marker_distance(self, start: Marker, end: Marker) -> int:
        """Add the distance of two markers and return its number."""
        a, b = self.elements.frame[start.body], self.elements.frame[end.body]
        s_a = self.elements.add_point(a, start.point)
        pair = Pair(a, b, s_a, self.elements.add_point(b, end.point))
        return self._add(distance(), pair)

    def _pair(self, joint: Joint | SpringDamper | Bushing | BetweenPoints) -> Pair:
        a, b = self.elements.frame[joint.parent], self.elements.frame[joint.child]
        s_a = self.elements.add_point(a, joint.parent_point)
        return Pair(a, b, s_a, self.elements.add_point(b, joint.child_point))

    def _add(self, coordinate: Coordinate, pair: Pair) -> int:
        """Add a coordinate and return its number."""
        self.elements.coordinates.append((coordinate, pair))
        return len(self.elements.coordinates) - 1

    def _joint_coordinate(self, joint_name: str, name: str) -> int:
        """Return the number of a joint's coordinate, which all elements along it share."""
        key = (joint_name, name)
        if key not in self.shared:
            joint = self.joints[joint_name]
            self.shared[key] = self._add(joint_coordinate(joint, name), self._pair(joint))
        return self.shared[key]

    def _joint(self, element: int, joint: Joint) -> None:
        pair, into = self._pair(joint), self.elements
        for equation in equations_of(joint, joint.name in self.switched):
            if isinstance(equation, Coincide):
                into.points.append((element, pair))
                continue
            first = self._add(equation.first, pair)
            second = -1 if equation.second is None else self._add(equation.second, pair)
            entry = EquationEntry(element, first, second, equation.coefficient, equation)
            into.equations.append(entry)
        into.first_equation.append(len(into.equations))

    def _coupling(self, element: int, coupling: Coupling) -> None:
        first, second = COORDINATES[coupling.kind]
        follower = self._joint_coordinate(coupling.second, second)
        leader = self._joint_coordinate(coupling.first, first)
        factor = -1.0 if coupling.lift is not None else -coupling.ratio
        self._add_load_equation(
            EquationEntry(
                *(element, follower, leader, factor, self._as_at_start(follower)),
                function=self.elements.add_law(coupling.lift),
            )
        )

    def _motion(self, element: int, column: int, motion: JointMotion | PointMotion) -> None:
        if isinstance(motion, JointMotion):
            coordinate = self._joint_coordinate(motion.joint, motion.coordinate)
        else:
            b = self.elements.frame[motion.body]
            point = self.elements.add_point(b, motion.point)
            pair = Pair(self.elements.ground, b, ZERO, point)
            coordinate = self._add(in_plane(motion.direction).first, pair)
        self._add_load_equation(
            EquationEntry(
                *(element, coordinate, -1, 0.0, self._as_at_start(coordinate)),
                law=self.elements.add_law(motion.law),
                column=column,
            )
        )

    def _contact(self, element: int, column: int, side: ContactSide) -> None:
        """Add the equations of an open contact, which any motion satisfies."""
        contact = side.contact
        coordinate = self._along_contact(contact)
        equation = Equation(self.elements.coordinates[coordinate][0], 0.0)
        self._add_load_equation(
            EquationEntry(element, coordinate, -1, 0.0, equation, first_coefficient=0.0)
        )
        friction, grip = friction_of(contact)
        if not isinstance(contact, JointLimit) and max(friction, grip) > 0.0:
            row, pair = len(self.elements.equations) - 1, self.elements.coordinates[coordinate][1]
            on_ground = self.elements.frame[contact.parent] == self.elements.ground
            slips = [self._slip(element, slip, pair) for slip in slips_of(contact, on_ground)]
            self.elements.sliding.append(
                SlidingEntry(row, (slips[0], slips[1]), column, side.sign * grip)
            )

    def _slip(self, element: int, slip: Equation, pair: Pair) -> int:
        """Add one of the slips of a contact: its coordinate, whose number is returned, and the
        equation of one that sticks.
        """
        coordinate = self._add(slip.first, pair)
        self.elements.equations.append(
            EquationEntry(element, coordinate, -1, 0.0, slip, first_coefficient=0.0)
        )
        return coordinate

    def _along_contact(self, contact: Contact) -> int:
        """Return the number of the coordinate of a contact."""
        if isinstance(contact, JointLimit):
            return self._joint_coordinate(contact.joint, contact.coordinate)
        along = distance()
        if isinstance(contact, PlaneContact):
            along = in_plane(contact.normal).first
            if contact.axis is not None:
                along = rim_height(contact.normal, contact.axis, contact.radius)
        elif isinstance(contact, BoxContact):
            along = box_distance(contact.axes, contact.half)
        elif isinstance(contact, CapsuleContact):
            ends = (contact.parent_half, contact.half)
            along = segment_distance(contact.parent_axis, contact.axis, ends)
        elif isinstance(contact, PinContact):
            along = curve_distance(*contact.axes[:2], contact.curve)
        elif isinstance(contact, SphereContact) and contact.axis is not None:
            x, y, _ = directions.frame(contact.axis)
            along = distance_across(x, y)
        return self._add(along, self._pair(contact))

    def _compliant_contact(self, column: int, contact: Contact) -> None:
        """Add the forces of a compliant contact, one for each side."""
        coordinate, offset = self._along_contact(contact), 0.0
        assert contact.compliance is not None
        if isinstance(contact, JointLimit) and contact.coordinate == "angle":
            offset = angle_offset(self.joints[contact.joint])
        for side in sides_of(contact):
            entry = CoordinateEntry(
                law=CONTACT,
                coordinate=coordinate,
                parameters=_compliant_parameters(side),
                column=column,
                origin=-offset,
                free=side.limit,
                table=self.elements.add_law(_tension_of(contact.compliance.table, side)),
                joint=_pressing(CONTACT),
            )
            self.elements.along.append(entry)
            self._rub(contact, entry)

    def _rub(self, contact: Contact, normal: CoordinateEntry) -> None:
        """Add the friction of a compliant contact, if it has some."""
        compliance, (friction, _) = contact.compliance, friction_of(contact)
        if isinstance(contact, JointLimit) or friction == 0.0:
            return
        assert compliance is not None
        assert compliance.friction_width is not None
        on_ground = self.elements.frame[contact.parent] == self.elements.ground
        pair = self.elements.coordinates[normal.coordinate][1]
        first, second = (self._add(slip.first, pair) for slip in slips_of(contact, on_ground))
        entry = RubbingEntry(normal, (first, second), friction, compliance.friction_width)
        self.elements.rubbing.append(entry)

    def _beams(self, element: int, column: int) -> int:
        """Add all beams, whose elements are numbered from ``element`` and columns of the table of
        work from ``column`` on; return the number of elements so far.
        """
        for beam in self.model.beams:
            frames = tuple(self.elements.frame[name] for name in beam.nodes)
            own = column if is_damped(beam) else -1
            self.elements.beams.append(BeamEntry(beam, frames, element, own))
            for frame, share in zip(frames, node_shares(beam.degree, beam.lengths), strict=True):
                self.elements.arms[frame].append(float(share))
            element += len(beam.lengths)
            column += is_damped(beam)
        return element

    def _elastic_body(self, column: int, body: ElasticBody) -> None:
        """Add the equations by which followers keep to the frame, each with a number of its own
        behind all other elements, and the springs along the amplitudes.
        """
        pairs = [self._following(body, follower) for follower in body.followers]
        far = FAR * max(math.dist(one.place, ZERO) for one in body.followers)
        places = (*body.carried(0, len(body.stiffness)), *body.squared)
        along = [
            self._add(in_plane(IDENTITY[axis]).first, _beyond(pairs[k], axis, far))
            for k, axis in places
        ]
        number = dict(zip(places, range(len(places)), strict=True))
        law = self.elements.add_law(SQUARE if body.squares else None)
        for k, (follower, pair) in enumerate(zip(body.followers, pairs, strict=True)):
            for axis in range(AXES):
                j = number.get((k, axis), -1)
                if j < 0:
                    place = in_plane(IDENTITY[axis])
                    self._follow(place, pair, follower.shape[axis], along)
                elif j >= len(body.stiffness):
                    square = body.squares[j - len(body.stiffness)]
                    argument = self._squared(body, square.argument, along, pairs)
                    self._square(along[j], square.factor, argument, law)
                self._follow(rotation_about(axis), pair, follower.rotation[axis], along)
            self.unknown += 1
        along = along[: len(body.stiffness)]
        for q, stiffness, damping in zip(along, body.stiffness, body.damping, strict=True):
            parameters = (("preload", 0.0), ("stiffness", stiffness))
            decay = self._decay(stiffness)
            entry = CoordinateEntry(SPRING, q, parameters, column, damping=damping, decay=decay)
            self.elements.along.append(entry)

    def _following(self, body: ElasticBody, follower: Follower) -> Pair:
        """Return the points of the frame and of a follower that coincide without amplitudes."""
        a, b = self.elements.frame[body.name], self.elements.frame[follower.body]
        s_a = self.elements.add_point(a, follower.place)
        return Pair(a, b, s_a, self.elements.add_point(b, ZERO))

    def _follow(
        self, equation: Equation, pair: Pair, shape: tuple[float, ...], along: list[int]
    ) -> None:
        """Add an equation whose value is the sum of the amplitudes times a ``shape``."""
        first = self._add(equation.first, pair)
        second = -1 if equation.second is None else self._add(equation.second, pair)
        more = tuple((q, -weight) for q, weight in zip(along, shape, strict=True) if weight)
        entry = EquationEntry(
            *(self.unknown, first, second, equation.coefficient, equation),
            first_coefficient=1.0 if second < 0 else 0.5,
            more=more,
        )
        self.elements.equations.append(entry)

    def _squared(
        self, body: ElasticBody, argument: int, along: list[int], pairs: Sequence[Pair]
    ) -> int:
        """Return the coordinate that is squared: an amplitude, or that of a sum of amplitudes."""
        k, axis = divmod(argument - len(body.stiffness), AXES)
        if k < 0:
            return along[argument]
        first = body.carriers + body.square_carriers
        return self._add(in_plane(IDENTITY[axis]).first, pairs[first + k])

    def _square(self, coordinate: int, factor: float, argument: int, law: int) -> None:
        """Add the equation by which a coordinate is a factor times the square of another one."""
        equation = Equation(self.elements.coordinates[coordinate][0], 0.0)
        entry = EquationEntry(
            *(self.unknown, coordinate, argument, -factor, equation), function=law
        )
        self.elements.equations.append(entry)

    def _as_at_start(self, coordinate: int) -> Equation:
        """The equation by which a coordinate keeps the value it has at t = 0."""
        return Equation(self.elements.coordinates[coordinate][0], None)

    def _add_load_equation(self, entry: EquationEntry) -> None:
        self.elements.load_equation.append(len(self.elements.equations))
        self.elements.equations.append(entry)

    def _load(self, column: int, load: Any) -> None:
        if isinstance(load, SpringDamper):
            coordinate = self._add(distance(), self._pair(load))
            free = np.nan if load.free_length is None else load.free_length
            self._spring(column, coordinate, load, 0.0, free)
        elif isinstance(load, JointSpring):
            coordinate = self._joint_coordinate(load.joint, load.coordinate)
            self._spring(column, coordinate, load, np.nan, load.free)
        elif isinstance(load, Bushing):
            self._bushing(column, load)
        elif isinstance(load, JointLoad):
            law, angular = JOINT_LAWS[load.law], load.coordinate == "angle"
            entry = CoordinateEntry(
                law=law,
                coordinate=self._joint_coordinate(load.joint, load.coordinate),
                parameters=load.parameters,
                column=column,
                origin=-angle_offset(self.joints[load.joint]) if angular else 0.0,
                joint=_pressing(law, self.number[load.joint]),
            )
            self.elements.along.append(entry)
        elif isinstance(load, PointLoad):
            self.elements.at_points.append((column, load))

    def _spring(
        self,
        column: int,
        coordinate: int,
        load: SpringDamper | JointSpring,
        origin: float,
        free: float,
    ) -> None:
        table = self.elements.add_law(load.table)
        steepest = _steepest(load.table) if load.table else load.stiffness
        entry = CoordinateEntry(
            law=SPRING,
            coordinate=coordinate,
            parameters=(("preload", load.preload), ("stiffness", load.stiffness)),
            column=column,
            damping=load.damping,
            origin=origin,
            free=free,
            table=table,
            decay=self._decay(steepest),
            element=self._unknown(load),
        )
        self.elements.along.append(entry)

    def _bushing(self, column: int, load: Bushing) -> None:
        pair = self._pair(load)
        directions = zip(_bushing_coordinates(load), load.stiffness, load.damping, strict=True)
        free, element = 0.0 if load.aligned else np.nan, self._unknown(load)
        for coordinate, k, c in directions:
            if k or c:
                q = self._add(coordinate, pair)
                entry = CoordinateEntry(
                    law=SPRING,
                    coordinate=q,
                    parameters=(("preload", 0.0), ("stiffness", k)),
                    column=column,
                    damping=c,
                    free=free,
                    decay=self._decay(k),
                    element=element if k else -1,
                )
                self.elements.along.append(entry)

    def _unknown(self, load: SpringDamper | JointSpring | Bushing) -> int:
        """Return the element's number of a spring in the compliance form, -1 for others."""
        self.unknown += load.compliance
        return self.unknown - 1 if load.compliance else -1

    def _decay(self, stiffness: float) -> float:
        """Return chi/2 k of a spring."""
        return 0.5 * resolve(self.model.simulation).decay.chi * stiffness


def _beyond(pair: Pair, axis: int, far: float) -> Pair:
    """Return the points farther along an axis of both bodies, which have the same axes: the same
    displacement along it, for whose round-off schemes allow by the size of these arms [m]."""
    offset = scale(far, IDENTITY[axis])
    return pair._replace(s_a=add(pair.s_a, offset), s_b=add(pair.s_b, offset))


def rotation_about(axis: int) -> Equation:
    """Return the equation that the child does not rotate about an ``axis`` of the parent, to first
    order: the antisymmetric part of its matrix of rotation."""
    i, j = (axis + 1) % AXES, (axis + 2) % AXES
    first, second = (perpendicular(IDENTITY[a], IDENTITY[b]).first for a, b in ((j, i), (i, j)))
    return Equation(first, 0.0, second, -0.5)


def _pressing(law: CoordinateLaw, joint: int = NO_JOINT) -> int:
    """Return what presses for the resistance of a law along a coordinate of a ``joint``."""
    if law.by_tension:
        return OWN_TENSION
    return joint if law.by_reaction else NO_JOINT


def _tension_of(table: Law | None, side: ContactSide) -> Law | None:
    """Return the tension over the coordinate, by the ``table`` of the force over the depth."""
    if table is None:
        return None
    depth, force = np.array(table.numbers).reshape(2, -1)
    x, T = side.limit - side.sign * depth, -side.sign * force
    beyond = side.limit + side.sign * depth[-1]  # where the gap is open
    order = slice(None, None, -1 if side.is_lower else 1)
    x, T = np.array([beyond, *x]), np.array([0.0, *T])
    return Law(table.kind, (*x[order].tolist(), *T[order].tolist()))


def _compliant_parameters(side: ContactSide) -> Parameters:
    """Return the numbers of the law of a side of a compliant contact."""
    contact = side.contact
    compliance, damping = contact.compliance, 0.0
    assert compliance is not None
    if compliance.impact_speed is not None:
        damping = damping_of(contact.restitution, compliance.impact_speed)
    return (
        ("stiffness", compliance.stiffness),
        ("exponent", compliance.exponent),
        ("damping", damping),
        ("side", side.sign),
    )


Round: TypeAlias = PlaneContact | SphereContact | BoxContact | CapsuleContact
"""Contacts whose points move on both surfaces."""


def slips_of(contact: BetweenPoints, on_ground: bool) -> tuple[Equation, Equation]:
    """Return the equations by which a contact sticks, along two tangents; ``on_ground`` says that
    the parent is a ground.
    """
    if isinstance(contact, PlaneContact):
        first, second = tangents(contact.normal)
        if contact.radius == 0.0:
            return in_plane(first), in_plane(second)
        if on_ground:
            given = (contact.normal, contact.axis or ZERO)
            return roll(*given, first, contact.radius), roll(*given, second, contact.radius)
    if isinstance(contact, PinContact):
        along = curve_slip(contact.axes, contact.curve, contact.radius, contact.reference)
        return along, in_plane(contact.axes[2])
    assert isinstance(contact, Round)
    return _rubs(contact, False), _rubs(contact, True)


def _rubs(contact: Round, second: bool) -> Equation:
    """The surfaces do not move against each other along one of two tangents."""
    owner, e, half, radius = PARENT, ZERO, None, contact.radius
    if isinstance(contact, PlaneContact):
        shape = contact_points.PLANE if contact.axis is None else contact_points.RIM
        n, e = contact.normal, contact.axis or ZERO
    elif isinstance(contact, BoxContact):
        shape, half, (e, _, n) = contact_points.BOX, contact.half, contact.axes
    elif isinstance(contact, CapsuleContact):
        shape, n, e = contact_points.LINES, contact.parent_axis, contact.axis
        half = (contact.parent_half, contact.half, 0.0)
    else:
        radius = math.copysign(contact.radius, contact.parent_radius)
        shape, n = contact_points.CYLINDER, contact.axis or ZERO
        if contact.axis is None:
            shape, owner = contact_points.SPHERE, GROUND
    surface = Surface(shape, radius, second, half)
    return Equation(
        Coordinate(PLAIN, (Product(SURFACE, n, owner, e, surface=surface),)), 0.0, rate=True
    )


def tangents(normal: Vector) -> tuple[Vector, Vector]:
    """Return two unit vectors across a ``normal`` and each other, the first across the axis that
    is the most across the normal.
    """
    axis = min(range(3), key=lambda i: abs(normal[i]))
    first = cross(IDENTITY[axis], normal)
    first = scale(1.0 / math.sqrt(dot(first, first)), first)
    return first, cross(normal, first)


def _bushing_coordinates(bushing: Bushing) -> list[Coordinate]:
    """Three displacements along the parent's frame and three rotations about it; for small ones
    these are scalar products of axes.
    """
    frame, child = bushing.parent_axes, bushing.child_axes
    slides = [in_plane(axis).first for axis in frame]
    pairs = ((Z, Y), (X, Z), (Y, X))
    return slides + [perpendicular(frame[i], child[j]).first for i, j in pairs]


def _steepest(table: Law) -> float:
    """Largest rise of a table from one entry to the next; zero if it only falls."""
    x, y = np.array(table.numbers).reshape(2, -1)
    return max(0.0, float((np.diff(y) / np.diff(x)).max()))
