"""Differentiates steps of order 2 by parameters; see ``schemes.common.tangents``."""

from typing import NamedTuple

from msahl.formulations.absolute.frames import first_multiplier
from msahl.jit.kernel import apart, kernel
from msahl.linalg import dense, sparse_lu
from msahl.schemes.common import accelerations
from msahl.schemes.common.accelerations import Instant
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
from msahl.schemes.common.workspace import Workspace, record_step
from msahl.schemes.midpoint import equations, load_moments, newton
from msahl.system import evaluate


class Pair(NamedTuple):
    """The subsystem that takes the steps, and the member that is shifted."""

    base: Workspace
    member: Workspace
    base_instant: Instant
    member_instant: Instant


@kernel
def differentiate(pair: Pair, tangents: Tangents, h: float, share: float, rows: int) -> None:
    """Differentiate the solved and accepted step ``h`` of the base, a ``share`` of the requested
    one, by all parameters; where ``rows`` is 1, record it and differentiate its rows as well.

    ``tangents.before`` holds the state at the start of the step.
    """
    base, member = pair.base, pair.member
    for i in range(tangents.base.size):
        tangents.after[i] = tangents.base[i]
    if rows > 0:
        _record(base, pair.base_instant, h)
    if tangents.changes.size == 0:
        return
    _set_member(pair, tangents, 0, 0.0, h)
    equations.jacobian(member.system, member.start, h, member.Z, member.values)
    sparse_lu.factor(base.unknowns.elimination, member.values, tangents.factor)
    for j in range(tangents.changes.size):
        e = difference_size(tangents, base.system.frames, j, h)
        tangents.step[:] = 0.0
        left = 1.0
        for k in range(ROUNDS):
            clear(tangents, j, rows)
            _sum(pair, tangents, j, e, h, share, rows if k > 0 else -1)
            before, left = left, _correct(base, tangents, e)
            if k > 0 and ends_rounds(left, before, k):
                break
        tangents.worst[j] = max(tangents.worst[j], left)
        accept(tangents, j)
        restore_numbers(tangents, j)


@apart
def _sum(
    pair: Pair, tangents: Tangents, j: int, e: float, h: float, share: float, rows: int
) -> None:
    """Set the ``rows`` of the tangents to D F; unless ``rows`` is negative, add up the states at
    the end of the step, and the rows of results where it is 1.
    """
    member = pair.member
    tangents.rows[:] = 0.0
    for k in range(MEMBERS):
        weighted, moved = weight(k) / e, shift_of(k) * e
        h_k = h + moved * tangents.size_slope[j]
        _set_member(pair, tangents, j, moved, h_k)
        for n in range(tangents.rows.shape[0]):
            for i in range(3):
                tangents.rows[n, i] += weighted * member.F[n, i]
        if rows >= 0:
            _finish(member, h_k, share)
            enter_state(tangents, weighted)
        if rows > 0:
            _record(member, pair.member_instant, h_k)
            _match_orientations(pair)
            enter_rows(tangents, j, weighted)


@apart
def _set_member(pair: Pair, tangents: Tangents, j: int, e: float, h: float) -> None:
    """Set the member to the state at the start of the step and the unknowns of its solution, both
    shifted by ``e`` along parameter ``j``, and evaluate the equations of a step ``h`` there.
    """
    member, order = pair.member, pair.base.unknowns.elimination.order
    system, state, start = member.system, member.state, member.start
    shift(tangents, j, e)
    evaluate.prepare(system, state, start)
    load_moments.set_loads(member, h)
    # Sets the unknowns that are not solved for as well.
    equations.predict(system, state, start, h, member.Z)
    for k in range(order.size):
        n, i = order[k] // 3, order[k] % 3
        member.Z[n, i] = pair.base.Z[n, i] + e * tangents.step[n, i]
    equations.residual(system, state, start, h, member.Z, member.F)


@kernel
def _correct(base: Workspace, tangents: Tangents, e: float) -> float:
    """Correct dz by what (1) leaves; return the correction relative to dz, without multipliers that
    are not unique.
    """
    lu, y, relaxed = base.unknowns.elimination, base.y, base.system.relaxation > 0.0
    first = first_multiplier(base.system.frames)
    dense.gather(lu.order, tangents.rows, y)
    sparse_lu.solve(lu, tangents.factor, y)
    change, largest = 0.0, 0.0
    for k in range(y.size):
        n, i = lu.order[k] // 3, lu.order[k] % 3
        tangents.step[n, i] -= y[k]
        if relaxed and n >= first:
            continue
        change = max(change, abs(y[k]))
        largest = max(largest, abs(tangents.step[n, i]), FLOOR * abs(base.Z[n, i]) / e)
    return change / largest if largest > 0.0 else 0.0


@kernel
def _finish(member: Workspace, h: float, share: float) -> None:
    """Accept the step of the member as ``newton.take_step`` does."""
    if member.system.relaxation > 0.0:
        _make_unique(member, h)
    newton.accept_step(member, h, share)


@apart
def _make_unique(member: Workspace, h: float) -> None:
    """Remove from the unknowns and the violation of the member what redundant constraints leave
    undetermined.

    The unknowns satisfy the constraints but for terms of higher order in e. The relaxed factors
    answer the part of these that no motion can remove by large multipliers, so they are corrected
    before the multipliers are.
    """
    equations.jacobian(member.system, member.start, h, member.Z, member.values)
    sparse_lu.factor(member.unknowns.elimination, member.values, member.factor)
    for k in range(IMPROVEMENTS):
        if k == IMPROVEMENTS - 1:
            newton.remove_null_multipliers(member)
        _improve(member, h)
    newton.remove_null_violation(member)


@kernel
def _improve(member: Workspace, h: float) -> None:
    """Correct the unknowns of the member by its residual, with the factors of its own Jacobian."""
    lu, y = member.unknowns.elimination, member.y
    equations.residual(member.system, member.state, member.start, h, member.Z, member.F)
    dense.gather(lu.order, member.F, y)
    sparse_lu.solve(lu, member.factor, y)
    for k in range(y.size):
        member.Z[lu.order[k] // 3, lu.order[k] % 3] -= y[k]
    equations.residual(member.system, member.state, member.start, h, member.Z, member.F)


@apart
def _record(workspace: Workspace, instant: Instant, h: float) -> None:
    """Write the first rows of tables and monitor."""
    record_step(workspace, h, 0, 0)
    if instant.publishes_reactions or workspace.tables.accelerations.shape[1] > 0:
        accelerations.write_instantaneous_reactions(workspace, instant, 0)


@kernel
def _match_orientations(pair: Pair) -> None:
    bodies = pair.base.system.bodies
    for b in range(bodies.frame.size):
        match_orientation(
            pair.member.tables.states, pair.base.tables.states, 0, bodies.column[b] + 3
        )
