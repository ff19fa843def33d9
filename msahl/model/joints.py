"""Records of joints, in SI units; ``msahl.joints`` has the equations of each kind."""

from msahl.algebra.vector import IDENTITY, Matrix, Vector
from msahl.records import record


@record
class Joint:
    """A joint of a ``kind`` between two bodies, ``parent`` and ``child``, by name.

    ``parent_point`` and ``child_point`` [m] are given from each body's B, and ``parent_axes`` and
    ``child_axes``, the rows x, y, z of the joint's frame, in that body's axes; ``parameters`` by
    name, in SI. Coordinates are zero where ``child_reference``, a direction of the child
    perpendicular to its axis, is along ``parent_reference`` (see ``msahl.joints.coordinates``); by
    default these are the x of the frames.
    """

    name: str
    kind: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
    parent_axes: Matrix = IDENTITY
    child_axes: Matrix = IDENTITY
    parameters: tuple[tuple[str, float], ...] = ()
    parent_reference: Vector | None = None
    child_reference: Vector | None = None

    def parameter(self, name: str) -> float:
        """Return the value of the parameter ``name`` [SI]."""
        return dict(self.parameters)[name]
