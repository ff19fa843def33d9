"""Chooses the size of collocation steps from a tolerance on their local errors.

Steps are taken in pairs of equal halves, and each pair is compared with one long step, of the size
of the pair, from the same state. It is solved after them, predicted by their polynomials, which
takes one or two iterations. Of a method of order p the difference gives the local error of the
pair,

    e = |pair - long step| / (2^p' - 1)                                                 [m]

    |.|    the largest of all bodies: displacement plus body length times rotation
    p'     p, or less where steps are too long to have their order (``convergence``)
    h      size of the pair [s]
    tol    tolerance [m], T the duration of the run [s]

The share of a pair is tol h/T. A pair is accepted if e is within its share, or within ``LENT``
shares as far as the pairs before left so much of theirs: the local errors of a run add up to the
tolerance at most. How far they grow afterwards depends on the motion and is not controlled. Over a
pair the error goes with h^(p+1), so e/h goes with h^p, and the next pair has the size

    h <- 0.9 h (tol h / (T e))^(1/p)      within limits of one change                     (1)

or, where the size by (1) fell over the last pair, this times the factor by which it fell: the error
probably goes on growing.

No pair extends beyond a breakpoint: where a law or an expression of time has one is known, and
where a coordinate reaches a breakpoint of a spring's table or of a cam, or the width of a friction
law, or an expression of the motion a kink or a jump, is an event of one of the halves
(``step_events``). The pair is taken again up to there, by the secant, until the
coordinate is at the breakpoint to round-off.

The positions at the ends of steps say little where motions are prescribed (if all are, there is no
error) or where loads oscillate (their impulses are exact). So in all systems but those of
coinciding points without laws of time two more terms count: the error of the dense output at the
middle of the long step, and that of the works, relative to the system's energy, times its length.
The errors of auxiliary states count likewise, each relative to its largest size so far, unless they
are within the rounding errors of the terms that make its rate (``signal_terms``): a state that is
zero but for noise has no size.

Works count once a body has been faster than tol/T. Slower than that, nothing moves by tol in the
run, and at rest both energy and works are rounding errors, whose quotient says nothing. The work
of a load during a displacement is not known better than the displacement, so where bodies move by
little more than the rounding errors of their positions, that part of the works is rounding error.

Source: E. Hairer, S. P. Noersett, G. Wanner, Solving Ordinary Differential Equations I (1993),
section II.4, for the pairs and (1).
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, inverse
from msahl.algebra.vector import at, copy, dot, sub
from msahl.events import margins
from msahl.events.margins import CONTACT
from msahl.events.margins import END as END_OF_RUN
from msahl.formulations.absolute.frames import moving_count
from msahl.jit.kernel import kernel, optional
from msahl.ports import forces
from msahl.schemes import step_events
from msahl.schemes.collocation import dense_output, newton
from msahl.schemes.collocation.dense_output import StepEnd
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.schemes.collocation.tree import stages as tree_stages
from msahl.schemes.collocation.tree import step as tree_step
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.step_events import Detector
from msahl.system import evaluate
from msahl.system.arrays import State
from msahl.system.diagnostics import KINETIC, SPEED, record_figures
from msahl.system.signal_terms import rate_terms
from msahl.system.state import copy_state

NEXT, SHARE, END, ERROR, LARGEST, BEST, SMALLEST = range(7)
WIDEST, STOP, ENERGY, FASTEST, CEILING, FIT, SHORTER, EASED, POSSIBLE, STATES = range(7, 17)
"""Places in ``StepControl.figures``: size of the next pair [s]; tolerance per second [m/s]; time
that no pair may pass for now [s]; sum of the local errors so far and the largest of them [m]; size
that the last pair should have had [s]; smallest and largest accepted step [s]; time of a breakpoint
or an event at which the present pair ends at the latest [s]; largest kinetic energy so far, with
which works are compared [J], and highest speed [m/s]; size that the next pair may have at most
after one that was refused [s]; size at which the last accepted pair would have had its share of the
tolerance [s]; how many pairs in succession may be refused because a step in joint coordinates did
not converge; pairs accepted since the last one that was refused by its error; size that the last
good pair could have had by its error [s]; from here on the largest sizes of the auxiliary
states."""
ACCEPTED, REFUSED, ROWS, SOUGHT = range(4)
"""Places in ``StepControl.counts``: pairs accepted and refused so far, rows written in the present
chunk, searches for a breakpoint since the last accepted pair."""
SEARCHES = 12
"""Most pairs that are taken for one event: by the secant, four or five lead to round-off."""
MISLED = 0.25
"""Factor of the size of the next pair after one whose event is not where pairs are taken up to it:
the motion comes nearer to a level than the dense output of a pair of that size is accurate."""
SHORTENED = 3.0
"""Most pairs that are refused in succession because a step in joint coordinates did not converge:
Newton's method in absolute coordinates would solve it, but takes longer than the steps that are a
half, a quarter or an eighth as long."""
WORTH = 4.0
"""Size that errors allow, over that of a pair that does not converge in joint coordinates, from
which on absolute ones take less time: steps there take ten times as long as others, and at rest
they may be as long as the run."""
REACHED = 1e-9
"""Fraction of a pair within which its end is where it was to be."""
NO_EVENT, AGAIN, ENDS, CROSSES = 0.0, 1.0, 2.0, 3.0
"""What follows from the events of a pair: nothing, to take it again up to one, that the run ends
within it, or that a switch crosses at its start."""
MAX_ROTATION = 1.5
"""Largest rotation of a body over a pair [rad]. Two bodies then rotate by less than half a
revolution relative to each other, as is needed to count full revolutions of their angle."""
SAFETY, SHRINK, GROW, SEARCH = 0.9, 0.2, 2.0, 10.0
"""Factor of (1), and the limits of one change of the size: least, largest from pair to pair, and
largest while a first size is sought."""
TREND = 0.75
"""Least factor of the size because it should have become smaller over the last pair, as it will
over the next."""
LENT = 5.0
"""Largest error of a pair over its share. Those before have used a part of theirs only, as 0.9^p
shares are aimed at."""
UNSOLVED, SOLVED, RECOVERY = 0.5, 0.75, 1.05
"""Size of the next pair after one that was not solved, the square of that while a first size is
sought, and largest one of those after it, as fractions; how much the largest grows by the first
pair after one was refused: pairs of that size would probably be refused again. By the k-th pair it
grows by the k-th power of that where errors were the reason: what the refused one met may be over,
as a vibration that has faded."""
ASYMPTOTIC = math.log(4.0)
"""Logarithm of the size at which errors are as large as bodies, over that from which on they
decrease by the order of the method. Larger steps of two pendulums, a four-bar, a slider-crank and a
squeezer have errors that vary by powers of ten from size to size."""
ROUND_OFF = 4e-16
"""Fraction of positions and lengths that is rounding error: no smaller step reduces it."""
TOO_SMALL = 1e-12
"""Shortest pair, as a fraction of the time at which the pairs end for now."""


class ControlSettings(NamedTuple):
    """What the user asked of the step-size control."""

    tolerance: float  # of the local errors of a run, added up [m]
    dt: float  # size of the steps tried first [s]
    t_final: float  # [s]


class StepControl(NamedTuple):
    """State of the step-size control, and memory for taking a pair back."""

    figures: np.ndarray  # (16 + n,) see above
    counts: np.ndarray  # (4,)
    event: np.ndarray  # (1,) the margin whose event the present pair is to end at
    sizes: np.ndarray  # (steps,) sizes of the present chunk's steps [s]
    ends: np.ndarray  # (steps,) times of their ends [s]
    start: State  # at the start of the pair
    middle: StepEnd  # of the pair
    end: StepEnd
    finish: State  # at its end
    x: np.ndarray  # (n+1, 3) mass centres at the middle of the long step, by its dense output [m]
    p: np.ndarray  # (n+1, 3) rotations there
    terms: np.ndarray  # (2, n) terms of their rates: per second, and over the run
    checks_rows: bool  # whether errors of the dense output and of works count as well
    timed: np.ndarray  # (l,) piecewise laws of time


def new_step_control(
    subsystem: CollocationWorkspace, steps: int, settings: ControlSettings
) -> StepControl:
    """Return the step-size control for chunks of up to ``steps`` steps."""
    state = subsystem.workspace.state
    system = subsystem.workspace.system
    figures = np.zeros(STATES + state.auxiliary.size)
    figures[STOP] = figures[CEILING] = figures[FIT] = math.inf
    figures[NEXT], figures[SMALLEST] = settings.dt, math.inf
    figures[SHARE], figures[SHORTER] = settings.tolerance / settings.t_final, SHORTENED
    return StepControl(
        figures=figures,
        counts=np.zeros(4, dtype=np.int64),
        event=np.zeros(1, dtype=np.int64),
        sizes=np.zeros(steps),
        ends=np.zeros(steps),
        start=State(*(array.copy() for array in state)),
        middle=dense_output.new_step_end(state),
        end=dense_output.new_step_end(state),
        finish=State(*(array.copy() for array in state)),
        x=np.zeros_like(state.x),
        p=np.zeros_like(state.p),
        terms=rate_terms(system, subsystem.workspace.start, state, settings.t_final),
        checks_rows=system.scalar is not None
        or state.auxiliary.size > 0
        or max(forces.laws_of_time(system.forces), default=-1) >= 0,
        timed=margins.laws_of_time(system),
    )


@kernel
def take_pairs(
    subsystem: CollocationWorkspace,
    control: StepControl,
    detector: Detector | None,
    order: int,
    last: int,
    times: np.ndarray,
) -> int:
    """Take pairs until there are ``last`` steps or all rows of the ``times`` are written, or until
    the run ends within the next pair; return the number of steps taken. 0 means else that no pair
    converges within the tolerance, however small.

    With ``last`` = 0 one pair is tried and taken back. Refused pairs count as well, except for
    those before the first accepted one: a call ends in time, however hard the steps become.
    """
    done, tried, figures = 0, 0, control.figures
    control.counts[ROWS] = 0
    if is_sliding(detector) > 0.0:
        return 0
    if last == 0:
        good = try_pair(subsystem, control, detector, order, 0, False)
        if tree_stages.is_mixed(subsystem.tree):
            good = try_pair(subsystem, control, detector, order, 0, False)
        return int(good)
    while (tried + 2 <= last or done == 0) and control.counts[ROWS] < times.size:
        tried += 2
        if try_pair(subsystem, control, detector, order, done, True):
            done += 2
            write_rows(subsystem, control, times)
            cross_at_end(detector, subsystem.workspace.state.time[0])
        elif ends_run(detector) > 0.0 or figures[NEXT] < TOO_SMALL * figures[END]:
            break
        if changes_contacts(detector, control) > 0.0:
            break
        if is_sliding(detector) > 0.0:
            break
    return done


@kernel
def try_pair(
    subsystem: CollocationWorkspace,
    control: StepControl,
    detector: Detector | None,
    order: int,
    row: int,
    commit: bool,
) -> bool:
    """Take a pair, into the rows ``row`` and ``row + 1`` of the monitor; return whether its error
    is small enough. If it is not, or if the pair is not to be kept, the state is as before and only
    the size of the next pair has changed.
    """
    workspace, figures = subsystem.workspace, control.figures
    t = workspace.state.time[0]
    left = min(time_left(subsystem, control, t), known_time_left(detector, t))
    h = pair_size(subsystem, figures[NEXT], left)
    dense_output.save_end(subsystem.dense_output.begin, workspace)
    begin_pair(detector, workspace)
    copy_state(workspace.state, control.start)
    solved = take_halves(subsystem, control, detector, h, row)
    follows = seek_event(detector, control, t, h) if commit and solved else NO_EVENT
    if follows != NO_EVENT:
        restore_start(subsystem, control)
        join_halves(subsystem, t, h)
        if follows == CROSSES:
            cross_at_start(detector, t)
        return False
    error, round_off, well = math.nan, 0.0, subsystem.stages.predicted_well[0]
    if solved and take_long_step(subsystem, control, h):
        if commit and tree_stages.is_mixed(subsystem.tree):
            restore_start(subsystem, control)
            return False
        error, round_off = local_error(subsystem, control, order, row)
    if not math.isfinite(error):
        refuse_unsolved(subsystem, control, detector, t, h, commit)
        return False
    good = choose_next_size(subsystem, control, order, h, error, round_off, commit)
    if good and commit:
        restore_end(subsystem, control, 0.5 * h, well)
        accept_pair(control, row, h, error)
        allow_shorter(subsystem, figures)
        tree_stages.save_forms(subsystem.tree, row)
        keep_margins(detector, workspace)
        if h == left and left < figures[END] - t:
            newton.reset_prediction(subsystem)
        return True
    # The next pair is predicted by the long step.
    restore_start(subsystem, control)
    count_refused(control, SAFETY * h, 0.0, commit)
    return good


@kernel
def allow_shorter(subsystem: CollocationWorkspace, figures: np.ndarray) -> None:
    """After an accepted pair, allow one refusal more if the next is tried in joint coordinates."""
    if tree_stages.comes_first(subsystem.tree):
        figures[SHORTER] = min(SHORTENED, figures[SHORTER] + 1.0)


@kernel
def refuse_unsolved(
    subsystem: CollocationWorkspace,
    control: StepControl,
    detector: Detector | None,
    t: float,
    h: float,
    commit: bool,
) -> None:
    """Go back to the start ``t`` of a pair of size ``h`` that was not solved; a smaller one is next
    unless switches give way.
    """
    restore_start(subsystem, control)
    figures, size = control.figures, UNSOLVED * h if commit else UNSOLVED**2 * h
    if commit:
        figures[SHORTER] = max(0.0, figures[SHORTER] - 1.0)
    newton.reset_prediction(subsystem)
    tree_stages.forget_halves(subsystem.tree)
    if not (commit and gives_way(detector, t) > 0.0):
        figures[NEXT] = figures[BEST] = size
        count_refused(control, SOLVED * h, -math.inf, commit)


@kernel
def time_left(subsystem: CollocationWorkspace, control: StepControl, t: float) -> float:
    """Time [s] from ``t`` to where the pair must end at the latest."""
    figures, laws = control.figures, subsystem.workspace.system.laws
    law = margins.next_break(control.timed, laws, t, TOO_SMALL * figures[END])
    return min(figures[END], law, figures[STOP]) - t


@kernel
def pair_size(subsystem: CollocationWorkspace, wanted: float, left: float) -> float:
    """Size [s] of the next pair: the ``wanted`` one if the rotations and the time ``left`` allow
    it, and half of that time rather than a short rest.
    """
    workspace, h = subsystem.workspace, wanted
    speed = largest_angular_speed(workspace.start.frames.W)
    if workspace.system.scalar is not None and h * speed > MAX_ROTATION:
        h = MAX_ROTATION / speed
    if h > left * (1.0 - 1e-9):
        h = left
    elif 2.0 * h > left:
        h = 0.5 * left
    return h


@kernel
def local_error(
    subsystem: CollocationWorkspace, control: StepControl, order: int, row: int
) -> tuple[float, float]:
    """Local error of the pair [m], and how much of that is rounding error."""
    error, round_off = end_difference(subsystem, control)
    if control.checks_rows:
        rest, more = middle_difference(subsystem, control)
        error, round_off = error + rest, round_off + more
        rest, more = work_difference(subsystem, control, row, round_off)
        error, round_off = error + rest, round_off + more
    return error / (2.0 ** convergence(subsystem, order, error) - 1.0), round_off


@kernel
def convergence(subsystem: CollocationWorkspace, order: int, error: float) -> float:
    """Order by which the ``error`` [m] of the long step decreases at half its size: that of the
    method where it is a quarter, or less, of the size that would have an error of the length of a
    body, and half of it where it is a half or more.
    """
    length = largest_body(subsystem)
    if not 0.0 < error < length:
        return 0.5 * order
    shorter = math.log(length / error) / (order + 1.0)  # logarithm of that size over this one
    return order * min(1.0, max(0.5, shorter / ASYMPTOTIC))


@kernel
def choose_next_size(
    subsystem: CollocationWorkspace,
    control: StepControl,
    order: int,
    h: float,
    error: float,
    round_off: float,
    commit: bool,
) -> bool:
    """Set the size of the next pair after one of size ``h``; return whether that one is good."""
    figures = control.figures
    share = figures[SHARE] * h
    most = GROW if commit else SEARCH
    growth, possible = most, math.inf
    if error > round_off:
        possible = SAFETY * (share / error) ** (1.0 / order)
        growth = min(most, max(SHRINK, possible))
    good = error <= max(allowed_error(control), share, round_off)
    speed = max(largest_angular_speed(control.middle.W), largest_angular_speed(control.end.W))
    if subsystem.workspace.system.scalar is not None and h * speed > 2.0 * MAX_ROTATION:
        good, growth = False, MAX_ROTATION / (h * speed)
    figures[BEST] = growth * h
    if good:
        figures[POSSIBLE] = possible * h
    if good and commit:
        fit = growth * h / SAFETY
        growth *= min(1.0, max(TREND, fit / figures[FIT]))
        figures[FIT] = fit
    if good:
        next_size = max(figures[NEXT], growth * h) if h < figures[NEXT] else growth * h
        figures[NEXT] = min(next_size, figures[CEILING]) if commit else next_size
    else:
        figures[NEXT] = min(growth, SAFETY) * h
    return good


@kernel
def allowed_error(control: StepControl) -> float:
    """Error [m] that the pair may have because those before had less than their shares; the sum of
    all stays below the tolerance.
    """
    figures, end = control.figures, control.end.time[0]
    share = figures[SHARE] * (end - control.start.time[0])
    return min(LENT * share, figures[SHARE] * end - figures[ERROR])


@kernel
def count_refused(control: StepControl, ceiling: float, eased: float, commit: bool) -> None:
    """Count a pair that was refused, if it was not only tried, and let those after it grow slowly
    beyond the size ``ceiling``, as after so many pairs that ``eased`` the growth.
    """
    if commit:
        control.counts[REFUSED] += 1
        control.figures[CEILING], control.figures[EASED] = ceiling, eased


@kernel
def accept_pair(control: StepControl, row: int, h: float, error: float) -> None:
    """Enter a good pair of size ``h`` in figures and counts, and as steps ``row``, ``row + 1``."""
    figures = control.figures
    control.counts[ACCEPTED] += 1
    control.counts[SOUGHT], figures[STOP] = 0, math.inf
    figures[ERROR] += error
    figures[LARGEST] = max(figures[LARGEST], error)
    figures[SMALLEST] = min(figures[SMALLEST], 0.5 * h)
    figures[WIDEST] = max(figures[WIDEST], 0.5 * h)
    figures[EASED] += 1.0
    figures[CEILING] *= RECOVERY ** max(1.0, figures[EASED])
    control.sizes[row] = control.sizes[row + 1] = 0.5 * h
    control.ends[row], control.ends[row + 1] = control.middle.time[0], control.end.time[0]


@kernel
def largest_angular_speed(W: np.ndarray) -> float:
    """Largest angular speed of all bodies [rad/s]."""
    largest = 0.0
    for b in range(W.shape[0]):
        largest = max(largest, dot(at(W, b), at(W, b)))
    return math.sqrt(largest)


@optional(math.inf)
def known_time_left(detector: Detector, t: float) -> float:
    """Time [s] from ``t`` to the next known time."""
    known = detector.margins.known
    first = margins.next_known(known, t, detector.figures[step_events.NEAR])
    return known.time[first] - t if first < known.time.size else math.inf


@optional()
def begin_pair(detector: Detector, workspace: Workspace) -> None:
    """Hold the switches in a pair, and save the margins at its start, if they are not known."""
    t = workspace.state.time[0]
    detector.event[0] = -1
    if margins.hold_known(detector.margins, t, detector.figures[step_events.NEAR]):
        detector.figures[step_events.KNOWN] = math.nan
    step_events.update_slips(detector, workspace)
    if detector.figures[step_events.KNOWN] != t:
        save_margins(detector, workspace, 0)
    step_events.hold_switches(detector, t)


@optional(0.0)
def gives_way(detector: Detector, t: float) -> float:
    """1 if another pair from ``t`` may be solved: switches were held in this one and are not any
    more, or the motion slides.
    """
    released = step_events.release(detector, t, True)
    return 1.0 if released or step_events.blame_switches(detector, t) else 0.0


@optional()
def cross_at_start(detector: Detector, t: float) -> None:
    """Let the switch that has the event cross at the start of the pair."""
    step_events.cross(detector, detector.event[0], t)


@optional()
def cross_at_end(detector: Detector, t: float) -> None:
    """Let the switch whose level the accepted pair ended at cross to its other side."""
    if detector.event[0] >= 0:
        step_events.cross(detector, detector.event[0], t)


@optional(0.0)
def is_sliding(detector: Detector) -> float:
    """1 if the motion slides along the level of a switch: no step meets a tolerance there."""
    return 1.0 if detector.slides[0] >= 0 else 0.0


@optional()
def save_margins(detector: Detector, workspace: Workspace, place: int) -> None:
    """Save the margins at the start (``place`` 0), the middle (1) or the end (2) of a pair."""
    step_events.set_margins(detector, workspace, detector.ends[place])


@optional()
def keep_margins(detector: Detector, workspace: Workspace) -> None:
    """Let the margins at the end of an accepted pair be those at the start of the next one."""
    for k in range(detector.low.size):
        detector.ends[0, k] = detector.ends[2, k]
    detector.figures[step_events.KNOWN] = workspace.state.time[0]
    step_events.count_step(detector)


@optional(0.0)
def ends_run(detector: Detector) -> float:
    """1 if the run ends within the pair tried last."""
    k = detector.event[0]
    return 1.0 if k >= 0 and detector.margins.action[k] == END_OF_RUN else 0.0


@optional(0.0)
def changes_contacts(detector: Detector, control: StepControl) -> float:
    """1 if contacts open or close where the pair tried last ends, or begins."""
    k = detector.event[0]
    found = k >= 0 and control.counts[SOUGHT] == 0
    return 1.0 if found and detector.margins.action[k] == CONTACT else 0.0


@optional(0.0)
def seek_event(detector: Detector, control: StepControl, t: float, h: float) -> float:
    """Look for an event in the pair of size ``h`` from ``t``, and set where the next one ends."""
    figures, seen = control.figures, detector.figures
    if control.counts[SOUGHT] > 0 and abs(t + h - figures[STOP]) <= REACHED * h:
        return approach(detector, control, t)
    output = detector.output
    dense_output.copy_end(output.begin, detector.begin)
    dense_output.copy_end(control.middle, output.end)
    found = step_events.find_event(detector, 0)
    if not found:
        dense_output.copy_end(control.middle, output.begin)
        dense_output.copy_end(control.end, output.end)
        found = step_events.find_event(detector, 1)
        dense_output.copy_end(detector.begin, output.begin)
    if not found:
        return NO_EVENT
    if ends_run(detector) > 0.0:
        return ENDS
    if seen[step_events.GUESS] <= t:
        return CROSSES
    if not math.isfinite(seen[step_events.GUESS] + seen[step_events.RATE]):
        return NO_EVENT
    control.counts[SOUGHT] = 1
    figures[STOP] = seen[step_events.GUESS]
    control.event[0] = detector.event[0]
    return AGAIN


@kernel
def approach(detector: Detector, control: StepControl, t: float) -> float:
    """Set where the next pair from ``t`` ends after one that was to end at an event, unless that
    is at its level to round-off.
    """
    figures, seen, k = control.figures, detector.figures, control.event[0]
    end, value = control.end.time[0], detector.ends[2, k] - seen[step_events.LEVEL]
    last_end, last = seen[step_events.LAST_TIME], seen[step_events.LAST_VALUE]
    small = abs(value) <= margins.AT_ENDS * abs(detector.ends[2, k] - detector.ends[0, k])
    near = value == 0.0
    if control.counts[SOUGHT] > 1 and end != last_end:
        # Round-off, if it is small; else the rate that led here was wrong.
        near = small and abs(value) >= 0.5 * abs(last)
        if value != last:
            seen[step_events.RATE] = (value - last) / (end - last_end)
    seen[step_events.LAST_TIME], seen[step_events.LAST_VALUE] = end, value
    new = end - value / seen[step_events.RATE] if seen[step_events.RATE] != 0.0 else end
    if detector.margins.action[k] == CONTACT and new - t <= ROUND_OFF * end:
        detector.event[0], control.counts[SOUGHT], figures[STOP] = k, 0, math.inf
        return CROSSES
    near = near or has_jumped(detector, control, t, value) or abs(new - end) <= ROUND_OFF * end
    away = not t < new < seen[step_events.AFTER] and (not small or new <= t)
    if near or away or control.counts[SOUGHT] == SEARCHES:
        if near or small:
            detector.event[0] = k
            return NO_EVENT
        # The dense output of the long pair was wrong by more. This pair may have the event within.
        control.counts[SOUGHT], figures[STOP] = 0, math.inf
        figures[NEXT] *= MISLED
        return AGAIN
    control.counts[SOUGHT] += 1
    figures[STOP] = new
    return AGAIN


@kernel
def has_jumped(detector: Detector, control: StepControl, t: float, value: float) -> bool:
    """Whether the force of a contact changes its sign right at the start ``t`` of the pair, as it
    does where a pair begins at a kink of a surface, on the near side of it.
    """
    margs, figures, k = detector.margins, control.figures, control.event[0]
    soonest = max(TOO_SMALL * figures[END], 2.0 * step_events.SOON * figures[NEXT])
    of_force = margs.kind[k] == margins.FORCE or margs.kind[k] == margins.FRICTION
    return of_force and figures[STOP] - t <= soonest and value * detector.ends[0, k] < 0.0


@kernel
def take_halves(
    subsystem: CollocationWorkspace,
    control: StepControl,
    detector: Detector | None,
    h: float,
    row: int,
) -> bool:
    """Take a pair of steps of size ``h``/2 and save their ends; return whether both were solved."""
    workspace, stages = subsystem.workspace, subsystem.stages
    for half in range(2):
        if not take_step(subsystem, control, 0.5 * h, h):
            return False
        record_figures(
            workspace.system,
            workspace.state,
            workspace.start,
            0.5 * h,
            workspace.monitor,
            row + half,
        )
        dense_output.save_end(control.middle if half == 0 else control.end, workspace)
        save_margins(detector, workspace, 1 + half)
        for k in range(stages.last_rates.shape[0]):
            copy(stages.last_rates[k], subsystem.half_rates[half, k])
        for k in range(stages.Z.shape[0]):
            copy(stages.Z[k], subsystem.half_solution[half, k])
        tree_stages.save_half(subsystem.tree, half)
    copy_state(workspace.state, control.finish)
    return True


@kernel
def take_step(subsystem: CollocationWorkspace, control: StepControl, h: float, pair: float) -> bool:
    """Take a step of size ``h``, only in joint coordinates where a shorter ``pair`` [s] than this
    one is to be taken; return whether it was solved.
    """
    figures = control.figures
    shorter = figures[SHORTER] > 0.0 and figures[POSSIBLE] < WORTH * pair
    if shorter and tree_stages.comes_first(subsystem.tree):
        given = subsystem.tree, subsystem.workspace, subsystem.stages, subsystem.outcome
        return tree_step.take_step(*given, h)
    return newton.take_step(subsystem, h)


@kernel
def take_long_step(subsystem: CollocationWorkspace, control: StepControl, h: float) -> bool:
    """Take a step of size ``h`` from the start of the pair; return whether it was solved."""
    restore_start(subsystem, control)
    join_halves(subsystem, control.start.time[0], h)
    if not take_step(subsystem, control, h, h):
        return False
    if control.checks_rows:
        save_middle(subsystem, control, h)
    return True


@kernel
def save_middle(subsystem: CollocationWorkspace, control: StepControl, h: float) -> None:
    """Save the middle of the long step, by its dense output."""
    output = subsystem.dense_output
    dense_output.save_end(output.end, subsystem.workspace)
    dense_output.fit(output, subsystem.instant, dense_output.EVERY)
    dense_output.set_basis_weights(output, output.level[0], 0.5)
    dense_output.interpolate(output, h, 0.5)
    copy(output.workspace.state.x, control.x)
    copy(output.workspace.state.p, control.p)


@kernel
def middle_difference(subsystem: CollocationWorkspace, control: StepControl) -> tuple[float, float]:
    """Difference [m] between the dense output of the long step and the pair at its middle, plus
    that of their auxiliary states over the largest of these, times the length of the system; and
    how much of that is rounding error.
    """
    figures, frames = control.figures, subsystem.workspace.system.frames
    error, length, other, any_states = 0.0, largest_body(subsystem), 0.0, False
    h = control.end.time[0] - control.start.time[0]
    auxiliary = subsystem.workspace.state.auxiliary
    for b in range(control.x.shape[0] - 1):
        u = sub(at(control.middle.x, b), at(control.x, b))
        c = compose(at(control.middle.p, b), inverse(at(control.p, b)))
        error = max(error, math.sqrt(dot(u, u)) + frames.length[b] * math.sqrt(dot(c, c)))
    for k in range(auxiliary.size):
        state = control.end.auxiliary[k]
        figures[STATES + k] = max(figures[STATES + k], abs(state))
        off = abs(state - auxiliary[k])
        noise = ROUND_OFF * (h * control.terms[0, k] + control.terms[1, k])
        if not off <= noise:  # a NaN counts
            any_states, other = True, max(other, length * off / figures[STATES + k])
    return error + other, ROUND_OFF * length if any_states else 0.0


@kernel
def work_difference(
    subsystem: CollocationWorkspace, control: StepControl, row: int, blurred: float
) -> tuple[float, float]:
    """Difference [m] between the works of the pair and of the long step over the energy, times the
    length of the system; and how much of that is rounding error, where positions are known to
    within ``blurred`` [m].
    """
    figures, rows = control.figures, subsystem.workspace.monitor.rows
    speed = max(rows[row, SPEED], rows[row + 1, SPEED])
    figures[FASTEST] = max(figures[FASTEST], speed)
    figures[ENERGY] = max(figures[ENERGY], rows[row, KINETIC], rows[row + 1, KINETIC])
    if figures[FASTEST] <= figures[SHARE]:
        return 0.0, 0.0
    work, size, done, of_long = 0.0, figures[ENERGY], 0.0, subsystem.workspace.state.work
    for w in range(of_long.size):
        work = max(work, abs(control.end.work[w] - of_long[w]))
        size = max(size, abs(of_long[w]))
        done = max(done, abs(control.end.work[w] - control.start.work[w]))
    if size == 0.0:
        return 0.0, 0.0
    length = largest_body(subsystem)
    moved = (control.end.time[0] - control.start.time[0]) * speed
    unknown = done * blurred / max(moved, blurred) if blurred > 0.0 else 0.0
    return length * work / size, length * (ROUND_OFF + unknown / size)


@kernel
def largest_body(subsystem: CollocationWorkspace) -> float:
    """Length of the largest body [m], by which relative errors count as positions."""
    length, frames = 0.0, subsystem.workspace.system.frames
    for b in range(moving_count(frames)):
        length = max(length, frames.length[b])
    return length


@kernel
def end_difference(subsystem: CollocationWorkspace, control: StepControl) -> tuple[float, float]:
    """Difference [m] between the ends of the pair and of the long step, where the state is, and how
    much of that is rounding error.
    """
    state, end = subsystem.workspace.state, control.end
    frames, error, size = subsystem.workspace.system.frames, 0.0, 0.0
    for b in range(state.x.shape[0] - 1):
        u = sub(at(end.x, b), at(state.x, b))
        c = compose(at(end.p, b), inverse(at(state.p, b)))
        length = frames.length[b]
        error = max(error, math.sqrt(dot(u, u)) + length * math.sqrt(dot(c, c)))
        size = max(size, math.sqrt(dot(at(end.x, b), at(end.x, b))) + length)
    return error, ROUND_OFF * size


@kernel
def restore_start(subsystem: CollocationWorkspace, control: StepControl) -> None:
    """Bring the state back to the start of the pair."""
    workspace = subsystem.workspace
    copy_state(control.start, workspace.state)
    evaluate.prepare(workspace.system, workspace.state, workspace.start)


@kernel
def restore_end(
    subsystem: CollocationWorkspace, control: StepControl, h: float, predicted_well: float
) -> None:
    """Bring the state back to the end of the pair, and let the next prediction follow the
    polynomials of its second half, of size ``h``.
    """
    workspace, stages = subsystem.workspace, subsystem.stages
    copy_state(control.finish, workspace.state)
    evaluate.prepare(workspace.system, workspace.state, workspace.start)
    for k in range(stages.last_rates.shape[0]):
        copy(subsystem.half_rates[1, k], stages.last_rates[k])
    for k in range(stages.Z.shape[0]):
        copy(subsystem.half_solution[1, k], stages.Z[k])
    tree_stages.follow_half(subsystem.tree)
    stages.last_step[0], stages.last_step[1] = control.middle.time[0], h
    stages.predicted_well[0] = predicted_well


@kernel
def join_halves(subsystem: CollocationWorkspace, t: float, h: float) -> None:
    """Let the next prediction follow the polynomials of both halves of a step ``h`` from ``t``."""
    stages, halves = subsystem.stages, subsystem.halves
    s = halves.rate_half.size
    for i in range(s):
        rates = subsystem.half_rates[halves.rate_half[i]]
        solution = subsystem.half_solution[halves.multiplier_half[i]]
        for node in range(rates.shape[1]):
            for k in range(3):
                stages.last_rates[i, node, k] = 0.0
                for j in range(s + 1):
                    stages.last_rates[i, node, k] += halves.rates[i, j] * rates[j, node, k]
        for node in range(solution.shape[1]):
            for k in range(3):
                stages.Z[i, node, k] = 0.0
                for j in range(s):
                    stages.Z[i, node, k] += halves.multipliers[i, j] * solution[j, node, k]
    stages.last_step[0], stages.last_step[1] = t, h
    if not tree_stages.follow_halves(subsystem.tree, halves):
        stages.last_step[1] = 0.0


@kernel
def write_rows(subsystem: CollocationWorkspace, control: StepControl, times: np.ndarray) -> None:
    """Write the rows of the ``times`` that the accepted pair has passed."""
    output = subsystem.dense_output
    for half in range(2):
        end = control.middle if half == 0 else control.end
        t, h = output.begin.time[0], end.time[0] - output.begin.time[0]
        dense_output.copy_end(end, output.end)
        fitted = False
        while control.counts[ROWS] < times.size:
            row = control.counts[ROWS]
            if times[row] > t + h * (1.0 + 1e-9):
                break
            if not fitted:
                dense_output.fit(output, subsystem.instant, dense_output.DIVERGES)
                fitted = True
            dense_output.write_row(output, subsystem.instant, (times[row] - t) / h, row)
            control.counts[ROWS] += 1
        dense_output.copy_end(end, output.begin)
