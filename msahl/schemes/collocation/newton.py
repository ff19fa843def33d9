"""Solves collocation steps by Newton's method, accepts them, and takes many steps of a subsystem.

After a step the velocities are projected onto the constraints, by the least change weighted by
mass, which is what the multiplier of the last node does. Friction depends on reactions; these
follow from the accelerations at its node and are computed anew in every iteration, which the
Jacobian does not see; ``secants`` improves the corrections for that. Energy lost by a decaying
scheme is entered as the work of that scheme; energy gained stays visible in the energy balance.
"""

import math
from typing import NamedTuple, Protocol

import numpy as np

from msahl.algebra.vector import copy
from msahl.elements.beams import stage as beams
from msahl.elements.constraints.scalar import clear_rate_violations
from msahl.elements.signals import inputs, states
from msahl.elements.signals.group import use_reactions
from msahl.formulations.absolute.frames import first_multiplier
from msahl.formulations.tree.table import Tree
from msahl.jit.kernel import apart, kernel, optional, unit
from msahl.linalg import block_lu
from msahl.linalg.elimination import Elimination, new_factor
from msahl.model.scheme import COLLOCATION
from msahl.ports import forces, sliding
from msahl.ports.forces import ReactionForces, pressed_by_reactions
from msahl.ports.sliding import Sliding
from msahl.schemes.collocation import dense_output, equations, predictor
from msahl.schemes.collocation.dense_output import DenseOutput, new_dense_output
from msahl.schemes.collocation.secants import Secants, forget, go_on, improve, new_secants
from msahl.schemes.collocation.tableau import Halves, halves_of, new_tableau
from msahl.schemes.collocation.tree import stages as tree_stages
from msahl.schemes.collocation.tree import step as tree_step
from msahl.schemes.collocation.tree.stages import TreeStages, new_tree_stages
from msahl.schemes.collocation.workspace import StageArrays, new_stage_arrays, set_node
from msahl.schemes.common import accelerations
from msahl.schemes.common.accelerations import Instant, new_instant
from msahl.schemes.common.criteria import AT_REST, DIVERGED, MAX_ITERATIONS, STUCK, is_implausible
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.common.workspace import record_step as record_at_end
from msahl.schemes.outcome import TOLERANCE
from msahl.system.arrays import State, System
from msahl.system.cut import Cut
from msahl.system.diagnostics import energy_balance

TARGET = 1e-14
"""As ``outcome.TARGET``. Collocation steps are few and long, so the residual of each matters less
to the energy."""
MAX_WITH_OLD_JACOBIAN = 5.0
"""Refactor only if more than 5 further iterations are expected with the old Jacobian: a new one
with its factors costs about as much as three iterations, and two more follow."""
PREDICTED_WELL = 0.03
"""First residual of a step up to which the next prediction may extrapolate with one velocity more.
Where predictions are worse than this, that velocity makes them worse still."""
DRIFT_FEEDBACK = 0.01
"""Fraction of the absolute position drift fed back per step, besides the violation that the last
step left over. A violation that is followed by increments alone drifts by rounding errors as
rotations are composed: 1e-11 m in two million steps. A fraction this small carries little of the
rounding errors of positions into the velocities."""


class CollocationWorkspace(NamedTuple):
    """Data and work arrays of one subsystem for collocation steps of one degree."""

    workspace: Workspace
    pressed: ReactionForces | None  # forces that depend on reactions; None: no code for them
    secants: Secants | None  # for what the Jacobian lacks of these; None: no code for them
    stages: StageArrays
    instant: Instant
    factor: np.ndarray  # (entries, s, s) sparse factors, blocks transposed
    y: np.ndarray  # (f, s) right-hand side, in the order of elimination
    pivot_rows: np.ndarray  # (s,) work array of the factorisation
    dense_output: DenseOutput
    halves: Halves
    half_rates: np.ndarray  # (2, s + 1, nodes, 3) velocities of both halves, to predict their step
    half_solution: np.ndarray  # (2, s, nodes, 3) their solutions
    outcome: np.ndarray  # (2,) residual and worst row of the last step
    tree: TreeStages | None  # steps in joint coordinates; None: no code for them


class Recorded(Protocol):
    """What ``record_step`` needs of a subsystem."""

    @property
    def workspace(self) -> Workspace:
        """State, monitor and tables."""

    @property
    def instant(self) -> Instant:
        """Work arrays of accelerations."""

    @property
    def dense_output(self) -> DenseOutput:
        """Interpolation of the step."""

    @property
    def tree(self) -> TreeStages | None:
        """Steps in joint coordinates."""


def new_collocation_workspace(
    workspace: Workspace,
    scheme: str,
    degree: int,
    tree: tuple[Tree, Cut | None] | None = None,
    like: CollocationWorkspace | None = None,
) -> CollocationWorkspace:
    """Return the workspace for steps by the ``scheme`` of a ``degree`` from the prepared state, in
    the joint coordinates of a ``tree``, cut where its loops close, if there is one. It shares what
    does not depend on the degree with another one, ``like`` it: only one of them takes steps.
    """
    lu, higher = workspace.unknowns.elimination, COLLOCATION[scheme]
    given = workspace.system, workspace.unknowns, workspace.state, new_tableau(scheme, degree)
    stages = new_stage_arrays(*given, like and like.stages)
    if like is None:
        violation, rate = workspace.monitor.violation, workspace.monitor.rate
        stages.first_energy[0] = energy_balance(
            workspace.system, workspace.state, workspace.start, violation, rate
        )
    else:
        stages.first_energy[:] = like.stages.first_energy
    instant = new_instant(workspace.system, workspace.unknowns) if like is None else like.instant
    pressed = pressed_by_reactions(workspace.system.forces)
    return CollocationWorkspace(
        workspace=workspace,
        pressed=pressed,
        secants=None if pressed is None else new_secants(lu.order.size, degree),
        stages=stages,
        instant=instant,
        factor=new_factor(lu, degree),
        y=np.zeros((lu.order.size, degree)),
        pivot_rows=np.zeros(degree, dtype=np.int64),
        dense_output=new_dense_output(workspace, higher.order(degree), higher.decays),
        halves=halves_of(scheme, degree),
        half_rates=np.zeros((2, *stages.last_rates.shape)),
        half_solution=np.zeros((2, *stages.Z.shape)),
        outcome=np.zeros(2),
        tree=tree and new_tree_stages(*tree, workspace, stages.tableau, like and like.tree),
    )


@kernel
def reset_prediction(subsystem: CollocationWorkspace) -> None:
    """Predict the next step from the accelerations at its start, without earlier steps."""
    subsystem.stages.last_step[1] = 0.0
    tree_stages.forget(subsystem.tree)


@kernel
def is_slow(residual: float, before: float) -> bool:
    """Whether a new Jacobian is expected to save work, by the convergence of the last iteration."""
    if not residual < before:
        return True
    expected = math.log(TARGET / residual)
    return expected < MAX_WITH_OLD_JACOBIAN * (math.log(residual) - math.log(before))


@kernel
def relative_residual(
    free: np.ndarray, F: np.ndarray, load_scale: np.ndarray, length: float
) -> tuple[float, int]:
    """Largest free residual relative to the step's length or to the loads in it, if they are
    larger, and its index among the flat rows.
    """
    worst, largest = -1, 0.0
    for i in range(free.size):
        node = free[i] // 3
        relief = length / max(length, load_scale[node])
        for j in range(F.shape[0]):
            row = abs(F[j, node, free[i] % 3]) * relief
            # Written so that a nan counts as the largest of all.
            if not row <= largest:
                worst, largest = free[i], row
                if math.isnan(row):
                    return row, worst
    return largest / length, worst


@apart
def update_reactions(
    pressed: ReactionForces | None,
    system: System,
    state: State,
    stages: StageArrays,
    instant: Instant,
    h: float,
) -> None:
    """Set the reactions at the nodes where forces act, if some depend on them, as friction does."""
    if pressed is None:
        return
    for n in range(stages.tableau.force_stage.size):
        i = stages.tableau.force_stage[n]
        if i < 0:
            continue
        set_node(system, state, stages, h, n)
        states.set_state(system.forces.signals, stages.start.forces.signals, stages.signals, i)
        copy(stages.reaction[i], stages.state.reaction)
        accelerations.accelerate(system, stages.state, stages.start, instant)
        copy(stages.state.reaction, stages.reaction[i])


@kernel
def remove_null_multipliers(subsystem: CollocationWorkspace) -> None:
    """Subtract from the multipliers what redundant constraints leave undetermined in them; see
    ``midpoint.newton.remove_null_multipliers``.
    """
    workspace, y, Z = subsystem.workspace, subsystem.y, subsystem.stages.Z
    lu, chi = workspace.unknowns.elimination, subsystem.stages.tableau.chi
    relaxation, first = workspace.system.relaxation, first_multiplier(workspace.system.frames)
    s = y.shape[1]
    for k in range(y.shape[0]):
        node, i = lu.order[k] // 3, lu.order[k] % 3
        for j in range(s):
            y[k, j] = 0.0
            if node >= first:
                for n in range(s):
                    y[k, j] += 2.0 * relaxation * chi[j, n] * Z[n, node, i]
    block_lu.solve(lu, subsystem.factor, y)
    for k in range(y.shape[0]):
        node = lu.order[k] // 3
        if node >= first:
            for j in range(s):
                Z[j, node, lu.order[k] % 3] -= y[k, j]


@kernel
def remove_null_violation(subsystem: CollocationWorkspace) -> None:
    """Subtract from the violation that the next step is to remove the part that no motion can
    remove, left over from this step or seen in absolute positions; see
    ``midpoint.newton.remove_null_violation``.
    """
    workspace, y, chi = subsystem.workspace, subsystem.y, subsystem.stages.tableau.chi
    system, lu = workspace.system, workspace.unknowns.elimination
    violation, s = workspace.state.violation, y.shape[1]
    first = first_multiplier(system.frames)
    for k in range(y.shape[0]):
        node, i = lu.order[k] // 3, lu.order[k] % 3
        for j in range(s):
            y[k, j] = violation[node - first, i] if node >= first and j == s - 1 else 0.0
    block_lu.solve(lu, subsystem.factor, y)
    for k in range(y.shape[0]):
        node, i = lu.order[k] // 3, lu.order[k] % 3
        if node >= first:
            for n in range(s):
                violation[node - first, i] -= 2.0 * system.relaxation * chi[s - 1, n] * y[k, n]
    clear_rate_violations(system.scalar, violation)


@kernel
def gather_stages(lu: Elimination, F: np.ndarray, y: np.ndarray) -> None:
    """Set ``y`` (f, s) to the free rows of ``F`` (s, nodes, 3) in the order of elimination."""
    for k in range(y.shape[0]):
        for j in range(y.shape[1]):
            y[k, j] = F[j, lu.order[k] // 3, lu.order[k] % 3]


@unit
def accept_step(subsystem: CollocationWorkspace, h: float) -> None:
    """Advance the state by the solved step and project its velocities onto the constraints."""
    workspace, stages = subsystem.workspace, subsystem.stages
    system, state, start = workspace.system, workspace.state, workspace.start
    violation, rate = workspace.monitor.violation, workspace.monitor.rate
    equations.accept(system, state, start, stages, h)
    accelerations.project_velocities(system, state, start, violation, rate, subsystem.instant)
    if use_reactions(system.forces.signals):
        _save_reactions(subsystem)
    for k in range(state.violation.shape[0]):
        for i in range(3):
            state.violation[k, i] += DRIFT_FEEDBACK * (violation[k, i] - state.violation[k, i])
    beams.correct_strains(system.beams, start.beams, DRIFT_FEEDBACK)
    forces.correct_elongations(system.forces, start.forces, system.scalar, DRIFT_FEEDBACK)
    if stages.tableau.decays:
        dissipated = stages.first_energy[0] - energy_balance(system, state, start, violation, rate)
        state.work[state.work.size - 1] -= max(0.0, dissipated)


@apart
def _save_reactions(subsystem: CollocationWorkspace) -> None:
    """Set the state's reactions, on which expressions depend in the next step, to those at its own
    time; the multipliers, from which that step is predicted, are not changed.
    """
    workspace, instant = subsystem.workspace, subsystem.instant
    system, state, start = workspace.system, workspace.state, workspace.start
    copy(state.force, instant.force)
    accelerations.accelerate(system, state, start, instant)
    copy(instant.force, state.force)
    inputs.save_reactions(system.forces.signals, start.forces.signals, state.reaction)


@kernel
def take_steps(
    subsystem: CollocationWorkspace,
    h: float,
    first: int,
    last: int,
    due: np.ndarray,
    share: np.ndarray,
) -> int:
    """Take steps ``first``..``last - 1`` of a chunk; return the number of the first that did not
    converge, or ``last``. ``due`` and ``share`` are those of ``OutputSchedule``; where ``due`` is
    empty nothing is recorded.
    """
    for step in range(first, last):
        if due.size > 0:
            dense_output.save_end(subsystem.dense_output.begin, subsystem.workspace)
            tree_stages.choose_form(subsystem.tree, step)
        if not take_step(subsystem, h):
            return step
        if due.size > 0:
            record_step(subsystem, h, step, due, share)
    return last


@kernel
def record_step(
    subsystem: Recorded, h: float, step: int, due: np.ndarray, share: np.ndarray
) -> None:
    """Write the accepted state to row ``step`` of the monitor, and the rows of the tables that are
    due; the start of the step has been saved in the dense output.
    """
    workspace, output, instant = subsystem.workspace, subsystem.dense_output, subsystem.instant
    first, last = due[step], due[step + 1]
    end = -1
    if last > first and share[last - 1] == 1.0:
        end, last = last - 1, last - 1
    record_at_end(workspace, h, step, end)
    tree_stages.save_form(subsystem.tree, step)
    if end >= 0:
        accelerations.write_instantaneous_reactions(workspace, instant, end)
    if last > first:
        dense_output.save_end(output.end, workspace)
        dense_output.fit(output, instant, dense_output.DIVERGES)
        for row in range(first, last):
            dense_output.write_row(output, instant, share[row], row)


@unit
def take_step(subsystem: CollocationWorkspace, h: float) -> bool:
    """Take a step of size ``h`` if it converges, and return whether it did; ``subsystem.outcome``
    receives its residual and worst row.
    """
    workspace, stages = subsystem.workspace, subsystem.stages
    if tree_step.take_step(subsystem.tree, workspace, stages, subsystem.outcome, h):
        return True
    system = workspace.system
    if tree_stages.leave(subsystem.tree, stages):
        accelerations.accelerate(system, workspace.state, workspace.start, subsystem.instant)
    predictor.predict(system, workspace.state, workspace.start, stages, h)
    residual, worst, first = iterate(subsystem, h)
    if TOLERANCE < residual <= system.relaxation:
        # Short steps see what the last removal left, a share of about 1e-7. It raises multipliers
        # to its size over the relaxation, which is therefore the most it is relative to them.
        remove_null_violation(subsystem)
        residual, worst, first = iterate(subsystem, h)
    subsystem.outcome[0], subsystem.outcome[1] = residual, worst
    if not (residual <= TOLERANCE or iterate_by_widths(system.forces.sliding, subsystem, h)):
        return False
    stages.predicted_well[0] = 1.0 if first <= PREDICTED_WELL else 0.0
    accept_step(subsystem, h)
    sliding.set_width(system.forces.sliding, 0.0)
    if system.relaxation > 0.0:
        remove_null_violation(subsystem)
    return True


@kernel
def iterate(subsystem: CollocationWorkspace, h: float) -> tuple[float, int, float]:
    """Solve the step from the prediction by Newton's method; return its relative residual, the
    worst row, and the residual of the prediction.
    """
    workspace, stages = subsystem.workspace, subsystem.stages
    system, state, start = workspace.system, workspace.state, workspace.start
    free = workspace.unknowns.free
    before, smallest, predicted, first = math.inf, math.inf, 0.0, math.inf
    iteration, fresh, relaxed = 0, True, system.relaxation > 0.0
    while True:
        update_reactions(subsystem.pressed, system, state, stages, subsystem.instant, h)
        length = equations.evaluate(system, state, start, stages, h, fresh)
        length = max(length, AT_REST)
        residual, worst = relative_residual(free, stages.F, stages.load_scale, length)
        if iteration == 0:
            predicted, first = length, residual
        smallest = min(smallest, residual)
        if residual <= TARGET or (residual > STUCK * before and residual <= TOLERANCE):
            if not relaxed:
                break
            if not fresh:
                fresh = True
                continue
            factor(subsystem)
            remove_null_multipliers(subsystem)
            relaxed, fresh, before, smallest = False, False, math.inf, math.inf
            continue
        if iteration == MAX_ITERATIONS or not residual <= DIVERGED * smallest:
            break
        slow = not fresh and is_slow(residual, before)
        if slow and not go_on(subsystem.secants, residual):
            fresh = True
            continue
        apply_correction(subsystem, fresh)
        iteration += 1
        before, fresh = residual, False
    if is_implausible(system, predicted, length):
        residual = math.inf
    return residual, worst, first


@optional(False)
def iterate_by_widths(group: Sliding, subsystem: CollocationWorkspace, h: float) -> bool:
    """Solve a step that has no solution near its prediction as that of slips that begin, by the
    path of ``ports.sliding``; return whether it is solved, with the last width, which is left.
    """
    workspace, stages, width = subsystem.workspace, subsystem.stages, sliding.widest(group)
    if width == 0.0:
        return False
    predictor.predict(workspace.system, workspace.state, workspace.start, stages, h)
    for _ in range(sliding.WIDTHS):
        sliding.set_width(group, width)
        residual, worst, _ = iterate(subsystem, h)
        subsystem.outcome[0], subsystem.outcome[1] = residual, worst
        if not residual <= TOLERANCE:
            sliding.set_width(group, 0.0)
            return False
        width *= sliding.NARROWER
    return True


@kernel
def factor(subsystem: CollocationWorkspace) -> None:
    """Factor the Jacobian that was evaluated last; the secants were those of another one."""
    stages, lu = subsystem.stages, subsystem.workspace.unknowns.elimination
    block_lu.factor(lu, stages.source, stages.values, subsystem.factor, subsystem.pivot_rows)
    forget(subsystem.secants)


@kernel
def apply_correction(subsystem: CollocationWorkspace, fresh: bool) -> None:
    """Subtract Newton's correction from the free unknowns; factor the Jacobian first if it is
    ``fresh``.
    """
    stages, lu, y = subsystem.stages, subsystem.workspace.unknowns.elimination, subsystem.y
    if fresh:
        factor(subsystem)
        subsystem.workspace.counts[1] += 1
    gather_stages(lu, stages.F, y)
    block_lu.solve(lu, subsystem.factor, y)
    improve(subsystem.secants, y)
    for k in range(y.shape[0]):
        for j in range(y.shape[1]):
            stages.Z[j, lu.order[k] // 3, lu.order[k] % 3] -= y[k, j]
    subsystem.workspace.counts[0] += 1


@kernel
def evaluate_free(
    subsystem: CollocationWorkspace, h: float, z: np.ndarray, f: np.ndarray, fresh: bool
) -> tuple[float, int, float]:
    """Set the free rows ``f`` (f, s) at the free unknowns ``z`` (f, s), and where ``fresh`` the
    Jacobian; return the relative residual, the worst row and the step's length [m].
    """
    workspace, stages, free = (
        subsystem.workspace,
        subsystem.stages,
        subsystem.workspace.unknowns.free,
    )
    system, state = workspace.system, workspace.state
    for i in range(free.size):
        for j in range(z.shape[1]):
            stages.Z[j, free[i] // 3, free[i] % 3] = z[i, j]
    update_reactions(subsystem.pressed, system, state, stages, subsystem.instant, h)
    length = equations.evaluate(system, state, workspace.start, stages, h, fresh)
    length = max(length, AT_REST)
    for i in range(free.size):
        for j in range(f.shape[1]):
            f[i, j] = stages.F[j, free[i] // 3, free[i] % 3]
    residual, worst = relative_residual(free, stages.F, stages.load_scale, length)
    return residual, worst, length
