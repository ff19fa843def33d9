"""Records of shapes: what bodies and grounds look like. They are no part of the physics."""

from msahl.algebra.vector import IDENTITY, ZERO, Matrix, Vector
from msahl.records import record

SIZES = {
    "box": ("x", "y", "z"),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "cone": ("radius", "length"),
    "mesh": ("units",),
}
"""Kinds of shapes, and what their sizes are: a mesh has the unit of its file in metres."""


Points = tuple[tuple[float, float], ...]


@record
class BeamShape:
    """What a ``beam`` looks like, by name: outlines (y, z) [m] of its section at both ends, in the
    axes d_2, d_3, with equally many corners; ``colour`` is #rrggbb, "" for one of the view's."""

    beam: str
    start: Points
    end: Points
    colour: str = ""


@record
class Shape:
    """A shape of a ``body`` or ground, by name, fixed in its axes.

    ``size`` [m] as in ``SIZES``; ``position`` [m] of its middle (of a mesh, the origin of its file)
    from B; ``axes`` are the shape's x, y, z as rows, both in the axes of the body. Axes of
    revolution are along z. ``colour`` is #rrggbb, "" for that of the body; ``file`` the path of a
    mesh, from the folder of the deck.
    """

    body: str
    kind: str
    size: tuple[float, ...]
    position: Vector = ZERO
    axes: Matrix = IDENTITY
    colour: str = ""
    file: str = ""
