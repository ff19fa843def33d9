"""Records of markers: points with axes, fixed in a body, whose motion is measured."""

from dataclasses import dataclass

from msahl.algebra.vector import IDENTITY, Matrix, Vector


@dataclass(frozen=True, slots=True)
class Marker:
    """A ``point`` [m] of a ``body`` or ground, by name, from its B in its own axes; ``axes`` are
    the marker's x, y, z as rows, in the axes of the body.
    """

    name: str
    body: str
    point: Vector
    axes: Matrix = IDENTITY
