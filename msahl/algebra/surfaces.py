"""Functions of two variables that a deck gives as tables over a grid.

    linear   bilinear between the entries: continuous
    cubic    tensor product of cubic splines (not-a-knot): continuous second derivatives

Outside the grid the value is that at its nearest edge, with the derivative zero across it. Each
cell has its own polynomial, sum c_ij u^i v^j for i, j = 0..3 with u and v from the cell's corner.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import interval_of
from msahl.jit.kernel import apart

DEGREE = 3
CELL = (DEGREE + 1) ** 2
"""Coefficients of a cell."""


@dataclass(frozen=True, slots=True)
class Surface:
    """A table over two variables as the deck gives it: ``values`` has a row for each of ``x`` and
    in it one value for each of ``y``; both increase. ``kind`` is linear or cubic.
    """

    kind: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    values: tuple[tuple[float, ...], ...]


class Surfaces(NamedTuple):
    """All tables over two variables: their numbers one after the other."""

    first: np.ndarray  # (t + 1,) into numbers
    numbers: np.ndarray  # of each: counts of x and of y, x, y, coefficients of the cells by x, y


def build_surfaces(surfaces: Sequence[Surface]) -> Surfaces:
    """Return the tables as arrays."""
    parts = [_numbers(surface) for surface in surfaces]
    return Surfaces(
        first=np.cumsum([0, *(part.size for part in parts)]).astype(np.int64),
        numbers=np.concatenate([np.zeros(0), *parts]),
    )


def axes_of(surfaces: Surfaces) -> Iterator[np.ndarray]:
    """Yield the grid lines of each table: its x, and its y."""
    for first in surfaces.first[:-1]:
        at_x, count_x, count_y = first + 2, *surfaces.numbers[first : first + 2].astype(int)
        yield surfaces.numbers[at_x : at_x + count_x]
        yield surfaces.numbers[at_x + count_x : at_x + count_x + count_y]


def _numbers(surface: Surface) -> np.ndarray:
    x, y, values = (np.array(part) for part in (surface.x, surface.y, surface.values))
    along_x = _pieces(surface.kind, x, values)  # (4, nx - 1, ny)
    # (4, nx - 1, ny) -> (ny, 4, nx - 1) -> (4, ny - 1, 4, nx - 1)
    along_both = _pieces(surface.kind, y, np.moveaxis(along_x, 2, 0))
    cells = along_both.transpose(3, 1, 2, 0)  # by x, by y, power of u, power of v
    return np.concatenate([[x.size, y.size], x, y, cells.reshape(-1)])


def _pieces(kind: str, x: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(4, n - 1, ...) ascending coefficients between the ``values`` (n, ...) over ``x``."""
    pieces = np.zeros((DEGREE + 1, x.size - 1, *values.shape[1:]))
    if kind == "linear" or x.size == 2:
        steps = np.diff(x).reshape(-1, *[1] * (values.ndim - 1))
        pieces[0], pieces[1] = values[:-1], np.diff(values, axis=0) / steps
    else:
        # Half a second to import: only models with splines pay.
        from scipy.interpolate import CubicSpline

        pieces[:] = CubicSpline(x, values, bc_type="not-a-knot").c[::-1]
    return pieces


@apart
def evaluate(surfaces: Surfaces, surface: int, x: float, y: float) -> tuple[float, float, float]:
    """Return the value of a table at ``x``, ``y`` and its derivatives by both."""
    numbers, first = surfaces.numbers, surfaces.first[surface]
    count_x, count_y = int(numbers[first]), int(numbers[first + 1])
    at_x, at_y = first + 2, first + 2 + count_x
    x_in = min(max(x, numbers[at_x]), numbers[at_x + count_x - 1])
    y_in = min(max(y, numbers[at_y]), numbers[at_y + count_y - 1])
    i = interval_of(numbers, at_x, at_x + count_x - 1, x_in) - at_x
    j = interval_of(numbers, at_y, at_y + count_y - 1, y_in) - at_y
    u, v = x_in - numbers[at_x + i], y_in - numbers[at_y + j]
    start = at_y + count_y + CELL * (i * (count_y - 1) + j)
    value, by_u, by_v = 0.0, 0.0, 0.0
    for k in range(DEGREE, -1, -1):
        row, slope = 0.0, 0.0
        for m in range(DEGREE, -1, -1):
            slope = slope * v + row
            row = row * v + numbers[start + (DEGREE + 1) * k + m]
        by_u = by_u * u + value
        value = value * u + row
        by_v = by_v * u + slope
    # A number that is none is none in the result as well.
    outside_x, outside_y = x_in != x, y_in != y
    return value, 0.0 if outside_x else by_u, 0.0 if outside_y else by_v
