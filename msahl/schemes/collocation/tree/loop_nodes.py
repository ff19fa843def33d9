"""The equations that close loops at the nodes of a step: violations and gradients.

The elements themselves evaluate them, by the bodies' poses at a node and increments from the start
of the step. A row of the gradient is what the wrenches of a unit multiplier do along the
coordinates between its bodies and the ground.
"""

import numpy as np

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
    put_rotation,
)
from msahl.formulations.tree import recursion
from msahl.formulations.tree.table import Tree, TreeMotion
from msahl.jit.kernel import kernel, optional
from msahl.jit.lanes import Lanes, spread, store
from msahl.schemes.collocation.tree.loop_stages import LoopStages
from msahl.schemes.collocation.workspace import StageArrays
from msahl.schemes.common.workspace import Workspace
from msahl.system.cut import PIECES

DRIFT_FEEDBACK = 0.01
"""As ``newton.DRIFT_FEEDBACK``."""


@kernel
def set_gaps(loops: LoopStages, workspace: Workspace, stages: StageArrays) -> None:
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
def enter_node(
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
def set_gradient(loops: LoopStages, motion: TreeMotion) -> None:
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
def set_levers(loops: LoopStages, tree: Tree, motion: TreeMotion) -> None:
    """Set the entries of G at t_1 ... t_(s-1) where multipliers act, after ``set_gradient``."""
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
