"""Differentiates collocation steps by parameters; see ``schemes.common.tangents``."""

from typing import NamedTuple

import numpy as np

from msahl.formulations.absolute.frames import first_multiplier
from msahl.jit.kernel import apart, kernel
from msahl.linalg import block_lu
from msahl.schemes.collocation import dense_output, equations, newton, predictor
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.schemes.common.tangents import (
    FLOOR,
    IMPROVEMENTS,
    MEMBERS,
    ROUNDS,
    Tangents,
    accept,
    clear,
    difference_size,
    ends_rounds,
    enter_rows,
    enter_state,
    match_orientation,
    restore_numbers,
    shift,
    shift_of,
    weight,
)
from msahl.system import evaluate


class CollocationPair(NamedTuple):
    """The subsystem that takes the steps, and the member that is shifted."""

    base: CollocationWorkspace
    member: CollocationWorkspace
    due: np.ndarray  # (2,) 0 and the number of output times within the present step
    share: np.ndarray  # (rows,) these as fractions of the step; those that are due are the first
    load_scale: np.ndarray  # (nodes,) ``last_load_scale`` of the base before the step


@kernel
def differentiate(pair: CollocationPair, tangents: Tangents, h: float) -> None:
    """Differentiate the solved and accepted step ``h`` of the base, and its rows of results, by all
    parameters. ``tangents.before`` holds the state at the start of the step.
    """
    base, member, rows = pair.base, pair.member, pair.due[1]
    for i in range(tangents.base.size):
        tangents.after[i] = tangents.base[i]
    if tangents.changes.size == 0:
        return
    _set_member(pair, tangents, 0, 0.0, h)
    _evaluate(member, h, True)
    lu, stages = base.workspace.unknowns.elimination, member.stages
    block_lu.factor(lu, stages.source, stages.values, tangents.factor, member.pivot_rows)
    for j in range(tangents.changes.size):
        e = difference_size(tangents, base.workspace.system.frames, j, h)
        tangents.step[:] = 0.0
        left = 1.0
        for k in range(ROUNDS):
            clear(tangents, j, rows)
            _sum(pair, tangents, j, e, h, k > 0)
            before, left = left, _correct(base, tangents, e)
            if k > 0 and ends_rounds(left, before, k):
                break
        tangents.worst[j] = max(tangents.worst[j], left)
        accept(tangents, j)
        restore_numbers(tangents, j)


@apart
def _sum(
    pair: CollocationPair, tangents: Tangents, j: int, e: float, h: float, finished: bool
) -> None:
    """Set the ``rows`` of the tangents to D F; where ``finished``, add up the states at the end of
    the step, and the rows of results.
    """
    member, F = pair.member, pair.member.stages.F
    tangents.rows[:] = 0.0
    for k in range(MEMBERS):
        weighted, moved = weight(k) / e, shift_of(k) * e
        h_k = h + moved * tangents.size_slope[j]
        _set_member(pair, tangents, j, moved, h_k)
        if pair.due[1] > 0:
            dense_output.save_end(member.dense_output.begin, member.workspace)
        _evaluate(member, h_k, False)
        for s in range(F.shape[0]):
            for n in range(F.shape[1]):
                for i in range(3):
                    tangents.rows[s, n, i] += weighted * F[s, n, i]
        if finished:
            _finish(member, h_k)
            enter_state(tangents, weighted)
            if pair.due[1] > 0:
                newton.record_step(member, h_k, 0, pair.due, pair.share)
                _match_orientations(pair)
                enter_rows(tangents, j, weighted)


@apart
def _set_member(pair: CollocationPair, tangents: Tangents, j: int, e: float, h: float) -> None:
    """Set the member to the state at the start of the step and the unknowns of its solution, both
    shifted by ``e`` along parameter ``j``.
    """
    workspace, stages, solved = pair.member.workspace, pair.member.stages, pair.base.stages
    system, state, start = workspace.system, workspace.state, workspace.start
    order = workspace.unknowns.elimination.order
    shift(tangents, j, e)
    evaluate.prepare(system, state, start)
    for n in range(pair.load_scale.size):
        stages.last_load_scale[n] = pair.load_scale[n]
    newton.reset_prediction(pair.member)
    # Sets the unknowns that are not solved for as well.
    predictor.predict(system, state, start, stages, h)
    for k in range(order.size):
        n, i = order[k] // 3, order[k] % 3
        for s in range(stages.Z.shape[0]):
            stages.Z[s, n, i] = solved.Z[s, n, i] + e * tangents.step[s, n, i]


@apart
def _evaluate(member: CollocationWorkspace, h: float, fresh: bool) -> None:
    """Evaluate the equations of the member, and where ``fresh`` their derivative."""
    workspace, stages = member.workspace, member.stages
    system, state = workspace.system, workspace.state
    newton.update_reactions(member.pressed, system, state, stages, member.instant, h)
    equations.evaluate(system, state, workspace.start, stages, h, fresh)


@kernel
def _correct(base: CollocationWorkspace, tangents: Tangents, e: float) -> float:
    """Correct dz by what (1) leaves; return the correction relative to dz, without multipliers that
    are not unique.
    """
    lu, y, Z = base.workspace.unknowns.elimination, base.y, base.stages.Z
    relaxed = base.workspace.system.relaxation > 0.0
    first = first_multiplier(base.workspace.system.frames)
    newton.gather_stages(lu, tangents.rows, y)
    block_lu.solve(lu, tangents.factor, y)
    change, largest = 0.0, 0.0
    for k in range(y.shape[0]):
        n, i = lu.order[k] // 3, lu.order[k] % 3
        for s in range(y.shape[1]):
            tangents.step[s, n, i] -= y[k, s]
            if relaxed and n >= first:
                continue
            change = max(change, abs(y[k, s]))
            largest = max(largest, abs(tangents.step[s, n, i]), FLOOR * abs(Z[s, n, i]) / e)
    return change / largest if largest > 0.0 else 0.0


@kernel
def _finish(member: CollocationWorkspace, h: float) -> None:
    """Accept the step of the member as ``newton.take_step`` does."""
    relaxed = member.workspace.system.relaxation > 0.0
    if relaxed:
        _make_unique(member, h)
    newton.accept_step(member, h)
    if relaxed:
        newton.remove_null_violation(member)


@apart
def _make_unique(member: CollocationWorkspace, h: float) -> None:
    """Remove from the unknowns of the member what redundant constraints leave undetermined; see
    ``midpoint.tangent``.
    """
    lu, stages = member.workspace.unknowns.elimination, member.stages
    _evaluate(member, h, True)
    block_lu.factor(lu, stages.source, stages.values, member.factor, member.pivot_rows)
    for k in range(IMPROVEMENTS):
        if k == IMPROVEMENTS - 1:
            newton.remove_null_multipliers(member)
        _improve(member, h)


@kernel
def _improve(member: CollocationWorkspace, h: float) -> None:
    """Correct the unknowns of the member by its residual, with the factors of its own Jacobian."""
    lu, y, stages = member.workspace.unknowns.elimination, member.y, member.stages
    _evaluate(member, h, False)
    newton.gather_stages(lu, stages.F, y)
    block_lu.solve(lu, member.factor, y)
    for k in range(y.shape[0]):
        for s in range(y.shape[1]):
            stages.Z[s, lu.order[k] // 3, lu.order[k] % 3] -= y[k, s]
    _evaluate(member, h, False)


@kernel
def _match_orientations(pair: CollocationPair) -> None:
    base, member = pair.base.workspace, pair.member.workspace
    for row in range(pair.due[1]):
        for b in range(base.system.bodies.frame.size):
            place = base.system.bodies.column[b] + 3
            match_orientation(member.tables.states, base.tables.states, row, place)
