"""Loads of a step in joint coordinates, by the elements themselves.

They see the bodies' poses and velocities at each node, as they do in absolute coordinates; what
they do to a body enters the recursion as a wrench.
"""

import math

from msahl.algebra.rotation import compose, matrix
from msahl.algebra.vector import (
    ZERO,
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
    frame_count,
    rotation_node,
)
from msahl.jit.kernel import apart, kernel, optional
from msahl.jit.lanes import LANES
from msahl.ports import forces
from msahl.schemes.collocation.tree import slopes
from msahl.schemes.collocation.tree.slopes import LoadSlopes
from msahl.schemes.collocation.tree.stages import SLOPES, LoadNode, TreeStages
from msahl.schemes.collocation.workspace import StageArrays
from msahl.schemes.common.workspace import Workspace
from msahl.system import evaluate


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
    _solve_states(tree.node.system.forces.signals, tree, workspace, stages, h)
    for i in range(tree.nodes.shape[0]):
        set_node(tree, workspace, stages, h, i)
        set_accelerations(tree.node, stages, h, i)
        take_loads(tree, i)
    for row in range(tree.motion.load.shape[0]):
        for i in range(tree.nodes.shape[0], LANES):
            tree.motion.load[row, i] = tree.motion.load[row, i - 1]


@optional()
def set_slopes(found: LoadSlopes, tree: TreeStages, stages: StageArrays) -> None:
    """Set the slopes of the loads to those at the last node, after ``set_loads``."""
    last, node = tree.nodes.shape[0] - 1, tree.node
    given = node.system, node.start.forces, stages.reaction[last], last
    slopes.differentiate(found, tree.tree, tree.motion, *given)
    tree.figures[SLOPES] += 1.0


@optional()
def _solve_states(
    group: Signals, tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float
) -> None:
    """Set the auxiliary states at all nodes, which depend on the motion at all of them."""
    if group.rate.size == 0:
        return
    system, node = tree.node.system, tree.node.start.forces
    for i in range(tree.nodes.shape[0]):
        set_node(tree, workspace, stages, h, i)
        forces.set_signal_inputs(group, node, system.scalar, system.frames, tree.node.still)
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
    """Set the state and the workspace of ``tree.node`` to the motion in lane ``i``."""
    state, node, start = workspace.state, tree.node.state, tree.node.start
    system, coordinate = tree.node.system, tree.node.coordinate
    node.time[0] = state.time[0] + h * stages.tableau.force_time[i]
    for b in range(1, tree.tree.frame.size):
        f = tree.tree.frame[b]
        x, c, v, W = body_motion(tree, b, i)
        put(node.x, f, x)
        p = compose(c, at(state.p, f))
        put(node.p, f, p)
        put(node.v, f, v)
        put(node.w, f, times(transpose(matrix(p)), W))
    evaluate.prepare(system, node, start)
    inputs.save_reactions(system.forces.signals, start.forces.signals, state.reaction)
    for q in range(coordinate.size):
        node.angle[q] = state.angle[coordinate[q]]
    scalar.count_rotations(system.scalar, start.scalar, node.angle)


@kernel
def set_accelerations(node: LoadNode, stages: StageArrays, h: float, i: int) -> None:
    """Set the accelerations by all forces at the node ``i``, and add their work."""
    system, start, rows = node.system, node.start, node.accelerations
    frames, group, gravity = system.frames, system.scalar, system.bodies.gravity
    for b in range(frame_count(frames)):
        put(rows, displacement_node(frames, b), (gravity[0], gravity[1], gravity[2]))
        put(rows, rotation_node(frames, b), ZERO)
    reaction, dt = stages.reaction[i], h * stages.tableau.force_weight[i]
    scalar.rates(group, start.scalar, frames, start.frames, node.still)
    forces.set_node(system.forces, start.forces, stages.factor[i])
    states.set_state(system.forces.signals, start.forces.signals, stages.signals, i)
    forces.add_forces(system.forces, start.forces, group, frames, reaction, rows)
    forces.add_power(system.forces, start.forces, group, reaction, dt, stages.work)


@kernel
def take_loads(tree: TreeStages, i: int) -> None:
    """Set the loads of lane ``i`` from the accelerations by all forces."""
    frames, found, loads = tree.node.system.frames, tree.node.accelerations, tree.motion.load
    for b in range(1, tree.tree.frame.size):
        f = tree.tree.frame[b]
        mass = tree.tree.mass[b]
        force = scale(mass, at(found, displacement_node(frames, f)))
        moment = scale(mass * frames.length[f], at(found, rotation_node(frames, f)))
        for c in range(3):
            loads[6 * b + c, i], loads[6 * b + 3 + c, i] = moment[c], force[c]
