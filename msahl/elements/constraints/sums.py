"""Further terms of scalar constraint equations: sums over more than two coordinates.

    c_1 q_1 + c_2 q_2 + sum_s w_s q_s = offset        as in ``equations``, and more terms

Each term belongs to one equation and has a weight w. The load along q_s is lam w_s, so that the
forces of an equation do no work over a step, as with the first two terms. A system whose equations
have no further terms has None in place of this group.
"""

from typing import NamedTuple

import numpy as np

from msahl.elements.constraints.coordinate_kinds import Coordinates, CoordinatesWorkspace
from msahl.elements.constraints.coordinates import coordinate_acceleration, row_factor
from msahl.elements.constraints.equations import ConstraintEquations
from msahl.elements.constraints.products import PARTS
from msahl.formulations.absolute.frames import Frames
from msahl.formulations.absolute.multipliers import by_unknown, multiplier, place_of
from msahl.jit.kernel import kernel, optional


class Sums(NamedTuple):
    """All further terms."""

    row: np.ndarray  # (s,) equation
    coordinate: np.ndarray  # (s,)
    weight: np.ndarray  # (s,)
    force_block: np.ndarray  # (s, 4) starts of the blocks of the coordinate's parts by the node
    constraint_block: np.ndarray  # (s, 4) and of the node by the parts


def coordinates_of(sums: Sums | None) -> np.ndarray:
    """(s,) coordinates of all terms; of no terms an empty array."""
    return np.zeros(0, dtype=np.int64) if sums is None else sums.coordinate


def fewer(sums: Sums | None, kept: np.ndarray, number: np.ndarray) -> Sums | None:
    """Return the terms of the equations ``kept`` alone, in their order; ``number`` (q,) are the new
    numbers of the coordinates."""
    if sums is None:
        return None
    places = np.full(int(max(sums.row.max(), kept.max(initial=0))) + 1, -1, dtype=np.int64)
    places[kept] = np.arange(kept.size)
    own = places[sums.row] >= 0
    if not own.any():
        return None
    found = Sums(*(array[own] for array in sums))
    return found._replace(row=places[found.row], coordinate=number[found.coordinate])


@optional()
def add_loads(
    sums: Sums,
    rows: ConstraintEquations,
    start: CoordinatesWorkspace,
    frames: Frames,
    factor: float,
    Z: np.ndarray,
) -> None:
    """Add the multipliers, in ``Z`` times ``factor`` by mass, to the coordinates' loads."""
    for s in range(sums.row.size):
        load = sums.weight[s] * multiplier(rows, frames, Z, factor, sums.row[s])
        start.load[sums.coordinate[s]] += load
        start.size[sums.coordinate[s]] += abs(load)


@optional()
def add_changes(
    sums: Sums,
    rows: ConstraintEquations,
    start: CoordinatesWorkspace,
    frames: Frames,
    F: np.ndarray,
) -> None:
    """Add the terms' changes over the step to the constraint equations."""
    for s in range(sums.row.size):
        node, slot = place_of(rows, frames, sums.row[s])
        change = sums.weight[s] * start.change[sums.coordinate[s]]
        F[node, slot] += rows.scale[sums.row[s]] * change


@optional()
def add_blocks(
    sums: Sums,
    rows: ConstraintEquations,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    factor: float,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the equations by the places, and ``factor`` times those of the
    accelerations by the multipliers' unknowns, as ``scalar`` does for the first two terms.
    """
    for s in range(sums.row.size):
        r, q = sums.row[s], sums.coordinate[s]
        slot = rows.place[r, 1]
        for part in range(PARTS):
            down, right = sums.force_block[s, part], sums.constraint_block[s, part]
            if down > 0:
                own = sums.weight[s] * by_unknown(rows, factor, r)
                by_lam = own * row_factor(coords, frames, factor, q, part)
                for i in range(3):
                    values[down + 3 * i + slot] += by_lam * start.force[q, part, i]
                    of_equation = rows.scale[r] * sums.weight[s] * start.slope[q, part, i]
                    values[right + 3 * slot + i] += of_equation


@optional()
def add_free_acceleration(
    sums: Sums,
    rows: ConstraintEquations,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    rates: tuple[np.ndarray, np.ndarray],
    F: np.ndarray,
) -> None:
    """Add minus the terms' second derivatives at zero accelerations to the constraint equations;
    ``rates`` are v and W (f, 3).
    """
    v, W = rates
    for s in range(sums.row.size):
        node, slot = place_of(rows, frames, sums.row[s])
        second = coordinate_acceleration(coords, start, v, W, sums.coordinate[s])
        F[node, slot] -= rows.scale[sums.row[s]] * sums.weight[s] * second


@optional()
def add_violations(
    sums: Sums,
    rows: ConstraintEquations,
    start: CoordinatesWorkspace,
    rate: np.ndarray,
    violation: np.ndarray,
    violation_rate: np.ndarray,
) -> None:
    """Add the terms to ``violation`` and ``violation_rate`` (k, 3), by the equations' places;
    ``rate`` (q,) are those of the coordinates.
    """
    for s in range(sums.row.size):
        r, q = sums.row[s], sums.coordinate[s]
        _add_to(violation, rows, r, sums.weight[s] * start.value[q])
        _add_to(violation_rate, rows, r, sums.weight[s] * rate[q])


@kernel
def _add_to(table: np.ndarray, rows: ConstraintEquations, r: int, value: float) -> None:
    table[rows.place[r, 0], rows.place[r, 1]] += value
