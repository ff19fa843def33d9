"""Whether a joint fits at t = 0: its own equations, evaluated on the configuration of the deck.

The equations are those of its kind (``msahl.joints``), so a new kind is judged without a word here.
"""

import math

from msahl.algebra.vector import ZERO, Vector, axpy, cross, dot, scale, sub
from msahl.deck.ends import Ends, open_by, tolerance
from msahl.deck.faults import shown
from msahl.deck.frames import PARALLEL, sine
from msahl.deck.values import INERTIAL, Reader
from msahl.elements.constraints.coordinates import ANGLE, RADIUS, ROUND, SKEW
from msahl.elements.constraints.products import DOT
from msahl.joints.joint import CHILD, PARENT, Coincide, Equation, Product, Coordinate
from msahl.joints.registry import KINDS
from msahl.model.joints import Joint


def complaints(joint: Joint, ends: Ends, reader: Reader) -> list[str]:
    """What keeps the joint from holding at t = 0; with ``project`` only what no motion mends."""
    here = Stance(joint, ends, reader)
    lost = _degenerate(joint, here)
    if lost or reader.project:
        return lost
    found = []
    shift, normals = ZERO, 0
    for equation in KINDS[joint.kind].equations(joint):
        if isinstance(equation, Coincide):
            found.append(open_by(ends, reader))
        elif equation.rate or equation.value is None or equation.first.kind == ANGLE:
            continue
        elif equation.first.kind == RADIUS:
            found.append(_distance_fault(joint, equation, here))
        elif equation.first.kind in (ROUND, SKEW):
            found.append(_contact_fault(equation, here))
        elif equation.first.products[0].kind == DOT:
            found.append(_angle_fault(equation, here))
        else:
            normal = here.direction(equation.first.products[0])
            shift = axpy(equation.value - here.value(equation.first), normal, shift)
            normals += 1
    found.append(_shift_fault(shift, normals, here))
    return [message for message in found if message]


class Stance:
    """A joint in the configuration at t = 0, inertial axes: D from the parent's point to the
    child's [m], both axes, and the gap that is forgiven."""

    def __init__(self, joint: Joint, ends: Ends, reader: Reader) -> None:
        self._joint, self._reader = joint, reader
        there = reader.placed(ends.child, ends.child_point)
        self.D = sub(there, reader.placed(ends.parent, ends.parent_point))
        self.axes = tuple(
            reader.turned(axes[2], body, INERTIAL)
            for axes, body in (
                (joint.parent_axes, joint.parent),
                (joint.child_axes, joint.child),
            )
        )
        lengths = [abs(value) for _, value in joint.parameters if not math.isnan(value)]
        arm = max(ends.arm(), math.hypot(*self.D), *lengths, 0.0)
        self.tolerance = tolerance(ends, arm, reader)

    def direction(self, product: Product) -> Vector:
        """The product's own direction n."""
        owners = {PARENT: self._joint.parent, CHILD: self._joint.child}
        return self._reader.turned(product.n, owners.get(product.owner, INERTIAL), INERTIAL)

    def other(self, product: Product) -> Vector:
        """The product's direction e, which is the child's."""
        return self._reader.turned(product.e, self._joint.child, INERTIAL)

    def measure(self, product: Product) -> float:
        """The product's value."""
        n = self.direction(product)
        if product.kind == DOT:
            return dot(n, self.other(product))
        return dot(n, self.D)

    def value(self, quantity: Coordinate) -> float:
        """The quantity's value."""
        measures = [self.measure(product) for product in quantity.products]
        if quantity.kind == RADIUS:
            return math.hypot(*measures)
        if quantity.kind == ROUND:
            return measures[0] - quantity.radius * math.sqrt(max(0.0, 1.0 - measures[1] ** 2))
        return measures[0]


def _degenerate(joint: Joint, here: Stance) -> list[str]:
    """Why the joint's equations say nothing where it stands."""
    parent, child = here.axes
    if KINDS[joint.kind].axes == 2 and sine(parent, child) < PARALLEL:
        return [f"its two axes are parallel; a {joint.kind} needs two directions, turn one"]
    for equation in KINDS[joint.kind].equations(joint):
        if isinstance(equation, Equation) and equation.first.kind == RADIUS:
            wanted, value = equation.value, here.value(equation.first)
            if wanted is not None and wanted <= 0.0:
                return [f"{_verb(joint, 'make')} a distance of zero; a distance must be greater"]
            if value <= here.tolerance:
                return ["the distance it keeps is zero at t = 0; move one of the two points"]
    return []


def _named(joint: Joint) -> str:
    return " and ".join(name for name, _ in joint.parameters)


def _verb(joint: Joint, verb: str) -> str:
    """The joint's parameters and what they do."""
    return f"{_named(joint)} {verb if len(joint.parameters) > 1 else verb + 's'}"


def _distance_fault(joint: Joint, equation: Equation, here: Stance) -> str:
    value = here.value(equation.first)
    if equation.value is None or abs(value - equation.value) <= here.tolerance:
        return ""
    return (
        f"the distance it keeps is {value:.9g} m at t = 0, but {_verb(joint, 'say')} "
        f"{equation.value:.9g} m; move the child or change {_named(joint)}"
    )


def _contact_fault(equation: Equation, here: Stance) -> str:
    """Two round surfaces, or a rim and a plane, touch."""
    quantity = equation.first
    if quantity.kind == SKEW:
        normal = cross(*(here.direction(product) for product in quantity.products[3:5]))
        length = math.hypot(*normal)
        normal = scale(math.copysign(1.0, dot(here.D, normal)), normal)
        violation = dot(here.D, normal) / length - quantity.radius
    else:
        normal, length = here.direction(quantity.products[0]), 1.0
        violation = here.value(quantity)
    if abs(violation) <= here.tolerance:
        return ""
    return (
        f"the surfaces are {violation:.4g} m apart at t = 0 (less than zero: one is in the other); "
        f"move the child by {shown(scale(-violation / length, normal))} m (inertial axes)"
    )


def _angle_fault(equation: Equation, here: Stance) -> str:
    cosine = here.value(equation.first)
    if abs(cosine) <= PARALLEL:
        return ""
    angle = math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
    return f"its axes are at {angle:.7g} deg at t = 0 and must be at a right angle; turn one"


def _shift_fault(shift: Vector, normals: int, here: Stance) -> str:
    """The child's point is in the parent's plane (one normal) or on its axis (two)."""
    violation = math.hypot(*shift)
    if violation <= here.tolerance:
        return ""
    place = "on the parent's axis" if normals == 2 else "where the parent's plane wants it"
    return (
        f"open by {violation:.4g} m at t = 0: the child's point is not {place}; move the child by "
        f"{shown(shift)} m (inertial axes)"
    )
