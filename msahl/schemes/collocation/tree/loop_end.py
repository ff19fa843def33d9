"""Velocities at the end of a step that closes loops, and the work of prescribed motions."""

import numpy as np

from msahl.algebra import small_system
from msahl.elements.constraints import scalar
from msahl.formulations.tree import mass_matrix, recursion
from msahl.formulations.tree.table import Tree, TreeMotion
from msahl.jit.kernel import kernel, optional
from msahl.jit.lanes import load, spread, store
from msahl.schemes.collocation.tree.loop_matrix import set_end_matrix, take_out
from msahl.schemes.collocation.tree.loop_nodes import enter_node, set_gradient
from msahl.schemes.collocation.tree.loop_stages import LoopStages
from msahl.schemes.collocation.workspace import StageArrays
from msahl.schemes.common.workspace import Workspace


@optional()
def project(
    loops: LoopStages,
    tree: Tree,
    motion: TreeMotion,
    workspace: Workspace,
    stages: StageArrays,
    h: float,
) -> None:
    """Make the rates ``motion.y`` at the end of the step satisfy the constraints, by the impulses
    of the last node, after ``mass_matrix.solve`` for the momenta there.
    """
    _add_work(loops.cut.scalar, loops, workspace, stages, h)
    for k in range(motion.rate.size):
        store(loops.rest, k, load(motion.y, k))
    set_equations(loops, tree, motion, workspace, stages, h)
    set_law_rates(loops, workspace.state.time[0] + h)
    impose(loops, tree, motion, stages, workspace.state.time[0] + h, 1.0)


@kernel
def set_equations(
    loops: LoopStages,
    tree: Tree,
    motion: TreeMotion,
    workspace: Workspace,
    stages: StageArrays,
    dt: float,
) -> None:
    """Set violations, G and G M^-1 G^T at the places of lane 0, a time ``dt`` after the start of
    the step, after the factors of M.
    """
    recursion.set_displacements(tree, motion, loops.displacement)
    enter_node(loops, motion, workspace, stages, dt, 0)
    set_gradient(loops, motion)
    set_end_matrix(loops, tree, motion)


@kernel
def impose(
    loops: LoopStages, tree: Tree, motion: TreeMotion, stages: StageArrays, t: float, share: float
) -> None:
    """Set ``motion.y`` to what is in ``loops.rest`` but for the least change, weighted by mass, by
    which G y is ``end_right``, after ``set_equations``. That receives the multipliers, a ``share``
    of which is an impulse that does work at the time ``t``.
    """
    cut, y, mu = loops.cut, motion.y, loops.end_right
    m = cut.scale.size
    for r in range(m):
        for e in range(cut.first[r], cut.first[r + 1]):
            mu[r] -= loops.gradient[e, 0] * loops.rest[cut.coordinate[e], 0]
        if not loops.independent[r]:
            take_out(loops.end_matrix, r)
            mu[r] = 0.0
    small_system.factor(loops.end_matrix, loops.end_pivot)
    small_system.solve(loops.end_matrix, loops.end_pivot, mu)
    add_work_of(cut.scalar, loops, stages, mu, t, share)
    for k in range(motion.rate.size):
        store(y, k, spread(0.0))
    for r in range(m):
        for e in range(cut.first[r], cut.first[r + 1]):
            k = cut.coordinate[e]
            store(y, k, load(y, k) + spread(loops.gradient[e, 0] * mu[r]))
    mass_matrix.solve(tree, motion)
    for k in range(motion.rate.size):
        store(y, k, load(y, k) + load(loops.rest, k))


@kernel
def set_law_rates(loops: LoopStages, t: float) -> None:
    """Set ``end_right`` to the rates at which laws of time change the equations."""
    for r in range(loops.cut.scale.size):
        loops.end_right[r] = 0.0
    _add_law_rates(loops.cut.scalar, loops, t)


@optional()
def _add_law_rates(group: scalar.ScalarConstraints, loops: LoopStages, t: float) -> None:
    cut = loops.cut
    for r in range(cut.scale.size):
        if cut.equation[r] >= 0 and group.equations.law[cut.equation[r]] >= 0:
            rate = scalar.law_rate(group, cut.equation[r], t)
            loops.end_right[r] = cut.scale[r] * rate


@optional()
def _add_work(
    group: scalar.ScalarConstraints,
    loops: LoopStages,
    workspace: Workspace,
    stages: StageArrays,
    h: float,
) -> None:
    """Add the work of prescribed motions over the solved step."""
    t, s = workspace.state.time[0], loops.weight.size
    for i in range(s):
        share = loops.weight[i] / h
        at_node = t + h * stages.tableau.multiplier_time[i]
        add_work_of(group, loops, stages, loops.y[i], at_node, share)


@optional()
def add_work_of(
    group: scalar.ScalarConstraints,
    loops: LoopStages,
    stages: StageArrays,
    y: np.ndarray,
    t: float,
    share: float,
) -> None:
    """Add the work of prescribed motions at ``t``, whose impulses are ``share`` times ``y``."""
    rows, cut = group.equations, loops.cut
    for r in range(cut.scale.size):
        equation = cut.equation[r]
        if equation >= 0 and rows.law[equation] >= 0:
            rate = scalar.law_rate(group, equation, t)
            work = share * y[r] * cut.scale[r] * rate
            stages.work[group.equation_column[equation]] += work
