"""Room for a step of degree s, and where the bodies are at a node of time within it."""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, to_step_turn
from msahl.algebra.vector import (
    ZERO,
    Vector,
    add,
    at,
    axpy,
    matrix_at,
    put,
    put_matrix,
    scale,
    times,
    transpose,
)
from msahl.elements import forces
from msahl.elements.constraints import scalar
from msahl.elements.frames import (
    Frames,
    displacement,
    displacement_node,
    first_multiplier,
    frame_count,
    moving_count,
    rotation_node,
)
from msahl.jit.kernel import kernel
from msahl.schemes.collocation import local_rotation
from msahl.schemes.collocation.tableau import Rule
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace, node_count
from msahl.system.unknowns import Unknowns

BODY, FORCE, GAP, BETWEEN = range(4)
"""Kinds of a block: body by body, body by multiplier, gap by body, gap by multiplier."""


class Stages(NamedTuple):
    """Room for a step of degree s; nodes as in ``system.arrays``."""

    rule: Rule
    linear: np.ndarray  # (9 m,) constant part of the joints' derivatives
    needed: np.ndarray  # (q,) entries of the Jacobian that the unknowns have
    sort: np.ndarray  # (q,) kind of the block of each
    rolling: np.ndarray  # (q,) whether its row is one between rates
    slot: np.ndarray  # (9 m,) where each of all entries is among the needed, -1 if it is not
    source: np.ndarray  # those of the sparse factors there
    idle: bool  # whether nothing acts at c_i but gravity and inertia
    mobility: np.ndarray  # (n+1, 3, 3) inverse inertia, body axes
    state: State  # of one node of time
    start: SystemWorkspace  # likewise
    turn: np.ndarray  # (n+1, 3) c at that node
    turning: np.ndarray  # (n+1, 3) its rate
    tangent: np.ndarray  # (n+1, 3, 3) H there
    bow: np.ndarray  # (n+1, 3, 3) see ``schemes.element``
    bow_rate: np.ndarray  # (n+1, 3, 3)
    still: np.ndarray  # (nodes, 3) no displacement, the node's multipliers
    moved: np.ndarray  # (nodes, 3) u and l Q up to the node, no multipliers
    row: np.ndarray  # (nodes, 3) what acts at the node
    violation: np.ndarray  # (nodes, 3) how open the joints are there
    by_place: np.ndarray  # (9 m,) derivatives at the node
    by_rate: np.ndarray  # (9 m,)
    room: np.ndarray  # (9 m,)
    Z: np.ndarray  # (s, nodes, 3) z_1..z_s, multipliers 0..s-1
    F: np.ndarray  # (s, nodes, 3) rows
    impulse: np.ndarray  # (nodes, 3) change of momentum over the step, by mass
    work: np.ndarray  # (w,) over the step [J]
    values: np.ndarray  # (q, s, s) the Jacobian, by stage of the unknown, then of the row
    slope: np.ndarray  # (6, 3, 3) of a body's momentum, force and bow by place, and by rate
    push: np.ndarray  # (2, 3) its force and momentum
    pull: np.ndarray  # (nodes,) largest part of a load along a quantity in the rows of a node [m]
    pulled: np.ndarray  # (nodes,) such parts near the end of the last step, by h^2
    rate: np.ndarray  # (s, nodes, 3) velocities at c_i, inertial axes
    before: np.ndarray  # (s + 1, nodes, 3) of the step the next guess follows, last at its start
    reaction: np.ndarray  # (s, j, 6) joints' reactions at c_i
    factor: np.ndarray  # (s, k) of the forces that depend on time, at c_i
    known: np.ndarray  # (2,) start and size [s] of the step of those polynomials; no size: none
    window: np.ndarray  # (3,) the same as seen from the present step, in parts of it; and ``near``
    near: np.ndarray  # (1,) 1 if the last guess was near, else 0
    seen: np.ndarray  # (s, s + 2) weights by which velocities at c_i follow from them and from ours
    pushed: np.ndarray  # (s, s) likewise joint forces, which are ours with h^2
    level: np.ndarray  # (1,) energy balance at the start of the run [J]


def new_stages(system: System, unknowns: Unknowns, state: State, rule: Rule) -> Stages:
    """Room for steps by ``rule`` from ``state``."""
    degree = rule.weight.size
    n, nodes = frame_count(system.frames), (node_count(system), 3)
    stages, vectors = (degree, *nodes), (n, 3)
    node_state = State(*(array.copy() for array in state))
    of_body = system.blocks < first_multiplier(system.frames)
    sort = np.select(
        [of_body.all(axis=1), of_body[:, 0], of_body[:, 1]], [BODY, FORCE, GAP], BETWEEN
    )
    needed = np.union1d(unknowns.elimination.source, unknowns.dense_from)
    slot = np.full(system.constant.size, -1)
    slot[needed] = np.arange(needed.size)
    return Stages(
        rule=rule,
        linear=np.where(np.repeat(sort, 9) == BODY, 0.0, system.constant),
        needed=needed,
        sort=sort[needed // 9],
        rolling=_rolling(system)[needed],
        slot=slot,
        source=slot[unknowns.elimination.source],
        idle=system.scalar is None and not forces.acts_at_points(system.forces),
        mobility=np.linalg.inv(system.bodies.inertia),
        state=node_state,
        start=new_system_workspace(system, node_state),
        turn=np.zeros(vectors),
        turning=np.zeros(vectors),
        tangent=np.zeros((*vectors, 3)),
        bow=np.zeros((*vectors, 3)),
        bow_rate=np.zeros((*vectors, 3)),
        still=np.zeros(nodes),
        moved=np.zeros(nodes),
        row=np.zeros(nodes),
        violation=np.zeros(nodes),
        by_place=np.zeros_like(system.constant),
        by_rate=np.zeros_like(system.constant),
        room=np.zeros_like(system.constant),
        Z=np.zeros(stages),
        F=np.zeros(stages),
        impulse=np.zeros(nodes),
        work=np.zeros_like(state.work),
        values=np.zeros((needed.size, degree, degree)),
        slope=np.zeros((6, 3, 3)),
        push=np.zeros((2, 3)),
        pull=np.zeros(nodes[0]),
        pulled=np.zeros(nodes[0]),
        rate=np.zeros(stages),
        before=np.zeros((degree + 1, *nodes)),
        reaction=np.zeros((degree, *state.reaction.shape)),
        factor=forces.new_node_factors(system.forces, degree),
        known=np.zeros(2),
        window=np.zeros(3),
        near=np.zeros(1),
        seen=np.zeros((degree, degree + 2)),
        pushed=np.zeros((degree, degree)),
        level=np.zeros(1),
    )


def _rolling(system: System) -> np.ndarray:
    """(9 m,) entries of the Jacobian in rows between rates."""
    rows = np.zeros((node_count(system), 3), dtype=bool)
    if system.scalar:
        group = system.scalar.equations
        place = group.place[~group.holonomic]
        rows[first_multiplier(system.frames) + place[:, 0], place[:, 1]] = True
    return np.repeat(rows[system.blocks[:, 0]].reshape(-1), 3)


@kernel
def go(system: System, state: State, stages: Stages, h: float, n: int) -> None:
    """Bring ``stages.start`` to what the rule has as number ``n``; only what inertia needs, where
    nothing else acts there.
    """
    rule = stages.rule
    bare = stages.idle and rule.acts[n] >= 0
    tau, phi, slope = rule.time[n], rule.place[n], rule.rate[n]
    frames, Z, node = system.frames, stages.Z, stages.state
    node.time[0] = state.time[0] + h * tau
    for b in range(moving_count(frames)):
        u, lc, v, lc_dot = ZERO, ZERO, ZERO, ZERO
        for j in range(phi.size):
            u_j, lc_j = displacement(frames, Z[j], b), at(Z[j], rotation_node(frames, b))
            u, lc = axpy(phi[j], u_j, u), axpy(phi[j], lc_j, lc)
            rate = slope[j] / h
            v, lc_dot = axpy(rate, u_j, v), axpy(rate, lc_j, lc_dot)
        c = scale(1.0 / frames.length[b], lc)
        put(stages.turn, b, c)
        put(stages.turning, b, scale(1.0 / frames.length[b], lc_dot))
        put_matrix(stages.tangent, b, local_rotation.tangent(c))
        put(node.v, b, v)
        if bare:
            continue
        put(stages.moved, displacement_node(frames, b), u)
        put(stages.moved, rotation_node(frames, b), scale(frames.length[b], to_step_turn(c)))
        put(node.x, b, add(at(state.x, b), u))
        put(node.p, b, compose(c, at(state.p, b)))
    if not bare:
        evaluate.prepare(system, node, stages.start)
    for b in range(moving_count(frames)):
        put(stages.start.frames.W, b, times(matrix_at(stages.tangent, b), at(stages.turning, b)))
    for q in range(node.angle.size):
        node.angle[q] = state.angle[q]
    scalar.count_rotations(system.scalar, stages.start.scalar, node.angle)


@kernel
def moment_in_chart(frames: Frames, stages: Stages, b: int) -> Vector:
    """The moment in ``stages.row`` as the rows of body ``b`` have it."""
    if not stages.rule.varied:
        return at(stages.row, rotation_node(frames, b))
    return times(transpose(matrix_at(stages.tangent, b)), at(stages.row, rotation_node(frames, b)))
