"""Detects the events of one subsystem for a stepper."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from msahl.events.margins import (
    CONTACT,
    COORDINATE,
    CROSSING,
    END,
    FORCE,
    FRICTION,
    KINK,
    REACTING,
    Margins,
    await_conditions,
)
from msahl.events.search import Event
from msahl.expressions.tape import FREE
from msahl.jit.compiled import Call, compiled
from msahl.jit.storage import Storage
from msahl.schemes import step_events
from msahl.schemes.collocation.dense_output import DenseOutput
from msahl.schemes.common.accelerations import Instant, new_instant
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.step_events import (
    AFTER,
    ARMED,
    GUESS,
    KNOWN,
    LEVEL,
    NEAR,
    RATE,
    SLIDES,
    SOON,
    Detector,
    new_detector,
)
from msahl.system.contacts import Contacts
from msahl.system.switches import Conditions

SAME_TIME = 1e-12
"""Difference of two times, as a fraction of them, that is round-off."""
AFTER_JUMP = 1e-9
"""Time after a jump of velocities, as a fraction of the time, at which it has happened for sure."""
OVERLAPS = 10.0
"""Overlap, over the round-off of the gap, of a contact that has closed before: the steps of the
search for another one leave one of it."""
PASSED = 1e-10
"""Distance behind a kink over that before it, or the other way round, that is not round-off."""
BEGINNING = 1.5
"""Time of an event of a contact, over the soonest one, up to which it is at the start."""
KEPT = ("crossed", "loose", "often", "holds", "slides")
"""Arrays of the detector that a run needs to go on."""
COMPILED: dict[Any, Any] = {
    kernel: compiled(kernel)
    for kernel in (
        step_events.begin_step,
        step_events.has_event,
        step_events.cross,
        step_events.release,
        step_events.blame_switches,
        step_events.set_margins,
    )
}


class Detection:
    """The ``Detector`` that a stepper passes to its compiled loop, and what it does itself where
    that loop has seen an event or could not solve a step.
    """

    def __init__(
        self,
        found: Margins,
        workspace: Workspace,
        output: DenseOutput,
        instant: Instant | None,
        storage: Storage,
        contacts: Contacts | None = None,
        conditions: Conditions | None = None,
    ) -> None:
        self.workspace, self.storage, self.conditions = workspace, storage, conditions
        self.gaps = 0 if contacts is None else contacts.row.size
        self.contacts = self.gaps + int((found.kind == FRICTION).sum())
        reacts = bool(np.isin(found.kind, (FORCE, REACTING)).any()) or self.contacts
        pressing = new_instant(workspace.system, workspace.unknowns) if reacts else None
        fresh = new_detector(found, workspace.state, output, instant, pressing)
        self.detector: Detector = storage.place(("events", id(output)), fresh)
        self.splits = self.detector.divides or bool(found.known.time.size)
        self.set_size(0.0)

    @property
    def calls(self) -> list[Call]:
        """As ``Stepper.calls``: what divides steps."""
        if not self.splits:
            return []
        step, values = (self.detector, self.workspace), COMPILED[step_events.set_margins]
        taken = COMPILED[step_events.begin_step], COMPILED[step_events.has_event]
        cross = COMPILED[step_events.cross], (self.detector, 0, 0.0)
        release = COMPILED[step_events.release], (self.detector, 0.0, False)
        blame = COMPILED[step_events.blame_switches], (self.detector, 0.0)
        calls = (*((kernel, step) for kernel in taken), cross, release, blame)
        return [*calls, (values, (*step, self.detector.probe))]

    def set_size(self, h: float) -> None:
        """Let times differ by round-off of the run, or of steps ``h`` [s]."""
        times = self.detector.margins.known.time
        latest = float(times[-1]) if times.size else 0.0
        self.detector.figures[NEAR] = max(SAME_TIME * latest, SOON * h)

    def known_part(self, h: float) -> float:
        """Return the part of a step ``h`` up to the first known time in it, 1 if there is none."""
        t, near = float(self.workspace.state.time[0]), float(self.detector.figures[NEAR])
        times = self.detector.margins.known.time
        first = np.searchsorted(times, t + near, side="right")
        if first == times.size or times[first] >= t + h - near:
            return 1.0
        return float(times[first] - t) / h

    def cross(self, event: Event) -> None:
        """Go on beyond the level of an ``event``, from the present time."""
        t = float(self.workspace.state.time[0])
        self._call(step_events.cross, self.detector, event.margin, t)

    def time_of_a_width(self, event: Event) -> float:
        """Time [s] in which the rate or the slip of an ``event`` changes by the width of its
        friction law; infinite if it is of another kind.
        """
        width = float(self.detector.margins.width[event.margin])
        return width / abs(event.rate) if width > 0.0 and event.rate else math.inf

    @property
    def counters(self) -> dict[str, Any]:
        """What later steps depend on, as JSON can hold it: which switches are held, when they have
        crossed, and along which level the motion slides.
        """
        detector = self.detector
        found = {name: getattr(detector, name).tolist() for name in KEPT}
        return {**found, "since": float(detector.figures[SLIDES])}

    def restore(self, counters: dict[str, Any]) -> None:
        """Restore what ``counters`` returned."""
        for name in KEPT:
            kept = getattr(self.detector, name)
            kept[:] = np.reshape(counters[name], kept.shape)  # JSON has no shape of no rows
        self.detector.figures[SLIDES] = counters["since"]

    @property
    def holds(self) -> bool:
        """Whether a switch is held, other than by the time."""
        own = self.detector.margins
        return bool((own.held[own.switch[own.jumps]] != FREE).any())

    def release(self, forever: bool) -> None:
        """Let the switches be free in the next step, or from then on ``forever``."""
        t = float(self.workspace.state.time[0])
        self._call(step_events.release, self.detector, t, forever)

    def blame(self) -> None:
        """Look for a switch that keeps a step from the present time from being solved."""
        t = float(self.workspace.state.time[0])
        self._call(step_events.blame_switches, self.detector, t)

    @property
    def finite(self) -> bool:
        """Whether the expressions of the motion have values, after ``value``."""
        signals, values = self.workspace.system.forces.signals, self.workspace.start.forces.signals
        if signals is None:
            return True
        places = np.concatenate([signals.rate, signals.result])
        return bool(np.isfinite(values.values.value[places]).all())

    @property
    def sliding(self) -> tuple[int, float] | None:
        """The switch of expressions along whose level the motion slides, and since when [s]."""
        k = int(self.detector.slides[0])
        if k < 0:
            return None
        return int(self.detector.margins.switch[k]), float(self.detector.figures[SLIDES])

    def arm(self, time: float) -> None:
        """Let events after ``time`` [s] end the run, and know nothing of the steps before."""
        self.detector.figures[ARMED], self.detector.figures[KNOWN] = time, np.nan
        self.detector.event[0] = -1
        self.set_conditions()

    def set_conditions(self) -> None:
        """Look for what the conditions of events wait for now."""
        if self.conditions is not None:
            await_conditions(self.detector.margins, self._first_condition, self.conditions)

    @property
    def _first_contact(self) -> int:
        """The first margin of a contact; those of contacts are the last."""
        return int(self.detector.margins.kind.size) - self.contacts

    def contact_of(self, event: Event) -> int | None:
        """Return the number of the contact that opens or closes at an ``event``, or behind all of
        them that of the one with friction that sticks or slides; None if it is of another kind.
        """
        k = event.margin - self._first_contact
        if k < self.gaps:
            return k if k >= 0 else None
        return self.gaps + int(self.detector.margins.item[event.margin])

    @property
    def _first_condition(self) -> int:
        """The first margin of a condition of the deck's events, before those of contacts."""
        count = 0 if self.conditions is None else self.conditions.place.size
        return self._first_contact - count

    def condition_of(self, event: Event) -> int | None:
        """Return the number of the condition that becomes true or false at an ``event``, None if it
        is of another kind.
        """
        return event.margin - self._first_condition if self.is_condition(event.margin) else None

    def is_condition(self, margin: int) -> bool:
        """Whether a ``margin`` is that of a condition of the deck's events."""
        return self._first_condition <= margin < self._first_contact

    def condition_values(self) -> np.ndarray:
        """(e,) margins of the conditions of events in the present state."""
        self._call(step_events.set_margins, self.detector, self.workspace, self.detector.probe)
        return self.detector.probe[self._first_condition : self._first_contact].copy()

    def condition_size(self, k: int) -> float:
        """Return the largest margin of condition ``k`` in the step that was examined last."""
        return float(np.abs(self.detector.value[:, self._first_condition + k]).max())

    def follow(self, other: "Detection") -> None:
        """Take over the switches from ``other``, which had the contacts of another mode."""
        size = self._first_contact
        self.set_conditions()
        for name in KEPT[:-1]:
            getattr(self.detector, name)[:size] = getattr(other.detector, name)[:size]
        self.detector.slides[:] = other.detector.slides
        for figure in (ARMED, NEAR, SLIDES):
            self.detector.figures[figure] = other.detector.figures[figure]
        self.detector.figures[KNOWN], self.detector.event[0] = np.nan, -1

    def forget_sides(self) -> None:
        """Let switches be held where the present state has them, as it has jumped."""
        own, detector = self.detector.margins, self.detector
        own.held[own.switch[own.jumps & (detector.holds > 0)]] = FREE
        detector.figures[KNOWN] = np.nan
        self.forget()

    def forget(self) -> None:
        """Let no event have been found."""
        self.detector.event[0] = -1

    def begin(self, resolves: bool) -> None:
        """Save the start of a step that Python takes, with free switches unless it ``resolves``
        events.
        """
        if not resolves:
            self.release(forever=False)
        self._call(step_events.begin_step, self.detector, self.workspace)

    def look(self) -> Event | None:
        """Return the first event in the step that Python has taken; then the state is as before."""
        self._call(step_events.has_event, self.detector, self.workspace)
        return self.event()

    def event(self) -> Event | None:
        """Return the event in the last step, or None."""
        k, figures = int(self.detector.event[0]), self.detector.figures
        if k < 0:
            return None
        ends_run = bool(self.detector.margins.action[k] == END)
        guess, after, level, rate = (float(figures[i]) for i in (GUESS, AFTER, LEVEL, RATE))
        begin, end = self.detector.output.begin.time[0], self.detector.output.end.time[0]
        # A contact whose gap is closed where the step begins is found at the first place looked at;
        # so is the condition of an event.
        soonest = BEGINNING * SOON * (end - begin) if k >= self._first_condition else 0.0
        at_start = bool(guess <= begin + soonest)
        return Event(k, ends_run, guess, after, level, rate, at_start)

    def stop_in_jump(self) -> Event | None:
        """Return the event that ends the run if a condition holds in the present state, whose
        velocities have just jumped.
        """
        margins, figures = self.detector.margins, self.detector.figures
        t = float(self.workspace.state.time[0])
        ending = np.flatnonzero(margins.action == END)
        if not ending.size or t < figures[ARMED]:
            return None
        values = [self.value(int(k)) for k in ending]
        k = int(np.argmax(values))
        if values[k] <= 0.0:
            return None
        after = t + max(AFTER_JUMP * abs(t), float(figures[NEAR]))
        return Event(int(ending[k]), True, t, after, 0.0, math.inf, at_start=True)

    def missed(self, since: float, but: int) -> Event | None:
        """Return the first kink of a distance, or end of a gap, ``but`` that of one margin, that
        has been passed from ``since`` [s] on, the start of the step that was examined last, to the
        present state, or None.
        """
        own, before, now = self.detector.margins, self.detector.value[0], self.detector.probe
        self._call(step_events.set_margins, self.detector, self.workspace, now)
        less, more = np.sort(np.abs([before, now]), axis=0)
        passed = (own.kind == KINK) & (before * now < 0.0) & (less > PASSED * more)
        level = np.where(own.kind == KINK, 0.0, own.level)
        ends = own.direction * (now - level) > OVERLAPS * own.near
        ends &= own.direction * (before - level) < 0.0
        passed |= np.isin(own.kind, (COORDINATE, CROSSING)) & (own.action == CONTACT) & ends
        passed[but] = False
        if not passed.any():
            return None
        t = float(self.workspace.state.time[0])
        part = np.full(now.size, math.inf)
        part[passed] = (before - level)[passed] / (before - now)[passed]
        k = int(np.argmin(part))
        rate = float(now[k] - before[k]) / (t - since)
        return Event(k, False, since + float(part[k]) * (t - since), t, float(level[k]), rate)

    def round_off(self, k: int) -> float:
        """Return the round-off of margin ``k`` if it is a gap, else 0."""
        own = self.detector.margins
        is_gap = own.action[k] == CONTACT and own.kind[k] in (COORDINATE, CROSSING)
        return float(own.near[k]) if is_gap else 0.0

    def is_force(self, k: int) -> bool:
        """Return whether margin ``k`` is a force of a contact, or what is left of its grip."""
        own = self.detector.margins
        return bool(own.action[k] == CONTACT and own.kind[k] in (FORCE, FRICTION))

    def value(self, k: int) -> float:
        """Return margin ``k`` of the present state."""
        self._call(step_events.set_margins, self.detector, self.workspace, self.detector.probe)
        return float(self.detector.probe[k])

    def _call(self, kernel: Callable[..., Any], *arguments: Any) -> None:
        """Call a ``kernel``, compiled if steps are divided; else only hard steps need it."""
        if self.splits:
            COMPILED[kernel](*arguments)
        else:
            self.storage.call(kernel, *arguments)
