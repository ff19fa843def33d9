"""Looks for events within a step: a margin that leaves its range, also if it has come back.

After a step the margins (``events.margins``) are known at its ends. They are evaluated once more in
its middle, on the motion interpolated from positions and velocities at the ends. Where one of them
is outside its range, or nearer to a level than the three values deviate from a line, the dense
output of the step is examined: at ``SAMPLES`` equal intervals, and between three neighbours where
the parabola through them comes near a level, at its largest value by golden sections. So a margin
that touches a level and comes back is seen. The first time outside is found by bisection there.

The dense output of schemes of order 2 is the cubic motion itself: a parabola in free flight, which
is exact. What is found is where to begin: the time of an event is that at which steps that are
taken up to it have the margin at the level, for which ``events.search`` takes them.

A step holds the switches of expressions that may jump at what they are at its start. After a step
up to the level of one it is held on the other side (``cross``). If the margin then leaves that side
at once, it was there for round-off only, or the motion touches the level, or it slides: on both
sides the motion leads to the other one. A switch that has crossed back at the same time is free in
the next step; where that goes on, the motion slides. Where an expression has no value with a held
switch, as a root beyond the level, switches are held no more.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import copy
from msahl.events import margins
from msahl.events.margins import END, FORCE, FRICTION, REACTING, Margins
from msahl.expressions.tape import FREE
from msahl.formulations.absolute.frames import first_multiplier
from msahl.jit.kernel import apart, kernel, optional, unit
from msahl.ports import forces, sliding
from msahl.schemes.collocation import dense_output
from msahl.schemes.collocation.dense_output import COARSE, DenseOutput, StepEnd, new_step_end
from msahl.schemes.common.accelerations import Instant, accelerate
from msahl.schemes.common.workspace import Workspace
from msahl.system import evaluate
from msahl.system.arrays import State
from msahl.system.state import copy_state

SAMPLES = 8
"""Intervals of a step in which margins are examined. One that leaves its range and comes back twice
within two of them may be taken for one that does so once."""
GOLDEN, SECTIONS = 0.5 * (math.sqrt(5.0) - 1.0), 20
"""Factor and number of golden sections: to 2e-5 of a step."""
BISECTIONS = 40
SLOPE = 1e-4
"""Fraction of a step over which the rate of a margin is taken."""
SOON = 1e-9
"""Smallest part of a step at whose end an event is sought."""
EARLY = 0.05
"""Fraction of the time until a margin is beyond its level at which it is there already if it leaves
its side at once."""
OFTEN, AGAIN = 4, 2
"""Steps with a free switch after which the motion slides, each at most so many after the last."""
ARMED, KNOWN, GUESS, AFTER, LEVEL, RATE, LAST_TIME, LAST_VALUE, NEAR, SLIDES = range(10)
"""Places in ``Detector.figures``: time of the first step in which events may end the run; time for
which values at the start of a step are known [s]; of the event that was found the time by the dense
output and a time after it [s], the level and the margin's rate; the end [s] of the last step taken
up to it, and what the margin was beyond the level there; difference of times that is round-off, and
time since which the motion slides [s]."""


class Detector(NamedTuple):
    """What is examined in the steps of one subsystem, and the event found last."""

    margins: Margins
    divides: bool  # whether events divide steps
    figures: np.ndarray  # (10,) see above
    event: np.ndarray  # (1,) the margin that has an event in the last step, or -1
    ends: np.ndarray  # (3, m) margins at the ends of steps: two, or three of a pair
    value: np.ndarray  # (SAMPLES + 1, m) within a step
    probe: np.ndarray  # (m,)
    low: np.ndarray  # (m,) levels between which a margin may be in the step
    high: np.ndarray  # (m,)
    slack: np.ndarray  # (m,) by which it may be beyond
    crossed: np.ndarray  # (m,) time at which its switch crossed last [s]
    loose: np.ndarray  # (m,) time since which its switch is free, as it has crossed back [s]
    often: np.ndarray  # (m, 2) how often that was so lately, and steps since
    holds: np.ndarray  # (m,) whether its switch is held in steps: 0 or 1; -1 once motion slides
    slides: np.ndarray  # (1,) the first margin along whose level the motion slides, or -1
    before: State  # at the start of the step
    begin: StepEnd  # of a pair of steps
    output: DenseOutput
    instant: Instant | None  # for the dense output of schemes of higher order
    pressing: Instant | None  # for forces of contacts and reactions; None: no margin needs them


def new_detector(
    margins: Margins,
    state: State,
    output: DenseOutput,
    instant: Instant | None,
    pressing: Instant | None = None,
) -> Detector:
    """Return what the ``margins`` need in steps from a ``state``. Nothing ends the run yet."""
    count = margins.kind.size
    figures = np.zeros(10)
    figures[ARMED], figures[KNOWN], figures[SLIDES] = math.inf, math.nan, math.inf
    return Detector(
        margins=margins,
        divides=bool((margins.action != END).any()),
        figures=figures,
        event=np.full(1, -1),
        ends=np.zeros((3, count)),
        value=np.zeros((SAMPLES + 1, count)),
        probe=np.zeros(count),
        low=np.zeros(count),
        high=np.zeros(count),
        slack=np.zeros(count),
        crossed=np.full(count, math.nan),
        loose=np.full(count, math.nan),
        often=np.zeros((count, 2), dtype=np.int64),
        holds=margins.jumps.astype(np.int64),
        slides=np.full(1, -1),
        before=State(*(array.copy() for array in state)),
        begin=new_step_end(state),
        output=output,
        instant=instant,
        pressing=pressing,
    )


@kernel
def is_armed(detector: Detector, t: float) -> bool:
    """Whether events may end the run in a step from ``t`` [s]."""
    return t >= detector.figures[ARMED]


@kernel
def is_idle(detector: Detector, t: float) -> bool:
    """Whether no event can count in a step from ``t`` [s]."""
    return not (detector.divides or is_armed(detector, t))


@kernel
def begin_step(detector: Detector, workspace: Workspace) -> None:
    """Save the start of a step, in which switches are held."""
    state = workspace.state
    t = state.time[0]
    dense_output.save_end(detector.output.begin, workspace)
    detector.event[0] = -1
    if margins.hold_known(detector.margins, t, detector.figures[NEAR]):
        detector.figures[KNOWN] = math.nan
    update_slips(detector, workspace)
    if detector.figures[KNOWN] != t and not is_idle(detector, t):
        set_margins(detector, workspace, detector.ends[0])
    hold_switches(detector, t)
    copy_state(state, detector.before)


@kernel
def update_slips(detector: Detector, workspace: Workspace) -> None:
    """Let the slips of contacts count along their directions at the start of a step."""
    own, start = detector.margins, workspace.start
    sliding.update_directions(
        *(workspace.system.forces.sliding, workspace.system.scalar, start.scalar, start.frames),
        *(own.coordinate, own.rate, detector.figures[KNOWN : KNOWN + 1]),
    )


@kernel
def set_margins(detector: Detector, workspace: Workspace, value: np.ndarray) -> None:
    """Set ``value`` (m,) to the margins of the prepared state."""
    margins.set_values(detector.margins, workspace.system, workspace.start, value)
    set_forces(detector.pressing, detector.margins, workspace, value)


@optional()
def set_forces(
    pressing: Instant, margins: Margins, workspace: Workspace, value: np.ndarray
) -> None:
    """Set the margins in ``value`` (m,) that are forces of closed contacts or depend on reactions,
    by the accelerations of the prepared state. What it holds of the last step stays.
    """
    system, state, start, solved = workspace.system, workspace.state, workspace.start, False
    first = first_multiplier(system.frames)
    for k in range(value.size):
        kind, item = margins.kind[k], margins.item[k]
        if kind != FORCE and kind != REACTING and kind != FRICTION:
            continue
        if not solved:
            copy(state.force, pressing.force)
            copy(state.reaction, pressing.reaction)
            accelerate(system, state, start, pressing)
            if margins.has_expressions:
                given = system.forces.signals, start.forces, system.scalar
                forces.set_expressions_by(*given, state.reaction, pressing.reaction)
            copy(pressing.force, state.force)
            copy(pressing.reaction, state.reaction)
            solved = True
        if kind == REACTING:
            value[k] = forces.expression_at(system.forces.signals, start.forces, item)
        elif kind == FRICTION:
            value[k] = sliding.margin(
                *(system.forces.sliding, system.scalar, item, margins.rate),
                *(pressing.solution[first:], system.unit),
            )
        else:
            node, slot = item // 3, item % 3
            value[k] = pressing.solution[first + node, slot] * system.unit[node, slot]


@kernel
def hold_switches(detector: Detector, t: float) -> None:
    """Hold the free switches at what they are at ``t`` [s], the start of a step."""
    own = detector.margins
    for k in range(own.switch.size):
        if detector.holds[k] > 0 and own.held[own.switch[k]] == FREE and detector.loose[k] != t:
            own.held[own.switch[k]] = margins.side_of(own, k, detector.ends[0, k])


@kernel
def has_known_time(detector: Detector, t: float, h: float) -> bool:
    """Whether a step ``h`` from ``t`` [s] has a known time within it, at which it is divided."""
    known, near = detector.margins.known, detector.figures[NEAR]
    if known.time.size == 0:
        return False
    first = margins.next_known(known, t, near)
    if first == known.time.size or known.time[first] >= t + h - near:
        return False
    detector.event[0] = -1
    return True


@kernel
def cross(detector: Detector, k: int, t: float) -> None:
    """Hold the switch of margin ``k``, if it has one, at its other side from ``t`` [s] on; it is
    free if it has come from there at the same time.
    """
    own, s = detector.margins, detector.margins.switch[k]
    detector.figures[KNOWN] = math.nan
    if not margins.is_held(own, k):
        return
    if detector.crossed[k] != t:
        detector.crossed[k] = t
        own.held[s] = margins.other_side(own, k, detector.figures[LEVEL])
        return
    own.held[s], detector.loose[k] = FREE, t
    often = detector.often[k]
    often[0] = often[0] + 1 if often[1] <= AGAIN else 1
    often[1] = 0
    if often[0] >= OFTEN:
        save_sliding(detector, k, t)


@kernel
def save_sliding(detector: Detector, k: int, t: float) -> None:
    """Save that the motion slides along the level of margin ``k`` since ``t`` [s]; steps are not
    divided there any more.
    """
    detector.holds[k] = -1
    if detector.slides[0] < 0:
        detector.slides[0], detector.figures[SLIDES] = k, t


@kernel
def blame_switches(detector: Detector, t: float) -> bool:
    """Save that the motion slides if a step from ``t`` [s] cannot be solved and a switch has
    crossed back there: no force between those on both sides makes it stay.
    """
    for k in range(detector.loose.size):
        if detector.loose[k] == t and detector.crossed[k] == t and detector.holds[k] > 0:
            save_sliding(detector, k, t)
            return True
    return False


@kernel
def release(detector: Detector, t: float, forever: bool) -> bool:
    """Let all switches be free in a step from ``t`` [s], or from then on ``forever``; return
    whether one was held.
    """
    own, was_held = detector.margins, False
    for k in range(own.switch.size):
        if margins.is_held(own, k):
            was_held, own.held[own.switch[k]] = True, FREE
            if forever:
                detector.holds[k] = min(detector.holds[k], 0)
        detector.loose[k] = t
    detector.figures[KNOWN] = math.nan
    return was_held


@kernel
def count_step(detector: Detector) -> None:
    """Count an accepted step."""
    for k in range(detector.often.shape[0]):
        detector.often[k, 1] += 1


@kernel
def has_event(detector: Detector, workspace: Workspace) -> bool:
    """Whether an event occurs in the step just taken. If so, the state is as before the step."""
    if is_idle(detector, detector.output.begin.time[0]):
        return False
    dense_output.save_end(detector.output.end, workspace)
    set_margins(detector, workspace, detector.ends[1])
    if not find_event(detector, 0):
        for k in range(detector.low.size):
            detector.ends[0, k] = detector.ends[1, k]
        detector.figures[KNOWN] = workspace.state.time[0]
        count_step(detector)
        return False
    go_back(detector, workspace)
    return True


@apart
def go_back(detector: Detector, workspace: Workspace) -> None:
    """Bring the state back to the start of the step."""
    copy_state(detector.before, workspace.state)
    evaluate.prepare(workspace.system, workspace.state, workspace.start)
    clear(workspace.mean_force)
    clear(workspace.mean_reaction)
    detector.figures[KNOWN] = math.nan


@kernel
def clear(values: np.ndarray) -> None:
    """Set ``values`` (n, k) to zero."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            values[i, j] = 0.0


@unit
def find_event(detector: Detector, first: int) -> bool:
    """Look for an event between ``begin`` and ``end`` of the dense output, at which the margins
    are the rows ``first`` and ``first + 1`` of the ``ends``.
    """
    detector.event[0] = -1
    output, last = detector.output, detector.value.shape[0] - 1
    for k in range(detector.low.size):
        detector.value[0, k], detector.value[2, k] = (
            detector.ends[first, k],
            detector.ends[first + 1, k],
        )
    dense_output.fit_ends(output)
    sample(detector, COARSE, 0.5, detector.value[1])
    set_ranges(detector, 3)
    if not is_near_level(detector):
        return False
    level = COARSE
    if fit(detector.instant, output) > 0.0:
        level = output.level[0]
    for k in range(detector.low.size):
        detector.value[last, k] = detector.ends[first + 1, k]
    for i in range(1, last):
        sample(detector, level, i / last, detector.value[i])
    set_ranges(detector, last + 1)
    before, after = 0.0, 0.0
    for i in range(1, last + 1):
        if i > 1:
            after = turning_point(detector, level, i - 1)
            before = (i - 2) / last
        if after == 0.0 and outside(detector, detector.value[i]) >= 0:
            before, after = (i - 1) / last, i / last
        if after > 0.0:
            save_event(detector, level, before, after)
            return True
    return False


@optional(0.0)
def fit(instant: Instant, output: DenseOutput) -> float:
    """Fit the dense output of a step of higher order; 1 if there is one."""
    dense_output.fit(output, instant, dense_output.EVERY)
    return 1.0


@apart
def sample(detector: Detector, level: int, tau: float, value: np.ndarray) -> None:
    """Set ``value`` (m,) to the margins at the fraction ``tau`` of a step, by a ``level`` of the
    dense output.
    """
    output, workspace = detector.output, detector.output.workspace
    h = output.end.time[0] - output.begin.time[0]
    dense_output.set_auxiliary(workspace.system.forces.signals, output, level, h, tau)
    dense_output.set_basis_weights(output, level, tau)
    dense_output.interpolate(output, h, tau)
    set_margins(detector, workspace, value)


@apart
def set_ranges(detector: Detector, count: int) -> None:
    """Set the ranges of the margins from the first of ``count`` values that is not at a level;
    those that do not count now have none.
    """
    value = detector.value
    armed = is_armed(detector, detector.output.begin.time[0])
    for k in range(detector.low.size):
        detector.low[k], detector.high[k], change = -math.inf, math.inf, 0.0
        if (detector.margins.action[k] == END and not armed) or detector.holds[k] < 0:
            continue
        for i in range(1, count):
            change = max(change, abs(value[i, k] - value[0, k]))
        for i in range(count):
            low, high, slack = margins.free_range(detector.margins, k, value[i, k], change)
            detector.low[k], detector.high[k], detector.slack[k] = low, high, slack
            if low > -math.inf or high < math.inf:
                break


@kernel
def outside(detector: Detector, value: np.ndarray) -> int:
    """Return the first margin whose ``value`` is outside its range, -1 if none is."""
    for k in range(value.size):
        # Written so that a nan, at which a run cannot go on either, counts as outside.
        within = (
            detector.low[k] - detector.slack[k] <= value[k] <= detector.high[k] + detector.slack[k]
        )
        if not within and (detector.low[k] > -math.inf or detector.high[k] < math.inf):
            return k
    return -1


@kernel
def split(detector: Detector, value: np.ndarray) -> int:
    """Return the first margin of a law that is not smooth whose ``value`` has passed its level, be
    it by little, -1 if none has: what jumps there is its doing.
    """
    margs = detector.margins
    for k in range(value.size):
        splits = margs.action[k] == margins.SPLIT and not margins.is_held(margs, k)
        if splits and not detector.low[k] <= value[k] <= detector.high[k]:
            return k
    return -1


@kernel
def is_near_level(detector: Detector) -> bool:
    """Whether a margin, known at three times of the step, may leave its range within it."""
    value = detector.value
    for i in range(1, 3):
        if outside(detector, value[i]) >= 0:
            return True
    for k in range(detector.low.size):
        bend = abs(value[0, k] - 2.0 * value[1, k] + value[2, k])
        largest = max(value[0, k], value[1, k], value[2, k])
        smallest = min(value[0, k], value[1, k], value[2, k])
        high, low = detector.high[k] + detector.slack[k], detector.low[k] - detector.slack[k]
        if largest + bend > high or smallest - bend < low:
            return True
    return False


@kernel
def turning_point(detector: Detector, level: int, i: int) -> float:
    """Fraction of the step, between the samples ``i - 1`` and ``i + 1``, at which a margin is
    outside its range, though it is not at ``i``; 0 if there is none.
    """
    value, last = detector.value, detector.value.shape[0] - 1
    for k in range(detector.low.size):
        bend = abs(value[i - 1, k] - 2.0 * value[i, k] + value[i + 1, k])
        for side in (1.0, -1.0):
            edge = detector.high[k] if side > 0.0 else detector.low[k]
            if math.isinf(edge) or outside(detector, value[i]) >= 0:
                continue
            a, b, c = side * value[i - 1, k], side * value[i, k], side * value[i + 1, k]
            bends = abs(c - a) < 2.0 * bend and 2.0 * b > a + c
            if bends and max(a, b, c) + bend > side * edge + detector.slack[k]:
                tau = peak(detector, level, k, side, (i - 1) / last, (i + 1) / last)
                if tau > 0.0:
                    return tau
    return 0.0


@apart
def peak(detector: Detector, level: int, k: int, side: float, left: float, right: float) -> float:
    """Fraction of the step between ``left`` and ``right`` at which ``side`` times margin ``k`` is
    largest; 0 if no margin is outside its range there.
    """
    inner, outer = right - GOLDEN * (right - left), left + GOLDEN * (right - left)
    at_inner, at_outer = probe(detector, level, k, inner), probe(detector, level, k, outer)
    for _ in range(SECTIONS):
        if side * at_inner > side * at_outer:
            right, outer, at_outer = outer, inner, at_inner
            inner = right - GOLDEN * (right - left)
            at_inner = probe(detector, level, k, inner)
        else:
            left, inner, at_inner = inner, outer, at_outer
            outer = left + GOLDEN * (right - left)
            at_outer = probe(detector, level, k, outer)
    tau = 0.5 * (left + right)
    probe(detector, level, k, tau)
    return tau if outside(detector, detector.probe) >= 0 else 0.0


@kernel
def probe(detector: Detector, level: int, k: int, tau: float) -> float:
    """Return margin ``k`` at the fraction ``tau`` of the step; ``Detector.probe`` receives all."""
    sample(detector, level, tau, detector.probe)
    return detector.probe[k]


@apart
def save_event(detector: Detector, level: int, before: float, after: float) -> None:
    """Save the first event between two fractions of a step, outside the ranges at the second."""
    figures, output, last = detector.figures, detector.output, after
    t, h = output.begin.time[0], output.end.time[0] - output.begin.time[0]
    for _ in range(BISECTIONS):
        middle = 0.5 * (before + after)
        sample(detector, level, middle, detector.probe)
        if outside(detector, detector.probe) >= 0:
            after = middle
        else:
            before = middle
    sample(detector, level, after, detector.probe)
    k = split(detector, detector.probe)
    if k < 0:
        k = outside(detector, detector.probe)
    edge = detector.high[k]
    if detector.probe[k] < detector.low[k]:
        edge = detector.low[k]
    beyond = detector.probe[k] - edge
    left, right = max(0.0, after - SLOPE), min(1.0, after + SLOPE)
    rise = -probe(detector, level, k, left)
    rise += probe(detector, level, k, right)
    rate = rise / (right - left)
    figures[AFTER] = t + h * last
    tau = after - beyond / rate if rate != 0.0 else after
    if tau > after + SLOPE:
        tau = after  # it has jumped there, where a load or a curvature jumps
    figures[GUESS] = t + h * min(max(tau, SOON), 1.0)
    figures[LEVEL], figures[RATE] = edge, rate / h
    early = probe(detector, level, k, EARLY * after) - edge
    if margins.is_held(detector.margins, k) and beyond * early > 0.0:
        figures[GUESS] = t
    detector.event[0] = k
