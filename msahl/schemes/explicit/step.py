"""Takes steps of the explicit Runge-Kutta schemes, in joint coordinates.

At each stage the bodies' motion follows from the coordinates q, counted from the start of the step,
and their rates u; the elements state their loads there, and the accelerations are

    M du/dt = f + G^T lam ,    G du/dt = r - dG/dt u

with the forces f of ``inverse_dynamics``. Where loops are closed, the multipliers lam of the cut
equations, with G as in ``collocation.tree.loops``, make their second derivatives vanish. What the
step's error leaves of the equations themselves and of their rates is taken out at its end, by the
least changes of the coordinates and of the rates, weighted by mass. The order is kept, as these
changes are of the size of that error. The step is neither symplectic nor symmetric, so the energy
drifts.

Source: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (1996), section VII.2, for
the projection of index-1 problems.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import Vector, add, at, cross, dot, put
from msahl.elements.constraints import coincide, scalar
from msahl.elements.signals import states
from msahl.elements.signals.group import Signals
from msahl.formulations.absolute.frames import first_multiplier
from msahl.formulations.tree import inverse_dynamics, mass_matrix, recursion
from msahl.formulations.tree.table import Tree
from msahl.jit.kernel import kernel, optional, unit
from msahl.jit.lanes import load, spread, store
from msahl.ports import concentrated
from msahl.schemes.collocation.dense_output import DenseOutput, new_dense_output
from msahl.schemes.collocation.tableau import new_tableau
from msahl.schemes.collocation.tree import loops as tree_loops
from msahl.schemes.collocation.tree.loads import (
    body_motion,
    set_accelerations,
    set_node,
    take_loads,
)
from msahl.schemes.collocation.tree.loop_end import impose, set_equations, set_law_rates
from msahl.schemes.collocation.tree.loop_stages import LoopStages
from msahl.schemes.collocation.tree.stages import TreeStages, new_tree_stages
from msahl.schemes.collocation.tree.step import end_step, move_bodies
from msahl.schemes.collocation.workspace import StageArrays, new_stage_arrays
from msahl.schemes.common.accelerations import Instant, new_instant
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.explicit.tableau import Butcher, butcher
from msahl.schemes.outcome import TOLERANCE
from msahl.system.cut import PIECES, Cut

CLOSED = 1e-14
"""Violation of a cut equation at the end of a step, relative to the longest body, that is round-off
of positions; the next step removes it."""
CORRECTIONS = 5
"""Most corrections of positions at the end of a step; each squares what the last one left."""


class ExplicitWorkspace(NamedTuple):
    """Data and work arrays of one subsystem for steps of s stages in n coordinates."""

    workspace: Workspace
    butcher: Butcher
    tree: TreeStages
    stages: StageArrays  # of one node: the present stage
    u: np.ndarray  # (s + 1, n) rates of the coordinates at the stages, and at the end
    acceleration: np.ndarray  # (s, n) rates of these
    state_rate: np.ndarray  # (s, m) of the auxiliary states
    instant: Instant
    dense_output: DenseOutput
    outcome: np.ndarray  # (2,) as that of the collocation schemes: there is no residual


def new_explicit_workspace(
    workspace: Workspace, scheme: str, order: int, tree: tuple[Tree, Cut | None]
) -> ExplicitWorkspace:
    """Return the workspace for steps of a ``scheme`` of this ``order`` from the prepared state, in
    the coordinates of a ``tree``, cut where its loops close.
    """
    one, table = new_tableau("gauss", 1), butcher(scheme)
    own = one._replace(force_time=one.force_time.copy(), force_weight=one.force_weight.copy())
    s, n = table.a.shape[1], tree[0].body.size
    return ExplicitWorkspace(
        workspace=workspace,
        butcher=table,
        tree=new_tree_stages(*tree, workspace, own)._replace(slopes=None),
        stages=new_stage_arrays(workspace.system, workspace.unknowns, workspace.state, own),
        u=np.zeros((s + 1, n)),
        acceleration=np.zeros((s, n)),
        state_rate=np.zeros((s, workspace.state.auxiliary.size)),
        instant=new_instant(workspace.system, workspace.unknowns),
        dense_output=new_dense_output(workspace, order, False),
        outcome=np.zeros(2),
    )


@unit
def take_step(subsystem: ExplicitWorkspace, h: float) -> bool:
    """Take a step of size ``h`` if its motion is finite and within the range of the coordinates;
    return whether it was taken.
    """
    tree, workspace, stages = subsystem.tree, subsystem.workspace, subsystem.stages
    s = subsystem.acceleration.shape[0]
    subsystem.outcome[0], subsystem.outcome[1] = math.inf, -1.0
    recursion.begin(tree.tree, tree.motion, workspace.state.x, workspace.start.frames)
    tree_loops.begin(tree.loops, tree.tree, tree.motion, workspace, stages, h)
    for w in range(stages.work.size):
        stages.work[w] = 0.0
    for i in range(s):
        if not set_stage(subsystem, h, i) or not set_acceleration(subsystem, h, i):
            return False
    workspace.counts[0] += s
    if not set_stage(subsystem, h, s):
        return False
    mass_matrix.set_factors(tree.tree, tree.motion)
    if not close_loops(tree.loops, tree, workspace, stages, subsystem.u[s], h):
        return False
    subsystem.outcome[0] = 0.0
    accept(subsystem, h)
    return True


@kernel
def set_stage(subsystem: ExplicitWorkspace, h: float, i: int) -> bool:
    """Set the motion at the stage ``i``, or at the end, in all lanes; return whether the
    coordinates are within the range of a step.
    """
    tree, motion = subsystem.tree.tree, subsystem.tree.motion
    a, within = subsystem.butcher.a, True
    for k in range(motion.rate.size):
        q, u = 0.0, motion.rate[k]
        for j in range(min(i, a.shape[1])):
            q += h * a[i, j] * subsystem.u[j, k]
            u += h * a[i, j] * subsystem.acceleration[j, k]
        # Written so that a nan counts.
        if not (abs(q) <= tree.reach[k] and abs(u) < math.inf):
            within = False
        subsystem.u[i, k] = u
        store(motion.q, k, spread(q))
        store(motion.u, k, spread(u))
    if within:
        recursion.set_places(tree, motion)
    return within


@kernel
def set_acceleration(subsystem: ExplicitWorkspace, h: float, i: int) -> bool:
    """Set the accelerations at the stage ``i``; return whether the loads are finite."""
    tree, stages, a = subsystem.tree, subsystem.stages, subsystem.butcher.a
    motion, rates, last = tree.motion, subsystem.acceleration[i], a.shape[1]
    stages.tableau.force_time[0] = subsystem.butcher.c[i]
    stages.tableau.force_weight[0] = a[last, i]
    recursion.set_twists(tree.tree, motion)
    set_loads(subsystem, h, i)
    inverse_dynamics.set_forces(tree.tree, motion)
    mass_matrix.set_factors(tree.tree, motion)
    mass_matrix.solve(tree.tree, motion)
    close_accelerations(tree.loops, tree, subsystem.workspace, stages, h)
    finite = True
    for k in range(rates.size):
        rates[k] = motion.y[k, 0]
        finite = finite and abs(rates[k]) < math.inf
    return finite


@kernel
def set_loads(subsystem: ExplicitWorkspace, h: float, i: int) -> None:
    """Set the loads on all bodies at the stage ``i``, and the rates of auxiliary states, and add
    the work of the step's forces.
    """
    tree, workspace, stages = subsystem.tree, subsystem.workspace, subsystem.stages
    system, motion = tree.node.system, tree.motion
    if tree.tree.bare:
        return
    set_states(system.forces.signals, subsystem, h, i)
    set_node(tree, workspace, stages, h, 0)
    group, laws = system.forces.concentrated, system.forces.laws
    concentrated.at_time(group, laws, tree.node.state.time[0], stages.factor[0])
    set_accelerations(tree.node, stages, h, 0)
    states.set_rates(
        system.forces.signals, tree.node.start.forces.signals, subsystem.state_rate[i], 0
    )
    take_loads(tree, 0)
    for row in range(motion.load.shape[0]):
        store(motion.load, row, spread(motion.load[row, 0]))


@optional()
def set_states(group: Signals, subsystem: ExplicitWorkspace, h: float, i: int) -> None:
    """Set the auxiliary states at the stage ``i``, or at the end."""
    begin, a = subsystem.workspace.state.auxiliary, subsystem.butcher.a
    for k in range(group.rate.size):
        value = begin[k]
        for j in range(min(i, a.shape[1])):
            value += h * a[i, j] * subsystem.state_rate[j, k]
        subsystem.stages.signals.state[0, k] = value


@optional()
def accept_states(group: Signals, subsystem: ExplicitWorkspace, h: float) -> None:
    """Advance the auxiliary states to the end of the step."""
    state = subsystem.workspace.state
    set_states(group, subsystem, h, subsystem.acceleration.shape[0])
    for k in range(group.rate.size):
        state.auxiliary[k] = subsystem.stages.signals.state[0, k]


@optional()
def close_accelerations(
    loops: LoopStages, tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float
) -> None:
    """Change the accelerations ``motion.y`` so that the cut equations hold, and add the work of
    prescribed motions.
    """
    cut, motion, node = loops.cut, tree.motion, tree.node
    dt = h * stages.tableau.force_time[0]
    t, F = workspace.state.time[0] + dt, stages.accelerations
    first = first_multiplier(workspace.system.frames)
    for k in range(motion.rate.size):
        store(loops.rest, k, load(motion.y, k))
    set_equations(loops, tree.tree, motion, workspace, stages, dt)
    frames = node.start.frames
    for c in range(cut.body.size):
        _, _, v, W = body_motion(tree, cut.body[c], 0)
        put(frames.v, cut.frame[c], v)
        put(frames.W, cut.frame[c], W)
    coincide.free_acceleration(cut.coincide, loops.node.coincide, frames.W, F)
    scalar.rates(cut.scalar, loops.node.scalar, workspace.system.frames, frames, loops.still)
    given = workspace.system.frames, frames.v, frames.W, t, F
    scalar.free_acceleration(cut.scalar, loops.node.scalar, *given)
    for r in range(cut.scale.size):
        needed = F[first + cut.place[r, 0], cut.place[r, 1]]
        loops.end_right[r] = needed - centripetal(loops, tree, r)
    impose(loops, tree.tree, motion, stages, t, h * stages.tableau.force_weight[0])


@kernel
def centripetal(loops: LoopStages, tree: TreeStages, r: int) -> float:
    """Second derivative of the equation ``r`` by the accelerations that the bodies have at constant
    rates of the coordinates.
    """
    motion, total = tree.motion, 0.0
    for piece in range(PIECES):
        b, row = loops.cut.piece[r, piece], 6 * (PIECES * r + piece)
        if b > 0:
            M, F = _vector(loops.wrench, row), _vector(loops.wrench, row + 3)
            w, v = _vector(motion.twist, 6 * b), _vector(motion.twist, 6 * b + 3)
            w_rate, v_rate = _vector(motion.momenta, 6 * b), _vector(motion.momenta, 6 * b + 3)
            velocity = add(v, cross(w, _vector(motion.place, 3 * b)))
            total += dot(M, w_rate) + dot(F, add(v_rate, cross(w, velocity)))
    return total


@kernel
def _vector(rows: np.ndarray, k: int) -> Vector:
    """Rows ``k`` to ``k + 2`` of an array of lanes, in lane 0."""
    return (rows[k, 0], rows[k + 1, 0], rows[k + 2, 0])


@optional(True)
def close_loops(
    loops: LoopStages,
    tree: TreeStages,
    workspace: Workspace,
    stages: StageArrays,
    u: np.ndarray,
    h: float,
) -> bool:
    """Project the coordinates and the rates ``u`` (n,) at the end of the step onto the cut
    equations; return whether these are satisfied.
    """
    motion, t, size, before = tree.motion, workspace.state.time[0] + h, 0.0, math.inf
    for k in range(motion.rate.size):
        size = max(size, tree.tree.length[k])
    for _ in range(CORRECTIONS + 1):
        set_equations(loops, tree.tree, motion, workspace, stages, h)
        left = largest_violation(loops)
        if left <= CLOSED * size or (left > 0.5 * before and left <= TOLERANCE * size):
            project_rates(loops, tree, stages, u, t)
            return True
        if not left < before:
            return False
        before = left
        remove_violation(loops, tree, stages)
    return False


@kernel
def largest_violation(loops: LoopStages) -> float:
    """Return the largest violation of a cut equation [m]; a nan counts as infinite."""
    largest = 0.0
    for r in range(loops.cut.scale.size):
        violation = abs(loops.violation[r, 0])
        if not violation <= largest:
            largest = violation if violation < math.inf else math.inf
    return largest


@kernel
def remove_violation(loops: LoopStages, tree: TreeStages, stages: StageArrays) -> None:
    """Change the coordinates so that the violations vanish, to first order."""
    motion = tree.motion
    for r in range(loops.cut.scale.size):
        loops.end_right[r] = -loops.violation[r, 0]
    for k in range(motion.rate.size):
        store(loops.rest, k, spread(0.0))
    impose(loops, tree.tree, motion, stages, 0.0, 0.0)
    for k in range(motion.rate.size):
        store(motion.q, k, load(motion.q, k) + load(motion.y, k))
    recursion.set_places(tree.tree, motion)
    mass_matrix.set_factors(tree.tree, motion)


@kernel
def project_rates(
    loops: LoopStages, tree: TreeStages, stages: StageArrays, u: np.ndarray, t: float
) -> None:
    """Change the rates ``u`` (n,) so that the cut equations' rates vanish, after
    ``set_equations``.
    """
    motion = tree.motion
    for k in range(u.size):
        store(loops.rest, k, spread(u[k]))
    set_law_rates(loops, t)
    impose(loops, tree.tree, motion, stages, t, 1.0)
    for k in range(u.size):
        u[k] = motion.y[k, 0]
        store(motion.u, k, spread(u[k]))


@unit
def accept(subsystem: ExplicitWorkspace, h: float) -> None:
    """Advance the state to the end of the step, which is set in all lanes."""
    tree, workspace, stages = subsystem.tree, subsystem.workspace, subsystem.stages
    state, frames = workspace.state, workspace.start.frames
    accept_states(workspace.system.forces.signals, subsystem, h)
    recursion.set_twists(tree.tree, tree.motion)
    for b in range(1, tree.tree.frame.size):
        f = tree.tree.frame[b]
        put(state.a, f, at(frames.v, f))
        put(state.alpha, f, at(frames.W, f))
    move_bodies(tree, workspace, 1.0 / h)
    end_step(tree, workspace, stages, h)
