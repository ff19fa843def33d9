"""Extrapolation in the machine's longest precision: for motions that multiply round-off.

Gragg's modified midpoint rule with 2, 4, ... 2 K substeps of a step H has an error in even powers
of the substep only; Aitken-Neville's scheme takes K - 1 of them away and leaves order 2 K. Its
numbers are integers, so no coefficient limits the precision. Source: Hairer, Norsett and Wanner,
Solving Ordinary Differential Equations I (1993), II.9.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

COLUMNS = 8
"""K: order 16, at 72 evaluations a step."""
MOST_SUBDIVISIONS = 6

Rate = Callable[[np.ndarray], np.ndarray]


class Refined(NamedTuple):
    """Mass centres, and how far those with steps twice as long are from them [m]."""

    x: np.ndarray  # (rows + 1, n, 3)
    apart: float


def refine(
    rate: Rate, places: Rate, start: np.ndarray, grid: float, rows: int, accuracy: float
) -> Refined:
    """Halve the step, from ``grid`` on, until that moves no mass centre by ``accuracy`` [m]."""
    x, apart = places(_solution(rate, start, grid, rows, 1)), np.inf
    for subdivisions in range(1, MOST_SUBDIVISIONS + 1):
        finer = places(_solution(rate, start, grid, rows, 2**subdivisions))
        apart = float(np.linalg.norm((finer - x).astype(float), axis=-1).max())
        x = finer
        if apart < accuracy:
            break
    return Refined(x.astype(float), apart)


def _solution(rate: Rate, start: np.ndarray, grid: float, rows: int, every: int) -> np.ndarray:
    """y at 0, grid, ... rows grid; ``every`` steps an interval."""
    # A decimal such as 0.1 has no exact double; a quotient of whole numbers is exact enough.
    H = start.dtype.type(round(grid * 1000)) / (1000 * every)
    y, table = start, [start]
    for step in range(1, rows * every + 1):
        with np.errstate(all="ignore"):
            y = _step(rate, y, H)
        if step % every == 0:
            table.append(y)
    return np.array(table)


def _step(rate: Rate, y: np.ndarray, H: np.floating) -> np.ndarray:
    """One step of order 2 ``COLUMNS``."""
    slope = rate(y)
    row: list[np.ndarray] = []
    for j in range(1, COLUMNS + 1):
        row, before = [_midpoint(rate, y, slope, H, 2 * j)], row
        for k, coarser in enumerate(before):
            ratio = (y.dtype.type(j) / (j - k - 1)) ** 2
            row.append(row[k] + (row[k] - coarser) / (ratio - 1))
    return row[-1]


def _midpoint(
    rate: Rate, y: np.ndarray, slope: np.ndarray, H: np.floating, substeps: int
) -> np.ndarray:
    h = H / substeps
    before, now = y, y + h * slope
    for _ in range(substeps - 1):
        before, now = now, before + 2 * h * rate(now)
    return now
