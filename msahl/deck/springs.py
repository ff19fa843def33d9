"""Springs and dampers between two bodies: elements -> records."""

import math

from msahl.algebra.functions import Law
from msahl.algebra.vector import IDENTITY, Matrix, transpose
from msahl.deck.ends import Ends, carried, is_placed, open_by, read_ends, shared_frame, tolerance
from msahl.deck.faults import Element, text
from msahl.deck.laws import read_table
from msahl.deck.loads import not_negative
from msahl.deck.named import named_joint
from msahl.deck.values import Reader
from msahl.model.loads import Bushing, JointSpring, SpringDamper

Six = tuple[float, float, float, float, float, float]

ALONG = {
    "torsionalSpringDamper": ("angle", "freeAngle", "angle", "moment"),
    "slideSpringDamper": ("slide", "freeSlide", "length", "force"),
}
"""Of a spring on a joint: the free motion, the tag of its unloaded place, the quantities (and tags
of a table's entries) of motion and load."""

QUANTITIES = {"angle": ("angularStiffness", "angularDamping"), "slide": ("stiffness", "damping")}
"""Of stiffness and damping along each free motion."""


def read_spring_damper(element: Element, reader: Reader) -> SpringDamper:
    """Record of a ``<springDamper>`` between two points."""
    ends = read_ends(element, reader)
    table = _table(element, "freeLength", ("length", "force"), reader)
    free = element.find("freeLength")
    if is_placed(element, ends, reader):
        _check_length(element, ends, reader)
    return SpringDamper(
        name=text(element.find("name")),
        parent=ends.parent,
        child=ends.child,
        parent_point=ends.parent_point,
        child_point=ends.child_point,
        stiffness=reader.number(element.find("stiffness"), "stiffness"),
        damping=not_negative(element, "damping", "damping", reader),
        free_length=None if free is None else not_negative(element, "freeLength", "length", reader),
        preload=reader.number(element.find("preload"), "force"),
        table=table,
    )


def read_joint_spring(element: Element, reader: Reader) -> JointSpring:
    """Record of a ``<torsionalSpringDamper>`` or ``<slideSpringDamper>``."""
    coordinate, free, motion, load = ALONG[str(element.tag)]
    table = _table(element, free, (motion, load), reader)
    stiffness, damping = QUANTITIES[coordinate]
    return JointSpring(
        name=text(element.find("name")),
        joint=named_joint(element, "joint", coordinate, reader),
        coordinate=coordinate,
        stiffness=reader.number(element.find("stiffness"), stiffness),
        damping=not_negative(element, "damping", damping, reader),
        free=reader.number(element.find(free), motion),
        preload=reader.number(element.find("preload"), load),
        table=table,
    )


def read_bushing(element: Element, reader: Reader) -> Bushing:
    """Record of a ``<bushing>``; its frame is the parent's axes unless an end gives an axis."""
    ends = read_ends(element, reader)
    shared = shared_frame(element, reader)
    if shared is None:
        shared = _parents_axes(ends, reader)
        if element.find("*/reference") is not None:
            reader.faults.add(element, "<reference> says nothing without <axis>; add one")
    if is_placed(element, ends, reader) and not reader.project:
        violation = open_by(ends, reader)
        if violation:
            reader.faults.add(element, violation)
    stiffness = _six(element, ("stiffness", "angularStiffness"), reader)
    damping = _six(element, ("damping", "angularDamping"), reader)
    if min(damping) < 0.0:
        reader.faults.add(element, "a damping is less than zero; a damper takes energy out only")
    if not any((*stiffness, *damping)) and reader.faults.sound(element):
        reader.faults.add(element, "it has neither stiffness nor damping; add one")
    return Bushing(
        name=text(element.find("name")),
        parent=ends.parent,
        child=ends.child,
        parent_point=ends.parent_point,
        child_point=ends.child_point,
        parent_axes=carried(shared, ends.parent, reader),
        child_axes=carried(shared, ends.child, reader),
        stiffness=stiffness,
        damping=damping,
    )


def _table(element: Element, free: str, entry: tuple[str, str], reader: Reader) -> Law | None:
    """The table in place of stiffness, preload and unloaded place; one of the two must be there.

    ``entry`` has the quantities of motion and load, which are the tags of their columns.
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
            reader.faults.add(place, f"<table> says it already; delete <{tag}> or the table")
    motion, load = entry
    return read_table(table, (motion, motion), (load, load), reader)


def _check_length(element: Element, ends: Ends, reader: Reader) -> None:
    """The points are apart at t = 0, or the spring has no direction."""
    here = reader.placed(ends.parent, ends.parent_point)
    there = reader.placed(ends.child, ends.child_point)
    if math.dist(here, there) <= tolerance(ends, ends.arm(), reader):
        message = "its length is zero at t = 0, so it has no direction; move one of its points"
        reader.faults.add(element, message)


def _parents_axes(ends: Ends, reader: Reader) -> Matrix:
    """The parent's own axes as rows, inertial axes."""
    return transpose(reader.axes.get(ends.parent, IDENTITY))


def _six(element: Element, tags: tuple[str, str], reader: Reader) -> Six:
    """Three numbers along and three about the frame's axes [SI]; zero where left out."""
    (a, b, c), (d, e, f) = (_three(element.find(tag), tag, reader) for tag in tags)
    return (a, b, c, d, e, f)


def _three(element: Element | None, quantity: str, reader: Reader) -> tuple[float, ...]:
    if element is None:
        return (0.0, 0.0, 0.0)
    return reader.numbers(element, ("x", "y", "z"), quantity)
