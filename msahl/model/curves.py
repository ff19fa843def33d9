"""Records of planar curves: parts that go on from each other, in SI units."""

from typing import TypeAlias

from msahl.records import record

STRAIGHT, ARC, SPLINE = CURVE_PARTS = ("line", "arc", "spline")

Point: TypeAlias = tuple[float, float]


@record
class CurvePart:
    """From the end of the part before: a straight line to one point, an arc through one point to
    another, or a smooth curve through all ``points`` [m]."""

    kind: str
    points: tuple[Point, ...]


@record
class Curve:
    """A curve from ``start`` [m] along its ``parts``: what is on the left of it is solid. A
    ``closed`` one goes back to the start, straight if need be; one of a single spline is smooth
    there. An open one goes on straight at both ends."""

    start: Point
    parts: tuple[CurvePart, ...]
    closed: bool = False
