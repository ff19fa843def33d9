"""Steps of higher degree whose size follows from a tolerance.

Steps go in pairs of two halves. One step of the whole size from the same start says what the pair's
own error is, by order p: |pair - whole| / (2^p - 1), of places and of turns times the bodies'
lengths. A pair is accepted if that is at most its share of the tolerance, by time, so that the own
errors of all steps add up to the tolerance; what the motion makes of them is another matter. The
size of the next pair is the one at which the error would be a little less than its share: over a
pair it goes with the power p + 1, over a unit of time with p.

No pair goes past a kink: where a law of time has one is known, and where a quantity comes to one of
a spring's table or of a cam, or to the width of a friction, is found (``solve.kinks``).

The error of positions at the ends of steps alone says little where motions are prescribed (where
all are, there is none) or loads oscillate (their impulses are exact). So in all systems but those
of coinciding points without laws of time the error of the row between, at the middle of the whole
step, counts as well, and that of the works, by the energy of the system over its length.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, inverse
from msahl.algebra.vector import at, copy, dot, sub
from msahl.elements import forces
from msahl.jit.kernel import kernel
from msahl.schemes.collocation import breakpoints, dense_output, newton
from msahl.schemes.collocation.breakpoints import Breakpoints, new_kinks
from msahl.schemes.collocation.dense_output import Point
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.system import evaluate
from msahl.system.arrays import State
from msahl.system.diagnostics import KINETIC, look

NEXT, SHARE, END, ERROR, LARGEST, BEST, SMALLEST, WIDEST, STOP, ENERGY = range(10)
"""Figures: size of the next pair [s]; tolerance per second [m/s]; where the pairs end for now [s];
sum of the own errors so far, and the largest [m]; size that the last pair should have had [s]; the
smallest and the widest accepted step [s]; where the present pair ends at the latest, as a kink was
found there [s]; the largest energy so far that works are compared with [J].
"""
ACCEPTED, REFUSED, ROWS, SOUGHT = range(4)
"""Counts: pairs accepted and refused so far, rows of the present chunk, how often a kink was sought
since the last accepted pair."""
SEARCHES = 12
"""At most, for one kink: each search squares the distance from it."""
WIDEST_TURN = 1.5
"""Of a body over a pair [rad]: between two bodies less than half a turn then, as angles are counted
on by less than that."""
SAFETY, SHRINK, GROW = 0.9, 0.2, 3.0
"""A pair aims at this part of the size that its error allows; limits of one change."""
ROUND_OFF = 4e-16
"""Part of the places and lengths that no smaller step makes more certain."""
TOO_SMALL = 1e-12
"""Part of the run that no pair is shorter than."""


class ControlSettings(NamedTuple):
    """What the user asked of the step-size control."""

    tolerance: float  # of the local errors of a whole run, added up [m]
    dt: float  # size of the steps tried first [s]
    t_final: float  # [s]


class StepControl(NamedTuple):
    """Where the choice of steps stands, and room for going back."""

    figures: np.ndarray  # (10,) see above
    counts: np.ndarray  # (4,)
    sizes: np.ndarray  # (steps,) of the present chunk's steps [s]
    ends: np.ndarray  # (steps,) where they end [s]
    kept: State  # the state that a pair starts from
    middle: Point
    end: Point
    x: np.ndarray  # (n+1, 3) where the whole step leads
    p: np.ndarray  # (n+1, 3)
    x_middle: np.ndarray  # (n+1, 3) where its rows between have its middle
    p_middle: np.ndarray  # (n+1, 3)
    work: np.ndarray  # (w,) at its end [J]
    checks_rows: bool  # whether errors of rows between and of works count as well
    kinks: Breakpoints


def new_step_control(
    subsystem: CollocationWorkspace, steps: int, settings: ControlSettings
) -> StepControl:
    """Return the step-size control for chunks of up to ``steps`` steps."""
    state = subsystem.workspace.state
    system = subsystem.workspace.system
    figures = np.zeros(10)
    figures[STOP] = math.inf
    figures[NEXT], figures[SMALLEST] = settings.dt, math.inf
    figures[SHARE] = settings.tolerance / settings.t_final
    return StepControl(
        figures=figures,
        counts=np.zeros(4, dtype=np.int64),
        sizes=np.zeros(steps),
        ends=np.zeros(steps),
        kept=State(*(array.copy() for array in state)),
        middle=dense_output.new_point(state),
        end=dense_output.new_point(state),
        x=np.zeros_like(state.x),
        p=np.zeros_like(state.p),
        x_middle=np.zeros_like(state.x),
        p_middle=np.zeros_like(state.p),
        work=np.zeros_like(state.work),
        checks_rows=system.scalar is not None
        or max(forces.laws_of_time(system.forces), default=-1) >= 0,
        kinks=new_kinks(system),
    )


@kernel
def march(
    subsystem: CollocationWorkspace, control: StepControl, order: int, last: int, times: np.ndarray
) -> int:
    """Take pairs until there are ``last`` steps or all rows of the ``times``; how many steps were
    taken. Fewer than that: the next pair does not converge however small it is.

    Without ``last`` one pair is tried and taken back. Refused pairs count as well, but for those
    before the first good one: a call ends in time, however hard the steps turn.
    """
    done, tried, figures = 0, 0, control.figures
    control.counts[ROWS] = 0
    if last == 0:
        return int(attempt(subsystem, control, order, 0, False))
    while (tried + 2 <= last or done == 0) and control.counts[ROWS] < times.size:
        tried += 2
        if attempt(subsystem, control, order, done, True):
            done += 2
            fill(subsystem, control, times)
        elif figures[NEXT] < TOO_SMALL * figures[END]:
            break
    return done


@kernel
def attempt(
    subsystem: CollocationWorkspace, control: StepControl, order: int, row: int, commit: bool
) -> bool:
    """Take a pair, into rows ``row`` and ``row + 1`` of the watch; whether its error is small
    enough. Else, or if it is not to be kept, all is as before but for the size of the next.
    """
    workspace, figures = subsystem.workspace, control.figures
    t = workspace.state.time[0]
    kink = breakpoints.next_kink(control.kinks, workspace.system, t, TOO_SMALL * figures[END])
    left = min(figures[END], kink, figures[STOP]) - t
    spin = largest_spin(workspace.start.frames.W)
    h = figures[NEXT]
    if workspace.system.scalar is not None and h * spin > WIDEST_TURN:
        h = WIDEST_TURN / spin
    if h > left * (1.0 - 1e-9):
        h = left
    elif 2.0 * h > left:
        h = 0.5 * left
    keep(workspace.state, control.kept)
    dense_output.mark(subsystem.between.begin, workspace)
    breakpoints.note(control.kinks, workspace, 0)
    if not pair(subsystem, control, h, row):
        figures[NEXT] = figures[BEST] = 0.25 * h
        control.counts[REFUSED] += 1
        go_back(subsystem, control)
        newton.forget(subsystem)
        return False
    if commit and seek(subsystem, control, h):
        go_back(subsystem, control)
        follow(subsystem, t, h)
        return False
    error, known = apart(subsystem, control)
    if control.checks_rows:
        rest, unsure = apart_within(subsystem, control, row)
        error, known = error + rest, known + unsure
    error /= 2.0**order - 1.0
    share = figures[SHARE] * h
    growth = GROW
    if error > known:
        growth = min(GROW, max(SHRINK, SAFETY * (share / error) ** (1.0 / order)))
    figures[BEST] = growth * h
    good = error <= max(share, known)
    spin = max(largest_spin(control.middle.W), largest_spin(control.end.W))
    if workspace.system.scalar is not None and h * spin > 2.0 * WIDEST_TURN:
        good, growth = False, WIDEST_TURN / (h * spin)
    if good:
        figures[NEXT] = max(figures[NEXT], growth * h) if h < figures[NEXT] else growth * h
    else:
        figures[NEXT] = min(growth, SAFETY) * h
    if good and commit:
        control.counts[ACCEPTED] += 1
        control.counts[SOUGHT], figures[STOP] = 0, math.inf
        if h == left and left < figures[END] - t:
            newton.forget(subsystem)
        figures[ERROR] += error
        figures[LARGEST] = max(figures[LARGEST], error)
        figures[SMALLEST] = min(figures[SMALLEST], 0.5 * h)
        figures[WIDEST] = max(figures[WIDEST], 0.5 * h)
        control.sizes[row] = control.sizes[row + 1] = 0.5 * h
        control.ends[row], control.ends[row + 1] = control.middle.time[0], control.end.time[0]
        return True
    if commit:
        control.counts[REFUSED] += 1
    go_back(subsystem, control)
    follow(subsystem, t, h)
    return good


@kernel
def largest_spin(W: np.ndarray) -> float:
    """Of all bodies [rad/s]."""
    largest = 0.0
    for b in range(W.shape[0]):
        largest = max(largest, dot(at(W, b), at(W, b)))
    return math.sqrt(largest)


@kernel
def seek(subsystem: CollocationWorkspace, control: StepControl, h: float) -> bool:
    """Whether the pair has gone past a kink of a quantity; it is to be taken again up to there."""
    part = breakpoints.crossing(control.kinks, subsystem.workspace.system, h)
    if part == 1.0 or control.counts[SOUGHT] == SEARCHES:
        return False
    control.counts[SOUGHT] += 1
    control.figures[STOP] = control.kept.time[0] + part * h
    return True


@kernel
def pair(subsystem: CollocationWorkspace, control: StepControl, h: float, row: int) -> bool:
    """Take a step of size ``h``, note where it leads, and go there in two halves."""
    workspace = subsystem.workspace
    system, state, start = workspace.system, workspace.state, workspace.start
    if not newton.take(subsystem, h):
        return False
    copy(state.x, control.x)
    copy(state.p, control.p)
    if control.checks_rows:
        go_between(subsystem, control, h)
    learn(subsystem)
    go_back(subsystem, control)
    for half in range(2):
        follow(subsystem, control.kept.time[0], h)
        if not newton.take(subsystem, 0.5 * h):
            return False
        look(system, state, start, 0.5 * h, workspace.monitor, row + half)
        dense_output.mark(control.middle if half == 0 else control.end, workspace)
        breakpoints.note(control.kinks, workspace, 1 + half)
    return True


@kernel
def go_between(subsystem: CollocationWorkspace, control: StepControl, h: float) -> None:
    """Note what the rows between and the works of the whole step are."""
    room = subsystem.between
    dense_output.mark(room.end, subsystem.workspace)
    dense_output.trace(room, subsystem.instant)
    dense_output.weigh(room, room.basis.shape[0] - 1, 0.5)
    dense_output.move(room, h, 0.5)
    copy(room.workspace.state.x, control.x_middle)
    copy(room.workspace.state.p, control.p_middle)
    for w in range(control.work.size):
        control.work[w] = subsystem.workspace.state.work[w]


@kernel
def apart_within(
    subsystem: CollocationWorkspace, control: StepControl, row: int
) -> tuple[float, float]:
    """How far rows between of the whole step are from the pair's middle, and the works from the
    pair's, by the energy over the length of the scene [m]; how much of that is round-off.
    """
    workspace, figures = subsystem.workspace, control.figures
    frames = workspace.system.frames
    error, length = 0.0, 0.0
    for b in range(control.x.shape[0] - 1):
        way = sub(at(control.middle.x, b), at(control.x_middle, b))
        turn = compose(at(control.middle.p, b), inverse(at(control.p_middle, b)))
        far = math.sqrt(dot(way, way)) + frames.length[b] * math.sqrt(dot(turn, turn))
        error, length = max(error, far), max(length, frames.length[b])
    for r in range(row, row + 2):
        figures[ENERGY] = max(figures[ENERGY], workspace.monitor.rows[r, KINETIC])
    work, size = 0.0, figures[ENERGY]
    for w in range(control.work.size):
        work = max(work, abs(control.end.work[w] - control.work[w]))
        size = max(size, abs(control.work[w]))
    if not size > 0.0:
        return error, 0.0
    return error + length * work / size, ROUND_OFF * length


@kernel
def apart(subsystem: CollocationWorkspace, control: StepControl) -> tuple[float, float]:
    """How far the pair and the whole step are apart [m], and how much of that is round-off."""
    state, frames = subsystem.workspace.state, subsystem.workspace.system.frames
    error, size = 0.0, 0.0
    for b in range(state.x.shape[0] - 1):
        way = sub(at(state.x, b), at(control.x, b))
        turn = compose(at(state.p, b), inverse(at(control.p, b)))
        length = frames.length[b]
        error = max(error, math.sqrt(dot(way, way)) + length * math.sqrt(dot(turn, turn)))
        size = max(size, math.sqrt(dot(at(state.x, b), at(state.x, b))) + length)
    return error, ROUND_OFF * size


@kernel
def keep(state: State, kept: State) -> None:
    """Copy what a step of higher degree changes of the state."""
    kept.time[0] = state.time[0]
    copy(state.x, kept.x)
    copy(state.x_low, kept.x_low)
    copy(state.p, kept.p)
    copy(state.v, kept.v)
    copy(state.w, kept.w)
    copy(state.a, kept.a)
    copy(state.alpha, kept.alpha)
    copy(state.force, kept.force)
    copy(state.violation, kept.violation)
    copy(state.reaction, kept.reaction)
    for source, target in ((state.angle, kept.angle), (state.work, kept.work)):
        for i in range(source.size):
            target[i] = source[i]


@kernel
def go_back(subsystem: CollocationWorkspace, control: StepControl) -> None:
    """Go back to where the pair starts."""
    workspace = subsystem.workspace
    keep(control.kept, workspace.state)
    evaluate.prepare(workspace.system, workspace.state, workspace.start)


@kernel
def learn(subsystem: CollocationWorkspace) -> None:
    """Keep the polynomials of the step just taken."""
    for k in range(subsystem.whole.shape[0]):
        copy(subsystem.stages.before[k], subsystem.whole[k])
    for k in range(subsystem.held.shape[0]):
        copy(subsystem.stages.Z[k], subsystem.held[k])


@kernel
def follow(subsystem: CollocationWorkspace, t: float, h: float) -> None:
    """Let the next step follow the polynomials kept, of a step ``h`` from ``t``."""
    for k in range(subsystem.whole.shape[0]):
        copy(subsystem.whole[k], subsystem.stages.before[k])
    for k in range(subsystem.held.shape[0]):
        copy(subsystem.held[k], subsystem.stages.Z[k])
    subsystem.stages.known[0], subsystem.stages.known[1] = t, h


@kernel
def fill(subsystem: CollocationWorkspace, control: StepControl, times: np.ndarray) -> None:
    """Enter the rows of the ``times`` that the accepted pair has passed."""
    room = subsystem.between
    for half in range(2):
        end = control.middle if half == 0 else control.end
        t, h = room.begin.time[0], end.time[0] - room.begin.time[0]
        dense_output.copy_point(end, room.end)
        traced = False
        while control.counts[ROWS] < times.size:
            row = control.counts[ROWS]
            if times[row] > t + h * (1.0 + 1e-9):
                break
            if not traced:
                dense_output.trace(room, subsystem.instant)
                traced = True
            dense_output.publish(room, subsystem.instant, (times[row] - t) / h, row)
            control.counts[ROWS] += 1
        dense_output.copy_point(end, room.begin)
