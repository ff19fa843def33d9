"""Reader of numbers and vectors: elements -> SI units, in the axes that the model uses.

An element's ``basis`` names the axes of its components, taken as they stand at t = 0; those of a
ground are the inertial axes. A vector given in the axes it is needed in is read bit for bit. What
cannot be read becomes a fault and a harmless value, so that reading goes on to the next fault.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from msahl.algebra.rotation import from_axis_angle, matrix, rescaled
from msahl.algebra.vector import IDENTITY, ZERO, Matrix, Vector, transpose
from msahl.beams.mesh import Mesh
from msahl.check.context import INERTIAL, Context
from msahl.check.directions import unit
from msahl.check.ends import frame_findings
from msahl.check.faults import LARGEST, SMALLEST, Finding
from msahl.check.loads import direction_findings
from msahl.deck.faults import Element, Faults, attribute, text
from msahl.deck.units import DEFAULTS, UNIT_FACTORS, UNITS, Parameter, to_si
from msahl.expressions.dimensions import Dimension, TableDimensions
from msahl.model.bodies import RigidBody
from msahl.model.joints import Joint
from msahl.records import record

VECTORS: Mapping[str, tuple[str, tuple[str, str, str]]] = {
    "gravity": ("acceleration", ("g1", "g2", "g3")),
    "rGB": ("length", ("x", "y", "z")),
    "position": ("length", ("x", "y", "z")),
    "velocity": ("velocity", ("v1", "v2", "v3")),
    "angularVelocity": ("angularVelocity", ("omega1", "omega2", "omega3")),
    "force": ("force", ("xForce", "yForce", "zForce")),
    "reaction": ("force", ("xForce", "yForce", "zForce")),
    "moment": ("moment", ("xMoment", "yMoment", "zMoment")),
    "acceleration": ("acceleration", ("a1", "a2", "a3")),
    "start": ("length", ("x", "y", "z")),
    "end": ("length", ("x", "y", "z")),
    "centre": ("length", ("x", "y", "z")),
    "point": ("length", ("x", "y", "z")),
    "capsuleEnd": ("length", ("x", "y", "z")),
    "axis": ("", ("x", "y", "z")),
    "reference": ("", ("x", "y", "z")),
    "direction": ("", ("x", "y", "z")),
    "normal": ("", ("x", "y", "z")),
}
"""Physical quantity and components of every vector element."""

INERTIAL_BASIS = "inertial"
"""Names the inertial axes as the basis of a vector, if no body is called so."""

PLACES = {
    "inertia": "moi",
    "free_length": "freeLength",
    "impact_speed": "impactSpeed",
    "parent_radius": "parentRadius",
}
"""Child that holds a part of a record, where its tag is not the part's name."""

REFERENCES = {
    "body": "body",
    "joint": "joint",
    "first": "first",
    "second": "second",
    "parent": "parent/name",
}
"""Child on whose line a reference is wrong; the fault is one of the element that refers."""

CERTAIN = frozenset((*REFERENCES, "ends", "entries", "numbers"))
"""Parts whose findings are right even if other parts of the element could not be read."""


def is_inertial(element: Element, context: Context) -> bool:
    """Return whether a vector is given in the inertial axes, named as such."""
    name = attribute(element, "basis")
    return name == INERTIAL_BASIS and name not in context.axes


@dataclass(slots=True)
class BodyStart:
    """What follows for a body from the coordinates of joints at t = 0; None: the body's own."""

    position: Vector | None = None  # of B, inertial axes [m]
    orientation: Vector | None = None  # Wiener-Milenkovic parameters
    velocity: Vector | None = None  # of B, body axes [m/s]
    angular_velocity: Vector | None = None  # body axes [rad/s]


@record
class Reader:
    """What reading needs: default units, what was read already, and where faults go.

    ``context`` holds what checks need of other elements. It contains names and kinds of elements
    with faults too, but places of bodies only if they are free of faults. ``parameters`` may be
    named in laws of the motion. ``bodies`` and ``joints`` hold the records free of faults.
    ``starts`` are of bodies that joints place or move, ``unplaced`` those that they could not place
    for some fault. ``signal_dimensions`` and ``table_dimensions`` are what signals, states and
    tables say of their units. ``meshes`` are of beams by name, ``beams`` their nodes, ``lengths``
    their lengths [m].
    """

    unit_system: str
    faults: Faults
    context: Context = field(default_factory=Context)
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    bodies: dict[str, RigidBody] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    meshes: dict[str, Mesh] = field(default_factory=dict)
    beams: dict[str, tuple[RigidBody, ...]] = field(default_factory=dict)
    lengths: dict[str, float] = field(default_factory=dict)
    starts: dict[str, BodyStart] = field(default_factory=dict)
    unplaced: set[str] = field(default_factory=set)
    signal_dimensions: dict[str, Dimension | None] = field(default_factory=dict)
    table_dimensions: dict[str, TableDimensions] = field(default_factory=dict)

    def add(self, element: Element, findings: Iterable[Finding]) -> None:
        """Add findings about the record of ``element`` to the faults, each at the child that holds
        its part. Findings that may follow from a fault already found there are dropped."""
        kept = []
        for part, message in findings:
            child = None if part in CERTAIN else element.find(PLACES.get(part, part) or ".")
            place = element if child is None else child
            if part in CERTAIN or self.faults.sound(place):
                at = element.find(REFERENCES[part]) if part in REFERENCES else None
                kept.append((place, message, at))
        for place, message, at in kept:
            self.faults.add(place, message, at)

    def name(self, element: Element) -> str:
        """Return the name of a record, or the name in a part of it."""
        return text(element.find("name"))

    def is_known(self, body: str) -> bool:
        """Return whether there is a body of that name."""
        return body in self.context.axes

    def number(self, element: Element | None, quantity: str = "") -> float:
        """Return the value in SI, zero without element; numbers too large or too small to compute
        with are faults."""
        if element is None:
            return 0.0
        value = float(element.text or "")  # which ignores white space itself
        if quantity:
            name = attribute(element, "units") or DEFAULTS[self.unit_system][quantity]
            if name not in UNITS[quantity]:  # where the schema allows units of two quantities
                units = ", ".join(UNITS[quantity])
                self.faults.add(element, f"'{name}' does not fit here; expected one of {units}")
                return 0.0
            value = to_si(value, name, quantity)
        elif element.get("units"):
            self.faults.add(element, "it is a plain number here; delete units")
        return self.limited(element, value)

    def limited(self, element: Element, value: float) -> float:
        """Return the ``value`` of an element [SI], zero with a fault if it is too large or too
        small to compute with."""
        if abs(value) > LARGEST:
            message = f"{text(element)} is too large; numbers go up to {LARGEST:g} in SI"
            self.faults.add(element, message)
            return 0.0
        if 0.0 < abs(value) < SMALLEST:
            message = f"is too small; numbers go down to {SMALLEST:g} in SI, or are 0"
            self.faults.add(element, f"{text(element)} {message}")
            return 0.0
        return value

    def numbers(
        self, parent: Element, tags: Sequence[str], quantity: str = ""
    ) -> tuple[float, ...]:
        """Return the values of the children ``tags`` in SI; missing ones are zero."""
        values = dict.fromkeys(tags, 0.0)
        units = UNIT_FACTORS.get(quantity, ())
        for child in parent:
            tag = str(child.tag)
            if tag in values:
                value = float(child.text or "")
                usual = SMALLEST <= abs(value) <= LARGEST or value == 0.0
                plain = usual and child.get("units") in units
                values[tag] = value if plain else self.number(child, quantity)
        return tuple(values.values())

    def components(self, element: Element | None) -> Vector:
        """Return the three components of a vector element as they are given, in SI."""
        if element is None:
            return ZERO
        quantity, tags = VECTORS[str(element.tag)]
        x, y, z = self.numbers(element, tags, quantity)
        return (x, y, z)

    def vector(self, element: Element | None, own: str, wanted: str) -> Vector:
        """Return a vector element's components in the axes of ``wanted``; its basis is ``own``
        unless it names another."""
        if element is None:
            return ZERO
        basis = INERTIAL if is_inertial(element, self.context) else self.basis(element) or own
        return self.context.rotated(self.components(element), basis, wanted)

    def basis(self, element: Element) -> str:
        """Return the frame that ``basis`` names, "" if it names none or an unknown one."""
        name = attribute(element, "basis")
        return name if name in self.context.axes else ""

    def direction(self, element: Element | None, own: str) -> Vector | None:
        """Return the unit vector along an element, inertial axes; None without one or if zero."""
        if element is None:
            return None
        a = self.vector(element, own, INERTIAL)
        if math.hypot(*a) == 0.0:
            self.add(element, direction_findings(str(element.tag), a))
            return None
        return unit(a)

    def orientation(self, body: Element) -> Vector:
        """Return the Wiener-Milenkovic parameters of a body's axes in the inertial axes."""
        given = body.find("initialConditions/orientation")
        return ZERO if given is None else self.parameters_of(given)

    def parameters_of(self, orientation: Element) -> Vector:
        """Return the Wiener-Milenkovic parameters that an ``<orientation>`` gives, in one of two
        ways."""
        rotation = orientation.find("eulerRotation")
        given = [child for child in orientation if child.tag != "eulerRotation"]
        if (rotation is None) == (not given):
            message = "give either <eulerRotation> or the parameters <P1>, <P2>, <P3>"
            self.faults.add(orientation, message)
            return ZERO
        if rotation is None:
            return self.rescaled(self.numbers(orientation, ("P1", "P2", "P3")))
        return self.rotation(rotation)

    def rescaled(self, P: tuple[float, ...]) -> Vector:
        """Return parameters within the ball |p| <= 4."""
        x, y, z = P
        return rescaled((x, y, z))

    def axes(self, orientation: Element | None) -> Matrix:
        """Return the rows x, y, z that the ``<orientation>`` of a part of a body gives."""
        if orientation is None:
            return IDENTITY
        rotation, given = orientation.find("eulerRotation"), orientation.find("axes")
        if (rotation is None) == (given is None):
            self.faults.add(orientation, "give either <eulerRotation> or <axes>")
            return IDENTITY
        if given is not None:
            return self.frame(given)
        assert rotation is not None
        P = self.rotation(rotation)
        return IDENTITY if P == ZERO else transpose(matrix(P))

    def frame(self, element: Element) -> Matrix:
        """Return the frame of an element that has its rows x, y, z as nine numbers."""
        a = tuple(float(word) for word in text(element).split())
        if len(a) != 9:
            self.faults.add(element, f"it has {len(a)} numbers; give nine: x, y and z of the frame")
            return IDENTITY
        rows = ((a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]))
        for finding in frame_findings(rows, ""):
            self.faults.add(element, finding.message)
            return IDENTITY
        return rows

    def rotation(self, rotation: Element) -> Vector:
        """Return the Wiener-Milenkovic parameters of an ``<eulerRotation>``."""
        phi = self.number(rotation.find("phi"), "angle")
        u1, u2, u3 = self.numbers(rotation, ("u1", "u2", "u3"))
        if math.hypot(u1, u2, u3) == 0.0:
            message = "the axis (u1, u2, u3) is zero; give a direction, for example 0 0 1"
            self.faults.add(rotation, message)
            return ZERO
        return from_axis_angle((u1, u2, u3), phi)
