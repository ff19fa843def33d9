"""Takes steps of gauss in joint coordinates.

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
slopes of the loads are taken as well (``slopes``); where that does not converge, either, the step
is left to Newton's method in absolute coordinates, and so are the following ones, of which
there are more each time.

Loads come from the elements themselves, which see the bodies' poses and velocities at each node.

Source: E. Hairer, C. Lubich, G. Wanner, Geometric Numerical Integration (2006), section VI.4, for
the symplecticity of collocation in (q, p).
"""

import math

import numpy as np

from msahl.algebra.lanes import integral
from msahl.algebra.rotation import compose, matrix
from msahl.algebra.vector import (
    ZERO,
    Vector,
    add,
    at,
    axpy,
    put,
    scale,
    sub,
    times,
    transpose,
)
from msahl.elements.constraints import scalar
from msahl.elements.signals import states
from msahl.formulations.absolute.frames import Frames, restrict
from msahl.formulations.tree import mass_matrix, recursion
from msahl.jit.kernel import kernel, optional, unit
from msahl.jit.lanes import LANES, load, spread, store
from msahl.schemes.collocation.tree import loop_end, loop_matrix, loops, slopes
from msahl.schemes.collocation.tree.loads import (
    begin_loads,
    body_motion,
    set_loads,
    set_slopes,
    states_exist,
)
from msahl.schemes.collocation.tree.predictor import predict, save_rates
from msahl.schemes.collocation.tree.stages import (
    ABSOLUTE,
    CONTRACTION,
    FROM_TREE,
    ITERATIONS,
    LONGEST_REST,
    REST,
    RESTING,
    SIZE,
    STEPS,
    STIFF,
    TreeStages,
)
from msahl.schemes.collocation.workspace import StageArrays
from msahl.schemes.common.criteria import AT_REST, STUCK
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.outcome import TOLERANCE
from msahl.system import evaluate
from msahl.system.arrays import State

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
CAUTION, FORGETTING = 4.0, 1.2
"""Factor of the contraction measured in an earlier step, with which a first correction is judged,
and its growth by every step that did not measure it."""


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


@unit
def solve_step(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> float:
    """Solve for the rates at all nodes; return the relative residual, inf if there is none."""
    recursion.begin(tree.tree, tree.motion, workspace.state.x, workspace.start.frames)
    loops.begin(tree.loops, tree.tree, tree.motion, workspace, stages, h)
    if tree.tree.bare:
        return iterate(tree, workspace, stages, h, MAX_ITERATIONS)
    begin_loads(workspace, stages, h)
    figures = tree.figures
    figures[STIFF] *= KEPT
    if h < ALIKE * figures[STIFF]:
        use_slopes(tree, False)
        residual = iterate(tree, workspace, stages, h, MAX_LOADED)
        if residual <= TOLERANCE:
            return residual
        figures[STIFF] = h
    use_slopes(tree, True)
    residual = iterate(tree, workspace, stages, h, MAX_ITERATIONS)
    if not residual <= TOLERANCE:
        figures[STIFF] = math.inf
    return residual


KEPT, ALIKE = 1.0002, 0.99
"""Growth by every step of the size of steps that take slopes of the loads, and fraction of it below
which a step is tried without: one of the same size after 50, which costs some five iterations if it
fails."""


@kernel
def use_slopes(tree: TreeStages, whether: bool) -> None:
    """Let the iteration take slopes of the loads or not; what another one showed does not count."""
    if slopes.are_used(tree.slopes) != whether:
        tree.figures[CONTRACTION] = 1.0
    slopes.use(tree.slopes, 1.0 if whether else 0.0)


@unit
def iterate(
    tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float, iterations: int
) -> float:
    """Iterate from the prediction; return the relative residual, inf if there is none."""
    motion = tree.motion
    follows = predict(tree, stages, workspace.start.frames.R, workspace.state.time[0], h)
    loops.predict(tree.loops, workspace, stages, follows, h)
    before, most = math.inf, WORK_TARGET if stages.work.size > 0 else math.inf
    tree.figures[STEPS] += 1.0
    workspace.counts[1] += 1
    for iteration in range(iterations):
        loops.set_nodes(tree.loops, tree.tree, motion, workspace, stages, h)
        if not set_coordinates(tree, h):
            return math.inf
        recursion.set_places(tree.tree, motion)
        recursion.set_twists(tree.tree, motion)
        if not tree.tree.bare:
            set_loads(tree, workspace, stages, h)
            if not states_exist(workspace.system.forces.signals, stages.signals):
                return math.inf
        if before > FAR and iteration <= MOST_RENEWALS and not set_factors(tree, stages, h):
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
            return left if loops.holds(tree.loops, tree.tree) else math.inf
        if iteration > 0 and ratio > STUCK and residual <= TOLERANCE:
            return left if loops.holds(tree.loops, tree.tree) else math.inf
        if iteration > MOST_RENEWALS and is_hopeless(residual, ratio, iterations - 1 - iteration):
            return math.inf
        before = residual
    return math.inf


@unit
def set_factors(tree: TreeStages, stages: StageArrays, h: float) -> bool:
    """Set the factors of the matrices that make corrections of residuals; return whether loads
    allow it.
    """
    motion = tree.motion
    if slopes.are_used(tree.slopes):
        set_slopes(tree.slopes, tree, stages)
        if not slopes.set_factors(tree.slopes, tree.tree, motion, h):
            return False
    else:
        mass_matrix.set_factors(tree.tree, motion)
    loop_matrix.set_factors(tree.loops, tree.slopes, tree.tree, motion)
    return True


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
def set_coordinates(tree: TreeStages, h: float) -> bool:
    """Set the coordinates at the nodes; return whether they are within the range of a step."""
    motion, within = tree.motion, True
    for k in range(motion.rate.size):
        store(motion.q, k, integral(motion.u, k, tree.nodes, h))
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
        motion.end_momentum[k] += loops.impulse(tree.loops, k, h)
    for b in range(1, tree.tree.frame.size):
        k = tree.tree.ball[b]
        if k >= 0:
            x, y = changed(0.0, motion.u, k, weight, h), changed(0.0, motion.u, k + 1, weight, h)
            about_x = changed(motion.momentum[k], motion.moment, k, weight, h)
            about_y = changed(motion.momentum[k + 1], motion.moment, k + 1, weight, h)
            about_z = changed(motion.momentum[k + 2], motion.moment, k + 2, weight, h)
            about_x += loops.moment_impulse(tree.loops, k, h)
            about_y += loops.moment_impulse(tree.loops, k + 1, h)
            about_z += loops.moment_impulse(tree.loops, k + 2, h)
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
            begin -= loops.impulse(tree.loops, k, h)
        value = load(motion.p, k) - begin
        for j in range(s):
            value = value - (h * motion.force[k, j]) * load(tree.nodes, j)
        store(motion.y, k, value)
    loops.add_pull(tree.loops, motion, h)
    slopes.correct(tree.slopes, tree.tree, motion)
    loops.correct(tree.loops, tree.slopes, tree.tree, motion, h)
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
    """Largest change of a velocity by a body's load within the step, at its first node [m/s]: where
    loads balance, rates are known no better than the round-off of this. A load moves the bodies
    beyond its own as well: those between the joints of one link may have hardly any mass.
    """
    loads, g, largest = tree.motion.load, tree.tree.gravity, 0.0
    for b in range(1, tree.tree.frame.size):
        force = 0.0
        for c in range(3):
            force += abs(loads[6 * b + 3 + c, 0] + tree.tree.mass[b] * g[c])
        largest = max(largest, force / tree.motion.composite[10 * b, 0])
    return h * largest


@unit
def accept(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> None:
    """Advance the state by the solved step."""
    system, state, start = workspace.system, workspace.state, workspace.start
    last = tree.nodes.shape[0] - 1
    save_rates(tree, start.frames.R)
    for b in range(1, tree.tree.frame.size):
        _, _, v, W = body_motion(tree, b, last)
        put(state.a, tree.tree.frame[b], v)
        put(state.alpha, tree.tree.frame[b], W)
    _set_end(tree, workspace, stages, h)
    move_bodies(tree, workspace, 1.0 / (h * (1.0 - stages.tableau.force_time[last])))
    states.accept(system.forces.signals, stages.signals, state.auxiliary)
    stages.last_step[0], stages.last_step[1] = state.time[0], h
    tree.figures[FROM_TREE], tree.figures[REST] = 1.0, max(1.0, 0.5 * tree.figures[REST])
    end_step(tree, workspace, stages, h)


@kernel
def move_bodies(tree: TreeStages, workspace: Workspace, rest: float) -> None:
    """Advance the bodies to their motion in lane 0; their accelerations are those from the
    velocities that stand in their place, ``1/rest`` [s] before.
    """
    system, state = workspace.system, workspace.state
    frames = system.frames
    for b in range(1, tree.tree.frame.size):
        f = tree.tree.frame[b]
        x, c, v, W = body_motion(tree, b, 0)
        c = restrict(frames, 1, c)
        put(state.a, f, restrict(frames, 0, scale(rest, sub(v, at(state.a, f)))))
        put(state.alpha, f, restrict(frames, 1, scale(rest, sub(W, at(state.alpha, f)))))
        _move(tree, state, frames, b, x)
        p = compose(c, at(state.p, f))
        put(state.p, f, p)
        put(state.v, f, restrict(frames, 0, v))
        put(state.w, f, times(transpose(matrix(p)), restrict(frames, 1, W)))


@kernel
def end_step(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> None:
    """Set what else of the state the step has changed, and prepare the next one."""
    system, state, start = workspace.system, workspace.state, workspace.start
    for k in range(state.force.shape[0]):
        put(state.force, k, ZERO)
        put(state.violation, k, ZERO)
    loops.save(tree.loops, state, h)
    for w in range(state.work.size):
        state.work[w] += stages.work[w]
    state.time[0] += h
    evaluate.prepare(system, state, start)
    scalar.count_rotations(system.scalar, start.scalar, state.angle)


@kernel
def _move(tree: TreeStages, state: State, frames: Frames, b: int, x: Vector) -> None:
    """Move body ``b`` to ``x`` or, if it is free, by its slides, without adding up round-off."""
    f, k = tree.tree.frame[b], tree.tree.first[b]
    if not tree.tree.free[b]:
        # Positions follow from rotations, which are composed without a rest.
        old = at(state.x, f)
        put(state.x, f, add(restrict(frames, 0, x), sub(old, restrict(frames, 0, old))))
        put(state.x_low, f, ZERO)
        return
    u = ZERO
    while k < tree.tree.first[b + 1] and tree.tree.slides[k]:
        u = axpy(tree.motion.q[k, 0], at(tree.motion.axis, k), u)
        k += 1
    begin, low = at(state.x, f), at(state.x_low, f)
    for i in range(3):
        total = begin[i] + (u[i] + low[i])
        state.x_low[f, i] += u[i] - (total - begin[i])
        state.x[f, i] = total


@kernel
def _set_end(tree: TreeStages, workspace: Workspace, stages: StageArrays, h: float) -> None:
    """Set the motion at the end of the step in every lane."""
    motion, weight = tree.motion, stages.tableau.force_weight
    loops.set_pull(tree.loops)
    set_end_momenta(tree, weight, h)
    for k in range(motion.rate.size):
        store(motion.q, k, spread(changed(0.0, motion.u, k, weight, h)))
        store(motion.y, k, spread(motion.end_momentum[k]))
    recursion.set_places(tree.tree, motion)
    mass_matrix.set_factors(tree.tree, motion)
    mass_matrix.solve(tree.tree, motion)
    loop_end.project(tree.loops, tree.tree, motion, workspace, stages, h)
    for k in range(motion.rate.size):
        store(motion.u, k, load(motion.y, k))
    recursion.set_twists(tree.tree, motion)
