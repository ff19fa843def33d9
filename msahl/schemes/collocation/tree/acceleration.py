"""Anderson's acceleration of the iteration of a step that contracts slowly.

From rates u with the correction y the plain iteration goes to u - y. With the changes dU and dY of
both in the last two iterations it goes to

    u - y - sum g_i (dU_i - dY_i)        g: minimum of |y - sum g_i dY_i|

in the norm of displacements. Near the solution that is what GMRES makes of the linear iteration.

Source: D. G. Anderson, Iterative procedures for nonlinear integral equations, J. ACM 12 (1965).
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import copy
from msahl.jit.kernel import kernel
from msahl.jit.lanes import LANES

SLOW = 0.05
"""Contraction from which the changes are worth their use."""
PARALLEL = 1e-8
"""Square of the sine between both changes below which one of them is enough."""


class History(NamedTuple):
    """The last two iterations of a step with n coordinates."""

    u: np.ndarray  # (n, LANES) rates of the last iteration
    y: np.ndarray  # (n, LANES) and their correction
    du: np.ndarray  # (2, n, LANES) changes of rates, the last one at number % 2
    dy: np.ndarray  # (2, n, LANES) and of corrections
    number: np.ndarray  # (1,) of changes in this step


def new_history(n: int) -> History:
    """Return the arrays for ``n`` coordinates."""
    u, y = np.zeros((2, n, LANES))
    du, dy = np.zeros((2, 2, n, LANES))
    return History(u, y, du, dy, np.zeros(1, dtype=np.int64))


@kernel
def accelerate(
    history: History, length: np.ndarray, u: np.ndarray, y: np.ndarray, ratio: float, first: bool
) -> None:
    """Add to the correction ``y`` (n, LANES) of the rates ``u`` (n, LANES) what the last changes
    show, if the ``ratio`` of the last corrections is slow. ``length`` (n,) [m or 1] weighs them.
    """
    if first:
        history.number[0] = 0
        copy(u, history.u)
        copy(y, history.y)
        return
    history.number[0] += 1
    last = history.number[0] % 2
    du, dy = history.du[last], history.dy[last]
    for k in range(length.size):
        for i in range(LANES):
            du[k, i], dy[k, i] = u[k, i] - history.u[k, i], y[k, i] - history.y[k, i]
    copy(u, history.u)
    copy(y, history.y)
    if ratio > SLOW:
        _extrapolate(history, length, last, y)


@kernel
def _extrapolate(history: History, length: np.ndarray, last: int, y: np.ndarray) -> None:
    """Add the share of both changes to ``y``."""
    a, b = history.dy[last], history.dy[1 - last]
    aa, ay = _product(length, a, a), _product(length, a, y)
    if not aa > 0.0:
        return
    share, other = ay / aa, 0.0
    if history.number[0] > 1:
        bb, ab, by = _product(length, b, b), _product(length, a, b), _product(length, b, y)
        square = aa * bb - ab * ab
        if square > PARALLEL * aa * bb:
            share, other = (ay * bb - by * ab) / square, (by * aa - ay * ab) / square
    for k in range(length.size):
        for i in range(LANES):
            y[k, i] += share * (history.du[last, k, i] - a[k, i])
            y[k, i] += other * (history.du[1 - last, k, i] - b[k, i])


@kernel
def _product(length: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    """Scalar product of two changes, as displacements."""
    total = 0.0
    for k in range(length.size):
        for i in range(LANES):
            total += length[k] * length[k] * a[k, i] * b[k, i]
    return total
