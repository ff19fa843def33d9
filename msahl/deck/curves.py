"""Reader of planar curves: elements -> records."""

from msahl.deck.faults import Element, is_true
from msahl.deck.values import Reader
from msahl.model.curves import ARC, SPLINE, STRAIGHT, Curve, CurvePart, Point


def read_curve(element: Element, reader: Reader) -> Curve:
    """Return the ``<curve>`` of an element: its first point, then what follows in order."""
    given = element.find("curve")
    assert given is not None  # the schema requires it
    first, *rest = given
    parts = tuple(_part(part, reader) for part in rest)
    return Curve(_point(first, reader), parts, is_true(given, "closed"))


def _part(element: Element, reader: Reader) -> CurvePart:
    if element.tag == "point":
        return CurvePart(STRAIGHT, (_point(element, reader),))
    kind = ARC if element.tag == "arc" else SPLINE
    return CurvePart(kind, tuple(_point(point, reader) for point in element))


def _point(element: Element, reader: Reader) -> Point:
    x, y = reader.numbers(element, ("x", "y"), "length")
    return x, y
