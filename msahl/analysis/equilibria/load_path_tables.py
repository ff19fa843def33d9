"""Tables and words on a path of equilibria under growing loads."""

import numpy as np

from msahl.analysis.equilibria.load_path import PathPoint, scaled_loads
from msahl.analysis.equilibria.static_equations import with_rates
from msahl.analysis.equilibria.tables import tables_of
from msahl.analysis.linearised.point import Point, complete
from msahl.system.build import build_system, initial_places

PATH = "path"
COLUMNS = ["point", "loadFactor", "unstable", "critical", "residual", "iterations"]
"""Of path.csv: ``unstable`` directions, -1 where they were not counted; ``critical`` is 1 at a
limit point and 2 at a bifurcation; ``residual`` over the largest force."""
NUMBER = "point"
KINDS = ("", "limit point", "bifurcation")


def tables(start: Point, points: list[PathPoint]) -> dict[str, tuple[list[str], np.ndarray]]:
    """Return columns and rows of path.csv and of the tables of a run, a row for each of the
    ``points`` of a path that begins at ``start``; accelerations and velocities are zero.
    """
    rows = [
        [
            number,
            point.factor,
            -1 if point.unstable is None else point.unstable,
            KINDS.index(point.kind),
            point.residual,
            point.iterations,
        ]
        for number, point in enumerate(points, start=1)
    ]
    reached = [_under_loads(start, point) for point in points]
    return {PATH: (COLUMNS, np.array(rows, dtype=float)), **tables_of(reached, NUMBER)}


def _under_loads(start: Point, point: PathPoint) -> Point:
    """Return the model at rest under the loads of a ``point``."""
    model = scaled_loads(start.model, point.factor)
    relaxed = start.system.relaxation > 0.0
    system = build_system(model, relaxed, initial_places(start.model))
    return complete(model, system, with_rates(point.state), start.unknowns)


def lines(points: list[PathPoint]) -> list[str]:
    """Return a line for each limit point and bifurcation, and for the ends of the path."""
    shown = ["load factor      unstable directions"]
    for number, point in enumerate(points):
        if point.kind or number in (0, len(points) - 1):
            counted = "not counted" if point.unstable is None else str(point.unstable)
            shown.append(f"{point.factor:<16.9g} {point.kind or counted}")
    residual = max(point.residual for point in points)
    shown.append(f"{len(points)} equilibria; residual at most {residual:.1e} of the largest force")
    return shown
