"""Tables of equilibria: those of a run, and the loads.

Each has one row for each equilibrium, whose number stands in place of the time. Beside the tables
of a run (``run.tables``), ``loads`` has what every load exerts:

    NAME.load              tension of a spring, against the coordinate of its joint; load of an
                           actuator, along it [N or N m]
    NAME.Fx to NAME.Mz     force and moment on the body, of a bushing on its child, at the point of
                           the load, inertial axes [N, N m]

Friction vanishes at rest and has no column.
"""

from collections.abc import Callable, Iterator

import numpy as np

from msahl.algebra.functions import build_laws, evaluate
from msahl.algebra.rotation import matrix
from msahl.algebra.vector import at
from msahl.analysis.equilibria.equilibrium import Solution
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.projection import prepared
from msahl.model import (
    Actuator,
    Bushing,
    ConcentratedLoad,
    JointActuator,
    JointSpring,
    Load,
    MarkerActuator,
    Model,
    PointLoad,
    SpringDamper,
)
from msahl.ports import coordinate, forces
from msahl.ports import point as at_points
from msahl.run.hidden_bodies import shown_tables, without_hidden
from msahl.run.observed import ObservedTables
from msahl.run.tables import (
    ACCELERATIONS,
    REACTIONS,
    RESULTANTS,
    SIGNALS,
    STATES,
    WORK,
)
from msahl.schemes.common.workspace import write_configuration
from msahl.system.arrays import SystemWorkspace, Tables, new_tables
from msahl.system.collect import collect
from msahl.system.names import (
    FACTOR_COLUMN,
    FORCE_COLUMNS,
    LOAD_COLUMN,
    MOMENT_COLUMNS,
    acceleration_columns,
    signal_columns,
)

LOADS = "loads"
NUMBER = "equilibrium"
"""First column of every table of equilibria."""
PAIRS = ((2, 1), (0, 2), (1, 0))
"""Axes of parent and child whose product is a bushing's rotation about x, y and z."""
COLUMNS: dict[type[Load], tuple[str, ...]] = {
    **dict.fromkeys((SpringDamper, JointSpring, JointActuator, MarkerActuator), (LOAD_COLUMN,)),
    **dict.fromkeys((ConcentratedLoad, Bushing, PointLoad), (*FORCE_COLUMNS, *MOMENT_COLUMNS)),
}
"""What ``loads.csv`` has of each kind of load."""


def tables(found: list[Solution]) -> dict[str, tuple[list[str], np.ndarray]]:
    """Return columns and rows of the tables, one row for each equilibrium."""
    return tables_of([solution.place.point for solution in found])


def tables_of(points: list[Point], number: str = NUMBER) -> dict[str, tuple[list[str], np.ndarray]]:
    """Return columns and rows of the tables, one row for each of the ``points``, whose ``number``
    is in the first column.
    """
    model = points[0].model
    known = {**shown_tables(model), LOADS: load_columns(model)}
    rows = [_rows(point) for point in points]
    result = {}
    for name, columns in known.items():
        if name in rows[0] and len(columns) > 1:
            table = without_hidden(model, {name: np.array([row[name] for row in rows])})[name]
            table[:, 0] = np.arange(1, len(points) + 1)
            result[name] = ([number, *columns[1:]], table + 0.0)  # no minus before a zero
    return result


def state_row(point: Point) -> np.ndarray:
    """(12 n,) the row of states.csv, without the time."""
    row: np.ndarray = _written(point)[1].states[0]
    return row


def _rows(point: Point) -> dict[str, np.ndarray]:
    """The row of each table by its name, with the time."""
    start, written = _written(point)
    time = point.state.time[:1]
    rows = {
        STATES: np.concatenate([time, written.states[0]]),
        REACTIONS: np.concatenate([time, written.reactions[0]]),
        SIGNALS: np.concatenate([time, written.signals[0]]),
        RESULTANTS: np.concatenate([time, written.resultants[0]]),
        LOADS: np.concatenate([time, *_loads(point, start, written.signals[0])]),
        ACCELERATIONS: np.zeros(len(acceleration_columns(point.model))),
    }
    # The energy of a group contains that of the springs.
    given = rows | {WORK: np.concatenate([time, written.work[0]])}
    observed = ObservedTables(point.model).rows({name: row[None] for name, row in given.items()})
    return rows | {name: table[0] for name, table in observed.items()}


def _written(point: Point) -> tuple[SystemWorkspace, Tables]:
    """What the elements need of a configuration, and its row of the tables of the steppers."""
    system, state = point.system, point.state
    start, written = prepared(system, state), new_tables(system, state, 1)
    forces.elastic_energy(system.forces, start.forces, system.scalar)
    write_configuration(system, state, start, (state.force, state.reaction, 0.0), written, 0)
    return start, written


def load_columns(model: Model) -> list[str]:
    """Header of ``loads.csv``, with the time."""
    columns = ((load.name, COLUMNS.get(type(load), ())) for load in model.loads)
    return ["time", *(f"{name}.{column}" for name, own in columns for column in own)]


def _loads(point: Point, start: SystemWorkspace, signals: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the values of each load that has columns."""
    tensions = _tensions(point, start)
    value = dict(zip(signal_columns(point.model)[1:], signals.tolist(), strict=True))
    for column, load in enumerate(point.model.loads):
        if isinstance(load, SpringDamper | JointSpring):
            yield np.array(tensions[column])
        elif isinstance(load, Actuator):
            yield np.array([value[f"{load.name}.{LOAD_COLUMN}"]])
        elif isinstance(load, ConcentratedLoad):
            factor = value.get(f"{load.name}.{FACTOR_COLUMN}", 1.0)
            yield _concentrated(point, load, factor)
        elif isinstance(load, Bushing):
            yield _bushing(point, load, tensions[column])
        elif isinstance(load, PointLoad):
            yield _at_point(point, start, column)


def _tensions(point: Point, start: SystemWorkspace) -> dict[int, list[float]]:
    """Tensions of all springs, in the order of their coordinates, by the number of their load."""
    group, found = point.system.forces.along, dict[int, list[float]]()
    for s, entry in enumerate(collect(point.model).along):
        q = coordinate.elongation(group, start.scalar.coordinates, s)
        T, _ = coordinate.tension(group, point.system.forces.laws, s, q)
        found.setdefault(entry.column, []).append(float(T))
    return found


def _rotation(point: Point) -> Callable[[str], np.ndarray]:
    """Return the function that returns the axes (3, 3) of a body or ground by its name."""
    number = {body.name: b for b, body in enumerate(point.model.bodies)}
    P = point.state.p
    return lambda name: np.array(matrix(at(P, number[name]))) if name in number else np.eye(3)


def _concentrated(point: Point, load: ConcentratedLoad, factor: float) -> np.ndarray:
    """Force and moment at the point of a load."""
    axes = _rotation(point)
    if load.law is not None:
        factor *= evaluate(build_laws([load.law]), 0, point.time)[0]
    force, moment = axes(load.force_basis) @ load.force, axes(load.moment_basis) @ load.moment
    return factor * np.concatenate([force, moment])


def _bushing(point: Point, load: Bushing, tensions: list[float]) -> np.ndarray:
    """Force and moment on the child of a bushing, at its point."""
    axes, left = _rotation(point), iter(tensions)
    parent = np.array(load.parent_axes) @ axes(load.parent).T  # rows, inertial axes
    child = np.array(load.child_axes) @ axes(load.child).T
    force, moment = np.zeros((2, 3))
    for i, (k, c) in enumerate(zip(load.stiffness, load.damping, strict=True)):
        if not (k or c):
            continue
        if i < 3:
            force -= next(left) * parent[i]
        else:
            p, q = PAIRS[i - 3]
            moment -= next(left) * np.cross(child[q], parent[p])
    return np.concatenate([force, moment])


def _at_point(point: Point, start: SystemWorkspace, column: int) -> np.ndarray:
    """Force on a body by a law of the velocity of its point, and no moment."""
    group = point.system.forces.point
    assert group is not None
    (k,) = np.flatnonzero(group.column == column)
    V = at_points.velocity(group, start.forces.point, start.frames, int(k))
    return np.concatenate([at_points.load_of(group, int(k), V), np.zeros(3)])
