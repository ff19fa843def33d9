"""Solves steps of order 2 by Newton's method with sparse factors, and takes many steps in a row.

    J dz = f(z) ,   z <- z - dz

One Jacobian J serves all iterations of a step: the prediction is good enough for the first
iteration, which is exact, to square the error, and later ones gain about as much again. J is
evaluated anew where the residual does not fall to a twentieth."""

import math

import numpy as np

from msahl.formulations.absolute.frames import first_multiplier
from msahl.jit.kernel import apart, kernel, optional, unit
from msahl.linalg import dense, sparse_lu
from msahl.ports import sliding
from msahl.ports.sliding import Sliding
from msahl.schemes.common import accelerations
from msahl.schemes.common.accelerations import Instant
from msahl.schemes.common.criteria import DIVERGED, MAX_ITERATIONS, STUCK, is_implausible
from msahl.schemes.common.workspace import Workspace, record_step
from msahl.schemes.midpoint import equations, load_moments
from msahl.schemes.midpoint.free_equations import relative_residual
from msahl.schemes.outcome import TARGET, TOLERANCE
from msahl.system import evaluate

SLOW = 0.05
"""Ratio of successive residuals above which the Jacobian is evaluated anew."""
LONG_TARGET = 1e-16
"""Residual at which the iteration stops in steps that are long relative to vibrations. Forces of
stiff elements do more work in them, so less must remain for the same error of the energy."""
FAR_BETTER = 0.1
"""Ratio of the residuals of two predictions below which the first one is taken."""
SCALED_ABOVE = 1e12
"""Ratio of the pivots above which those of the matrix with scaled rows and columns count. In thin
beams of stiff material, entries of the Jacobian differ by more than this for their units alone.
"""


@apart
def iterate(workspace: Workspace, h: float, target: float) -> tuple[float, int]:
    """Solve one step from the start in ``Z``, to the relative residual ``target`` where rounding
    errors permit it; return the residual and its worst row.
    """
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
    smallest, slow, stuck, pivots = residual, True, False, 0.0
    for _ in range(MAX_ITERATIONS):
        if residual <= target or stuck or not residual <= DIVERGED * smallest:
            break
        if slow:
            equations.jacobian(system, start, h, Z, workspace.values)
            sparse_lu.factor(lu, workspace.values, workspace.factor)
            pivots = max(pivots, pivot_ratio(workspace))
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
    if residual <= TOLERANCE:
        workspace.pivots[0] = max(workspace.pivots[0], pivots)
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


@kernel
def solve(workspace: Workspace, h: float) -> tuple[float, int]:
    """Solve one step from its prediction, or from the motion of the last step where that is nearer
    or the prediction leads nowhere; return its relative residual and worst row.
    """
    state = workspace.state
    repeats = state.prediction[0] == equations.BY_LAST_STEP and not _is_predictable(workspace, h)
    _set_start(workspace, h, repeats)
    residual, worst = iterate(workspace, h, LONG_TARGET if repeats else TARGET)
    # At t = 0 there is no last step.
    if not residual <= TOLERANCE and state.time[0] > 0.0:
        _set_start(workspace, h, not repeats)
        residual, worst = iterate(workspace, h, LONG_TARGET)
        if residual <= TOLERANCE:
            state.prediction[0] = equations.BY_LAST_STEP
    return residual, worst


@optional(False)
def solve_by_widths(group: Sliding, workspace: Workspace, h: float) -> bool:
    """Solve a step that has no solution near its prediction as that of slips that begin, by the
    path of ``ports.sliding``; return whether it is solved, with the last width, which is left.
    """
    width = sliding.widest(group)
    if width == 0.0:
        return False
    _set_start(workspace, h, False)
    for _ in range(sliding.WIDTHS):
        sliding.set_width(group, width)
        if not iterate(workspace, h, TARGET)[0] <= TOLERANCE:
            sliding.set_width(group, 0.0)
            return False
        width *= sliding.NARROWER
    return True


@apart
def _set_start(workspace: Workspace, h: float, repeats: bool) -> None:
    """Set ``Z`` to the motion of the last step if the step ``repeats`` it, or to the prediction."""
    system, state, start, Z = workspace.system, workspace.state, workspace.start, workspace.Z
    if repeats:
        equations.repeat_last(system, state, start, h, Z)
    else:
        equations.predict(system, state, start, h, Z)


@apart
def _is_predictable(workspace: Workspace, h: float) -> bool:
    """Whether the prediction by accelerations is far better than the motion of the last step; if
    so, it is used from now on.
    """
    residuals = (0.0, 0.0)
    for repeats in (False, True):
        _set_start(workspace, h, repeats)
        equations.residual(
            workspace.system, workspace.state, workspace.start, h, workspace.Z, workspace.F
        )
        residuals = (residuals[1], relative_residual(workspace, h)[0])
    if residuals[0] < FAR_BETTER * residuals[1]:
        workspace.state.prediction[0] = equations.BY_LAST_CHANGE
        return True
    return False


@unit
def accept_step(workspace: Workspace, h: float, share: float) -> None:
    """Advance the state by the solved step of size ``h``, a ``share`` of the requested one; prepare
    the next.
    """
    equations.accept(
        workspace.system, workspace.state, workspace.start, h, workspace.Z, workspace.F
    )
    evaluate.prepare(workspace.system, workspace.state, workspace.start)
    for k in range(workspace.mean_force.shape[0]):
        for i in range(3):
            workspace.mean_force[k, i] += share * workspace.state.force[k, i]
    for k in range(workspace.mean_reaction.shape[0]):
        for i in range(6):
            workspace.mean_reaction[k, i] += share * workspace.state.reaction[k, i]


@unit
def take_step(workspace: Workspace, h: float, share: float) -> tuple[float, int]:
    """Take a step of size ``h``, a ``share`` of the requested one, if it converges; return its
    relative residual and worst row.
    """
    load_moments.set_loads(workspace, h)
    residual, worst = solve(workspace, h)
    if not residual <= TOLERANCE and solve_by_widths(workspace.system.forces.sliding, workspace, h):
        residual, worst = relative_residual(workspace, h)[:2]
    if workspace.system.relaxation > 0.0 and residual <= TOLERANCE:
        equations.jacobian(workspace.system, workspace.start, h, workspace.Z, workspace.values)
        sparse_lu.factor(workspace.unknowns.elimination, workspace.values, workspace.factor)
        remove_null_multipliers(workspace)
        residual, worst = iterate(workspace, h, TARGET)
        remove_null_violation(workspace)
    if residual <= TOLERANCE:
        accept_step(workspace, h, share)
    sliding.set_width(workspace.system.forces.sliding, 0.0)
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


@kernel
def take_steps_instantaneous(
    workspace: Workspace, instant: Instant, h: float, first: int, last: int, rows: np.ndarray
) -> int:
    """Take steps as ``take_steps``, with reactions at the output times."""
    for k in range(first, last):
        if take_steps(workspace, h, k, k + 1, rows) == k:
            return k
        if rows[k] >= 0:
            accelerations.write_instantaneous_reactions(workspace, instant, rows[k])
    return last
