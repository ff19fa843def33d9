"""Records of markers and of what is derived from them, and of groups of bodies."""

from msahl.algebra.vector import IDENTITY, Matrix, Vector
from msahl.records import record


@record
class Marker:
    """A ``point`` [m] of a ``body`` or ground, by name, from its B in its own axes; ``axes`` are
    the marker's x, y, z as rows, in the axes of the body. ``basis`` names the body or ground in
    whose axes tables have its position, velocity and acceleration; "": inertial axes.
    """

    name: str
    body: str
    point: Vector
    axes: Matrix = IDENTITY
    basis: str = ""


@record
class MarkerDistance:
    """The distance of two markers, by name."""

    name: str
    start: str
    end: str


@record
class MarkerAngle:
    """The angle at the marker ``vertex`` between the directions to two others, from 0 to pi."""

    name: str
    start: str
    vertex: str
    end: str


@record
class Group:
    """``bodies`` by name whose mass centre, momentum and energy are written; () stands for all."""

    name: str
    bodies: tuple[str, ...] = ()


Sensor = MarkerDistance | MarkerAngle
