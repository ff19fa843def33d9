"""Reader of springs and dampers between two bodies or along a joint: elements -> records."""

from msahl.algebra.functions import Law
from msahl.algebra.vector import IDENTITY, Matrix, transpose
from msahl.check.loads import element_findings, start_findings
from msahl.deck.ends import (
    SIDES,
    Ends,
    carried,
    given_frames,
    is_placed,
    own_frame,
    read_ends,
    shared_frame,
)
from msahl.deck.faults import Element, attribute, text
from msahl.deck.laws import read_table
from msahl.deck.values import Reader
from msahl.model.loads import Bushing, JointSpring, SpringDamper

Six = tuple[float, float, float, float, float, float]

ALONG = {
    "torsionalSpringDamper": ("angle", "freeAngle", "angle", "moment"),
    "slideSpringDamper": ("slide", "freeSlide", "length", "force"),
}
"""Of a spring on a joint: the joint coordinate, the tag of its unloaded value, the physical
quantities (and tags of a table's entries) of displacement and load."""

QUANTITIES = {"angle": ("angularStiffness", "angularDamping"), "slide": ("stiffness", "damping")}
"""Physical quantities of stiffness and damping along each joint coordinate."""


def read_spring_damper(element: Element, reader: Reader) -> SpringDamper:
    """Return the record of a ``<springDamper>`` between two points."""
    ends = read_ends(element, reader)
    table = _table(element, "freeLength", ("length", "force"), reader)
    free = element.find("freeLength")
    spring = SpringDamper(
        name=text(element.find("name")),
        parent=ends.parent,
        child=ends.child,
        parent_point=ends.parent_point,
        child_point=ends.child_point,
        stiffness=reader.number(element.find("stiffness"), "stiffness"),
        damping=reader.number(element.find("damping"), "damping"),
        free_length=None if free is None else reader.number(free, "length"),
        preload=reader.number(element.find("preload"), "force"),
        table=table,
        compliance=_is_compliant(element),
    )
    _check(element, spring, ends, reader)
    return spring


def read_joint_spring(element: Element, reader: Reader) -> JointSpring:
    """Return the record of a ``<torsionalSpringDamper>`` or ``<slideSpringDamper>``."""
    coordinate, free, displacement, load = ALONG[str(element.tag)]
    table = _table(element, free, (displacement, load), reader)
    stiffness, damping = QUANTITIES[coordinate]
    spring = JointSpring(
        name=text(element.find("name")),
        joint=text(element.find("joint")),
        coordinate=coordinate,
        stiffness=reader.number(element.find("stiffness"), stiffness),
        damping=reader.number(element.find("damping"), damping),
        free=reader.number(element.find(free), displacement),
        preload=reader.number(element.find("preload"), load),
        table=table,
        compliance=_is_compliant(element),
    )
    reader.add(element, element_findings(spring, reader.context))
    return spring


def read_bushing(element: Element, reader: Reader) -> Bushing:
    """Return the record of a ``<bushing>``; its frame is the parent's axes unless an end gives an
    axis, or both give their own."""
    ends = read_ends(element, reader)
    aligned = attribute(element, "unloaded") == "aligned"
    frames = given_frames(element, reader)
    if frames is None:
        read = _own_frames(element, reader) if aligned else _shared_frames(element, ends, reader)
        here, there = read
        frames = (
            carried(here, ends.parent, reader.context),
            carried(there, ends.child, reader.context),
        )
    bushing = Bushing(
        name=text(element.find("name")),
        parent=ends.parent,
        child=ends.child,
        parent_point=ends.parent_point,
        child_point=ends.child_point,
        parent_axes=frames[0],
        child_axes=frames[1],
        stiffness=_six(element, ("stiffness", "angularStiffness"), reader),
        damping=_six(element, ("damping", "angularDamping"), reader),
        aligned=aligned,
        compliance=_is_compliant(element),
    )
    _check(element, bushing, ends, reader)
    return bushing


def _is_compliant(element: Element) -> bool:
    """Return whether a spring's load is to be an unknown of each step."""
    return attribute(element, "form") == "compliance"


def _shared_frames(element: Element, ends: Ends, reader: Reader) -> tuple[Matrix, Matrix]:
    """Return the one frame of both sides of a bushing, inertial axes."""
    shared = shared_frame(element, reader)
    if shared is None:
        shared = _parents_axes(ends, reader)
        if element.find("*/reference") is not None:
            message = "<reference> has no effect without <axis>; add an <axis>"
            reader.faults.add(element, message)
    return shared, shared


def _own_frames(element: Element, reader: Reader) -> tuple[Matrix, Matrix]:
    """Return the frames of both sides of a bushing, which is unloaded where they coincide, inertial
    axes.
    """
    frames = [own_frame(element, side, reader) for side in SIDES]
    for side, frame in zip(SIDES, frames, strict=True):
        if frame is None and reader.faults.sound(element):
            message = (
                f'<axis> is missing on the {side}; with unloaded="aligned" each side has a frame '
                "of its own"
            )
            reader.faults.add(element, message)
    return frames[0] or IDENTITY, frames[1] or IDENTITY


def _check(element: Element, spring: SpringDamper | Bushing, ends: Ends, reader: Reader) -> None:
    """Add what is wrong with a spring between two bodies."""
    findings = list(element_findings(spring, reader.context))
    if not findings and is_placed(element, ends, reader):
        findings += start_findings(spring, reader.context)
    reader.add(element, findings)


def _table(element: Element, free: str, entry: tuple[str, str], reader: Reader) -> Law | None:
    """Return the table that replaces stiffness, preload and unloaded value; one of the two is
    needed.

    ``entry`` has the quantities of displacement and load, which are the tags of their columns.
    """
    table = element.find("table")
    stiffness, damping = element.find("stiffness"), element.find("damping")
    if table is None:
        if stiffness is None and damping is None and element.find("preload") is None:
            message = "it has neither <stiffness>, <table>, <damping> nor <preload>; add one"
            reader.faults.add(element, message)
        return None
    for tag in ("stiffness", "preload", free):
        place = element.find(tag)
        if place is not None:
            message = f"<table> gives it already; delete <{tag}> or the table"
            reader.faults.add(place, message)
    displacement, load = entry
    return read_table(table, (displacement, displacement), (load, load), reader)


def _parents_axes(ends: Ends, reader: Reader) -> Matrix:
    """Return the parent's own axes as rows, inertial axes."""
    return transpose(reader.context.axes.get(ends.parent, IDENTITY))


def _six(element: Element, tags: tuple[str, str], reader: Reader) -> Six:
    """Return three numbers along and three about the frame's axes [SI]; zero by default."""
    (a, b, c), (d, e, f) = (_three(element.find(tag), tag, reader) for tag in tags)
    return (a, b, c, d, e, f)


def _three(element: Element | None, quantity: str, reader: Reader) -> tuple[float, ...]:
    if element is None:
        return (0.0, 0.0, 0.0)
    return reader.numbers(element, ("x", "y", "z"), quantity)
