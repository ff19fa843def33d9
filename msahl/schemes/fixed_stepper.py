"""Takes steps of a given size by any scheme, and subdivides those that cannot be solved.

The solver ``newton`` is the compiled loop, ``root`` means ``scipy.optimize.root``, and ``auto``
starts with scipy; a step that the compiled loop does not solve is solved along a path from shorter
ones, else by scipy. A step that none solves is divided into two halves, each of these again where
needed, down to 2^-10 of it.

A step in which an event divides steps is taken in parts, up to the event and on from there, so the
next one begins where it would have begun; so is one with a time that is known to be a breakpoint.
The compiled loop returns where it sees either. A companion takes such parts in two halves: they may
be the same as those of the run, whose errors would not show.

The parts after a rate or a slip is at the width of a friction law, which it passes faster than a
step, begin with the time of one width, and each is twice as long as the last one, until they are
steps again: no stage of a longer part would see where friction falls short of its limit.
"""

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from msahl.events.search import Event, NoStep, time_of_zero
from msahl.jit.compiled import Call
from msahl.schemes.common.workspace import Workspace, prepare
from msahl.schemes.outcome import EVALUATION, STEP_WORK, Outcome, Requests
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Advance, Chunk, Stepper

if TYPE_CHECKING:
    from msahl.schemes.contact_steps import ContactSteps
    from msahl.schemes.detection import Detection

MAX_SUBDIVISIONS = 10
LARGEST_DENSE = 300
"""Largest number of unknowns for which ``auto`` calls scipy, whose algebra is dense: a step with
300 unknowns takes it tens of milliseconds, and the time grows with the third power."""
MOST_MISSED = 4
"""Most events before the one sought, each of which is sought in turn."""
MAX_PARTS = 16
"""Largest number of parts of a step: what happens more often is not resolved by such steps, and the
rest of the step is taken as if there were no events."""


MOST_PIECES = 500
"""Largest number of parts into which contacts divide a step, events or not: those of a step whose
equations have no solution become ever shorter."""
SMALLER, SHORTER_PARTS = 0.125, 3
"""Part of a step that is taken where a slip that begins seems to end in it, and how often."""
SHORTEST = 1e-14
"""Fraction of a step that is none: round-off of its times."""
NEAR, CLOSE = 1e-9, 1e-12
"""Fractions of a step by which it may pass an event of friction or of a force, and another one,
where the rest of the step would be as short: slips and forces would be round-off over its time. The
next step begins with the event."""
FINEST = 2.0**-20
"""Least fraction of a step with which parts begin that resolve friction: rates of change that are
differences over a shorter one are round-off."""
TOO_SHORT = 1e-7
"""Fraction of a step up to which an event by the forces of contacts is one at its start: in steps
of this size forces that keep gaps closed are round-off over the square of their time, and sliding
does work by them. What a force changes by in it is as small."""


class _Undivided(Exception):  # noqa: N818 - an outcome
    """A step is to be taken without looking for events."""


class StepMethod(Protocol):
    """How one scheme solves its steps; ``FixedStepper`` decides which of these calls to make."""

    workspace: Workspace
    degree: int  # of the polynomials; 0 for the schemes of order 2
    varies: bool  # whether ``take_varied`` will be called
    most_divisions: float  # of one step and its parts
    detection: "Detection | None"  # None if the system has no margins

    @property
    def kind(self) -> str:
        """Name of the compiled code that the steps need."""

    @property
    def calls(self) -> list[Call]:
        """As ``Stepper.calls``, of the compiled loop."""

    @property
    def rare_calls(self) -> list[Call]:
        """As ``Stepper.calls``, of steps that the compiled loop does not solve."""

    @property
    def memory(self) -> Any:
        """As ``Stepper.memory``."""

    @property
    def counters(self) -> dict[str, Any]:
        """As ``Stepper.counters``."""

    def restore(self, counters: dict[str, Any]) -> None:
        """As ``Stepper.restore``."""

    def set_degree(self, degree: int) -> None:
        """Take the next steps by polynomials of this ``degree``."""

    @property
    def forms(self) -> np.ndarray | None:
        """As ``Stepper.forms``."""

    def set_forms(self, forms: np.ndarray) -> None:
        """Take the steps of the next chunk in absolute coordinates where ``forms`` (m,) is 0."""

    def begin_again(self, other: Any) -> None:
        """Go on where an ``other`` method of the same kind and state stands, with other contacts
        closed, and remember nothing of earlier steps.
        """

    def take_steps(self, h: float, first: int, last: int, schedule: OutputSchedule) -> int:
        """Take and record steps ``first``..``last - 1`` in compiled code; the number of the first
        that was not solved or has an event, ``last`` if there is none.
        """

    def take_varied(self, sizes: np.ndarray, first: int, schedule: OutputSchedule) -> int:
        """As ``Stepper.take_varied``, after ``varies`` was set."""

    def take_step(self, h: float, share: float) -> Outcome:
        """Take one step of size ``h``, a ``share`` of the requested one, in compiled code."""

    def take_step_by_scipy(
        self, h: float, share: float, count_work: Callable[[int], None]
    ) -> Outcome:
        """As ``take_step``, with scipy; ``count_work`` receives the work done."""

    def take_step_by_path(
        self, h: float, share: float, count_work: Callable[[int], None]
    ) -> Outcome:
        """As ``take_step_by_scipy``, along a path from shorter steps, if the scheme has that."""

    def record_step(self, h: float, step: int, schedule: OutputSchedule) -> None:
        """Write the monitor's row ``step`` and the rows of the tables that are due there."""

    def reset_prediction(self) -> None:
        """As ``Stepper.reset_prediction``."""


def begin_anew(method: Any, contacts: "ContactSteps | None") -> Any:
    """Let a ``method`` and its ``contacts`` do what ``Stepper.begin_anew`` asks for; return the
    method of the steps to follow. Raises ``ContactsUnsolved``.
    """
    workspace = method.workspace
    if method.detection:
        method.detection.forget_sides()
    prepare(workspace)
    method.reset_prediction()
    return contacts.change(method, None) if contacts else method


class FixedStepper:
    """A ``Stepper`` with steps of a given size.

    ``may_compile`` says whether ``auto`` may use the compiled loop, ``large`` whether the subsystem
    is too large for scipy.
    """

    def __init__(
        self, method: StepMethod, solver: str, contacts: "ContactSteps | None" = None
    ) -> None:
        self.contacts, self.h = contacts, 0.0
        self.most_parts = MAX_PARTS if contacts is None else contacts.most_events
        self.method, self.solver, self.workspace = method, solver, method.workspace
        self.requests = Requests()
        self.armed = math.inf
        self.halves_parts = self.half_taken = False
        self.divisions = 0  # of the present step and its parts
        self.solved_part = math.inf  # share of a step of the last part that was shorter than asked
        self.resolving = math.inf  # longest part that the next may be after a friction's width [s]
        self.scipy_steps = self.path_steps = self.subdivisions = 0
        unknowns = self.workspace.unknowns.free.size
        self.large = bool(unknowns * max(method.degree, 1) > LARGEST_DENSE)
        # scipy takes the first step of the schemes of order 2. It would have to be compiled for
        # the others as well, so there it is called only where the compiled loop fails.
        self.may_compile = method.degree > 0

    @property
    def kind(self) -> str:
        """See ``Stepper``."""
        return self.method.kind

    @property
    def calls(self) -> list[Call]:
        """See ``Stepper``."""
        if self.solver == "root":
            return self.method.rare_calls
        by_scipy = self.solver == "auto" and not self.may_compile and not self.large
        return [*self.method.calls, *(self.method.rare_calls if by_scipy else ())]

    @property
    def memory(self) -> Any:
        """See ``Stepper``."""
        return self.method.memory

    @property
    def counters(self) -> dict[str, Any]:
        """See ``Stepper``."""
        events = self.method.detection.counters if self.method.detection else {}
        contacts = self.contacts.counters if self.contacts else {}
        own = {"may_compile": self.may_compile, "resolving": self.resolving}
        return {**own, "events": events, "contacts": contacts, **self.method.counters}

    def restore(self, counters: dict[str, Any]) -> None:
        """See ``Stepper``."""
        self.may_compile, self.resolving = counters["may_compile"], counters["resolving"]
        if self.contacts:
            self.contacts.restore(counters["contacts"])
            self.method = self.contacts.method
        self.method.restore(counters)
        if self.method.detection:
            self.method.detection.restore(counters["events"])

    def reset_prediction(self) -> None:
        """See ``Stepper``."""
        self.method.reset_prediction()

    def vary_sizes(self, varies: bool) -> None:
        """See ``Stepper``; events are looked for in steps of one size."""
        self.method.varies = varies and self.method.degree > 0 and not self.method.detection

    def take_varied(self, sizes: np.ndarray, first: int, schedule: OutputSchedule) -> int:
        """See ``Stepper``."""
        if first == len(sizes) or not (self.method.varies and self._uses_compiled_loop()):
            return first
        return self.method.take_varied(sizes, first, schedule)

    def begin_anew(self) -> None:
        """See ``Stepper``."""
        self.method = begin_anew(self.method, self.contacts)

    @property
    def trouble(self) -> str:
        """See ``Stepper``."""
        return self.contacts.trouble if self.contacts else ""

    @property
    def sliding(self) -> tuple[int, float] | None:
        """See ``Stepper``."""
        return self.method.detection.sliding if self.method.detection else None

    def arm(self, time: float) -> None:
        """See ``Stepper``."""
        self.armed = time

    @property
    def forms(self) -> np.ndarray | None:
        """See ``Stepper``."""
        return self.method.forms

    def follow(self, other: Stepper, steps: int, parts: int) -> None:
        """See ``Stepper``."""
        degree = other.counters.get("degree", 0)
        if degree != self.method.degree:
            self.method.set_degree(degree)
        if other.forms is not None:
            self.method.set_forms(np.repeat(other.forms[:steps], parts))

    def smallest_tried(self, h: float) -> float:
        """See ``Stepper``."""
        return h / 2**MAX_SUBDIVISIONS

    def as_json(self) -> tuple[dict[str, Any] | None, dict[str, float]]:
        """See ``Stepper``."""
        return None, {}

    def advance(self, chunk: Chunk, patience: float = math.inf) -> Advance:
        """See ``Stepper``."""
        k, outcome, event = chunk.first, Outcome(0.0, -1), None
        began, self.h = time.perf_counter(), chunk.h
        parts: dict[int, tuple[float, ...]] = {}
        self._prepare_detection()
        while k < chunk.last:
            detection, tried = self.method.detection, False
            if self._uses_compiled_loop() and self.resolving == math.inf:
                tried = True
                k = self.method.take_steps(chunk.h, k, chunk.last, chunk.schedule)
                event = detection.event() if detection else None
            if k < chunk.last:
                if not (event and event.ends_run):
                    outcome, event, ends = self._take_single(chunk, k, tried and event is None)
                if event or not outcome.converged:
                    break
                if ends:
                    parts[k] = tuple(ends)
                k += 1
                self.may_compile = True
                if time.perf_counter() - began > patience:
                    break
        taken = max(0, k - chunk.first)
        ends_of_steps = chunk.ends[:taken]
        sizes = np.full(taken, chunk.h)
        return Advance(k, outcome, chunk.schedule, sizes, ends_of_steps, event, parts)

    def _prepare_detection(self) -> None:
        """Let the present method look for events as this stepper is to."""
        if self.method.detection:
            self.method.detection.arm(self.armed)
            self.method.detection.set_size(self.h)

    def _uses_compiled_loop(self) -> bool:
        return self.solver == "newton" or (
            self.solver == "auto" and (self.may_compile or self.large)
        )

    def _take_single(
        self, chunk: Chunk, step: int, tried: bool
    ) -> tuple[Outcome, Event | None, list[float]]:
        """Take one step and record it: in substeps if it is hard (the compiled loop has ``tried``
        it, if it may), in parts if it has events, at whose fractions of the step these end. On
        failure, or if an event ends the run within the step, the state is as before.
        """
        before, ends, events = self._saved(), [0.0], 0
        modes = self.contacts.counters if self.contacts else {}
        self.half_taken, self.solved_part, self.divisions = False, math.inf, 0
        self.reset_prediction()
        while True:
            try:
                outcome, event, part = self._take_next(chunk.h, ends[-1], events, tried)
            except _Undivided:
                self._go_back(before)
                ends, events, self.resolving = [0.0], self.most_parts, math.inf
                continue
            tried = False
            if not outcome.converged or (event and event.ends_run):
                self.reset_prediction()
                self._undo(before, modes)
                return outcome, event if outcome.converged else None, []
            done = ends[-1] + part >= 1.0 - SHORTEST
            if done:
                self._record(chunk, step, ends[-1], 1.0)
            elif part > 0.0:
                self._record(chunk, step, ends[-1], ends[-1] + part)
                ends.append(ends[-1] + part)
            if len(ends) > MOST_PIECES and self.contacts:
                self.contacts.give_up(len(ends))
                self._undo(before, modes)
                return Outcome(math.inf, -1), None, []
            if event and self.method.detection:
                events += 1
                crossed, stop = self._cross(event, events), None
                if crossed and self.contacts:
                    stop = self.method.detection.stop_in_jump()
                if stop or not crossed:
                    self._undo(before, modes)
                    return outcome if stop else Outcome(math.inf, -1), stop, []
            if done:
                return outcome, None, ends[1:]

    def _cross(self, event: Event, events: int) -> bool:
        """Go on beyond an ``event``, the last of so many ``events`` of a step; return whether that
        is possible.
        """
        assert self.method.detection
        self.method.detection.cross(event)
        time = self.method.detection.time_of_a_width(event)
        self.solved_part, self.resolving = math.inf, max(time, FINEST * self.h)
        if self.contacts is None:
            return True
        from msahl.contact.modes import ContactsUnsolved  # which few models need

        try:
            self.method = self.contacts.change(self.method, event)
        except ContactsUnsolved as error:
            self.contacts.fail(error)
            return False
        if events == self.most_parts:
            self.contacts.fail(None)
        return events < self.most_parts

    def _undo(self, before: list[np.ndarray], counters: dict[str, Any]) -> None:
        """Return to the state ``before`` a step, and to the contacts of these ``counters``."""
        self._go_back(before)
        self.resolving = math.inf
        if self.contacts:
            self.contacts.restore(counters)
            self.method = self.contacts.enter(self.method)
            self._prepare_detection()

    def _take_next(
        self, h: float, begun: float, events: int, tried: bool
    ) -> tuple[Outcome, Event | None, float]:
        """Take the next part of a step ``h`` of which a fraction has ``begun``, after so many
        ``events``; return the event at its end, and the fraction that it is. Raises ``_Undivided``
        if it is to be taken without events.
        """
        detection, rest = self.method.detection, 1.0 - begun
        if detection is None:
            return self._subdivide(h, 1.0, tried), None, rest
        part = rest * detection.known_part(rest * h)
        if self.contacts:
            part = min(part, self.contacts.time_left() / h)
        part = min(part, self.resolving / h * (0.5 if self.half_taken else 1.0))
        halves = self.halves_parts and not self.half_taken and (part < rest or begun > 0.0)
        part *= 0.5 if halves else 1.0
        detection.begin(events < self.most_parts)
        begin, holds = self._saved(), detection.holds
        outcome, part = self._solve_part(h, part, tried and part == 1.0, holds)
        event = detection.look() if outcome.converged and events < self.most_parts else None
        failed = not outcome.converged
        if event and not event.ends_run:
            if self._only_begins(event) and not holds:
                outcome, part, event = self._begin_slip(event, begin, h, part)
            else:
                event, part = self._take_to_first(event, begin, h, part)
                if self._may_share(halves) and SHORTEST < part < rest:
                    event, part, halves = self._take_half(event, begin, h, part)
                if event and self.contacts and math.isnan(part) and not holds:
                    (outcome, part), event = self._approach(event, begin, h), None
            failed = not (part == 0.0 or (part > 0.0 and (detection.finite or not holds)))
        if not failed:
            self.half_taken = halves and event is None
            self._lengthen(h)
            counts = event is not None and (event.ends_run or part < rest)
            return outcome, event if counts else None, part
        self._go_back(begin)
        if holds:
            detection.release(forever=True)
            return self._take_next(h, begun, events, False)
        if self.contacts and not event and self._opens_where_stuck(begin):
            return self._take_next(h, begun, events, False)
        detection.blame()
        if self.contacts is None and (event or 0 < events < MAX_PARTS):
            raise _Undivided
        return Outcome(math.inf, -1) if event else outcome, None, part

    def _may_share(self, halves: bool) -> bool:
        """Whether the part just taken may be the same in another run, as it is not one of two
        ``halves``.
        """
        return self.halves_parts and not halves and not self.half_taken

    def _take_half(
        self, event: Event, begin: list[np.ndarray], h: float, part: float
    ) -> tuple[Event | None, float, bool]:
        """Take the first half of a ``part`` of a step ``h`` that ends at an ``event``, or the part
        once more if the half cannot be solved or has an event; return the event at its end, what
        fraction it is, and whether it is a half.
        """
        detection = self.method.detection
        outcome, half = self._take_again(begin, h, 0.5 * part)
        if outcome.converged and half == 0.5 * part and detection and detection.look() is None:
            return None, half, True
        return event, self._take_part(event, begin, h, part), False

    def _lengthen(self, h: float) -> None:
        """Let the next part be twice as long as the one taken, up to a step ``h``."""
        if not self.half_taken:
            self.resolving *= 2.0
        if self.resolving >= h:
            self.resolving = math.inf

    def _opens_where_stuck(self, begin: list[np.ndarray]) -> bool:
        """Whether other contacts are closed in the steps from the ``begin`` of one that cannot be
        solved.
        """
        assert self.contacts
        new = self.contacts.change_where_stuck(self.method)
        if new is None:
            self._go_back(begin)
            return False
        self.method, self.solved_part = new, math.inf
        self._prepare_detection()
        return True

    def _solve_part(
        self, h: float, share: float, tried: bool, holds: bool
    ) -> tuple[Outcome, float]:
        """Do what ``_solve`` does, and return the share that is taken. With contacts one that is
        hard becomes a part of its own: events are to be found in its first half, as the second
        may have no solution beyond them, or one that slow solvers find and no motion has. Parts
        begin with twice the last one that could be solved.
        """
        if self.contacts is None or holds:
            return self._solve(h, share, tried, holds), share
        part = min(share, 2.0 * self.solved_part)
        for k in range(MAX_SUBDIVISIONS if self._uses_compiled_loop() else 0):
            if k > 0 or not tried:
                outcome = self.method.take_step(part * h, part)
                if outcome.converged:
                    self.solved_part = part if part < share else math.inf
                    return outcome, part
                self.reset_prediction()
            self.subdivisions, part = self.subdivisions + 1, 0.5 * part
        return self._solve(h, share, tried, False), share

    def _solve(self, h: float, share: float, tried: bool, holds: bool) -> Outcome:
        """Take a ``share`` of a step ``h``, in substeps if it is hard; only once while it ``holds``
        switches, as what these hold may have no value beyond the level.
        """
        if not holds:
            return self._subdivide(share * h, share, tried)
        if tried and self._uses_compiled_loop():
            return Outcome(math.inf, -1)
        return self._solve_once(share * h, share, False)

    def _only_begins(self, event: Event) -> bool:
        """Whether an ``event`` is the end of a slip that has begun at the present time."""
        return self.contacts is not None and self.contacts.only_begins(self.method, event)

    def _approach(self, event: Event, begin: list[np.ndarray], h: float) -> tuple[Outcome, float]:
        """Take a part of a step ``h`` half way to an ``event`` to which none can be taken: at the
        end of a slip its direction must be nearly that at the start of the part.
        """
        share = 0.5 * (event.guess - float(begin[0][0])) / h
        outcome, part = self._take_again(begin, h, share)
        return outcome, part if outcome.converged and part > SHORTEST else math.nan

    def _begin_slip(
        self, event: Event, begin: list[np.ndarray], h: float, solved: float
    ) -> tuple[Outcome, float, Event | None]:
        """Take a part of a step ``h``, of which a fraction ``solved`` has a solution, although a
        slip that begins seems to end in it by an ``event``; return the event at its end.

        Such a slip grows by the square of the time, so at first it is less than the error of the
        dense output. In a shorter part that is less as well; where it is not, the step is taken if
        the contact slips at its end.
        """
        detection, share = self.method.detection, solved
        assert detection
        for _ in range(SHORTER_PARTS):
            share *= SMALLER
            outcome, part = self._take_again(begin, h, share)
            found = detection.look() if outcome.converged else event
            if found is None:
                return outcome, part, None
            if not self._only_begins(found):
                return outcome, self._take_part(found, begin, h, part), found
        outcome, part = self._take_again(begin, h, solved)
        if outcome.converged and detection.value(event.margin) > event.level:
            return outcome, part, None
        part = self._take_part(event, begin, h, solved)
        if part > 0.0 or event.at_start:
            return outcome, part, event
        return *self._approach(event, begin, h), None

    def _take_again(self, begin: list[np.ndarray], h: float, share: float) -> tuple[Outcome, float]:
        """Take a ``share`` of a step ``h`` from its ``begin``, as ``_solve_part`` does."""
        self._go_back(begin)
        self.reset_prediction()
        return self._solve_part(h, share, False, False)

    def _take_to_first(
        self, event: Event, begin: list[np.ndarray], h: float, rest: float
    ) -> tuple[Event, float]:
        """Do what ``_take_part`` does up to an ``event``, or to a kink or the end of a gap before
        it: the dense output of a step beyond one may have others before it.
        """
        part, since = self._take_part(event, begin, h, rest), float(begin[0][0])
        if self.contacts is None or not part > 0.0:
            return event, part
        assert self.method.detection
        for _ in range(MOST_MISSED):
            first = self.method.detection.missed(since, event.margin)
            if first is None:
                break
            event, part = first, self._take_part(first, begin, h, part)
            if not part > 0.0:
                break
        return event, part

    def _take_part(self, event: Event, begin: list[np.ndarray], h: float, rest: float) -> float:
        """Take the part of a step ``h``, of which a fraction ``rest`` is left, that ends at the
        ``event``; return the fraction of the step that it is, nan if it cannot be solved. It is
        none, and not taken, for an event at the start.
        """
        detection, since = self.method.detection, float(begin[0][0])
        assert detection
        self.reset_prediction()
        if event.at_start or not math.isfinite(event.guess + event.rate):
            return 0.0 if event.at_start else math.nan
        sign = math.copysign(1.0, event.rate)

        def margin(tau: float) -> float:
            self._go_back(begin)
            self.reset_prediction()
            if not self._subdivide(tau * h, tau).converged:
                raise NoStep
            return sign * (detection.value(event.margin) - event.level)

        guess = (event.guess - since) / h
        try:
            near = detection.round_off(event.margin)
            part = time_of_zero(margin, guess, abs(event.rate) * h, 0.0, rest, near)
            has_width = detection.time_of_a_width(event) < math.inf
            passed = NEAR if has_width or detection.is_force(event.margin) else CLOSE
            if part < rest <= part + passed:
                margin(rest)
                part = rest
        except NoStep:
            return math.nan
        if part > (TOO_SHORT if detection.is_force(event.margin) else SHORTEST):
            return part
        self._go_back(begin)
        return 0.0

    def _record(self, chunk: Chunk, step: int, begin: float, end: float) -> None:
        """Record the part of a step from ``begin`` to ``end``, fractions of it."""
        schedule = chunk.schedule
        if begin > 0.0 or end < 1.0:
            schedule = schedule.part(step, begin, end)
        if end == 1.0 or schedule.due[step + 1] > schedule.due[step]:
            self.method.record_step(chunk.h, step, schedule)

    def _subdivide(
        self, h: float, share: float, tried: bool = False, depth: int = MAX_SUBDIVISIONS
    ) -> Outcome:
        """Take a step ``h``, a ``share`` of the requested one, or its two halves if it fails;
        ``tried``: the compiled loop has failed.
        """
        outcome = self._solve_once(h, share, tried)
        if outcome.converged or depth == 0 or self.divisions >= self.method.most_divisions:
            return outcome
        self.subdivisions, self.divisions = self.subdivisions + 1, self.divisions + 1
        outcome = self._subdivide(0.5 * h, 0.5 * share, depth=depth - 1)
        if not outcome.converged:
            return outcome
        return self._subdivide(0.5 * h, 0.5 * share, depth=depth - 1)

    def _solve_once(self, h: float, share: float, tried: bool) -> Outcome:
        """Take a step by one solver after the other; ``tried``: the compiled one has failed."""
        if self.solver == "newton" or (self.solver == "auto" and self.large):
            self.requests.after(EVALUATION + STEP_WORK * self.workspace.unknowns.free.size)
            return self.method.take_step(h, share)
        if self.solver == "root" or not self.may_compile:
            return self._solve_by_scipy(h, share)
        outcome = Outcome(math.inf, -1)
        if not tried:
            outcome = self.method.take_step(h, share)
        if not outcome.converged:
            self.reset_prediction()
            outcome = self.method.take_step_by_path(h, share, self.requests.after)
            self.path_steps += int(outcome.converged)
        return outcome if outcome.converged else self._solve_by_scipy(h, share)

    def _solve_by_scipy(self, h: float, share: float) -> Outcome:
        self.scipy_steps += 1
        return self.method.take_step_by_scipy(h, share, self.requests.after)

    def _saved(self) -> list[np.ndarray]:
        """Copies of what a step changes."""
        return [array.copy() for array in self._changing()]

    def _go_back(self, saved: list[np.ndarray]) -> None:
        """Bring the workspace back to what was saved."""
        for array, value in zip(self._changing(), saved, strict=True):
            array[:] = value
        if self.contacts:
            self.contacts.prepare()
        else:
            prepare(self.workspace)

    def _changing(self) -> list[np.ndarray]:
        workspace = self.workspace
        return [*workspace.state, workspace.mean_force, workspace.mean_reaction]
