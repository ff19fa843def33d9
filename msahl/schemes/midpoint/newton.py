"""Newton's method on the sparse system, and the loop of many steps, to be compiled.

One Jacobian serves a whole step: the guess is good enough that the error of the first, exact,
iteration is squared and later ones gain as much again. It is renewed where a residual does not
fall to a twentieth.
"""

import math

import numpy as np

from msahl.elements.frames import first_multiplier
from msahl.jit.kernel import kernel
from msahl.linalg import dense, sparse_lu
from msahl.schemes.midpoint import equations, load_moments
from msahl.schemes.midpoint.workspace import Workspace, accept, show
from msahl.schemes.outcome import TARGET, TOLERANCE

MAX_ITERATIONS = 25
SLOW = 0.05
"""Ratio of residuals above which the Jacobian is made anew."""
STUCK = 0.5
"""Ratio of residuals above which a solved step is not improved further."""
DIVERGED = 1e3
"""Residual, relative to the smallest so far, at which an iteration is given up."""


@kernel
def solve_step(workspace: Workspace, h: float) -> tuple[float, int]:
    """Solve one step from the guess in ``Z``; its residual (relative) and worst row."""
    system, state, start, Z, F = (
        workspace.system,
        workspace.state,
        workspace.start,
        workspace.Z,
        workspace.F,
    )
    unknowns, y = workspace.unknowns, workspace.y
    order = unknowns.elimination.order
    equations.residual(system, state, start, h, Z, F)
    residual, worst, guess = dense.judge(system, unknowns, start, h, Z, F)
    step = guess
    smallest, slow, stuck = residual, True, False
    for _ in range(MAX_ITERATIONS):
        if residual <= TARGET or stuck or not residual <= DIVERGED * smallest:
            break
        if slow:
            equations.jacobian(system, start, h, Z, workspace.values)
            sparse_lu.factor(unknowns.elimination, workspace.values, workspace.factor)
            workspace.pivots[0] = max(
                workspace.pivots[0], sparse_lu.spread(unknowns.elimination, workspace.factor)
            )
            workspace.counts[1] += 1
        dense.gather(order, F, y)
        sparse_lu.solve(unknowns.elimination, workspace.factor, y)
        for k in range(y.size):
            Z[order[k] // 3, order[k] % 3] -= y[k]
        workspace.counts[0] += 1
        before = residual
        equations.residual(system, state, start, h, Z, F)
        residual, worst, step = dense.judge(system, unknowns, start, h, Z, F)
        slow = residual > SLOW * before
        stuck = residual > STUCK * before and residual <= TOLERANCE
        smallest = min(smallest, residual)
    if dense.is_astray(system, guess, step):
        return math.inf, worst
    return residual, worst


@kernel
def drop_null(workspace: Workspace) -> None:
    """Take from the multipliers what the joints' redundancy leaves open.

    With G^T n = 0 the relaxed Jacobian maps (0, n) to (0, -relaxation n), so its factors pick
    n out. What is left is the multipliers' smallest, weighted by mass as the unknowns are.
    """
    lu, Z, y = workspace.unknowns.elimination, workspace.Z, workspace.y
    first = first_multiplier(workspace.system.frames)
    for k in range(y.size):
        node = lu.order[k] // 3
        y[k] = -workspace.system.relaxation * Z[node, lu.order[k] % 3] if node >= first else 0.0
    sparse_lu.solve(lu, workspace.factor, y)
    for k in range(y.size):
        node = lu.order[k] // 3
        if node >= first:
            Z[node, lu.order[k] % 3] -= y[k]


@kernel
def drop_gap(workspace: Workspace) -> None:
    """Take from the solved step's gaps what no motion can close: round-off of redundant rows, which
    would add up from step to step.

    With n^T G = 0 the relaxed system answers the rows F by multipliers of which n^T takes
    -n^T F / relaxation.
    """
    lu, F, y = workspace.unknowns.elimination, workspace.F, workspace.y
    first = first_multiplier(workspace.system.frames)
    dense.gather(lu.order, F, y)
    sparse_lu.solve(lu, workspace.factor, y)
    for k in range(y.size):
        node = lu.order[k] // 3
        if node >= first:
            F[node, lu.order[k] % 3] += workspace.system.relaxation * y[k]


@kernel
def take(workspace: Workspace, h: float, share: float) -> tuple[float, int]:
    """Take a step of size ``h``, a ``share`` of the whole one, if it converges: residual, row."""
    load_moments.load(workspace, h)
    equations.predict(workspace.system, workspace.state, workspace.start, h, workspace.Z)
    residual, worst = solve_step(workspace, h)
    if workspace.system.relaxation > 0.0 and residual <= TOLERANCE:
        equations.jacobian(workspace.system, workspace.start, h, workspace.Z, workspace.values)
        sparse_lu.factor(workspace.unknowns.elimination, workspace.values, workspace.factor)
        drop_null(workspace)
        residual, worst = solve_step(workspace, h)
        drop_gap(workspace)
    if residual <= TOLERANCE:
        accept(workspace, h, share)
    return residual, worst


@kernel
def march(workspace: Workspace, h: float, first: int, last: int, schedule: np.ndarray) -> int:
    """Take steps ``first``..``last - 1`` of a chunk; the one that would not converge, or ``last``.

    Step k fills row k of the watch and is published in row ``plan[k]`` of the tables unless that
    is negative.
    """
    for k in range(first, last):
        residual, _ = take(workspace, h, 1.0)
        if not residual <= TOLERANCE:
            return k
        show(workspace, h, k, schedule[k])
    return last
