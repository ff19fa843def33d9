"""Solves steps of order 2 by Newton's method with sparse factors, and takes many steps in a row.

    J dz = f(z) ,   z <- z - dz

One Jacobian J serves all iterations of a step: the prediction is good enough for the first
iteration, which is exact, to square the error, and later ones gain about as much again. J is
evaluated anew where the residual does not fall to a twentieth."""

import math

import numpy as np

from msahl.elements.frames import first_multiplier
from msahl.jit.kernel import apart, kernel, unit
from msahl.linalg import dense, sparse_lu
from msahl.schemes.midpoint import equations, load_moments
from msahl.schemes.midpoint.free_equations import is_implausible, relative_residual
from msahl.schemes.midpoint.workspace import Workspace, accept_step, record_step
from msahl.schemes.outcome import TARGET, TOLERANCE

MAX_ITERATIONS = 25
SLOW = 0.05
"""Ratio of successive residuals above which the Jacobian is evaluated anew."""
STUCK = 0.5
"""Ratio of successive residuals above which a solved step is not improved further."""
DIVERGED = 1e3
"""Residual relative to the smallest so far at which the iteration is given up."""
SCALED_ABOVE = 1e12
"""Ratio of the pivots above which those of the matrix with scaled rows and columns count. In thin
beams of stiff material, entries of the Jacobian differ by more than this for their units alone.
"""


@apart
def iterate(workspace: Workspace, h: float) -> tuple[float, int]:
    """Solve one step from the prediction in ``Z``; return its relative residual and worst row."""
    system, state, start, Z, F = (
        workspace.system,
        workspace.state,
        workspace.start,
        workspace.Z,
        workspace.F,
    )
    lu, y = workspace.unknowns.elimination, workspace.y
    equations.residual(system, state, start, h, Z, F)
    residual, worst, predicted = relative_residual(workspace, h)
    length = predicted
    smallest, slow, stuck = residual, True, False
    for _ in range(MAX_ITERATIONS):
        if residual <= TARGET or stuck or not residual <= DIVERGED * smallest:
            break
        if slow:
            equations.jacobian(system, start, h, Z, workspace.values)
            sparse_lu.factor(lu, workspace.values, workspace.factor)
            ratio = pivot_ratio(workspace)
            workspace.pivots[0] = max(workspace.pivots[0], ratio)
            workspace.counts[1] += 1
        dense.gather(lu.order, F, y)
        sparse_lu.solve(lu, workspace.factor, y)
        for k in range(y.size):
            Z[lu.order[k] // 3, lu.order[k] % 3] -= y[k]
        workspace.counts[0] += 1
        before = residual
        equations.residual(system, state, start, h, Z, F)
        residual, worst, length = relative_residual(workspace, h)
        slow = residual > SLOW * before
        stuck = residual > STUCK * before and residual <= TOLERANCE
        smallest = min(smallest, residual)
    if is_implausible(system, predicted, length):
        return math.inf, worst
    return residual, worst


@kernel
def pivot_ratio(workspace: Workspace) -> float:
    """Ratio of the pivots of the Jacobian just factored, or the ``scaled_pivot_ratio`` where that
    is smaller and the first is so large that the units may be the reason.
    """
    lu, W = workspace.unknowns.elimination, workspace.factor
    ratio = sparse_lu.pivot_ratio(lu, W)
    if ratio <= SCALED_ABOVE:
        return ratio
    blocks = workspace.system.blocks
    scaled = sparse_lu.scaled_pivot_ratio(lu, blocks, workspace.values, W, workspace.sizes)
    return min(ratio, scaled)


@kernel
def remove_null_multipliers(workspace: Workspace) -> None:
    """Subtract from the multipliers what redundant constraints leave undetermined in them.

    With G^T n = 0 the relaxed Jacobian maps (0, n) to (0, -relaxation n), so its factors separate
    n from the rest. The remaining multipliers are the smallest, weighted by mass as the unknowns.
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
def remove_null_violation(workspace: Workspace) -> None:
    """Subtract from the violation that a solved step leaves the part that no motion can remove:
    rounding errors of redundant equations, which would add up from step to step.

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


@unit
def take_step(workspace: Workspace, h: float, share: float) -> tuple[float, int]:
    """Take a step of size ``h``, a ``share`` of the requested one, if it converges; return its
    relative residual and worst row.
    """
    load_moments.set_loads(workspace, h)
    equations.predict(workspace.system, workspace.state, workspace.start, h, workspace.Z)
    residual, worst = iterate(workspace, h)
    if workspace.system.relaxation > 0.0 and residual <= TOLERANCE:
        equations.jacobian(workspace.system, workspace.start, h, workspace.Z, workspace.values)
        sparse_lu.factor(workspace.unknowns.elimination, workspace.values, workspace.factor)
        remove_null_multipliers(workspace)
        residual, worst = iterate(workspace, h)
        remove_null_violation(workspace)
    if residual <= TOLERANCE:
        accept_step(workspace, h, share)
    return residual, worst


@kernel
def take_steps(workspace: Workspace, h: float, first: int, last: int, rows: np.ndarray) -> int:
    """Take steps ``first``..``last - 1`` of a chunk; return the number of the first that did not
    converge, or ``last``.

    Step k fills row k of the monitor, and row ``rows[k]`` of the tables unless that is negative.
    """
    for k in range(first, last):
        residual, _ = take_step(workspace, h, 1.0)
        if not residual <= TOLERANCE:
            return k
        record_step(workspace, h, k, rows[k])
    return last
