"""Elements -> numbers and vectors in SI, in the axes the model wants.

Axes are named by ``basis`` and taken as they stand at t = 0; a ground's are the inertial axes. A
vector given in the axes it is wanted in passes unchanged, bit for bit. What cannot be read becomes
a fault and a harmless value, so that reading goes on to the next fault.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from msahl.algebra.rotation import from_axis_angle
from msahl.algebra.vector import IDENTITY, ZERO, Matrix, Vector, add, times, transpose
from msahl.deck.faults import Element, Faults, attribute, text
from msahl.deck.frames import unit
from msahl.deck.units import DEFAULTS, UNITS, to_si
from msahl.model.bodies import RigidBody
from msahl.model.joints import Joint

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
    "axis": ("", ("x", "y", "z")),
    "reference": ("", ("x", "y", "z")),
    "direction": ("", ("x", "y", "z")),
}
"""Quantity and components of every vector element."""

LARGEST, SMALLEST = 1e100, 1e-100
"""Sizes of numbers in SI between which products of three can be computed with; or zero. The largest
things there are stay far below: the universe weighs some 1e53 kg."""

INERTIAL = ""
"""Stands for the inertial axes where a frame is named; no body's name is empty."""


@dataclass(frozen=True, slots=True)
class Reader:
    """What reading needs to know: default units, what was read already, where faults go.

    ``axes`` holds R (body to inertial components at t = 0) by name of body or ground; ``origins``
    the point B in inertial axes [m], of those whose place is free of faults, and ``reach`` alone
    the distance of the farthest; ``grounds`` the names of all grounds, faults or not, and
    ``INERTIAL`` if there may be others; ``kinds`` the kind of every joint by name. ``bodies`` and
    ``joints`` hold the records free of faults. With ``project`` joints need not fit at t = 0.
    """

    unit_system: str
    faults: Faults
    project: bool = False
    axes: dict[str, Matrix] = field(default_factory=lambda: {INERTIAL: IDENTITY})
    origins: dict[str, Vector] = field(default_factory=dict)
    dt2: list[float] = field(default_factory=lambda: [0.0])
    grounds: dict[str, None] = field(default_factory=dict)
    bodies: dict[str, RigidBody] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)

    def number(self, element: Element | None, quantity: str = "") -> float:
        """Value in SI; without element zero; numbers too large or too small to compute with are
        faults."""
        if element is None:
            return 0.0
        value = float(text(element))
        if quantity:
            name = attribute(element, "units") or DEFAULTS[self.unit_system][quantity]
            if name not in UNITS[quantity]:  # where the schema cannot know which of two it is
                units = ", ".join(UNITS[quantity])
                self.faults.add(element, f"'{name}' does not fit here; expected one of {units}")
                return 0.0
            value = to_si(value, name, quantity)
        elif element.get("units"):
            self.faults.add(element, "it is a plain number here; delete units")
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
        """Values of the children ``tags`` in SI; missing ones are zero."""
        return tuple(self.number(parent.find(tag), quantity) for tag in tags)

    def components(self, element: Element | None) -> Vector:
        """The three components of a vector element as they are given, in SI."""
        if element is None:
            return ZERO
        quantity, tags = VECTORS[str(element.tag)]
        x, y, z = self.numbers(element, tags, quantity)
        return (x, y, z)

    def vector(self, element: Element | None, own: str, wanted: str) -> Vector:
        """Components of a vector element in the axes of ``wanted``; its basis is ``own`` unless it
        names another."""
        if element is None:
            return ZERO
        basis = self.basis(element) or own
        return self.turned(self.components(element), basis, wanted)

    def basis(self, element: Element) -> str:
        """The frame an element's ``basis`` names, "" if it names none or an unknown one."""
        name = attribute(element, "basis")
        return name if name in self.axes else ""

    def turned(self, a: Vector, basis: str, wanted: str) -> Vector:
        """``a`` from the axes of ``basis`` to those of ``wanted``."""
        if self.axes[basis] != self.axes[wanted]:
            a = times(transpose(self.axes[wanted]), times(self.axes[basis], a))
        return a

    def direction(self, element: Element | None, own: str) -> Vector | None:
        """Unit vector along a vector element, inertial axes; None without element or if zero."""
        if element is None:
            return None
        a = self.vector(element, own, INERTIAL)
        if math.hypot(*a) == 0.0:
            self.faults.add(element, f"the {element.tag} is zero; give a direction, 0 0 1 say")
            return None
        return unit(a)

    def place(self, body: str, origin: Vector) -> None:
        """Put a body's point B at ``origin``, inertial axes [m]."""
        self.origins[body] = origin
        self.dt2[0] = max(self.dt2[0], math.hypot(*origin))

    def placed(self, body: str, point: Vector) -> Vector:
        """A point of a body from the inertial origin, inertial axes [m]."""
        return add(self.origins[body], self.turned(point, body, INERTIAL))

    def orientation(self, body: Element) -> Vector:
        """Wiener-Milenkovic parameters of a body's axes relative to the inertial ones."""
        rotation = body.find("initialConditions/orientation/eulerRotation")
        if rotation is None:
            return ZERO
        phi = self.number(rotation.find("phi"), "angle")
        u1, u2, u3 = self.numbers(rotation, ("u1", "u2", "u3"))
        if math.hypot(u1, u2, u3) == 0.0:
            self.faults.add(rotation, "the axis (u1, u2, u3) is zero; give a direction, 0 0 1 say")
            return ZERO
        return from_axis_angle((u1, u2, u3), phi)
