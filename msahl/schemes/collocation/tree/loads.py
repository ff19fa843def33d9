"""Loads of a step in joint coordinates, by the elements themselves.

They see the bodies' poses and velocities at each node, as they do in absolute coordinates; what
they do to a body enters the recursion as a wrench.
"""

import math

from msahl.algebra.rotation import compose, matrix
from msahl.algebra.vector import (
    Vector,
    add,
    at,
    cross,
    put,
    scale,
    times,
    transpose,
)
from msahl.elements.constraints import scalar
from msahl.elements.signals import inputs, states
from msahl.elements.signals.group import Signals, Stages
from msahl.formulations.absolute.frames import (
    displacement_node,
    rotation_node,
)
from msahl.jit.kernel import apart, kernel, optional
from msahl.jit.lanes import LANES
from msahl.ports import forces
from msahl.schemes.collocation import equations
from msahl.schemes.collocation.tree.stages import TreeStages
from msahl.schemes.collocation.workspace import StageArrays
from msahl.schemes.common.workspace import Workspace
from msahl.system import evaluate
from msahl.system.arrays import System


@kernel
def begin_loads(workspace: Workspace, stages: StageArrays, h: float) -> None:
    """Set the factors of laws of time at the nodes, and save what signals are at the start."""
    group, begin = workspace.system.forces, workspace.state.time[0]
    forces.node_factors(group, begin, h, stages.tableau.from_moments, stages.factor)
    started, scalar_group = workspace.start.forces, workspace.system.scalar
    forces.begin_stages(group.signals, started, scalar_group, stages.signals)


@apart
def set_loads(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> None:
    """Set the loads on all bodies at all nodes, and the work of the step's forces."""
    for w in range(stages.work.size):
        stages.work[w] = 0.0
    _solve_states(workspace.system.forces.signals, tree, workspace, stages, h)
    for i in range(tree.nodes.shape[0]):
        set_node(tree, workspace, stages, h, i)
        equations.set_force_accelerations(workspace.system, stages, h, i)
        _take_loads(tree, workspace.system, stages, i)
    for row in range(tree.motion.load.shape[0]):
        for i in range(tree.nodes.shape[0], LANES):
            tree.motion.load[row, i] = tree.motion.load[row, i - 1]


@optional()
def _solve_states(
    group: Signals, tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float
) -> None:
    """Set the auxiliary states at all nodes, which depend on the motion at all of them."""
    if group.rate.size == 0:
        return
    system, node = workspace.system, stages.start.forces
    for i in range(tree.nodes.shape[0]):
        set_node(tree, workspace, stages, h, i)
        forces.set_signal_inputs(group, node, system.scalar, system.frames, stages.at_rest)
        states.save_inputs(group, node.signals, stages.signals, i)
    states.solve(group, node.signals, stages.signals, workspace.state.auxiliary, h)


@optional(True)
def states_exist(group: Signals, stages: Stages) -> bool:
    """Whether the auxiliary states have a solution, even if no load depends on them."""
    for j in range(stages.rate.shape[0]):
        for k in range(group.rate.size):
            if not math.isfinite(stages.rate[j, k]):
                return False
    return True


@kernel
def body_motion(tree: TreeStages, b: int, i: int) -> tuple[Vector, Vector, Vector, Vector]:
    """Mass centre [m], rotation parameters since the start of the step, velocity and angular
    velocity of body ``b`` in lane ``i``.
    """
    m = tree.motion
    c = (m.place[3 * b, i], m.place[3 * b + 1, i], m.place[3 * b + 2, i])
    w = (m.twist[6 * b, i], m.twist[6 * b + 1, i], m.twist[6 * b + 2, i])
    v = (m.twist[6 * b + 3, i], m.twist[6 * b + 4, i], m.twist[6 * b + 5, i])
    e = (m.quaternion[4 * b + 1, i], m.quaternion[4 * b + 2, i], m.quaternion[4 * b + 3, i])
    real = m.quaternion[4 * b, i]
    sign = 1.0 if real >= 0.0 else -1.0
    parameters = scale(4.0 * sign / (1.0 + sign * real), e)
    x = add(c, (m.origin[0], m.origin[1], m.origin[2]))
    return x, parameters, add(v, cross(w, c)), w


@kernel
def set_node(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float, i: int) -> None:
    """Set ``stages.state`` and ``stages.start`` to the motion in lane ``i``."""
    system, state, node = workspace.system, workspace.state, stages.state
    node.time[0] = state.time[0] + h * stages.tableau.force_time[i]
    for b in range(1, tree.tree.frame.size):
        f = tree.tree.frame[b]
        x, c, v, W = body_motion(tree, b, i)
        put(node.x, f, x)
        p = compose(c, at(state.p, f))
        put(node.p, f, p)
        put(node.v, f, v)
        put(node.w, f, times(transpose(matrix(p)), W))
    evaluate.prepare(system, node, stages.start)
    inputs.save_reactions(system.forces.signals, stages.start.forces.signals, state.reaction)
    for q in range(node.angle.size):
        node.angle[q] = state.angle[q]
    scalar.count_rotations(system.scalar, stages.start.scalar, node.angle)


@kernel
def _take_loads(tree: TreeStages, system: System, stages: StageArrays, i: int) -> None:
    """Set the loads of lane ``i`` from the accelerations by all forces."""
    frames, load_rows = system.frames, tree.motion.load
    for b in range(1, tree.tree.frame.size):
        f = tree.tree.frame[b]
        mass = tree.tree.mass[b]
        force = scale(mass, at(stages.accelerations, displacement_node(frames, f)))
        moment = scale(mass * frames.length[f], at(stages.accelerations, rotation_node(frames, f)))
        for c in range(3):
            load_rows[6 * b + c, i], load_rows[6 * b + 3 + c, i] = moment[c], force[c]
