"""Rule that a joint fits at t = 0: its own constraint equations hold for the places of its bodies.

The equations are those of the joint's kind (``msahl.joints``), so a new kind needs no words here.
"""

import math
from collections.abc import Iterator

from msahl.algebra.vector import ZERO, Vector, axpy, cross, dot, scale, sub
from msahl.check.context import INERTIAL, Context
from msahl.check.directions import PARALLEL, sine
from msahl.check.ends import apart, arm, points, tolerance
from msahl.check.faults import Finding, shown
from msahl.elements.constraints.coordinate_kinds import ANGLE, RADIUS, ROUND, SKEW
from msahl.elements.constraints.products import DOT
from msahl.joints.joint import CHILD, PARENT, Coincide, Coordinate, Equation, Product
from msahl.joints.registry import KINDS
from msahl.model.joints import Joint


def fit_findings(joint: Joint, context: Context) -> Iterator[Finding]:
    """Find what violates the joint at t = 0; with ``project`` only what no motion can correct, and
    nothing of a joint that is released.
    """
    if joint.name in context.released:
        return
    if KINDS[joint.kind].equations(joint) == [Coincide()]:
        if not context.project:
            yield from apart(joint, context)
        return
    start = JointAtStart(joint, context)
    singular = _singular(joint, start)
    if singular or context.project:
        yield from (Finding("", message) for message in singular)
        return
    shift, normals = ZERO, 0
    for equation in KINDS[joint.kind].equations(joint):
        if isinstance(equation, Coincide):
            yield from apart(joint, context)
        elif equation.rate or equation.value is None or equation.first.kind == ANGLE:
            continue
        elif equation.first.kind in CHECKS:
            yield from CHECKS[equation.first.kind](joint, equation, start)
        elif equation.first.products[0].kind == DOT:
            yield from _angle_findings(equation, start)
        else:
            normal = start.direction(equation.first.products[0])
            shift = axpy(equation.value - start.value(equation.first), normal, shift)
            normals += 1
    yield from _shift_findings(shift, normals, start)


def twist_findings(joint: Joint, context: Context) -> Iterator[Finding]:
    """Find frames that do not coincide at t = 0, from where an angle counts.

    Those of decks do, as their joints have one axis for both sides.
    """
    if "angle" not in KINDS[joint.kind].coordinates or context.project:
        return
    x, y = (context.rotated(axis, joint.parent, INERTIAL) for axis in joint.parent_axes[:2])
    child_x = context.rotated(joint.child_axes[0], joint.child, INERTIAL)
    twist = math.atan2(dot(child_x, y), dot(child_x, x))
    if abs(twist) > PARALLEL:
        degrees = math.degrees(twist)
        message = (
            f"its frames are rotated by {degrees:.7g} deg about the axis at t = 0, where the angle "
            f"is zero; rotate child_axes by {-degrees:.7g} deg"
        )
        yield Finding("child_axes", message)


class JointAtStart:
    """A joint at t = 0 in inertial axes: D from the parent's point to the child's [m], both axes,
    and the accepted constraint violation [m]."""

    def __init__(self, joint: Joint, context: Context) -> None:
        self._joint, self._context = joint, context
        here, there = points(joint, context)
        self.D = sub(there, here)
        self.axes = (
            context.rotated(joint.parent_axes[2], joint.parent, INERTIAL),
            context.rotated(joint.child_axes[2], joint.child, INERTIAL),
        )
        lengths = [abs(value) for _, value in joint.parameters if not math.isnan(value)]
        longest = max(arm(joint), math.hypot(*self.D), *lengths, 0.0)
        self.tolerance = tolerance(here, there, longest, context)

    def direction(self, product: Product) -> Vector:
        """Return the product's own direction n."""
        owners = {PARENT: self._joint.parent, CHILD: self._joint.child}
        return self._context.rotated(product.n, owners.get(product.owner, INERTIAL), INERTIAL)

    def product(self, product: Product) -> float:
        """Return the value of a product: n . e with the child's direction e, or n . D."""
        n = self.direction(product)
        if product.kind == DOT:
            return dot(n, self._context.rotated(product.e, self._joint.child, INERTIAL))
        return dot(n, self.D)

    def value(self, coordinate: Coordinate) -> float:
        """Return the value of a joint coordinate."""
        products = [self.product(product) for product in coordinate.products]
        if coordinate.kind == RADIUS:
            return math.hypot(*products)
        if coordinate.kind == ROUND:
            return products[0] - coordinate.radius * math.sqrt(max(0.0, 1.0 - products[1] ** 2))
        return products[0]


def _singular(joint: Joint, start: JointAtStart) -> list[str]:
    """Return why the joint's equations have no derivative where it stands."""
    parent, child = start.axes
    if KINDS[joint.kind].axes == 2 and sine(parent, child) < PARALLEL:
        return [f"its two axes are parallel; a {joint.kind} needs two directions, rotate one"]
    for equation in KINDS[joint.kind].equations(joint):
        if isinstance(equation, Equation) and equation.first.kind == RADIUS:
            wanted, value = equation.value, start.value(equation.first)
            if wanted is not None and wanted <= 0.0:
                return [f"{_verb(joint, 'make')} a distance of zero; a distance must be greater"]
            if value <= start.tolerance:
                return ["the constrained distance is zero at t = 0; move one of the two points"]
    return []


def _named(joint: Joint) -> str:
    return " and ".join(name for name, _ in joint.parameters)


def _verb(joint: Joint, verb: str) -> str:
    """Return the joint's parameters with a verb."""
    return f"{_named(joint)} {verb if len(joint.parameters) > 1 else verb + 's'}"


def _distance_findings(joint: Joint, equation: Equation, start: JointAtStart) -> Iterator[Finding]:
    value = start.value(equation.first)
    if equation.value is not None and abs(value - equation.value) > start.tolerance:
        message = (
            f"the constrained distance is {value:.9g} m at t = 0, but {_verb(joint, 'say')} "
            f"{equation.value:.9g} m; move the child or change {_named(joint)}"
        )
        yield Finding("", message)


def _rim_findings(joint: Joint, equation: Equation, start: JointAtStart) -> Iterator[Finding]:
    normal = start.direction(equation.first.products[0])
    yield from _contact_findings(start.value(equation.first), normal, start)


def _skew_findings(joint: Joint, equation: Equation, start: JointAtStart) -> Iterator[Finding]:
    d, e = (start.direction(product) for product in equation.first.products[3:5])
    across = cross(d, e)
    length = math.hypot(*across)
    across = scale(math.copysign(1.0, dot(start.D, across)), across)
    distance = dot(start.D, across) / length - equation.first.radius
    yield from _contact_findings(distance, scale(1.0 / length, across), start)


def _contact_findings(distance: float, normal: Vector, start: JointAtStart) -> Iterator[Finding]:
    """Find two round surfaces, or a rim and a plane, that do not touch."""
    if abs(distance) > start.tolerance:
        shift = shown(scale(-distance, normal))
        message = (
            f"the surfaces are {distance:.4g} m apart at t = 0 (less than zero: they overlap); "
            f"move the child by {shift} m (inertial axes)"
        )
        yield Finding("", message)


CHECKS = {RADIUS: _distance_findings, ROUND: _rim_findings, SKEW: _skew_findings}
"""Checks of constraint equations that are neither between directions nor along one, by kind."""


def _angle_findings(equation: Equation, start: JointAtStart) -> Iterator[Finding]:
    cosine = start.value(equation.first)
    if abs(cosine) > PARALLEL:
        angle = math.degrees(math.acos(max(-1.0, min(1.0, cosine))))
        message = f"its axes are at {angle:.7g} deg at t = 0 and must be at 90 deg; rotate one"
        yield Finding("", message)


def _shift_findings(shift: Vector, normals: int, start: JointAtStart) -> Iterator[Finding]:
    """Find a child's point that is off the parent's plane (one normal) or axis (two)."""
    distance = math.hypot(*shift)
    if distance > start.tolerance:
        place = "axis" if normals == 2 else "plane"
        message = (
            f"the child's point is {distance:.4g} m from where the parent's {place} requires it at "
            f"t = 0; move the child by {shown(shift)} m (inertial axes)"
        )
        yield Finding("", message)
