"""Takes steps of gauss in joint coordinates, for subsystems that are open trees.

Hamilton's weak principle in coordinates q and their momenta p (``formulations.tree.recursion``),
collocated at the Gauss nodes c_i, with the rates u_j there as unknowns:

    q_i = h sum_j a_ij u_j ,    p(q_i, u_i) = p0 + h sum_j a_ij dp/dt(q_j, u_j)
    q_1 = h sum_j b_j u_j ,     p_1 = p0 + h sum_j b_j dp/dt(q_j, u_j) ,    M(q_1) u = p_1

Coordinates count from the start of the step; p0 are the momenta of the bodies there, carried along
by a change of coordinates, so the step is symplectic as the collocation in (q, p) is. As dp/du is
the mass matrix, each iteration subtracts from the rates what the inverse of M(q_i) makes of the
residual; it contracts by about h times the rates of rotation, and by h^2 stiffness/mass. All nodes
are evaluated at once, in lanes. Where the iteration does not converge the step is left to Newton's
method in absolute coordinates, and so are the following ones, of which there are more each time.

Loads come from the elements themselves, which see the bodies' poses and velocities at each node.

Source: E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration (2006), section VI.4, for
the symplecticity of collocation in (q, p).
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, matrix
from msahl.algebra.vector import (
    ZERO,
    Vector,
    add,
    at,
    cross,
    put,
    scale,
    sub,
    times,
    transpose,
)
from msahl.elements.constraints import scalar
from msahl.elements.signals import inputs
from msahl.formulations.absolute.frames import (
    displacement_node,
    frame_count,
    restrict,
    rotation_node,
)
from msahl.formulations.tree import mass_matrix, recursion
from msahl.formulations.tree.table import Tree, TreeMotion, new_motion
from msahl.jit.kernel import apart, kernel, optional, unit
from msahl.jit.lanes import LANES, load, spread, store
from msahl.ports import forces
from msahl.schemes.collocation import equations, predictor, tree_loops
from msahl.schemes.collocation.tableau import Halves, Tableau, lagrange
from msahl.schemes.collocation.tree_loops import LoopStages, new_loop_stages
from msahl.schemes.collocation.workspace import StageArrays
from msahl.schemes.common.criteria import AT_REST, DIVERGED, STUCK
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.outcome import TOLERANCE
from msahl.system import evaluate
from msahl.system.arrays import System, node_count
from msahl.system.cut import Cut

TARGET = 1e-14
"""As ``newton.TARGET``, of the last correction times its contraction."""
MAX_ITERATIONS = 14
"""Iterations after which a step is left to Newton's method, which takes three to five."""
MAX_ANGLE = 1.5
"""Largest rotation about a hinge within a step [rad]: below the range of ``lanes.half_angle``."""
LONGEST_REST = 256
"""Largest number of steps that are left to Newton's method after one that was not solved."""
FROM_TREE, RESTING, REST = range(3)
"""Places in ``TreeStages.figures``: 1 if the polynomials to follow are those of rates of this form;
steps to be left to Newton's method now, and after the next step that is not solved."""


FRESH = (0.0, 0.0, 1.0)


class TreeStages(NamedTuple):
    """Work arrays of steps of one degree in joint coordinates."""

    tree: Tree
    motion: TreeMotion
    loops: LoopStages | None  # of closed loops; None: no code for them
    nodes: np.ndarray  # (s, LANES) a_ij: lane i of row j
    rates: np.ndarray  # (s + 1, n) of the coordinates at c_i and at the start, of the present step
    last_rates: np.ndarray  # (s + 1, n) of the step to follow
    half_rates: np.ndarray  # (2, s + 1, n) of both halves of a pair
    figures: np.ndarray  # (3,) see above


def new_tree_stages(tree: Tree, cut: Cut | None, system: System, tableau: Tableau) -> TreeStages:
    """Return the arrays for steps by a ``tableau`` of at most ``LANES`` nodes, with the equations
    of a ``cut`` where loops are closed.
    """
    c, motion = tableau.force_time, new_motion(tree)
    sizes = frame_count(system.frames), node_count(system), int(system.multipliers.node.size)
    s, n = c.size, tree.body.size
    node = np.minimum(np.arange(LANES), s - 1)
    return TreeStages(
        tree=tree,
        motion=motion,
        loops=cut and new_loop_stages(cut, tree, motion, tableau, sizes),
        nodes=np.ascontiguousarray(lagrange(c, c, -1)[node].T),
        rates=np.zeros((s + 1, n)),
        last_rates=np.zeros((s + 1, n)),
        half_rates=np.zeros((2, s + 1, n)),
        figures=np.array(FRESH),
    )


@optional(False)
def take_step(
    tree: TreeStages, workspace: Workspace, stages: StageArrays, outcome: np.ndarray, h: float
) -> bool:
    """Take a step of size ``h`` if it converges, and return whether it did; ``outcome`` (2,)
    receives its residual.
    """
    if tree.figures[RESTING] > 0.0:
        tree.figures[RESTING] -= 1.0
        return False
    residual = solve_step(tree, workspace, stages, h)
    if not residual <= TOLERANCE:
        tree.figures[RESTING] = tree.figures[REST]
        tree.figures[REST] = min(2.0 * tree.figures[REST], LONGEST_REST)
        leave(tree, stages)
        return False
    outcome[0], outcome[1] = residual, -1.0
    accept(tree, workspace, stages, h)
    return True


@optional()
def leave(tree: TreeStages, stages: StageArrays) -> None:
    """Predict the next step from its start alone, where the last one was of the other form."""
    if tree.figures[FROM_TREE] > 0.0:
        stages.last_step[1] = 0.0
        tree.figures[FROM_TREE] = 0.0


@optional()
def save_half(tree: TreeStages, half: int) -> None:
    """Keep the rates of a half of a pair."""
    for j in range(tree.rates.shape[0]):
        for k in range(tree.rates.shape[1]):
            tree.half_rates[half, j, k] = tree.last_rates[j, k]
    tree_loops.save_half(tree.loops, half)


@optional()
def follow_half(tree: TreeStages) -> None:
    """Let the next prediction follow the second half."""
    for j in range(tree.rates.shape[0]):
        for k in range(tree.rates.shape[1]):
            tree.last_rates[j, k] = tree.half_rates[1, j, k]
    tree_loops.follow_half(tree.loops)


@optional()
def follow_halves(tree: TreeStages, halves: Halves) -> None:
    """Let the next prediction follow both halves."""
    half, weights = halves.rate_half, halves.rates
    for i in range(half.size):
        for k in range(tree.rates.shape[1]):
            total = 0.0
            for j in range(weights.shape[1]):
                total += weights[i, j] * tree.half_rates[half[i], j, k]
            tree.last_rates[i, k] = total
    tree_loops.follow_halves(tree.loops, halves.multiplier_half, halves.multipliers)


@unit
def solve_step(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> float:
    """Solve for the rates at all nodes; return the relative residual, inf if there is none."""
    motion = tree.motion
    recursion.begin(tree.tree, motion, workspace.state.x, workspace.start.frames)
    tree_loops.begin(tree.loops, tree.tree, motion, workspace, stages, h)
    follows = predict(tree, stages, workspace.state.time[0], h)
    tree_loops.predict(tree.loops, workspace, stages, follows, h)
    if not tree.tree.bare:
        forces.node_factors(
            workspace.system.forces,
            workspace.state.time[0],
            h,
            stages.tableau.from_moments,
            stages.factor,
        )
    before, smallest = math.inf, math.inf
    for iteration in range(MAX_ITERATIONS):
        tree_loops.set_nodes(tree.loops, tree.tree, motion, workspace, stages, h)
        if not set_coordinates(tree, h):
            return math.inf
        recursion.set_places(tree.tree, motion)
        recursion.set_twists(tree.tree, motion)
        if iteration == 0:
            mass_matrix.set_factors(tree.tree, motion)
            tree_loops.set_factors(tree.loops, tree.tree, motion)
            workspace.counts[1] += 1
        if not tree.tree.bare:
            set_loads(tree, workspace, stages, h)
        recursion.set_momenta(tree.tree, motion)
        residual = correct(tree, h)
        workspace.counts[0] += 1
        if iteration == 0:
            stages.predicted_well[0] = 1.0 if residual <= PREDICTED_WELL else 0.0
        ratio = residual / before if iteration > 0 else 1.0
        if residual * min(1.0, ratio) <= TARGET or (ratio > STUCK and residual <= TOLERANCE):
            return min(residual, TOLERANCE)
        smallest = min(smallest, residual)
        if not residual <= DIVERGED * smallest:
            return math.inf
        before = residual
    return math.inf


PREDICTED_WELL = 0.03
"""As ``newton.PREDICTED_WELL``, of the first correction."""


@kernel
def predict(tree: TreeStages, stages: StageArrays, t: float, h: float) -> bool:
    """Set the rates at the nodes to the prediction from the step to follow, or to those at the
    start; return whether there is one to follow.
    """
    motion, s = tree.motion, tree.rates.shape[0] - 1
    follows = False
    if tree.figures[FROM_TREE] > 0.0:
        follows = predictor.set_weights(stages, t, h)
    for k in range(motion.rate.size):
        for i in range(s):
            value = motion.rate[k]
            if follows:
                value = stages.rate_weights[i, s + 1] * value
                for j in range(s + 1):
                    value += stages.rate_weights[i, j] * tree.last_rates[j, k]
            motion.u[k, i] = value
        for i in range(s, LANES):
            motion.u[k, i] = motion.u[k, s - 1]
    for b in range(1, tree.tree.frame.size):
        if tree.tree.is_ball[b]:
            _to_hinges(tree, tree.tree.first[b], h)
    return follows


SWEEPS = 3
"""Iterations for the rates of a ball's hinges; each gains a power of the rotation over the step."""


@kernel
def _to_hinges(tree: TreeStages, k: int, h: float) -> None:
    """Replace angular velocities of a ball, in the parent's axes, by rates of its hinges from
    coordinate ``k``.
    """
    u, s = tree.motion.u, tree.rates.shape[0] - 1
    for i in range(s):
        for c in range(3):
            tree.rates[i, k + c] = u[k + c, i]
    for _ in range(SWEEPS):
        for i in range(s):
            x, y = 0.0, 0.0
            for j in range(s):
                x += h * tree.nodes[j, i] * u[k, j]
                y += h * tree.nodes[j, i] * u[k + 1, j]
            w = (tree.rates[i, k], tree.rates[i, k + 1], tree.rates[i, k + 2])
            first, second, third = hinge_rates(x, y, w)
            tree.motion.y[k, i], tree.motion.y[k + 1, i] = first, second
            tree.motion.y[k + 2, i] = third
        for c in range(3):
            for i in range(LANES):
                u[k + c, i] = tree.motion.y[k + c, min(i, s - 1)]


@kernel
def hinge_rates(x: float, y: float, w: Vector) -> Vector:
    """Rates of the hinges x, y, z of a ball with an angular velocity ``w`` in the parent's axes."""
    along = math.cos(x) * w[2] - math.sin(x) * w[1]
    third = along / max(math.cos(y), 0.1)  # a prediction need not be right
    return (
        w[0] - math.sin(y) * third,
        math.cos(x) * w[1] + math.sin(x) * w[2],
        third,
    )


@kernel
def angular_velocity(x: float, y: float, u: Vector) -> Vector:
    """Angular velocity of a ball in the parent's axes, by the rates ``u`` of its hinges."""
    across = math.cos(y) * u[2]
    return (
        u[0] + math.sin(y) * u[2],
        math.cos(x) * u[1] - math.sin(x) * across,
        math.sin(x) * u[1] + math.cos(x) * across,
    )


@kernel
def set_coordinates(tree: TreeStages, h: float) -> bool:
    """Set the coordinates at the nodes; return whether they are within the range of a step."""
    motion, largest = tree.motion, 0.0
    for k in range(motion.rate.size):
        value = (h * motion.u[k, 0]) * load(tree.nodes, 0)
        for j in range(1, tree.nodes.shape[0]):
            value = value + (h * motion.u[k, j]) * load(tree.nodes, j)
        store(motion.q, k, value)
        if not tree.tree.slides[k]:
            for i in range(LANES):
                # Written so that a nan counts.
                if not abs(motion.q[k, i]) <= largest:
                    largest = abs(motion.q[k, i])
    return largest <= MAX_ANGLE


@kernel
def correct(tree: TreeStages, h: float) -> float:
    """Subtract from the rates what the mass matrices make of the residual; return the largest
    correction relative to the largest displacement of the step.
    """
    motion, s = tree.motion, tree.nodes.shape[0]
    for k in range(motion.rate.size):
        value = load(motion.p, k) - motion.momentum[k]
        for j in range(s):
            value = value - (h * motion.force[k, j]) * load(tree.nodes, j)
        store(motion.y, k, value)
    tree_loops.add_pull(tree.loops, motion, h)
    mass_matrix.solve(tree.tree, motion)
    left = tree_loops.correct(tree.loops, tree.tree, motion, h)
    largest, length = 0.0, max(AT_REST, speed_of_loads(tree, h))
    for k in range(motion.rate.size):
        metres = tree.tree.length[k]
        store(motion.u, k, load(motion.u, k) - load(motion.y, k))
        length = max(length, metres * abs(motion.rate[k]))
        for i in range(s):
            length = max(length, metres * abs(motion.u[k, i]))
            change = metres * abs(motion.y[k, i])
            # Written so that a nan counts.
            if not change <= largest:
                largest = change
    return max(largest, left / h) / length


@kernel
def speed_of_loads(tree: TreeStages, h: float) -> float:
    """Largest change of a body's velocity by its load within the step, at its first node [m/s]:
    where loads balance, rates are known no better than the round-off of this.
    """
    loads, g, largest = tree.motion.load, tree.tree.gravity, 0.0
    for b in range(1, tree.tree.frame.size):
        force = 0.0
        for c in range(3):
            force += abs(loads[6 * b + 3 + c, 0] + tree.tree.mass[b] * g[c])
        largest = max(largest, force / tree.tree.mass[b])
    return h * largest


@apart
def set_loads(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> None:
    """Set the loads on all bodies at all nodes, and the work of the step's forces."""
    for w in range(stages.work.size):
        stages.work[w] = 0.0
    for i in range(tree.nodes.shape[0]):
        set_node(tree, workspace, stages, h, i)
        equations.set_force_accelerations(workspace.system, stages, h, i)
        _take_loads(tree, workspace.system, stages, i)
    for row in range(tree.motion.load.shape[0]):
        for i in range(tree.nodes.shape[0], LANES):
            tree.motion.load[row, i] = tree.motion.load[row, i - 1]


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
    turn = scale(4.0 * sign / (1.0 + sign * real), e)
    x = add(c, (m.origin[0], m.origin[1], m.origin[2]))
    return x, turn, add(v, cross(w, c)), w


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


@unit
def accept(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> None:
    """Advance the state by the solved step."""
    system, state, start = workspace.system, workspace.state, workspace.start
    frames, last = system.frames, tree.nodes.shape[0] - 1
    _save_rates(tree)
    for b in range(1, tree.tree.frame.size):
        _, _, v, W = body_motion(tree, b, last)
        put(state.a, tree.tree.frame[b], v)
        put(state.alpha, tree.tree.frame[b], W)
    _set_end(tree, workspace, stages, h)
    rest = 1.0 / (h * (1.0 - stages.tableau.force_time[last]))
    for b in range(1, tree.tree.frame.size):
        f = tree.tree.frame[b]
        x, c, v, W = body_motion(tree, b, 0)
        put(state.a, f, restrict(frames, 0, scale(rest, sub(v, at(state.a, f)))))
        put(state.alpha, f, restrict(frames, 1, scale(rest, sub(W, at(state.alpha, f)))))
        put(state.x, f, x)
        put(state.x_low, f, ZERO)
        p = compose(c, at(state.p, f))
        put(state.p, f, p)
        put(state.v, f, restrict(frames, 0, v))
        put(state.w, f, times(transpose(matrix(p)), restrict(frames, 1, W)))
    if not tree.tree.bare:
        for w in range(state.work.size):
            state.work[w] += stages.work[w]
    stages.last_step[0], stages.last_step[1] = state.time[0], h
    tree.figures[FROM_TREE], tree.figures[REST] = 1.0, max(1.0, 0.5 * tree.figures[REST])
    state.time[0] += h
    evaluate.prepare(system, state, start)
    scalar.count_rotations(system.scalar, start.scalar, state.angle)


@kernel
def _save_rates(tree: TreeStages) -> None:
    """Keep the rates of the solved step, of balls as angular velocities in the parent's axes."""
    motion, s = tree.motion, tree.nodes.shape[0]
    for k in range(motion.rate.size):
        tree.last_rates[s, k] = motion.rate[k]
        for i in range(s):
            tree.last_rates[i, k] = motion.u[k, i]
    for b in range(1, tree.tree.frame.size):
        if not tree.tree.is_ball[b]:
            continue
        k = tree.tree.first[b]
        for i in range(s):
            rates = (motion.u[k, i], motion.u[k + 1, i], motion.u[k + 2, i])
            w = angular_velocity(motion.q[k, i], motion.q[k + 1, i], rates)
            for c in range(3):
                tree.last_rates[i, k + c] = w[c]


@kernel
def _set_end(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> None:
    """Set the motion at the end of the step in every lane."""
    motion, tableau = tree.motion, stages.tableau
    for k in range(motion.rate.size):
        q, p = 0.0, motion.momentum[k]
        for i in range(tableau.force_weight.size):
            q += h * tableau.force_weight[i] * motion.u[k, i]
            p += h * tableau.force_weight[i] * motion.force[k, i]
        store(motion.q, k, spread(q))
        store(motion.y, k, spread(p))
    tree_loops.add_impulse(tree.loops, motion, h)
    recursion.set_places(tree.tree, motion)
    mass_matrix.set_factors(tree.tree, motion)
    mass_matrix.solve(tree.tree, motion)
    tree_loops.project(tree.loops, tree.tree, motion, workspace, stages, h)
    for k in range(motion.rate.size):
        store(motion.u, k, load(motion.y, k))
    recursion.set_twists(tree.tree, motion)
