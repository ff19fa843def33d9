"""Writers of joints, couplings, motions and loads: records -> elements."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from msahl.algebra.functions import Law
from msahl.algebra.vector import IDENTITY, Matrix, Vector, transpose
from msahl.check.context import INERTIAL, Context
from msahl.check.directions import crossed_references, frame, shared_references, unit
from msahl.check.joints import SCALES
from msahl.deck.contacts import LOAD, SPEED
from msahl.deck.couplings import QUANTITIES as COUPLED
from msahl.deck.elements import child, law, number, number_unless, numbers, table, vector
from msahl.deck.ends import SIDES, carried
from msahl.deck.faults import Element
from msahl.deck.joint_start import has_references
from msahl.deck.motions import UNIT
from msahl.deck.springs import ALONG, QUANTITIES
from msahl.expressions.text import text_of
from msahl.joints.registry import KINDS
from msahl.laws.law import Field
from msahl.laws.registry import JOINT_LAWS, POINT_LAWS
from msahl.model import (
    Bushing,
    ConcentratedLoad,
    Coupling,
    DistanceLimit,
    Joint,
    JointActuator,
    JointLimit,
    JointLoad,
    JointMotion,
    JointSpring,
    MarkerActuator,
    PinContact,
    PlaneContact,
    PointLoad,
    PointMotion,
    SphereContact,
    SpringDamper,
)
from msahl.model.contacts import (
    BetweenPoints,
    BoxContact,
    BoxesContact,
    CapsuleContact,
    Contact,
    WithFriction,
)
from msahl.model.curves import STRAIGHT, Point

Sides = tuple[Matrix, Matrix]


def write_joint(group: Element, joint: Joint, context: Context) -> None:
    """Add a joint of any kind; both frames in full unless its axes say the same."""
    element, kind = _named(group, joint.kind, joint.name), KINDS[joint.kind]
    short = _frames_by_axes(joint, context) == (joint.parent_axes, joint.child_axes)
    short = short and _references(joint) == (joint.parent_reference, joint.child_reference)
    ends = _ends(element, joint, None if short else (joint.parent_axes, joint.child_axes))
    if short:
        for end, axes in zip(
            ends[: kind.axes], (joint.parent_axes, joint.child_axes), strict=False
        ):
            vector(end, "axis", axes[2])
    else:
        for end, a in zip(ends, (joint.parent_reference, joint.child_reference), strict=True):
            if a is not None:
                vector(end, "reference", a)
    for (name, quantity, default, _), (_, value) in zip(
        kind.parameters, joint.parameters, strict=True
    ):
        if value == value and value != default:  # the default of a default may be no number
            number(element, name, value, quantity)


def _frames_by_axes(joint: Joint, context: Context) -> Sides:
    """Return the frames that a deck gives the joint by its axes alone."""
    kind, bodies = KINDS[joint.kind], (joint.parent, joint.child)
    if kind.axes == 0 or kind.faces:
        frames = [IDENTITY, IDENTITY]
    else:
        axes = zip((joint.parent_axes[2], joint.child_axes[2]), bodies, strict=True)
        frames = [frame(unit(context.rotated(a, body, INERTIAL))) for a, body in axes]
    if kind.axes == 1:
        frames[1] = frames[0]
    parent, child = (carried(a, body, context) for a, body in zip(frames, bodies, strict=True))
    return parent, child


def _references(joint: Joint) -> tuple[Vector | None, Vector | None]:
    """Return the directions from which coordinates count in a deck that gives none."""
    kind = KINDS[joint.kind]
    if not has_references(kind):
        return None, None
    complete = crossed_references if kind.axes == 2 else shared_references
    return complete(joint.parent_axes[2], joint.child_axes[2], None, None)


def _named(group: Element, tag: str, name: str) -> Element:
    element = child(group, tag)
    child(element, "name", name)
    return element


def _ends(
    element: Element,
    record: Joint | SpringDamper | Bushing | BetweenPoints,
    frames: Sides | None,
) -> tuple[Element, Element]:
    """Add both ends of an element, with ``frames`` if there are some, and return them."""
    names, points = (record.parent, record.child), (record.parent_point, record.child_point)
    ends = [child(element, side) for side in SIDES]
    for k, end in enumerate(ends):
        child(end, "name", names[k])
        vector(end, "position", points[k])
        if frames is not None:
            numbers(end, "frame", [component for row in frames[k] for component in row])
    return ends[0], ends[1]


def write_coupling(group: Element, coupling: Coupling) -> None:
    """Add a coupling of two joints."""
    element = _named(group, coupling.kind, coupling.name)
    child(element, "first", coupling.first)
    child(element, "second", coupling.second)
    tag = SCALES.get(coupling.kind)
    if tag is not None:
        number(element, tag, coupling.ratio, COUPLED[tag])
    elif coupling.lift is not None:
        number_table(child(element, "lift", interpolation=coupling.lift.kind), coupling.lift, "rad")


def number_table(element: Element, given: Law, units: str = "") -> None:
    """Add arguments and values of a table to the element that holds them."""
    half = len(given.numbers) // 2
    x = numbers(element, "x", given.numbers[:half])
    if units:
        x.set("units", units)
    numbers(element, "values", given.numbers[half:])


def _joint_motion(group: Element, motion: JointMotion, context: Context) -> None:
    element = _named(group, "jointMotion", motion.name)
    child(element, "joint", motion.joint)
    child(element, "coordinate", motion.coordinate)
    law(element, motion.law, UNIT[motion.coordinate])


def _point_motion(group: Element, motion: PointMotion, context: Context) -> None:
    element = _named(group, "pointMotion", motion.name)
    child(element, "body", motion.body)
    vector(element, "position", motion.point)
    vector(element, "direction", motion.direction)
    law(element, motion.law, "length")


def _joint_limit(group: Element, limit: JointLimit, context: Context) -> None:
    element = _named(group, "jointLimit", limit.name)
    child(element, "joint", limit.joint)
    child(element, "coordinate", limit.coordinate)
    _range(element, limit, UNIT[limit.coordinate])


def _distance_limit(group: Element, limit: DistanceLimit, context: Context) -> None:
    element = _named(group, "distanceLimit", limit.name)
    _ends(element, limit, None)
    _range(element, limit, "length")


def _range(element: Element, limit: JointLimit | DistanceLimit, quantity: str) -> None:
    number(element, "lower", limit.lower, quantity)
    number(element, "upper", limit.upper, quantity)
    _contact_law(element, limit, getattr(limit, "coordinate", "slide"))


def _plane_contact(group: Element, contact: PlaneContact, context: Context) -> None:
    element = _named(group, "planeContact", contact.name)
    parent, own = _ends(element, contact, None)
    vector(parent, "normal", contact.normal)
    if contact.axis is not None:
        vector(own, "axis", contact.axis)
    number_unless(element, 0.0, "radius", contact.radius, "length")
    _contact_law(element, contact, "slide")
    _friction(element, contact)


def _sphere_contact(group: Element, contact: SphereContact, context: Context) -> None:
    tag = "sphereContact" if contact.axis is None else "cylinderContact"
    element = _named(group, tag, contact.name)
    parent, _ = _ends(element, contact, None)
    if contact.axis is not None:
        vector(parent, "axis", contact.axis)
    _round(element, contact)


def _box_contact(group: Element, contact: BoxContact, context: Context) -> None:
    is_box = contact.axes == IDENTITY
    element = _named(group, "boxContact" if is_box else "cylinderContact", contact.name)
    parent, _ = _ends(element, contact, None)
    if is_box:
        _box(element, "box", contact.half)
    else:
        vector(parent, "axis", contact.axes[2])
        number(element, "length", 2.0 * contact.half[2], "length")
    _round(element, contact)


def _round(element: Element, contact: SphereContact | BoxContact | BoxesContact) -> None:
    """Write the radii, the law and the friction of a contact."""
    number(element, "parentRadius", contact.parent_radius, "length")
    number_unless(element, 0.0, "radius", contact.radius, "length")
    _contact_law(element, contact, "slide")
    _friction(element, contact)


def _box(element: Element, tag: str, half: Vector) -> None:
    box = child(element, tag)
    for axis, size in zip(("x", "y", "z"), half, strict=True):
        number_unless(box, 0.0, axis, 2.0 * size, "length")


def _boxes_contact(group: Element, contact: BoxesContact, context: Context) -> None:
    element = _named(group, "boxContact", contact.name)
    _, own = _ends(element, contact, None)
    _box(element, "box", contact.parent_half)
    if contact.axes == IDENTITY:
        _box(element, "childBox", contact.half)
    else:
        vector(own, "axis", contact.axes[2])
        number(element, "length", 2.0 * contact.half[2], "length")
    _round(element, contact)


def _capsule_contact(group: Element, contact: CapsuleContact, context: Context) -> None:
    element = _named(group, "capsuleContact", contact.name)
    parent, own = _ends(element, contact, None)
    vector(parent, "axis", contact.parent_axis)
    vector(own, "axis", contact.axis)
    number(element, "parentRadius", contact.parent_radius, "length")
    number(element, "parentLength", 2.0 * contact.parent_half, "length")
    number(element, "radius", contact.radius, "length")
    number(element, "length", 2.0 * contact.half, "length")
    _contact_law(element, contact, "slide")
    _friction(element, contact)


def _pin_contact(group: Element, contact: PinContact, context: Context) -> None:
    element = _named(group, "pinContact", contact.name)
    parent, own = _ends(element, contact, None)
    vector(parent, "axis", contact.axes[2])
    vector(parent, "reference", contact.axes[0])
    if contact.reference != context.rotated(contact.axes[0], contact.parent, contact.child):
        vector(own, "reference", contact.reference)
    curve, given = child(element, "curve"), contact.curve
    if given.closed:
        curve.set("closed", "true")
    _point(curve, given.start)
    for part in given.parts:
        into = curve if part.kind == STRAIGHT else child(curve, part.kind)
        for point in part.points:
            _point(into, point)
    number_unless(element, 0.0, "radius", contact.radius, "length")
    _contact_law(element, contact, "slide")
    _friction(element, contact)


def _point(group: Element, point: Point) -> None:
    element = child(group, "point")
    for tag, value in zip(("x", "y"), point, strict=True):
        number(element, tag, value, "length")


def _friction(element: Element, contact: WithFriction) -> None:
    number_unless(element, 0.0, "friction", contact.friction)
    number(element, "staticFriction", contact.static_friction)


def _contact_law(element: Element, contact: Contact, coordinate: str) -> None:
    """Add what a contact along a ``coordinate`` does with impacts."""
    law = contact.compliance
    number_unless(element, 0.0 if law is None else 1.0, "restitution", contact.restitution)
    if law is not None:
        is_linear = law.exponent == 1.0
        unit = QUANTITIES[coordinate][0] if is_linear else ""
        if law.table is None:
            number(element, "stiffness", law.stiffness, unit)
        else:
            along, load = UNIT[coordinate], LOAD[coordinate]
            table(element, law.table, (along, along), (load, load))
        number_unless(element, 1.0, "exponent", law.exponent)
        number(element, "impactSpeed", law.impact_speed, SPEED[coordinate])
        number(element, "frictionWidth", law.friction_width, "velocity")


def _concentrated(group: Element, load: ConcentratedLoad, context: Context) -> None:
    element = _named(group, "concentrated", load.name)
    child(element, "body", load.body)
    vector(element, "position", load.point)
    vector(element, "force", load.force, load.force_basis, always=True)
    vector(element, "moment", load.moment, load.moment_basis, always=True)
    if load.expression is not None:
        child(child(element, "law"), "expression", text_of(load.expression))
    elif load.law is not None:
        law(element, load.law, "")


def _spring_damper(group: Element, load: SpringDamper, context: Context) -> None:
    element = _named(group, "springDamper", load.name)
    _ends(element, load, None)
    _spring(element, load, ("freeLength", "length", "force"), ("stiffness", "damping"))
    number(element, "freeLength", load.free_length, "length")


def _joint_spring(group: Element, load: JointSpring, context: Context) -> None:
    (tag, along) = next((tag, a) for tag, a in ALONG.items() if a[0] == load.coordinate)
    element = _named(group, tag, load.name)
    child(element, "joint", load.joint)
    _spring(element, load, along[1:], QUANTITIES[load.coordinate])
    number_unless(element, 0.0, along[1], load.free, along[2])


def _spring(
    element: Element,
    load: SpringDamper | JointSpring,
    along: tuple[str, str, str],
    quantities: tuple[str, str],
) -> None:
    """Add the numbers of a spring ``along`` a coordinate: tag of its unloaded value, quantities of
    displacement and load."""
    if load.compliance:
        element.set("form", "compliance")
    _, displacement, force = along
    if load.table is None:
        number(element, "stiffness", load.stiffness, quantities[0])
    number_unless(element, 0.0, "damping", load.damping, quantities[1])
    number_unless(element, 0.0, "preload", load.preload, force)
    if load.table is not None:
        table(element, load.table, (displacement, displacement), (force, force))


def _bushing(group: Element, load: Bushing, context: Context) -> None:
    element, frames = _named(group, "bushing", load.name), (load.parent_axes, load.child_axes)
    shared = transpose(context.axes[load.parent])
    short = (carried(shared, load.parent, context), carried(shared, load.child, context))
    _ends(element, load, None if short == frames and not load.aligned else frames)
    if load.compliance:
        element.set("form", "compliance")
    if load.aligned:
        element.set("unloaded", "aligned")
    for values, tags in (
        (load.stiffness, ("stiffness", "angularStiffness")),
        (load.damping, ("damping", "angularDamping")),
    ):
        for tag, three in zip(tags, (values[:3], values[3:]), strict=True):
            given = [(axis, value) for axis, value in zip("xyz", three, strict=True) if value]
            inner = child(element, tag) if given else element
            for axis, value in given:
                number(inner, axis, value, tag)


def _point_load(group: Element, load: PointLoad, context: Context) -> None:
    element = _named(group, load.law, load.name)
    child(element, "body", load.body)
    vector(element, "position", load.point)
    _parameters(element, POINT_LAWS[load.law].fields, load)


def _joint_load(group: Element, load: JointLoad, context: Context) -> None:
    element = _named(group, load.law, load.name)
    child(element, "joint", load.joint)
    child(element, "coordinate", load.coordinate)
    _parameters(element, JOINT_LAWS[load.law].fields, load, load.coordinate)


def _parameters(
    element: Element, fields: Sequence[Field], load: PointLoad | JointLoad, coordinate: str = ""
) -> None:
    """Add the numbers of a law, which may act along a ``coordinate``, but for its defaults."""
    values = dict(load.parameters)
    for field in fields:
        quantity = field.quantity_along(coordinate)
        if quantity is not None and values[field.name] != field.default:
            number(element, field.name, values[field.name], quantity)


def _joint_actuator(group: Element, load: JointActuator, context: Context) -> None:
    element = _named(group, "actuator", load.name)
    child(element, "joint", load.joint)
    child(element, "coordinate", load.coordinate)
    child(element, "expression", text_of(load.expression))


def _marker_actuator(group: Element, load: MarkerActuator, context: Context) -> None:
    element = _named(group, "actuator", load.name)
    child(element, "from", load.start)
    child(element, "to", load.end)
    child(element, "expression", text_of(load.expression))


WRITERS: Mapping[type, Callable[[Element, Any, Context], None]] = {
    JointMotion: _joint_motion,
    PointMotion: _point_motion,
    JointLimit: _joint_limit,
    DistanceLimit: _distance_limit,
    PlaneContact: _plane_contact,
    SphereContact: _sphere_contact,
    BoxContact: _box_contact,
    BoxesContact: _boxes_contact,
    CapsuleContact: _capsule_contact,
    PinContact: _pin_contact,
    ConcentratedLoad: _concentrated,
    SpringDamper: _spring_damper,
    JointSpring: _joint_spring,
    Bushing: _bushing,
    PointLoad: _point_load,
    JointLoad: _joint_load,
    JointActuator: _joint_actuator,
    MarkerActuator: _marker_actuator,
}
"""Writers of motions, contacts and loads."""
