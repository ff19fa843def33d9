"""Finds breakpoints: times at which a law of time, a table or a friction law is not smooth.

A step across a breakpoint has the order of the law's smoothness there, and the comparison of two
such steps may miss it. So steps by tolerance end at breakpoints. Those of laws of time are known.
Those of a coordinate q (tables of springs and cams) or of its rate (friction) are found after a
pair of steps has passed one. In each half of the pair q is taken as the cubic Hermite polynomial of
its values and rates at the ends, and a rate over the pair as the parabola through three values. The
pair is taken again up to the root. If that is not near enough, the search is repeated from there.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import PIECES, Laws, piece_of
from msahl.elements.constraints import scalar
from msahl.jit.kernel import apart, kernel
from msahl.ports import forces
from msahl.schemes.common.workspace import Workspace
from msahl.system.arrays import System

SAMPLES = 8
"""Points in each half at which a coordinate is evaluated. One that leaves its piece and comes back
between two of them is not found."""
NEAR = 1e-9
"""Fraction of a table's piece (beyond its ends: of a metre or radian), or of a friction law's
width, within which a coordinate counts as being at it."""
AT_ENDS = 1e-6
"""Fraction of a pair within which a breakpoint counts as being at the end of the pair."""
BISECTIONS = 50


class Breakpoints(NamedTuple):
    """Laws with breakpoints, and the coordinates on which these depend."""

    time_laws: np.ndarray  # (l,) piecewise laws of time
    table: np.ndarray  # (m,) piecewise laws of coordinates
    coordinate: np.ndarray  # (m,) their coordinates
    origin: np.ndarray  # (m,) values of these at the laws' origins [m or rad]
    friction: np.ndarray  # (f,) coordinates with friction
    width: np.ndarray  # (f,) rate at their breakpoints [m/s or rad/s]
    value: np.ndarray  # (3, q) all coordinates at the start, middle and end of a pair
    rate: np.ndarray  # (3, q) their rates there


def new_breakpoints(system: System) -> Breakpoints:
    """Return the breakpoints of a ``system``."""
    laws, group = system.laws, system.scalar
    timed = set(forces.laws_of_time(system.forces))
    tables = [*forces.laws_of_coordinates(system.forces)]
    if group:
        timed |= set(group.equations.law.tolist())
        rows = group.equations
        tables += zip(rows.function, rows.coordinate[:, 1], np.zeros(len(rows.law)), strict=True)
    tables = [entry for entry in tables if entry[0] >= 0 and laws.kind[entry[0]] == PIECES]
    wanted = [law for law in sorted(timed) if law >= 0 and laws.kind[law] == PIECES]
    friction, width = forces.rate_breakpoints(system.forces)
    places = (3, group.coordinates.kind.size if group else 0)
    return Breakpoints(
        time_laws=np.array(wanted, dtype=np.int64),
        table=np.array([table for table, _, _ in tables], dtype=np.int64),
        coordinate=np.array([coordinate for _, coordinate, _ in tables], dtype=np.int64),
        origin=np.array([origin for _, _, origin in tables], dtype=float),
        friction=friction,
        width=width,
        value=np.zeros(places),
        rate=np.zeros(places),
    )


@kernel
def next_law_breakpoint(breakpoints: Breakpoints, system: System, t: float, near: float) -> float:
    """Time of the first breakpoint of a law of time after ``t``, by more than ``near``."""
    first = math.inf
    for k in range(breakpoints.time_laws.size):
        _, end = piece_of(system.laws, breakpoints.time_laws[k], t + near)
        first = min(first, end)
    return first


@kernel
def save_coordinates(breakpoints: Breakpoints, workspace: Workspace, place: int) -> None:
    """Save the coordinates of the prepared state as those at the start (``place`` 0), the middle
    (1) or the end (2) of a pair.
    """
    if breakpoints.table.size + breakpoints.friction.size > 0:
        start = workspace.start
        value, rate = breakpoints.value[place], breakpoints.rate[place]
        scalar.values(workspace.system.scalar, start.scalar, start.frames, value, rate)


@apart
def first_crossing(breakpoints: Breakpoints, system: System, h: float) -> float:
    """Fraction of a pair of size ``h`` at which the first coordinate reaches a breakpoint; 1 if
    none does, or only near the ends of the pair.
    """
    part, value, rate = 1.0, breakpoints.value, breakpoints.rate
    for k in range(breakpoints.table.size):
        q, laws, table = breakpoints.coordinate[k], system.laws, breakpoints.table[k]
        x0, x1, x2 = (
            value[0, q] - breakpoints.origin[k],
            value[1, q] - breakpoints.origin[k],
            value[2, q] - breakpoints.origin[k],
        )
        low, high = _piece(laws, table, x0, rate[0, q] * h)
        found = _leaving_point(x0, x1, rate[0, q] * h, rate[1, q] * h, low, high)
        if found == 1.0:
            found = 1.0 + _leaving_point(x1, x2, rate[1, q] * h, rate[2, q] * h, low, high)
        part = min(part, 0.5 * found)
    for k in range(breakpoints.friction.size):
        q = breakpoints.friction[k]
        part = min(part, _friction_point(rate[0, q], rate[1, q], rate[2, q], breakpoints.width[k]))
    return part if AT_ENDS < part < 1.0 - AT_ENDS else 1.0


@kernel
def _piece(laws: Laws, table: int, x: float, change: float) -> tuple[float, float]:
    """Ends of the piece that contains a coordinate ``x`` or that it enters at once, moved outwards
    by the tolerance ``NEAR``; ``change`` is about how far it moves in half a pair.
    """
    low, high = piece_of(laws, table, x)
    near = NEAR * (high - low) if high - low < math.inf else NEAR
    soon = near + AT_ENDS * abs(change)
    if change > 0.0 and x > high - soon:
        low, high = piece_of(laws, table, high)
    elif change < 0.0 and x < low + soon:
        low, high = piece_of(laws, table, low - 2.0 * near)
    return low - near, high + near


@kernel
def _leaving_point(x0: float, x1: float, v0: float, v1: float, low: float, high: float) -> float:
    """Fraction of half a pair at which the cubic with values ``x0``, ``x1`` and rates ``v0``,
    ``v1`` by the fraction of the pair leaves the piece from ``low`` to ``high``; 1 if it does not.
    """
    before = 0.0
    for k in range(1, SAMPLES + 1):
        here = k / SAMPLES
        x = _cubic(x0, x1, v0, v1, here)
        if low <= x <= high:
            before = here
            continue
        sign, edge = (1.0, high) if x > high else (-1.0, low)
        for _ in range(BISECTIONS):
            middle = 0.5 * (before + here)
            if sign * (_cubic(x0, x1, v0, v1, middle) - edge) > 0.0:
                here = middle
            else:
                before = middle
        return before
    return 1.0


@kernel
def _cubic(x0: float, x1: float, v0: float, v1: float, s: float) -> float:
    """Cubic Hermite polynomial at ``s``, by its values at 0 and 1 and twice its rates there."""
    a, b, d = 0.5 * v0, 0.5 * v1, x1 - x0
    return x0 + s * (a + s * (3.0 * d - 2.0 * a - b + s * (a + b - 2.0 * d)))


@kernel
def _friction_point(v0: float, v1: float, v2: float, width: float) -> float:
    """Fraction of a pair at which the parabola through three rates reaches ``width`` or -``width``
    from either side; 1 if it does not.
    """
    near, v_before, before = NEAR * width, v0, 0.0
    for k in range(1, 2 * SAMPLES + 1):
        here = k / (2.0 * SAMPLES)
        v = _parabola(v0, v1, v2, here)
        for side in range(2):
            edge = width if side == 0 else -width
            if abs(v_before - edge) > near and (v_before - edge) * (v - edge) < 0.0:
                left, right = before, here
                for _ in range(BISECTIONS):
                    middle = 0.5 * (left + right)
                    if (_parabola(v0, v1, v2, middle) - edge) * (v_before - edge) > 0.0:
                        left = middle
                    else:
                        right = middle
                return right
        before, v_before = here, v
    return 1.0


@kernel
def _parabola(v0: float, v1: float, v2: float, s: float) -> float:
    """Value at ``s`` of the parabola with given values at 0, 1/2 and 1."""
    return v0 + s * (4.0 * v1 - 3.0 * v0 - v2 + s * 2.0 * (v0 + v2 - 2.0 * v1))
