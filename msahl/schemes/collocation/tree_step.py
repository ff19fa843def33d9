"""Takes steps of gauss in joint coordinates, for subsystems that are open trees.

Hamilton's weak principle in coordinates q and their momenta p (``formulations.tree.recursion``),
collocated at the Gauss nodes c_i, with the rates u_j there as unknowns:

    q_i = h sum_j a_ij u_j ,    p(q_i, u_i) = p0 + h sum_j a_ij dp/dt(q_j, u_j)
    q_1 = h sum_j b_j u_j ,     p_1 = p0 + h sum_j b_j dp/dt(q_j, u_j) ,    M(q_1) u = p_1

Coordinates count from the start of the step, and p0 are the momenta of the bodies there. From step
to step the coordinates of hinges and slides differ by constants, which changes nothing: the step is
symplectic, as collocation in (q, p) is. The hinges of a ball have other axes in each step. With
their momenta p0 = L0 at the start, those about the same axes fixed in the parent, the step would
not be symplectic. It is with the p0 by which the momenta at the end are

    L_1 = L0 + h sum_j b_j dL/dt(q_j, u_j) ,     p_1 = E(q_1)^T L_1

where E u is the angular velocity by the rates u in those axes, and dL/dt is the ``moment`` of the
recursion. It follows from varying the orientation at the start of the action over one step, with
the axes that it carries along; a ball without moments keeps its angular momentum exactly.

As dp/du is the mass matrix, each iteration subtracts from the rates what the inverse of M(q_i)
makes of the residual; it contracts by about h times the rates of rotation, and by h^2
stiffness/mass. All nodes are evaluated at once, in lanes. Where the iteration does not converge the
step is left to Newton's method in absolute coordinates, and so are the following ones, of which
there are more each time.

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
    matrix_at,
    put,
    scale,
    sub,
    times,
    transpose,
)
from msahl.elements.constraints import scalar
from msahl.elements.signals import inputs, states
from msahl.elements.signals.group import Signals, Stages
from msahl.formulations.absolute.frames import (
    displacement_node,
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
from msahl.schemes.common.criteria import AT_REST, STUCK
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.outcome import TOLERANCE
from msahl.system import evaluate
from msahl.system.arrays import System
from msahl.system.cut import Cut

TARGET = 3e-16
"""Largest last correction times its contraction: the error that remains, which has the same sign in
all steps. With 1e-14 the energy of a pendulum drifts by 3e-15 of itself in a step."""
WORK_TARGET = 1e-12
"""Largest last correction where loads do work, which is evaluated before it: work changes with the
velocities themselves, momenta with the time step times these."""
MAX_ITERATIONS, MAX_LOADED = 18, 10
"""Iterations, and those of systems with loads, which take longer, after which a step is left to
Newton's method. That takes one or two, and as long as some 20 and 10 of these: see
``stepper.work_of``."""
LONGEST_REST = 256
"""Largest number of steps that are left to Newton's method after one that was not solved."""
CAUTION, FORGETTING = 4.0, 1.2
"""Factor of the contraction measured in an earlier step, with which a first correction is judged,
and its growth by every step that did not measure it."""
FROM_TREE, RESTING, REST, ITERATIONS, STEPS, CONTRACTION, SIZE, ABSOLUTE = range(8)
"""Places in ``TreeStages.figures``: 1 if the polynomials to follow are those of rates of this form;
steps to be left to Newton's method now, and after the next step that is not solved; iterations and
steps in this form so far; ratio of the second to the first correction, and the size of the step in
which it was measured [s]; 1 if the next step is to be in absolute coordinates."""
MIXED = 8.0
"""Growth of the rest after a pair whose steps were not all of one form, of which only the long one
did not converge."""


class TreeStages(NamedTuple):
    """Work arrays of steps of one degree in joint coordinates."""

    tree: Tree
    motion: TreeMotion
    loops: LoopStages | None  # of closed loops; None: no code for them
    nodes: np.ndarray  # (s, LANES) a_ij: lane i of row j
    rates: np.ndarray  # (s + 1, n) of the coordinates at c_i and at the start, of the present step
    last_rates: np.ndarray  # (s + 1, n) of the step to follow
    half_rates: np.ndarray  # (2, s + 1, n) of both halves of a pair
    half_form: np.ndarray  # (2,) ``FROM_TREE`` after each of them
    forms: np.ndarray  # (chunk,) ``FROM_TREE`` after each step of the present chunk
    given: np.ndarray  # (chunk,) 0 where a step of the chunk is to be in absolute coordinates
    figures: np.ndarray  # (8,) see above


def new_tree_stages(
    tree: Tree, cut: Cut | None, workspace: Workspace, tableau: Tableau
) -> TreeStages:
    """Return the arrays for steps by a ``tableau`` of at most ``LANES`` nodes, with the equations
    of a ``cut`` where loops are closed.
    """
    system, chunk = workspace.system, workspace.monitor.rows.shape[0]
    c, motion = tableau.force_time, new_motion(tree)
    s, n = c.size, tree.body.size
    node = np.minimum(np.arange(LANES), s - 1)
    return TreeStages(
        tree=tree,
        motion=motion,
        loops=cut and new_loop_stages(cut, tree, system, tableau),
        nodes=np.ascontiguousarray(lagrange(c, c, -1)[node].T),
        rates=np.zeros((s + 1, n)),
        last_rates=np.zeros((s + 1, n)),
        half_rates=np.zeros((2, s + 1, n)),
        half_form=np.zeros(2),
        forms=np.zeros(chunk),
        given=np.ones(chunk),
        figures=np.array((0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0)),
    )


@optional(False)
def take_step(
    tree: TreeStages, workspace: Workspace, stages: StageArrays, outcome: np.ndarray, h: float
) -> bool:
    """Take a step of size ``h`` if it converges, and return whether it did; ``outcome`` (2,)
    receives its residual.
    """
    if tree.figures[ABSOLUTE] > 0.0:
        return False
    if tree.figures[RESTING] > 0.0:
        tree.figures[RESTING] -= 1.0
        return False
    residual = solve_step(tree, workspace, stages, h)
    if not residual <= TOLERANCE:
        tree.figures[RESTING] = tree.figures[REST]
        tree.figures[REST] = min(2.0 * tree.figures[REST], LONGEST_REST)
        return False
    outcome[0], outcome[1] = residual, -1.0
    accept(tree, workspace, stages, h)
    return True


@optional()
def forget(tree: TreeStages) -> None:
    """Solve the next step in this form, without what earlier steps have shown."""
    for place in (FROM_TREE, RESTING):
        tree.figures[place] = 0.0
    for place in (REST, CONTRACTION, SIZE):
        tree.figures[place] = 1.0


@optional()
def choose_form(tree: TreeStages, step: int) -> None:
    """Prepare for a ``step`` of the chunk."""
    tree.figures[ABSOLUTE] = 1.0 - tree.given[step]


@optional()
def save_form(tree: TreeStages, step: int) -> None:
    """Save in which form a ``step`` of the chunk was solved."""
    tree.forms[step] = tree.figures[FROM_TREE]


@optional()
def save_forms(tree: TreeStages, step: int) -> None:
    """Save in which form both halves of a pair were solved, whose first is the ``step``."""
    for half in range(2):
        tree.forms[step + half] = tree.half_form[half]


@optional(False)
def is_mixed(tree: TreeStages) -> bool:
    """Whether a long step was solved in another form than both halves. Each form has an error of
    its own, so the difference says nothing of either. Then the next steps are left to absolute
    coordinates.
    """
    form = tree.figures[FROM_TREE]
    if tree.half_form[0] == form and tree.half_form[1] == form:
        return False
    tree.figures[RESTING] = tree.figures[REST] = min(MIXED * tree.figures[REST], LONGEST_REST)
    return True


@optional(False)
def leave(tree: TreeStages, stages: StageArrays) -> bool:
    """Predict the next step from its start alone where the last one was of this form, which has no
    multipliers; return whether it was.
    """
    if tree.figures[FROM_TREE] > 0.0:
        stages.last_step[1] = 0.0
        tree.figures[FROM_TREE] = 0.0
        return True
    return False


@optional()
def save_half(tree: TreeStages, half: int) -> None:
    """Keep the rates of a half of a pair, and its form."""
    tree.half_form[half] = tree.figures[FROM_TREE]
    for j in range(tree.rates.shape[0]):
        for k in range(tree.rates.shape[1]):
            tree.half_rates[half, j, k] = tree.last_rates[j, k]
    tree_loops.save_half(tree.loops, half)


@optional()
def follow_half(tree: TreeStages) -> None:
    """Let the next prediction follow the second half."""
    tree.figures[FROM_TREE] = tree.half_form[1]
    for j in range(tree.rates.shape[0]):
        for k in range(tree.rates.shape[1]):
            tree.last_rates[j, k] = tree.half_rates[1, j, k]
    tree_loops.follow_half(tree.loops)


@optional(True)
def follow_halves(tree: TreeStages, halves: Halves) -> bool:
    """Let the next prediction follow both halves; return whether it can: they are of one form."""
    tree.figures[FROM_TREE] = tree.half_form[1]
    half, weights = halves.rate_half, halves.rates
    for i in range(half.size):
        for k in range(tree.rates.shape[1]):
            total = 0.0
            for j in range(weights.shape[1]):
                total += weights[i, j] * tree.half_rates[half[i], j, k]
            tree.last_rates[i, k] = total
    tree_loops.follow_halves(tree.loops, halves.multiplier_half, halves.multipliers)
    return bool(tree.half_form[0] == tree.half_form[1])


@unit
def solve_step(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> float:
    """Solve for the rates at all nodes; return the relative residual, inf if there is none."""
    motion = tree.motion
    recursion.begin(tree.tree, motion, workspace.state.x, workspace.start.frames)
    tree_loops.begin(tree.loops, tree.tree, motion, workspace, stages, h)
    follows = predict(tree, stages, workspace.start.frames.R, workspace.state.time[0], h)
    tree_loops.predict(tree.loops, workspace, stages, follows, h)
    if not tree.tree.bare:
        begin_loads(workspace, stages, h)
    before, most = math.inf, WORK_TARGET if stages.work.size > 0 else math.inf
    iterations = MAX_ITERATIONS if tree.tree.bare else MAX_LOADED
    tree.figures[STEPS] += 1.0
    workspace.counts[1] += 1
    for iteration in range(iterations):
        tree_loops.set_nodes(tree.loops, tree.tree, motion, workspace, stages, h)
        if not set_coordinates(tree, h):
            return math.inf
        recursion.set_places(tree.tree, motion)
        recursion.set_twists(tree.tree, motion)
        if before > FAR and iteration <= MOST_RENEWALS:
            mass_matrix.set_factors(tree.tree, motion)
            tree_loops.set_factors(tree.loops, tree.tree, motion)
        if not tree.tree.bare:
            set_loads(tree, workspace, stages, h)
            if not _states_exist(workspace.system.forces.signals, stages.signals):
                return math.inf
        recursion.set_momenta(tree.tree, motion)
        residual = correct(tree, stages.tableau.force_weight, h)
        workspace.counts[0] += 1
        tree.figures[ITERATIONS] += 1.0
        if iteration == 0:
            stages.predicted_well[0] = 1.0 if residual <= PREDICTED_WELL else 0.0
        ratio = contraction(tree, residual, before, iteration, h)
        left = residual * min(1.0, ratio)
        if left <= TARGET and residual <= most:
            return left if tree_loops.holds(tree.loops, tree.tree) else math.inf
        if iteration > 0 and ratio > STUCK and residual <= TOLERANCE:
            return left if tree_loops.holds(tree.loops, tree.tree) else math.inf
        if iteration > MOST_RENEWALS and is_hopeless(residual, ratio, iterations - 1 - iteration):
            return math.inf
        before = residual
    return math.inf


@kernel
def contraction(
    tree: TreeStages, residual: float, before: float, iteration: int, h: float
) -> float:
    """Ratio of the present correction to the one ``before`` it; for the first one that of the next
    to it, as far as it is known from earlier steps.
    """
    figures = tree.figures
    if iteration == 0:
        figures[CONTRACTION] *= FORGETTING
        return float(CAUTION * figures[CONTRACTION] * max(1.0, h / figures[SIZE]) ** 2)
    ratio = residual / before
    if iteration == 1:
        figures[CONTRACTION], figures[SIZE] = ratio, h
    return ratio


FAR, MOST_RENEWALS = 0.01, 3
"""Correction after which the mass matrices of the prediction are not good enough, and how often
they are set anew in a step; only then does the ratio of corrections say how the iteration goes."""
PREDICTED_WELL = 0.03
"""As ``newton.PREDICTED_WELL``, of the first correction."""
SLOWER = 2.0
"""Factor by which the iteration may turn out to converge faster than its last two corrections say:
the first ones contain parts that vanish at once, or grow before they fall."""


@kernel
def is_hopeless(residual: float, ratio: float, left: int) -> bool:
    """Whether ``left`` further iterations will not do, by the ``ratio`` of the last corrections."""
    if not ratio < 1.0:
        return not (ratio < GROWTH and residual < SMALL)
    return residual * ratio ** (SLOWER * left) > TARGET


GROWTH, SMALL = 10.0, 0.1
"""Ratio of corrections, and their size, up to which growth is not taken for divergence."""


@kernel
def predict(tree: TreeStages, stages: StageArrays, R: np.ndarray, t: float, h: float) -> bool:
    """Set the rates at the nodes to the prediction from the step to follow, or to those at the
    start, where the frames have the orientations ``R``; return whether there is one to follow.

    What is extrapolated of a ball is its angular velocity in the parent's axes, as its hinges have
    other axes in each step.
    """
    motion, s = tree.motion, tree.rates.shape[0] - 1
    follows = False
    if tree.figures[FROM_TREE] > 0.0:
        follows = predictor.set_weights(stages, t, h)
    _set_start(tree, R)
    for k in range(motion.rate.size):
        for i in range(s):
            value = tree.rates[s, k]
            if follows:
                value = stages.rate_weights[i, s + 1] * value
                for j in range(s + 1):
                    value += stages.rate_weights[i, j] * tree.last_rates[j, k]
            motion.u[k, i] = value
    for b in range(1, tree.tree.frame.size):
        if tree.tree.ball[b] >= 0:
            _to_hinges(tree, R, b, h)
    for k in range(motion.rate.size):
        for i in range(s, LANES):
            motion.u[k, i] = motion.u[k, s - 1]
    return follows


@kernel
def _set_start(tree: TreeStages, R: np.ndarray) -> None:
    """Set the last of ``tree.rates`` to those at the start."""
    motion, s = tree.motion, tree.rates.shape[0] - 1
    for k in range(motion.rate.size):
        tree.rates[s, k] = motion.rate[k]
    for b in range(1, tree.tree.frame.size):
        k = tree.tree.ball[b]
        if k >= 0:
            w = in_parent(tree, R, b, (motion.rate[k], motion.rate[k + 1], motion.rate[k + 2]))
            for c in range(3):
                tree.rates[s, k + c] = w[c]


@kernel
def in_parent(tree: TreeStages, R: np.ndarray, b: int, w: Vector) -> Vector:
    """Vector in the parent's axes, from its components along the hinges of the ball of body ``b``
    at the start of the step.
    """
    axes = axes_of_ball(tree, b)
    parent = matrix_at(R, tree.tree.frame[tree.tree.parent[b]])
    return times(transpose(parent), times(transpose(axes), w))


@kernel
def axes_of_ball(tree: TreeStages, b: int) -> tuple[Vector, Vector, Vector]:
    """Axes of the three hinges of body ``b`` at the start of the step, inertial axes."""
    k, axis = tree.tree.ball[b], tree.motion.axis
    return (at(axis, k), at(axis, k + 1), at(axis, k + 2))


SWEEPS = 3
"""Iterations for the rates of a ball's hinges; each gains a power of the rotation over the step."""


@kernel
def _to_hinges(tree: TreeStages, R: np.ndarray, b: int, h: float) -> None:
    """Replace angular velocities of the ball of body ``b``, in the parent's axes, by the rates of
    its hinges.
    """
    k, u, s = tree.tree.ball[b], tree.motion.u, tree.rates.shape[0] - 1
    axes, parent = axes_of_ball(tree, b), matrix_at(R, tree.tree.frame[tree.tree.parent[b]])
    for i in range(s):
        w = times(axes, times(parent, (u[k, i], u[k + 1, i], u[k + 2, i])))
        for c in range(3):
            tree.rates[i, k + c] = w[c]
    for _ in range(SWEEPS):
        for i in range(s):
            x, y = 0.0, 0.0
            for j in range(s):
                x += h * tree.nodes[j, i] * u[k, j]
                y += h * tree.nodes[j, i] * u[k + 1, j]
            w = hinge_rates(x, y, (tree.rates[i, k], tree.rates[i, k + 1], tree.rates[i, k + 2]))
            for c in range(3):
                tree.motion.y[k + c, i] = w[c]
        for c in range(3):
            for i in range(s):
                u[k + c, i] = tree.motion.y[k + c, i]


@kernel
def hinge_rates(x: float, y: float, w: Vector) -> Vector:
    """Rates of the hinges x, y, z of a ball with an angular velocity ``w`` in the axes that these
    have at the start of the step.
    """
    along = math.cos(x) * w[2] - math.sin(x) * w[1]
    third = along / max(math.cos(y), 0.1)  # a prediction need not be right
    return (
        w[0] - math.sin(y) * third,
        math.cos(x) * w[1] + math.sin(x) * w[2],
        third,
    )


@kernel
def angular_velocity(x: float, y: float, u: Vector) -> Vector:
    """Angular velocity of a ball by the rates ``u`` of its hinges, in the axes that these have at
    the start of the step.
    """
    across = math.cos(y) * u[2]
    return (
        u[0] + math.sin(y) * u[2],
        math.cos(x) * u[1] - math.sin(x) * across,
        math.sin(x) * u[1] + math.cos(x) * across,
    )


@kernel
def set_coordinates(tree: TreeStages, h: float) -> bool:
    """Set the coordinates at the nodes; return whether they are within the range of a step."""
    motion, within = tree.motion, True
    for k in range(motion.rate.size):
        value = (h * motion.u[k, 0]) * load(tree.nodes, 0)
        for j in range(1, tree.nodes.shape[0]):
            value = value + (h * motion.u[k, j]) * load(tree.nodes, j)
        store(motion.q, k, value)
        for i in range(LANES):
            # Written so that a nan counts.
            if not abs(motion.q[k, i]) <= tree.tree.reach[k]:
                within = False
    return within


@kernel
def set_end_momenta(tree: TreeStages, weight: np.ndarray, h: float) -> None:
    """Set the momenta at the end of the step from those at its start and their rates."""
    motion = tree.motion
    for k in range(motion.rate.size):
        motion.end_momentum[k] = changed(motion.momentum[k], motion.force, k, weight, h)
        motion.end_momentum[k] += tree_loops.impulse(tree.loops, k, h)
    for b in range(1, tree.tree.frame.size):
        k = tree.tree.ball[b]
        if k >= 0:
            x, y = changed(0.0, motion.u, k, weight, h), changed(0.0, motion.u, k + 1, weight, h)
            about_x = changed(motion.momentum[k], motion.moment, k, weight, h)
            about_y = changed(motion.momentum[k + 1], motion.moment, k + 1, weight, h)
            about_z = changed(motion.momentum[k + 2], motion.moment, k + 2, weight, h)
            about_x += tree_loops.moment_impulse(tree.loops, k, h)
            about_y += tree_loops.moment_impulse(tree.loops, k + 1, h)
            about_z += tree_loops.moment_impulse(tree.loops, k + 2, h)
            across = math.cos(x) * about_z - math.sin(x) * about_y
            motion.end_momentum[k] = about_x
            motion.end_momentum[k + 1] = math.cos(x) * about_y + math.sin(x) * about_z
            motion.end_momentum[k + 2] = math.sin(y) * about_x + math.cos(y) * across


@kernel
def changed(value: float, rates: np.ndarray, k: int, weight: np.ndarray, h: float) -> float:
    """``value`` at the start of the step plus the integral over it of row ``k`` of ``rates``."""
    for i in range(weight.size):
        value += h * weight[i] * rates[k, i]
    return value


@kernel
def correct(tree: TreeStages, weight: np.ndarray, h: float) -> float:
    """Subtract from the rates what the mass matrices make of the residual; return the largest
    correction relative to the largest displacement of the step.
    """
    motion, s = tree.motion, tree.nodes.shape[0]
    set_end_momenta(tree, weight, h)
    for k in range(motion.rate.size):
        begin = motion.momentum[k]
        if 0 <= tree.tree.ball[tree.tree.body[k]] <= k:
            begin = changed(motion.end_momentum[k], motion.force, k, weight, -h)
            begin -= tree_loops.impulse(tree.loops, k, h)
        value = load(motion.p, k) - begin
        for j in range(s):
            value = value - (h * motion.force[k, j]) * load(tree.nodes, j)
        store(motion.y, k, value)
    tree_loops.add_pull(tree.loops, motion, h)
    mass_matrix.solve(tree.tree, motion)
    tree_loops.correct(tree.loops, tree.tree, motion, h)
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
    return largest / length


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
def _states_exist(group: Signals, stages: Stages) -> bool:
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


@unit
def accept(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> None:
    """Advance the state by the solved step."""
    system, state, start = workspace.system, workspace.state, workspace.start
    frames, last = system.frames, tree.nodes.shape[0] - 1
    _save_rates(tree, start.frames.R)
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
        # Positions follow from rotations, which are composed without such a rest.
        put(state.x_low, f, ZERO)
        p = compose(c, at(state.p, f))
        put(state.p, f, p)
        put(state.v, f, restrict(frames, 0, v))
        put(state.w, f, times(transpose(matrix(p)), restrict(frames, 1, W)))
    for k in range(state.force.shape[0]):
        put(state.force, k, ZERO)
        put(state.violation, k, ZERO)
    tree_loops.save(tree.loops, state, h)
    for w in range(state.work.size):
        state.work[w] += stages.work[w]
    states.accept(system.forces.signals, stages.signals, state.auxiliary)
    stages.last_step[0], stages.last_step[1] = state.time[0], h
    tree.figures[FROM_TREE], tree.figures[REST] = 1.0, max(1.0, 0.5 * tree.figures[REST])
    state.time[0] += h
    evaluate.prepare(system, state, start)
    scalar.count_rotations(system.scalar, start.scalar, state.angle)


@kernel
def _save_rates(tree: TreeStages, R: np.ndarray) -> None:
    """Keep the rates of the solved step to predict the next one, see ``predict``."""
    motion, s = tree.motion, tree.nodes.shape[0]
    for k in range(motion.rate.size):
        tree.last_rates[s, k] = tree.rates[s, k]
        for i in range(s):
            tree.last_rates[i, k] = motion.u[k, i]
    for b in range(1, tree.tree.frame.size):
        k = tree.tree.ball[b]
        if k < 0:
            continue
        for i in range(s):
            rates = (motion.u[k, i], motion.u[k + 1, i], motion.u[k + 2, i])
            w = angular_velocity(motion.q[k, i], motion.q[k + 1, i], rates)
            w = in_parent(tree, R, b, w)
            for c in range(3):
                tree.last_rates[i, k + c] = w[c]


@kernel
def _set_end(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> None:
    """Set the motion at the end of the step in every lane."""
    motion, weight = tree.motion, stages.tableau.force_weight
    tree_loops.set_pull(tree.loops)
    set_end_momenta(tree, weight, h)
    for k in range(motion.rate.size):
        store(motion.q, k, spread(changed(0.0, motion.u, k, weight, h)))
        store(motion.y, k, spread(motion.end_momentum[k]))
    recursion.set_places(tree.tree, motion)
    mass_matrix.set_factors(tree.tree, motion)
    mass_matrix.solve(tree.tree, motion)
    tree_loops.project(tree.loops, tree.tree, motion, workspace, stages, h)
    for k in range(motion.rate.size):
        store(motion.u, k, load(motion.y, k))
    recursion.set_twists(tree.tree, motion)
