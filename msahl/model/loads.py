"""Records of loads; ``msahl.laws`` and ``msahl.ports`` have their equations."""

from msahl.algebra.functions import Law
from msahl.algebra.vector import Matrix, Vector
from msahl.expressions.syntax import Tree
from msahl.records import record


@record
class ConcentratedLoad:
    """``point`` [m] from B in the body's axes; ``force`` [N] and ``moment`` [N m] have constant
    components in the axes of the bodies (or grounds) named by ``force_basis`` and
    ``moment_basis``, and rotate with them; ``law`` of time, or ``expression`` of the motion,
    multiplies both. Body forces and distributed loads become their resultant.
    """

    name: str
    body: str
    point: Vector
    force: Vector
    force_basis: str
    moment: Vector
    moment_basis: str
    law: Law | None = None
    expression: Tree | None = None


@record
class SpringDamper:
    """Between two points [m] (from each body's B, its axes): tension ``preload`` + ``stiffness``
    (length - ``free_length``) [N], or ``table`` over length, and ``damping`` [N s/m] times the
    rate. Without ``free_length`` it is the distance at t = 0. With ``compliance`` its force is an
    unknown of each step."""

    name: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
    stiffness: float
    damping: float
    free_length: float | None = None
    preload: float = 0.0
    table: Law | None = None
    compliance: bool = False


@record
class JointSpring:
    """Spring-damper along the ``coordinate`` of ``joint``: units of N, m or N m, rad. The spring is
    unloaded at ``free``, counted from t = 0. With ``compliance`` its load is an unknown of
    each step."""

    name: str
    joint: str
    coordinate: str
    stiffness: float
    damping: float
    free: float = 0.0
    preload: float = 0.0
    table: Law | None = None
    compliance: bool = False


@record
class Bushing:
    """Stiffness and damping of three displacements of the child's point along the parent's frame
    and of three small rotations about it: N/m and N m/rad in that order. All are zero at t = 0, or,
    if it is ``aligned``, where points and frames coincide. With ``compliance`` the loads along
    directions with a stiffness are unknowns of each step."""

    name: str
    parent: str
    child: str
    parent_point: Vector
    child_point: Vector
    parent_axes: Matrix
    child_axes: Matrix
    stiffness: tuple[float, float, float, float, float, float]
    damping: tuple[float, float, float, float, float, float]
    aligned: bool = False
    compliance: bool = False


@record
class PointLoad:
    """Force at a ``point`` [m] (from B, body axes) of a body by a ``law`` of ``msahl.laws``, for
    example drag; ``parameters`` are the law's fields by name, in SI."""

    name: str
    law: str
    body: str
    point: Vector
    parameters: tuple[tuple[str, float], ...]


@record
class JointLoad:
    """Force along the ``coordinate`` of ``joint`` by a ``law`` of ``msahl.laws``, for example
    friction. ``parameters`` are the law's fields by name, in SI."""

    name: str
    law: str
    joint: str
    coordinate: str
    parameters: tuple[tuple[str, float], ...]


@record
class JointActuator:
    """Actuator along the ``coordinate`` of ``joint``: its load, equal and opposite on both bodies,
    is an ``expression`` of the motion [N or N m], positive where the coordinate increases."""

    name: str
    joint: str
    coordinate: str
    expression: Tree


@record
class MarkerActuator:
    """Actuator between two markers, by name: a force along the line through them, equal and
    opposite, is an ``expression`` of the motion [N]; a positive one pushes them apart."""

    name: str
    start: str
    end: str
    expression: Tree


Actuator = JointActuator | MarkerActuator
Load = ConcentratedLoad | SpringDamper | JointSpring | Bushing | PointLoad | JointLoad | Actuator
