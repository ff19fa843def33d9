"""Where a motion comes to a kink: of laws of time, of tables of springs and cams, of friction.

A step across a kink is of the order of the kink, and two such steps may both miss it. So steps by
tolerance end there. Kinks of laws of time are known. Those of a quantity q are found after a pair
of steps has passed one: between its ends and its middle q is a cubic by its values and rates there,
a rate the parabola through three. The pair is taken again up to the root, and from its end, which
is nearer, a better root is found where need be.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import PIECES, Laws, piece_of
from msahl.elements import forces
from msahl.elements.constraints import scalar
from msahl.jit.kernel import apart, kernel
from msahl.schemes.midpoint.workspace import Workspace
from msahl.system.arrays import System

SAMPLES = 8
"""Places in a half at which a quantity is looked at: one that leaves its piece and comes back
between two of them is not found."""
NEAR = 1e-9
"""Part of a table's piece (beyond its ends: of a metre or radian), or of a friction's width, within
which a quantity is at its kink."""
AT_ENDS = 1e-6
"""Part of a pair within which a kink is as good as at its end."""
BISECTIONS = 50


class Breakpoints(NamedTuple):
    """What has kinks in a scene."""

    timed: np.ndarray  # (l,) laws of time with pieces
    table: np.ndarray  # (m,) laws of quantities with pieces
    quantity: np.ndarray  # (m,) theirs
    origin: np.ndarray  # (m,) from where these count
    rubbing: np.ndarray  # (f,) quantities with friction
    width: np.ndarray  # (f,) rate at their kinks
    value: np.ndarray  # (3, q) the quantities where a pair begins, in its middle, at its end
    rate: np.ndarray  # (3, q) likewise their rates


def new_kinks(system: System) -> Breakpoints:
    """Those of a ``system``."""
    laws, group = system.laws, system.scalar
    timed = set(forces.laws_of_time(system.forces))
    tables = [*forces.laws_of_coordinates(system.forces)]
    if group:
        timed |= set(group.equations.law.tolist())
        rows = group.equations
        tables += zip(rows.function, rows.coordinate[:, 1], np.zeros(len(rows.law)), strict=True)
    tables = [entry for entry in tables if entry[0] >= 0 and laws.kind[entry[0]] == PIECES]
    wanted = [law for law in sorted(timed) if law >= 0 and laws.kind[law] == PIECES]
    rubbing, width = forces.rate_breakpoints(system.forces)
    places = (3, group.coordinates.kind.size if group else 0)
    return Breakpoints(
        timed=np.array(wanted, dtype=np.int64),
        table=np.array([table for table, _, _ in tables], dtype=np.int64),
        quantity=np.array([quantity for _, quantity, _ in tables], dtype=np.int64),
        origin=np.array([origin for _, _, origin in tables], dtype=float),
        rubbing=rubbing,
        width=width,
        value=np.zeros(places),
        rate=np.zeros(places),
    )


@kernel
def next_kink(kinks: Breakpoints, system: System, t: float, near: float) -> float:
    """Time of the first kink of a law of time that is later than ``t`` by more than ``near``."""
    first = math.inf
    for k in range(kinks.timed.size):
        _, end = piece_of(system.laws, kinks.timed[k], t + near)
        first = min(first, end)
    return first


@kernel
def note(kinks: Breakpoints, workspace: Workspace, place: int) -> None:
    """Note the quantities of the prepared state, as those at the ``place`` 0, 1, 2 of a pair."""
    if kinks.table.size + kinks.rubbing.size > 0:
        start = workspace.start
        value, rate = kinks.value[place], kinks.rate[place]
        scalar.values(workspace.system.scalar, start.scalar, start.frames, value, rate)


@apart
def crossing(
    kinks: Breakpoints,
    system: System,
    h: float,
) -> float:
    """Part of a pair of size ``h`` at which the first quantity comes to a kink; 1 if none does, or
    only near the pair's ends.
    """
    part, value, rate = 1.0, kinks.value, kinks.rate
    for k in range(kinks.table.size):
        q, laws, table = kinks.quantity[k], system.laws, kinks.table[k]
        x0, x1, x2 = (
            value[0, q] - kinks.origin[k],
            value[1, q] - kinks.origin[k],
            value[2, q] - kinks.origin[k],
        )
        low, high = _piece(laws, table, x0, rate[0, q] * h)
        found = _leaves(x0, x1, rate[0, q] * h, rate[1, q] * h, low, high)
        if found == 1.0:
            found = 1.0 + _leaves(x1, x2, rate[1, q] * h, rate[2, q] * h, low, high)
        part = min(part, 0.5 * found)
    for k in range(kinks.rubbing.size):
        q = kinks.rubbing[k]
        part = min(part, _slows(rate[0, q], rate[1, q], rate[2, q], kinks.width[k]))
    return part if AT_ENDS < part < 1.0 - AT_ENDS else 1.0


@kernel
def _piece(laws: Laws, table: int, x: float, way: float) -> tuple[float, float]:
    """Ends of the piece that a quantity at ``x``, which moves by about ``way``, is in or at once
    comes into, with what is near them.
    """
    low, high = piece_of(laws, table, x)
    near = NEAR * (high - low) if high - low < math.inf else NEAR
    soon = near + AT_ENDS * abs(way)
    if way > 0.0 and x > high - soon:
        low, high = piece_of(laws, table, high)
    elif way < 0.0 and x < low + soon:
        low, high = piece_of(laws, table, low - 2.0 * near)
    return low - near, high + near


@kernel
def _leaves(x0: float, x1: float, v0: float, v1: float, low: float, high: float) -> float:
    """Part of half a pair at which the cubic by values and rates, over the pair, leaves the piece
    from ``low`` to ``high``; 1 if it does not.
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
    """A cubic at ``s``, by its values at 0 and 1 and twice its rates there."""
    a, b, d = 0.5 * v0, 0.5 * v1, x1 - x0
    return x0 + s * (a + s * (3.0 * d - 2.0 * a - b + s * (a + b - 2.0 * d)))


@kernel
def _slows(v0: float, v1: float, v2: float, width: float) -> float:
    """Part of a pair at which the parabola through three rates comes to ``width`` or to minus it,
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
    """A parabola at ``s``, by its values at 0, 1/2 and 1."""
    return v0 + s * (4.0 * v1 - 3.0 * v0 - v2 + s * 2.0 * (v0 + v2 - 2.0 * v1))
