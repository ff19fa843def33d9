"""Closes the loops of a step in joint coordinates: cut equations with their multipliers.

Constraints are imposed at the Lobatto nodes t_k of the step, as in absolute coordinates
(``tableau``), and their multipliers act there. With the rates u_j at the Gauss nodes c_i,

    qt_k = h sum_j ab_kj u_j ,    g(qt_k) = 0    k = 1..s
    p_i  = p0 + h sum_j a_ij dp/dt_j + (1/h) sum_l at_il G_l^T y_l ,    at_il = B_l (1 - ab_li/b_i)
    p_1  = p0 + h sum_j b_j dp/dt_j + (1/h) sum_l B_l G_l^T y_l + G_s^T mu ,    G_s u(1) = r

with G_k = dg/dq at qt_k, the unknowns y_l = h^2 times the multipliers at t_0 ... t_(s-1), and the
rates r of prescribed motions. The equations are those of the elements themselves, which see the
bodies' poses at each node; a row of G is what the wrenches of a unit multiplier do along the
coordinates.

Each iteration subtracts M_j^-1 times the residual from the rates, corrected by the multipliers that
make the constraints hold to first order: the matrix of these, with blocks

    T_kl = G_k (sum_j ab_kj at_jl M_j^-1) G_l^T

is factored at the prediction. Where equations are redundant those are kept, step by step, that a
Cholesky factorisation with pivots finds independent at its start; the others must hold by
themselves, or the step is left to Newton's method.

Source: see ``tableau``; L. O. Jay (2007) for the constraints in Runge-Kutta form.
"""

import numpy as np

from msahl.algebra import small_system
from msahl.algebra.lanes import integral
from msahl.algebra.vector import at, matrix_at, put, put_matrix
from msahl.elements.constraints import coincide, scalar
from msahl.formulations.absolute.frames import ground_of
from msahl.formulations.tree import mass_matrix, recursion
from msahl.formulations.tree.table import Tree, TreeMotion
from msahl.jit.kernel import kernel, optional
from msahl.jit.lanes import load, spread, store
from msahl.schemes.collocation.tree import slopes
from msahl.schemes.collocation.tree.loop_matrix import choose, set_end_matrix
from msahl.schemes.collocation.tree.loop_nodes import enter_node, set_gaps, set_gradient, set_levers
from msahl.schemes.collocation.tree.loop_stages import LoopStages
from msahl.schemes.collocation.tree.slopes import LoadSlopes
from msahl.schemes.collocation.workspace import StageArrays
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.outcome import TOLERANCE
from msahl.system.arrays import State


@optional()
def begin(
    loops: LoopStages,
    tree: Tree,
    motion: TreeMotion,
    workspace: Workspace,
    stages: StageArrays,
    h: float,
) -> None:
    """Set what the equations need of the start of a step, and the entries of G there."""
    cut, start, state = loops.cut, loops.start, workspace.state
    frames, x, R = workspace.system.frames, state.x, workspace.start.frames.R
    for w in range(stages.work.size):
        stages.work[w] = 0.0
    for q in range(cut.angle.size):
        start.angle[q] = state.angle[cut.angle[q]]
    coincide.prepare(cut.coincide, R, start.coincide)
    scalar.prepare(cut.scalar, x, R, start.angle, start.scalar)
    set_gaps(loops, workspace, stages)
    ground = ground_of(frames)
    put(loops.x, ground, at(x, ground))
    put_matrix(loops.R, ground, matrix_at(R, ground))
    for k in range(motion.rate.size):
        store(motion.q, k, spread(0.0))
    recursion.set_places(tree, motion)
    recursion.set_displacements(tree, motion, loops.displacement)
    enter_node(loops, motion, workspace, stages, 0.0, 0)
    set_gradient(loops, motion)
    for e in range(cut.coordinate.size):
        loops.lever[e, 0] = loops.moment[e, 0] = loops.gradient[e, 0]
    if cut.redundant:
        mass_matrix.set_factors(tree, motion)
        set_end_matrix(loops, tree, motion)
        choose(loops)


@optional()
def predict(
    loops: LoopStages, workspace: Workspace, stages: StageArrays, follows: bool, h: float
) -> None:
    """Set the unknowns to the prediction from the step to follow, or to those of the state."""
    cut, force = loops.cut, workspace.state.force
    s = loops.weight.size
    for r in range(cut.scale.size):
        for i in range(s):
            value = h * h * force[cut.place[r, 0], cut.place[r, 1]] / cut.scale[r]
            if follows:
                value = 0.0
                for j in range(s):
                    value += stages.multiplier_weights[i, j] * loops.last_y[j, r]
            loops.y[i, r] = value if loops.independent[r] else 0.0


@optional()
def set_nodes(
    loops: LoopStages,
    tree: Tree,
    motion: TreeMotion,
    workspace: Workspace,
    stages: StageArrays,
    h: float,
) -> None:
    """Set violations and entries of G at the Lobatto nodes of the rates ``motion.u``, and the
    momenta by the multipliers; overwrites coordinates and places.
    """
    for k in range(motion.rate.size):
        store(motion.q, k, integral(motion.u, k, loops.to_nodes, h))
    recursion.set_places(tree, motion)
    recursion.set_displacements(tree, motion, loops.displacement)
    for i in range(loops.weight.size):
        enter_node(loops, motion, workspace, stages, h * stages.tableau.constraint_time[i], i)
    set_gradient(loops, motion)
    set_levers(loops, tree, motion)
    set_pull(loops)


@optional()
def set_pull(loops: LoopStages) -> None:
    """Set ``pull`` and ``pull_moment`` to those of the unknowns."""
    m = loops.cut.scale.size
    for i in range(loops.weight.size):
        for r in range(m):
            loops.right[m * i + r] = loops.y[i, r]
    _set_pull_of(loops, loops.lever, loops.right, loops.pull)
    _set_pull_of(loops, loops.moment, loops.right, loops.pull_moment)


@kernel
def _set_pull_of(loops: LoopStages, lever: np.ndarray, y: np.ndarray, out: np.ndarray) -> None:
    """Set ``out`` to what unknowns ``y`` (s m,) do by the ``lever``."""
    cut, m = loops.cut, loops.cut.scale.size
    for k in range(out.shape[0]):
        store(out, k, spread(0.0))
    for r in range(m):
        for e in range(cut.first[r], cut.first[r + 1]):
            for i in range(loops.weight.size):
                out[cut.coordinate[e], i] += lever[e, i] * y[m * i + r]


@optional(0.0)
def impulse(loops: LoopStages, k: int, h: float) -> float:
    """Impulse of the multipliers over the step along coordinate ``k``."""
    return _sum(loops, loops.pull, k) / h


@optional(0.0)
def moment_impulse(loops: LoopStages, k: int, h: float) -> float:
    """Likewise of a ball, about axes fixed in its parent."""
    return _sum(loops, loops.pull_moment, k) / h


@kernel
def _sum(loops: LoopStages, pull: np.ndarray, k: int) -> float:
    """Sum of row ``k`` of ``pull`` with the weights of the nodes."""
    total = 0.0
    for i in range(loops.weight.size):
        total += loops.weight[i] * pull[k, i]
    return total


@optional()
def add_pull(loops: LoopStages, motion: TreeMotion, h: float) -> None:
    """Subtract the multipliers' part from the residuals ``motion.y`` of the momenta, and keep
    these.
    """
    for k in range(motion.rate.size):
        value = load(motion.y, k)
        for j in range(loops.weight.size):
            value = value - (loops.pull[k, j] / h) * load(loops.across, j)
        store(motion.y, k, value)
        store(loops.rest, k, value)


@optional()
def correct(
    loops: LoopStages, matrices: LoadSlopes | None, tree: Tree, motion: TreeMotion, h: float
) -> None:
    """Correct the multipliers so that the constraints hold after the rates are corrected, too, and
    set ``motion.y`` to the correction of the rates; it is M^-1 times the residual before.
    """
    right, m = loops.right, loops.cut.scale.size
    _set_needed(loops, motion, h)
    for r in range(m):
        for k in range(loops.weight.size):
            right[m * k + r] = -loops.needed[r, k] if loops.independent[r] else 0.0
    small_system.solve(loops.matrix, loops.pivot, right)
    _set_pull_of(loops, loops.lever, right, loops.pull)
    for r in range(m):
        for i in range(loops.weight.size):
            loops.y[i, r] += right[m * i + r]
    for k in range(motion.rate.size):
        value = load(loops.rest, k)
        for j in range(loops.weight.size):
            value = value - (loops.pull[k, j] / h) * load(loops.across, j)
        store(motion.y, k, value)
    slopes.correct(matrices, tree, motion)
    if loops.cut.redundant:
        loops.left[0] = _largest_left(loops, motion, h)


@optional(True)
def holds(loops: LoopStages, tree: Tree) -> bool:
    """Whether the dependent equations are satisfied after the last correction, to round-off."""
    size = 0.0
    for k in range(tree.length.size):
        size = max(size, tree.length[k])
    return bool(loops.left[0] <= TOLERANCE * size)


@kernel
def _set_needed(loops: LoopStages, motion: TreeMotion, h: float) -> None:
    """Set ``needed`` to the violations after the rates are corrected by ``motion.y``, which is
    replaced.
    """
    cut, y = loops.cut, motion.y
    for k in range(motion.rate.size):
        store(y, k, integral(y, k, loops.to_nodes, h))
    for r in range(cut.scale.size):
        total = load(loops.violation, r)
        for e in range(cut.first[r], cut.first[r + 1]):
            total = total - load(loops.gradient, e) * load(y, cut.coordinate[e])
        store(loops.needed, r, total)


@kernel
def _largest_left(loops: LoopStages, motion: TreeMotion, h: float) -> float:
    """Return the largest violation of dependent equations after the rates are corrected."""
    largest = 0.0
    for k in range(motion.rate.size):
        store(loops.rest, k, load(motion.y, k))
    _set_needed(loops, motion, h)
    for r in range(loops.cut.scale.size):
        for k in range(loops.weight.size):
            if not (loops.independent[r] or abs(loops.needed[r, k]) <= largest):
                largest = abs(loops.needed[r, k])
    for k in range(motion.rate.size):
        store(motion.y, k, load(loops.rest, k))
    return largest


@optional()
def save(loops: LoopStages, state: State, h: float) -> None:
    """Save the multipliers, also as those of the ``state``, and the violations that are left."""
    cut, last = loops.cut, loops.weight.size - 1
    for r in range(cut.scale.size):
        node, slot = cut.place[r, 0], cut.place[r, 1]
        # What is left of the others no motion can remove.
        state.violation[node, slot] = loops.violation[r, 0] if loops.independent[r] else 0.0
        state.force[node, slot] = loops.y[last, r] * cut.scale[r] / (h * h)
        for i in range(last + 1):
            loops.last_y[i, r] = loops.y[i, r]
