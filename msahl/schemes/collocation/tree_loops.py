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

from typing import NamedTuple

import numpy as np

from msahl.algebra import small_system
from msahl.algebra.lanes import LaneVector, cross, dot, vector_at
from msahl.algebra.lanes import matrix_at as matrix_at_lanes
from msahl.algebra.lanes import times as lanes_times
from msahl.algebra.vector import (
    Vector,
    add,
    at,
    matrix_at,
    product,
    put,
    put_matrix,
    scale,
)
from msahl.algebra.vector import cross as cross_product
from msahl.elements.constraints import coincide, coordinates, equations, scalar
from msahl.elements.constraints.products import Q_A, U_A, U_B
from msahl.formulations.absolute.frames import (
    displacement_node,
    first_multiplier,
    frame_count,
    ground_of,
    put_rotation,
)
from msahl.formulations.tree import mass_matrix, recursion
from msahl.formulations.tree.table import Tree, TreeMotion
from msahl.jit.kernel import kernel, optional
from msahl.jit.lanes import LANES, Lanes, load, spread, store
from msahl.schemes.collocation.tableau import Tableau
from msahl.schemes.collocation.workspace import StageArrays
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.outcome import TOLERANCE
from msahl.system.arrays import State, System, node_count
from msahl.system.cut import PIECES, Cut, CutWorkspace, new_cut_workspace

DRIFT_FEEDBACK = 0.01
"""As ``newton.DRIFT_FEEDBACK``."""
INDEPENDENT = 1e-10
"""Pivot, relative to the equation's own diagonal entry, above which one of redundant equations
counts as independent; its square is what that entry must be relative to the largest one."""


class LoopStages(NamedTuple):
    """Work arrays of the m cut equations, with e entries, in steps of s nodes."""

    cut: Cut
    start: CutWorkspace
    node: CutWorkspace
    still: np.ndarray  # (nodes, 3) unknowns of no motion
    x: np.ndarray  # (f, 3) at a node: mass centres [m]
    R: np.ndarray  # (f, 3, 3) orientations
    gap: np.ndarray  # (k, 3) violations at the start, by the multipliers' nodes
    displacement: np.ndarray  # (3 (b+1), LANES) of all bodies at t_1 ... t_s [m]
    wrench: np.ndarray  # (6 PIECES m, LANES) of unit multipliers, moments about the origin first
    gradient: np.ndarray  # (e, LANES) entries of G at t_1 ... t_s
    lever: np.ndarray  # (e, LANES) likewise at t_0 ... t_(s-1)
    moment: np.ndarray  # (e, LANES) as ``lever``, of balls about axes fixed in their parents
    balance: np.ndarray  # (e, LANES) work array
    is_ball: np.ndarray  # (e,) whether the coordinate is one of a ball
    violation: np.ndarray  # (m, LANES) at t_1 ... t_s [m]
    to_nodes: np.ndarray  # (s, LANES) ab_kj: lane k of row j
    across: np.ndarray  # (s, LANES) at_il: lane i of row l
    weight: np.ndarray  # (s,) B_l
    y: np.ndarray  # (s, m) unknowns
    last_y: np.ndarray  # (s, m) those of the step to follow
    half_y: np.ndarray  # (2, s, m) of both halves of a pair
    needed: np.ndarray  # (m, LANES) what the multipliers are to remove from the violations [m]
    pull: np.ndarray  # (n, LANES) G_l^T y_l at t_0 ... t_(s-1)
    pull_moment: np.ndarray  # (n, LANES) likewise by ``moment``
    rest: np.ndarray  # (n, LANES) residual of the momenta
    independent: np.ndarray  # (m,) whether the equation is used in the present step
    matrix: np.ndarray  # (s m, s m) T, then its factors
    pivot: np.ndarray  # (s m,)
    right: np.ndarray  # (s m,) right-hand side
    left: np.ndarray  # (1,) largest violation of dependent equations, after the last correction [m]
    end_matrix: np.ndarray  # (m, m) G M^-1 G^T at one configuration
    end_pivot: np.ndarray  # (m,)
    end_right: np.ndarray  # (m,)


def new_loop_stages(cut: Cut, tree: Tree, system: System, tableau: Tableau) -> LoopStages:
    """Return the arrays for steps of a ``system`` by a ``tableau``."""
    s, m, e = tableau.force_weight.size, cut.scale.size, cut.coordinate.size
    nodes, multipliers = node_count(system), int(system.multipliers.node.size)
    arrays = _lane_arrays(cut, tree, tableau)
    return LoopStages(
        cut=cut,
        start=new_cut_workspace(cut, nodes),
        node=new_cut_workspace(cut, nodes),
        still=np.zeros((nodes, 3)),
        x=np.zeros((frame_count(system.frames), 3)),
        R=np.zeros((frame_count(system.frames), 3, 3)),
        gap=np.zeros((multipliers, 3)),
        is_ball=of_ball(tree)[cut.coordinate],
        weight=tableau.multiplier_weight,
        y=np.zeros((s, m)),
        last_y=np.zeros((s, m)),
        half_y=np.zeros((2, s, m)),
        independent=np.ones(m, dtype=bool),
        matrix=np.zeros((s * m, s * m)),
        pivot=np.zeros(s * m, dtype=np.int64),
        right=np.zeros(s * m),
        left=np.zeros(1),
        end_matrix=np.zeros((m, m)),
        end_pivot=np.zeros(m, dtype=np.int64),
        end_right=np.zeros(m),
        **arrays,
        **{name: np.zeros((e, LANES)) for name in ("gradient", "lever", "moment", "balance")},
    )


def of_ball(tree: Tree) -> np.ndarray:
    """(n,) whether a coordinate of the tree is one of a ball."""
    first = tree.ball[tree.body]
    return (first >= 0) & (np.arange(tree.body.size) >= first)


def _lane_arrays(cut: Cut, tree: Tree, tableau: Tableau) -> dict[str, np.ndarray]:
    """Return the weights of the nodes, and arrays by bodies, equations and coordinates."""
    b, w = tableau.force_weight, tableau.multiplier_weight
    lane = np.minimum(np.arange(LANES), b.size - 1)
    before = np.vstack([np.zeros(b.size), tableau.integral[:-1]])  # ab_li, l = 0 ... s - 1
    across = w[:, None] * (1.0 - before / b)
    m, n = cut.scale.size, tree.body.size
    rows = {
        "displacement": 3 * tree.frame.size,
        "wrench": 6 * PIECES * m,
        **dict.fromkeys(("violation", "needed"), m),
        **dict.fromkeys(("pull", "pull_moment", "rest"), n),
    }
    return {
        "to_nodes": np.ascontiguousarray(tableau.integral[lane].T),
        "across": np.ascontiguousarray(across[:, lane]),
        **{name: np.zeros((count, LANES)) for name, count in rows.items()},
    }


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
    _set_gaps(loops, workspace, stages)
    ground = ground_of(frames)
    put(loops.x, ground, at(x, ground))
    put_matrix(loops.R, ground, matrix_at(R, ground))
    for k in range(motion.rate.size):
        store(motion.q, k, spread(0.0))
    recursion.set_places(tree, motion)
    recursion.set_displacements(tree, motion, loops.displacement)
    _enter_node(loops, motion, workspace, stages, 0.0, 0)
    _set_gradient(loops, motion)
    for e in range(cut.coordinate.size):
        loops.lever[e, 0] = loops.moment[e, 0] = loops.gradient[e, 0]
    if cut.redundant:
        mass_matrix.set_factors(tree, motion)
        _set_end_matrix(loops, tree, motion)
        _choose(loops)


@kernel
def _set_gaps(loops: LoopStages, workspace: Workspace, stages: StageArrays) -> None:
    """Set the violations at the start of a step to those that the last one left, and a little of
    those seen in absolute positions.
    """
    cut, start, state = loops.cut, loops.start, workspace.state
    seen = stages.violation
    coincide.violation(cut.coincide, start.coincide, state.x, start.coincide.violation)
    frames = workspace.start.frames
    scalar.observe(cut.scalar, start.scalar, frames, state.time[0], seen, loops.gap)
    for r in range(cut.scale.size):
        node, slot = cut.place[r, 0], cut.place[r, 1]
        if cut.pair[r] >= 0:
            absolute = start.coincide.violation[cut.pair[r], slot]
        else:
            absolute = cut.scale[r] * seen[node, slot]
        carried = state.violation[node, slot]
        loops.gap[node, slot] = carried + DRIFT_FEEDBACK * (absolute - carried)
    for r in range(cut.scale.size):
        if cut.pair[r] >= 0:
            node, slot = cut.place[r, 0], cut.place[r, 1]
            start.coincide.violation[cut.pair[r], slot] = loops.gap[node, slot]


@kernel
def _enter_node(
    loops: LoopStages,
    motion: TreeMotion,
    workspace: Workspace,
    stages: StageArrays,
    dt: float,
    i: int,
) -> None:
    """Set the violations and the wrenches of unit multipliers in lane ``i``, a time ``dt`` after
    the start of the step.
    """
    cut, start, node = loops.cut, loops.start, loops.node
    frames, state, R = workspace.system.frames, workspace.state, workspace.start.frames.R
    origin = (motion.origin[0], motion.origin[1], motion.origin[2])
    for c in range(cut.body.size):
        b, f = cut.body[c], cut.frame[c]
        put(loops.x, f, add(_vector(motion.place, 3 * b, i), origin))
        D = motion.rotation
        rotation = (_vector(D, 9 * b, i), _vector(D, 9 * b + 3, i), _vector(D, 9 * b + 6, i))
        put_matrix(loops.R, f, product(rotation, matrix_at(R, f)))
        half = scale(2.0 / motion.quaternion[4 * b, i], _vector(motion.quaternion, 4 * b + 1, i))
        put_rotation(frames, stages.increments, f, half)
        put(stages.increments, displacement_node(frames, f), _vector(loops.displacement, 3 * b, i))
    F, first = stages.violation, first_multiplier(frames)
    coincide.set_violations(cut.coincide, start.coincide, frames, stages.increments, F)
    interval = (state.time[0], dt)
    scalar.set_violations(
        cut.scalar, start.scalar, frames, loops.gap, interval, stages.increments, F
    )
    for r in range(cut.scale.size):
        loops.violation[r, i] = F[first + cut.place[r, 0], cut.place[r, 1]]
    coincide.prepare(cut.coincide, loops.R, node.coincide)
    _prepare_coordinates(cut.scalar, loops, workspace)
    for r in range(cut.scale.size):
        if cut.pair[r] >= 0:
            _enter_pair(loops, motion, r, i)
    _enter_equations(cut.scalar, loops, motion, i)


@kernel
def _vector(rows: np.ndarray, k: int, i: int) -> Vector:
    """Rows ``k`` to ``k + 2`` of an array of lanes, in lane ``i``."""
    return (rows[k, i], rows[k + 1, i], rows[k + 2, i])


@optional()
def _prepare_coordinates(
    group: scalar.ScalarConstraints, loops: LoopStages, workspace: Workspace
) -> None:
    """Evaluate the coordinates at a node, with their unit forces there."""
    frames, still = workspace.system.frames, loops.still
    begun, node = loops.start.scalar.coordinates, loops.node.scalar.coordinates
    for q in range(loops.node.angle.size):
        loops.node.angle[q] = begun.value[q] + begun.change[q]
    coordinates.prepare(group.coordinates, loops.x, loops.R, loops.node.angle, node)
    coordinates.evaluate(group.coordinates, node, frames, still)


@kernel
def _enter_pair(loops: LoopStages, motion: TreeMotion, r: int, i: int) -> None:
    """Set the wrenches of a unit force along an inertial axis at a pair of points."""
    cut, arms, slot = loops.cut, loops.node.coincide, loops.cut.place[r, 1]
    x = 1.0 if slot == 0 else 0.0
    y = 1.0 if slot == 1 else 0.0
    z = 1.0 if slot == 2 else 0.0
    for side in range(2):
        sign = -1.0 if side == 0 else 1.0
        arm = at(arms.r_a, cut.pair[r]) if side == 0 else at(arms.r_b, cut.pair[r])
        force = (sign * x, sign * y, sign * z)
        _put_wrench(loops, motion, (r, side), i, force, cross_product(arm, force))


@optional()
def _enter_equations(
    group: scalar.ScalarConstraints, loops: LoopStages, motion: TreeMotion, i: int
) -> None:
    """Set the wrenches of a unit multiplier of each scalar equation."""
    cut, rows, node = loops.cut, group.equations, loops.node.scalar.coordinates
    for r in range(cut.scale.size):
        for side in range(2 if cut.equation[r] >= 0 else 0):
            q = rows.coordinate[cut.equation[r], side]
            if q < 0:
                continue
            _, share, _, _ = equations.coefficients(rows, group.laws, node, cut.equation[r], side)
            for end in range(2):
                part = U_B if end == 1 else U_A
                force = scale(share * cut.scale[r], at(node.force[q], part))
                moment = scale(share * cut.scale[r], at(node.force[q], part + Q_A))
                _put_wrench(loops, motion, (r, 2 * side + end), i, force, moment)


@kernel
def _put_wrench(
    loops: LoopStages,
    motion: TreeMotion,
    place: tuple[int, int],
    i: int,
    force: Vector,
    moment: Vector,
) -> None:
    """Set a piece (equation, number) from a force and a moment about the body's mass centre."""
    b, row = loops.cut.piece[place[0], place[1]], 6 * (PIECES * place[0] + place[1])
    about = add(moment, cross_product(_vector(motion.place, 3 * b, i), force))
    for c in range(3):
        loops.wrench[row + c, i], loops.wrench[row + 3 + c, i] = about[c], force[c]


@kernel
def _set_gradient(loops: LoopStages, motion: TreeMotion) -> None:
    """Set the entries of G from the wrenches and the screws, in all lanes."""
    cut = loops.cut
    for r in range(cut.scale.size):
        for e in range(cut.first[r], cut.first[r + 1]):
            k = cut.coordinate[e]
            a, s = vector_at(motion.screw, 6 * k), vector_at(motion.screw, 6 * k + 3)
            store(loops.gradient, e, _work(loops, r, e, a, s))


@kernel
def _work(loops: LoopStages, r: int, e: int, a: LaneVector, s: LaneVector) -> Lanes:
    """What the unit multiplier of equation ``r`` does along the screw (a, s) of its entry ``e``."""
    total = spread(0.0)
    for piece in range(PIECES):
        if loops.cut.acts[e, piece]:
            place = 6 * (PIECES * r + piece)
            M, F = vector_at(loops.wrench, place), vector_at(loops.wrench, place + 3)
            total = total + (dot(a, M) + dot(s, F))
    return total


@kernel
def _set_levers(loops: LoopStages, tree: Tree, motion: TreeMotion) -> None:
    """Set the entries of G at t_1 ... t_(s-1) where multipliers act, after ``_set_gradient``."""
    cut, last = loops.cut, loops.weight.size - 1
    for r in range(cut.scale.size):
        for e in range(cut.first[r], cut.first[r + 1]):
            for i in range(last):
                loops.lever[e, i + 1] = loops.gradient[e, i]
            if loops.is_ball[e]:
                k = cut.coordinate[e]
                b = tree.body[k]
                D = matrix_at_lanes(motion.rotation, 9 * tree.parent[b])
                a = lanes_times(D, at(motion.axis, k))
                s = cross(recursion.pivot(tree, motion, b), a)
                store(loops.balance, e, _work(loops, r, e, a, s))
                for i in range(last):
                    loops.moment[e, i + 1] = loops.balance[e, i]


@kernel
def _set_end_matrix(loops: LoopStages, tree: Tree, motion: TreeMotion) -> None:
    """Set ``end_matrix`` to G M^-1 G^T of lane 0, after the factors of M."""
    cut, y = loops.cut, motion.y
    m = cut.scale.size
    for r in range(m):
        for k in range(tree.body.size):
            store(y, k, spread(0.0))
        for e in range(cut.first[r], cut.first[r + 1]):
            store(y, cut.coordinate[e], spread(loops.gradient[e, 0]))
        mass_matrix.solve(tree, motion)
        for p in range(m):
            total = 0.0
            for e in range(cut.first[p], cut.first[p + 1]):
                total += loops.gradient[e, 0] * y[cut.coordinate[e], 0]
            loops.end_matrix[p, r] = total


@kernel
def _choose(loops: LoopStages) -> None:
    """Mark equations as independent by the pivots of a Cholesky factorisation of ``end_matrix``,
    the largest ones first, relative to their own diagonal entries.
    """
    A, m, own = loops.end_matrix, loops.cut.scale.size, loops.end_right
    most = 0.0
    for r in range(m):
        own[r] = A[r, r]
        most = max(most, own[r])
        loops.independent[r] = False
    for _ in range(m):
        best, largest = -1, INDEPENDENT
        for r in range(m):
            acts = own[r] > INDEPENDENT**2 * most and not loops.independent[r]
            if acts and A[r, r] / own[r] > largest:
                best, largest = r, A[r, r] / own[r]
        if best < 0:
            break
        loops.independent[best] = True
        for p in range(m):
            if not loops.independent[p]:
                share = A[p, best] / A[best, best]
                for r in range(m):
                    if not loops.independent[r]:
                        A[p, r] -= share * A[best, r]


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
    s = loops.weight.size
    for k in range(motion.rate.size):
        value = (h * motion.u[k, 0]) * load(loops.to_nodes, 0)
        for j in range(1, s):
            value = value + (h * motion.u[k, j]) * load(loops.to_nodes, j)
        store(motion.q, k, value)
    recursion.set_places(tree, motion)
    recursion.set_displacements(tree, motion, loops.displacement)
    for i in range(s):
        _enter_node(loops, motion, workspace, stages, h * stages.tableau.constraint_time[i], i)
    _set_gradient(loops, motion)
    _set_levers(loops, tree, motion)
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
def set_factors(loops: LoopStages, tree: Tree, motion: TreeMotion) -> None:
    """Set the factors of T, after those of the mass matrices."""
    cut, y, A = loops.cut, motion.y, loops.matrix
    s, m, n = loops.weight.size, cut.scale.size, tree.body.size
    for p in range(m):
        for i in range(s):
            column = m * i + p
            for k in range(n):
                store(y, k, spread(0.0))
            for e in range(cut.first[p], cut.first[p + 1]):
                store(y, cut.coordinate[e], spread(loops.lever[e, i]))
            mass_matrix.solve(tree, motion)
            for k in range(n):
                total = spread(0.0)
                for j in range(s):
                    total = total + (loops.across[i, j] * y[k, j]) * load(loops.to_nodes, j)
                store(y, k, total)
            for r in range(m):
                total = spread(0.0)
                for e in range(cut.first[r], cut.first[r + 1]):
                    total = total + load(loops.gradient, e) * load(y, cut.coordinate[e])
                store(loops.rest, 0, total)
                for k in range(s):
                    A[m * k + r, column] = loops.rest[0, k]
    for r in range(m):
        if not loops.independent[r]:
            for k in range(s):
                _take_out(A, m * k + r)
    small_system.factor(A, loops.pivot)


@kernel
def _take_out(A: np.ndarray, r: int) -> None:
    """Replace row and column ``r`` of a matrix by those of the unit matrix."""
    for k in range(A.shape[0]):
        A[r, k] = A[k, r] = 0.0
    A[r, r] = 1.0


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
def correct(loops: LoopStages, tree: Tree, motion: TreeMotion, h: float) -> None:
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
    mass_matrix.solve(tree, motion)
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
        total = spread(0.0)
        for j in range(loops.weight.size):
            total = total + (h * y[k, j]) * load(loops.to_nodes, j)
        store(y, k, total)
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
    cut, y, mu, state = loops.cut, motion.y, loops.end_right, workspace.state
    m = cut.scale.size
    _add_work(cut.scalar, loops, workspace, stages, h)
    for k in range(motion.rate.size):
        store(loops.rest, k, load(y, k))
    recursion.set_displacements(tree, motion, loops.displacement)
    _enter_node(loops, motion, workspace, stages, h, 0)
    _set_gradient(loops, motion)
    _set_end_matrix(loops, tree, motion)
    _set_law_rates(cut.scalar, loops, state.time[0] + h)
    for r in range(m):
        for e in range(cut.first[r], cut.first[r + 1]):
            mu[r] -= loops.gradient[e, 0] * loops.rest[cut.coordinate[e], 0]
        if not loops.independent[r]:
            _take_out(loops.end_matrix, r)
            mu[r] = 0.0
    small_system.factor(loops.end_matrix, loops.end_pivot)
    small_system.solve(loops.end_matrix, loops.end_pivot, mu)
    _add_work_of(cut.scalar, loops, stages, mu, state.time[0] + h, 1.0)
    for k in range(motion.rate.size):
        store(y, k, spread(0.0))
    for r in range(m):
        for e in range(cut.first[r], cut.first[r + 1]):
            k = cut.coordinate[e]
            store(y, k, load(y, k) + spread(loops.gradient[e, 0] * mu[r]))
    mass_matrix.solve(tree, motion)
    for k in range(motion.rate.size):
        store(y, k, load(y, k) + load(loops.rest, k))


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


@kernel
def _set_law_rates(group: scalar.ScalarConstraints | None, loops: LoopStages, t: float) -> None:
    """Set ``end_right`` to the rates at which laws of time change the equations."""
    for r in range(loops.cut.scale.size):
        loops.end_right[r] = 0.0
    _add_law_rates(group, loops, t)


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
        _add_work_of(group, loops, stages, loops.y[i], at_node, share)


@optional()
def _add_work_of(
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


@optional()
def save_half(loops: LoopStages, half: int) -> None:
    """Keep the unknowns of a half of a pair."""
    for i in range(loops.y.shape[0]):
        for r in range(loops.y.shape[1]):
            loops.half_y[half, i, r] = loops.last_y[i, r]


@optional()
def follow_half(loops: LoopStages) -> None:
    """Let the next prediction follow the second half."""
    for i in range(loops.y.shape[0]):
        for r in range(loops.y.shape[1]):
            loops.last_y[i, r] = loops.half_y[1, i, r]


@optional()
def follow_halves(loops: LoopStages, half: np.ndarray, weights: np.ndarray) -> None:
    """Let the next prediction follow both halves, see ``tableau.Halves``."""
    for i in range(half.size):
        for r in range(loops.y.shape[1]):
            total = 0.0
            for j in range(half.size):
                total += weights[i, j] * loops.half_y[half[i], j, r]
            loops.last_y[i, r] = total
