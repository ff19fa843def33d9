"""Takes steps of the collocation schemes, of a given size or by a tolerance.

With a tolerance ``step_control`` chooses the sizes. Unless the degree is given as well, it is the
one that takes the least work per second of motion: after a number of pairs of steps the
neighbouring degrees are tried from the present state. Work is counted and not timed, so a run gives
the same results on every machine.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from msahl.contact.modes import ContactsUnsolved
from msahl.events.margins import UNCHANGING, Changing, Span, build_margins
from msahl.events.search import Event
from msahl.formulations.tree.table import Tree
from msahl.jit.compiled import Call, compiled
from msahl.jit.storage import Storage, doubles_in
from msahl.model.scheme import COLLOCATION
from msahl.schemes.collocation import (
    dense_output,
    newton,
    step_control,
    steps_to_event,
    varied_steps,
)
from msahl.schemes.collocation.newton import CollocationWorkspace, new_collocation_workspace
from msahl.schemes.collocation.step_control import ControlSettings
from msahl.schemes.collocation.tree.stages import ITERATIONS, SLOPES, STEPS, TreeStages
from msahl.schemes.common.workspace import Workspace, kind_of
from msahl.schemes.contact_steps import MOST_EVENTS, ContactSteps
from msahl.schemes.detection import Detection
from msahl.schemes.fixed_stepper import begin_anew
from msahl.schemes.outcome import Outcome, Requests
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import NO_TIMES, Advance, Chunk, Stepper
from msahl.system.cut import Cut

_take_steps = compiled(newton.take_steps)
_record_step = compiled(newton.record_step)
_take_steps_to_event = compiled(steps_to_event.take_steps)
_take_varied = compiled(varied_steps.take_steps)
_take_pairs = compiled(step_control.take_pairs)

NO_ROWS = np.zeros(0, dtype=np.int64)

FIRST_REVIEW, FIRST_IN_TREE, LONGEST_PAUSE = 16, 128, 128
"""Accepted pairs until the degree is reviewed: first, first in joint coordinates, where steps of
all degrees take about as long, and at most; the number doubles each time, so that reviews take a
few per cent of the work."""
SHORTER = 0.25
"""Size of the next pair, over that of the last, in which the end of a slip was not found."""
TRIES = 3
"""Largest number of pairs tried to find the step size at a degree."""
MUCH = 1.5
"""Work, over that of the neighbour, above which a degree is tried once only."""
WORTH = 0.9
"""Fraction of the present work below which the degree is changed."""


LEAST_IN_TREE = 2
"""Least degree that a tolerance chooses in joint coordinates, where that of 1 takes as long."""


FIRST_ROTATION = 0.3
"""Rotation of a body [rad], or displacement over its length, in the first pair tried, if that is
longer than the given step: pairs that meet a tolerance of 1e-6 m rotate bodies by about so much."""
LOOSE = 1e-4
"""Tolerance, over the length of the longest body, above which steps begin with degree 3; else with
degree 4. At 1e-3, 1e-6 and 1e-9 m these two take the least work for most of nine mechanisms."""


def first_degree(degrees: tuple[int, ...], tolerance: float) -> int:
    """Return with which of the ``degrees`` steps begin, by the ``tolerance`` over the length of the
    longest body.
    """
    wanted = 3 if tolerance > LOOSE else 4
    return max((degree for degree in degrees if degree <= wanted), default=degrees[0])


class CollocationMethod:
    """The ``StepMethod`` of a collocation ``scheme`` with polynomials of a ``degree``."""

    varies = False
    most_divisions = math.inf

    def __init__(
        self,
        workspace: Workspace,
        scheme: str,
        degree: int,
        span: Span,
        storage: Storage | None = None,
        tree: tuple[Tree, Cut | None] | None = None,
        changing: Changing = UNCHANGING,
    ) -> None:
        self.workspace, self.scheme, self.span, self.tree = workspace, scheme, span, tree
        self.storage = Storage() if storage is None else storage
        self.changing = changing
        self.fresh: dict[int, list[np.ndarray]] = {}  # memory of each degree as it was at first
        self.by_degree: dict[int, CollocationWorkspace] = {}
        self.detections: dict[int, Detection | None] = {}
        self.set_degree(degree)

    @property
    def kind(self) -> str:
        """See ``StepMethod``."""
        kind = kind_of(self.workspace.system)
        friction = "" if self.subsystem.pressed is None else "-friction"
        events = "-events" if self.detection else ""
        tree = "" if self.tree is None else "-loops" if self.tree[1] is not None else "-tree"
        return f"{kind}{friction}{tree}-collocation{events}"

    @property
    def calls(self) -> list[Call]:
        """See ``StepMethod``."""
        steps = 0.0, 0, 0, NO_ROWS, NO_TIMES
        if self.varies:
            return [(_take_varied, (self.subsystem, NO_TIMES, *steps[1:]))]
        plain, detection = (_take_steps, (self.subsystem, *steps)), self.detection
        if not detection:
            return [plain]
        parts = (
            [plain, (_record_step, (self.subsystem, 0.0, 0, NO_ROWS, NO_TIMES))]
            if detection.splits
            else []
        )
        given = _take_steps_to_event, (self.subsystem, detection.detector, *steps)
        return [given, *parts, *detection.calls]

    @property
    def rare_calls(self) -> list[Call]:
        """See ``StepMethod``; scipy is slow to import."""
        from msahl.schemes.collocation import scipy_root

        rows = (NO_ROWS, NO_TIMES)
        return [*scipy_root.calls(self.subsystem), (_record_step, (self.subsystem, 0.0, 0, *rows))]

    @property
    def memory(self) -> tuple[Any, ...]:
        """See ``StepMethod``."""
        stages, tree = self.subsystem.stages, self.subsystem.tree
        if tree is None:
            return (stages,)
        unknowns = () if tree.loops is None else (tree.loops.last_y,)
        slopes = () if tree.slopes is None else (tree.slopes.used,)
        return (stages, tree.last_rates, tree.figures, *slopes, *unknowns)

    @property
    def counters(self) -> dict[str, Any]:
        """See ``StepMethod``."""
        return {"degree": self.degree}

    def restore(self, counters: dict[str, Any]) -> None:
        """See ``StepMethod``."""
        self.set_degree(counters["degree"])

    def set_degree(self, degree: int) -> None:
        """See ``StepMethod``; steps in joint coordinates are tried again at once."""
        self.degree = degree
        if degree not in self.by_degree:
            like = next(iter(self.by_degree.values()), None)
            given = self.workspace, self.scheme, degree, self.tree
            fresh = new_collocation_workspace(*given, like)
            self.by_degree[degree] = self.storage.place((self.scheme, degree), fresh)
            self.detections[degree] = self._new_detection(self.by_degree[degree], degree)
        self.subsystem, self.detection = self.by_degree[degree], self.detections[degree]
        if any(self.changing) and degree not in self.fresh:
            kept = doubles_in(self.subsystem.stages)
            self.fresh[degree] = [array.copy() for array in kept]
        newton.reset_prediction(self.subsystem)

    def begin_again(self, other: "CollocationMethod") -> None:
        """See ``StepMethod``; nothing is left of what was before, so that a run that is resumed
        has the same steps.
        """
        self.set_degree(other.degree)
        stages = self.subsystem.stages
        for array, value in zip(doubles_in(stages), self.fresh[self.degree], strict=True):
            array[...] = value
        stages.first_energy[:] = other.subsystem.stages.first_energy

    @property
    def forms(self) -> np.ndarray | None:
        """See ``StepMethod``."""
        return None if self.subsystem.tree is None else self.subsystem.tree.forms

    def set_forms(self, forms: np.ndarray) -> None:
        """See ``StepMethod``."""
        if self.subsystem.tree is not None:
            self.subsystem.tree.given[: forms.size] = forms

    @property
    def work(self) -> float:
        """Work of the steps of this degree, but for a constant, in iterations of degree 1, absolute
        coordinates.
        """
        iterations, factorisations = self.workspace.counts.tolist()
        if self.subsystem.tree is None:
            return work_of(self.degree, iterations, factorisations)
        in_tree, steps, slopes = self.subsystem.tree.figures[[ITERATIONS, STEPS, SLOPES]].tolist()
        rest = work_of(self.degree, iterations - in_tree, factorisations - steps)
        return rest + work_in_tree(self.subsystem.tree, self.degree, in_tree, steps, slopes)

    def _new_detection(self, subsystem: CollocationWorkspace, degree: int) -> Detection | None:
        """What detects events, if there can be any."""
        order = COLLOCATION[self.scheme].order(degree)
        margins = build_margins(self.workspace.system, order, self.span, *self.changing)
        if margins is None:
            return None
        output, instant = subsystem.dense_output, subsystem.instant
        return Detection(margins, self.workspace, output, instant, self.storage, *self.changing)

    def take_steps(self, h: float, first: int, last: int, schedule: OutputSchedule) -> int:
        """See ``StepMethod``."""
        if self.detection:
            given = self.subsystem, self.detection.detector, h, first, last
            return int(_take_steps_to_event(*given, schedule.due, schedule.share))
        return int(_take_steps(self.subsystem, h, first, last, schedule.due, schedule.share))

    def take_varied(self, sizes: np.ndarray, first: int, schedule: OutputSchedule) -> int:
        """See ``StepMethod``."""
        given = self.subsystem, sizes, first, len(sizes), schedule.due, schedule.share
        return int(_take_varied(*given))

    def take_step(self, h: float, share: float) -> Outcome:
        """See ``StepMethod``; nothing here depends on the ``share``."""
        _take_steps(self.subsystem, h, 0, 1, NO_ROWS, NO_TIMES)
        return self._checked(self.outcome)

    def take_step_by_scipy(
        self, h: float, share: float, count_work: Callable[[int], None]
    ) -> Outcome:
        """See ``StepMethod``; scipy is slow to import."""
        from msahl.schemes.collocation import scipy_root

        return self._checked(scipy_root.take_step(self.subsystem, h, count_work))

    def take_step_by_path(
        self, h: float, share: float, count_work: Callable[[int], None]
    ) -> Outcome:
        """See ``StepMethod``; these schemes have none."""
        return Outcome(math.inf, -1)

    def record_step(self, h: float, step: int, schedule: OutputSchedule) -> None:
        """See ``StepMethod``."""
        _record_step(self.subsystem, h, step, schedule.due, schedule.share)

    def reset_prediction(self) -> None:
        """See ``StepMethod``."""
        self._forget()
        dense_output.save_end(self.subsystem.dense_output.begin, self.workspace)

    @property
    def outcome(self) -> Outcome:
        """Outcome of the last step that compiled code tried."""
        residual, worst = self.subsystem.outcome
        return Outcome(float(residual), int(worst))

    def _checked(self, outcome: Outcome) -> Outcome:
        """Return the ``outcome``; after a failure discard the predictor's history."""
        if not outcome.converged:
            self._forget()
        return outcome

    def _forget(self) -> None:
        """Begin the next step without what earlier ones have left: also without reactions that a
        step has iterated beyond all numbers.
        """
        newton.reset_prediction(self.subsystem)
        reaction = self.subsystem.stages.reaction
        if not np.isfinite(reaction).all():
            reaction[:] = self.workspace.state.reaction


class AdaptiveStepper:
    """A ``Stepper`` whose step sizes follow from a ``tolerance`` [m], of one of the ``degrees``.

    ``chosen`` lists the degrees with the time since when, and the work per second of motion that
    this degree and those it was compared with took then, in iterations of degree 1.
    """

    def __init__(
        self,
        method: CollocationMethod,
        degrees: tuple[int, ...],
        settings: ControlSettings,
        contacts: ContactSteps | None = None,
    ) -> None:
        self.contacts = contacts
        self.method, self.workspace = method, method.workspace
        least = 1 if method.tree is None else LEAST_IN_TREE
        self.degrees = tuple(d for d in degrees if d >= least) or degrees
        self.requests = Requests()
        self.armed = math.inf
        self.scipy_steps = self.path_steps = self.subdivisions = 0
        self.halves_parts = False  # no companion chooses its steps
        self.tolerance = settings.tolerance
        chunk = len(self.workspace.monitor.rows)
        control = step_control.new_step_control(method.subsystem, chunk, settings)
        self.control = method.storage.place("control", control)
        self.sizes: dict[int, float] = {}
        self.chosen: list[dict[str, Any]] = []
        self.review = FIRST_REVIEW if method.tree is None else FIRST_IN_TREE
        self.pause = min(2 * self.review, LONGEST_PAUSE)

    @property
    def kind(self) -> str:
        """See ``Stepper``."""
        return f"{self.method.kind}-adaptive"

    @property
    def calls(self) -> list[Call]:
        """See ``Stepper``."""
        return [(_take_pairs, self._pairs(0, NO_TIMES))]

    @property
    def memory(self) -> Any:
        """See ``Stepper``."""
        return self.method.memory, self.control.figures

    @property
    def counters(self) -> dict[str, Any]:
        """See ``Stepper``."""
        return {
            "degree": self.method.degree,
            "chosen": [*self.chosen],
            "review": [self.review, self.pause],
            "pairs": self.control.counts.tolist(),
            "events": self.method.detection.counters if self.method.detection else {},
            "contacts": self.contacts.counters if self.contacts else {},
        }

    def restore(self, counters: dict[str, Any]) -> None:
        """See ``Stepper``."""
        if self.contacts:
            self.contacts.restore(counters["contacts"])
            self.method = self.contacts.method
        self.method.restore(counters)
        self.chosen = [*counters["chosen"]]
        self.review, self.pause = counters["review"]
        self.control.counts[:] = counters["pairs"]
        if self.method.detection:
            self.method.detection.restore(counters["events"])

    def reset_prediction(self) -> None:
        """See ``Stepper``."""
        self.method.reset_prediction()

    def begin_anew(self) -> None:
        """See ``Stepper``."""
        self.method = begin_anew(self.method, self.contacts)
        if self.contacts:
            left = float(self.workspace.state.time[0]) + self.contacts.time_left()
            self.control.figures[step_control.STOP] = left

    @property
    def trouble(self) -> str:
        """See ``Stepper``."""
        return self.contacts.trouble if self.contacts else ""

    @property
    def sliding(self) -> tuple[int, float] | None:
        """See ``Stepper``."""
        return self.method.detection.sliding if self.method.detection else None

    def vary_sizes(self, varies: bool) -> None:
        """See ``Stepper``; no companion is of this class."""

    def take_varied(self, sizes: np.ndarray, first: int, schedule: OutputSchedule) -> int:
        """See ``Stepper``."""
        return first

    def arm(self, time: float) -> None:
        """See ``Stepper``."""
        self.armed = time

    @property
    def forms(self) -> np.ndarray | None:
        """See ``Stepper``."""
        return self.method.forms

    def follow(self, other: Stepper, steps: int, parts: int) -> None:
        """See ``Stepper``; no companion is of this class."""
        self.method.set_degree(other.counters["degree"])

    def smallest_tried(self, h: float) -> float:
        """See ``Stepper``."""
        return 0.5 * float(self.control.figures[step_control.NEXT])

    def advance(self, chunk: Chunk, patience: float = math.inf) -> Advance:
        """See ``Stepper``; no step at all means that the tolerance cannot be met."""
        most = min(chunk.last, len(self.control.sizes))
        self.control.figures[step_control.END] = float(chunk.times[-1])
        if len(self.degrees) > 1:
            accepted = int(self.control.counts[step_control.ACCEPTED])
            if not self.chosen:
                self._begin()
            elif accepted >= self.review:
                self._review_degree()
                self.review = accepted + self.pause
                self.pause = min(2 * self.pause, LONGEST_PAUSE)
            most = min(most, 2 * (self.review - accepted))
        done, event = self._take_to_event(max(2, most), chunk.times)
        ends = self.control.ends[:done].copy()
        rows = int(self.control.counts[step_control.ROWS])
        schedule = OutputSchedule.passed(chunk.times[:rows], chunk.begin, ends)
        sizes = self.control.sizes[:done]
        return Advance(done, self.method.outcome, schedule, sizes, ends, event)

    def _take_to_event(self, most: int, times: np.ndarray) -> tuple[int, Event | None]:
        """Take pairs up to the first event that opens or closes contacts, if there is one; return
        the number of steps, and the event that ends the run.
        """
        for _ in range(MOST_EVENTS):
            detection = self.method.detection
            if detection:
                detection.arm(self.armed)
            wanted = self.control.figures[step_control.NEXT]
            done = self._take_pairs(most, times)
            seen = detection.event() if detection else None
            if not (done or seen) and self._opens_where_stuck(wanted):
                continue
            if seen and seen.ends_run:
                return done, seen
            if not (self.contacts and detection and seen):
                return done, None
            if not step_control.changes_contacts(detection.detector, self.control) > 0.0:
                return done, None
            t, figures = float(self.workspace.state.time[0]), self.control.figures
            if not done and self.contacts.only_begins(self.method, seen):
                figures[step_control.NEXT] *= SHORTER
                figures[step_control.STOP] = t + self.contacts.time_left()
                detection.forget()
                continue
            try:
                self.method = self.contacts.change(self.method, seen)
            except ContactsUnsolved as error:  # again, and without steps, when it is called next
                self.contacts.fail(error)
                return done, None
            figures[step_control.STOP] = t + self.contacts.time_left()
            # What kept larger pairs from being solved is over: the end of a slip, for example.
            figures[step_control.CEILING] = math.inf
            assert self.method.detection
            stop = self.method.detection.stop_in_jump()
            if done or stop:
                return done, stop
        if self.contacts:
            self.contacts.fail(None)
        return 0, None

    def _opens_where_stuck(self, h: float) -> bool:
        """Whether other contacts are closed in the pairs that follow where none could be taken,
        the first of the size ``h``.
        """
        if self.contacts is None:
            return False
        saved = [array.copy() for array in self.workspace.state]
        new = self.contacts.change_where_stuck(self.method)
        if new is None:
            for array, value in zip(self.workspace.state, saved, strict=True):
                array[:] = value
            return False
        self.method = new
        t, figures = float(self.workspace.state.time[0]), self.control.figures
        figures[step_control.NEXT], figures[step_control.STOP] = h, t + self.contacts.time_left()
        return True

    def _take_pairs(self, most: int, times: np.ndarray) -> int:
        """Take pairs of steps, about ``most`` steps; the number of steps taken."""
        return int(_take_pairs(*self._pairs(most, times)))

    def _pairs(self, most: int, times: np.ndarray) -> tuple[Any, ...]:
        detector = self.method.detection.detector if self.method.detection else None
        return self.method.subsystem, self.control, detector, self.order, most, times

    @property
    def order(self) -> int:
        """Order of the steps of the present degree."""
        return COLLOCATION[self.method.scheme].order(self.method.degree)

    def as_json(self) -> tuple[dict[str, Any] | None, dict[str, float]]:
        """See ``Stepper`` [m, s]."""
        figures, counts = self.control.figures, self.control.counts
        report = {
            "localTolerance": self.tolerance,
            "acceptedPairs": int(counts[step_control.ACCEPTED]),
            "rejectedPairs": int(counts[step_control.REFUSED]),
            "stepMin": float(min(figures[step_control.SMALLEST], figures[step_control.WIDEST])),
            "stepMax": float(figures[step_control.WIDEST]),
            "degrees": self.chosen,
        }
        extremes = {
            "localErrorMax": float(figures[step_control.LARGEST]),
            "localErrorSum": float(figures[step_control.ERROR]),
        }
        return report, extremes

    def _begin(self) -> None:
        """Find the size of the first pair; its degree is that of the tolerance."""
        degree = self.method.degree
        given = float(self.control.figures[step_control.NEXT])
        self.sizes[degree] = max(given, time_to_rotate(self.workspace, FIRST_ROTATION))
        self._choose(degree, {degree: self._work_rate(degree, degree, math.inf)})

    def _review_degree(self) -> None:
        """Change to the degree that takes the least work, if the gain is worth it."""
        present = self.method.degree
        self.sizes[present] = float(self.control.figures[step_control.NEXT])
        work = {present: self._work_rate(present, present, math.inf)}
        for change in (1, -1):
            degree = present
            while degree + change in self.degrees and min(work, key=lambda d: work[d]) == degree:
                work[degree + change] = self._work_rate(degree + change, degree, work[degree])
                degree += change
        best = min(work, key=lambda degree: work[degree])
        self._choose(best if work[best] <= WORTH * work[present] else present, work)

    def _choose(self, best: int, work: dict[int, float]) -> None:
        """Take the ``best`` degree, which was compared with others by their ``work``."""
        if best != self.method.degree:
            self.method.set_degree(best)
        self.control.figures[step_control.NEXT] = self.sizes[best]
        if not self.chosen or self.chosen[-1]["degree"] != best:
            compared = {str(degree): work[degree] for degree in sorted(work)}
            since = float(self.workspace.state.time[0])
            self.chosen.append({"degree": best, "since": since, "work": compared})

    def _work_rate(self, degree: int, like: int, other: float) -> float:
        """Work per second of motion at this ``degree``, by pairs that are tried and taken back; the
        first has the size found for the degree ``like``, whose work is the ``other``.
        """
        figures, method = self.control.figures, self.method
        size = self.sizes[like]
        if degree != self.method.degree:
            self.method.set_degree(degree)
        for _ in range(TRIES):
            before, figures[step_control.NEXT] = method.work, size
            self._take_pairs(0, NO_TIMES)
            tried, size = size, float(figures[step_control.BEST])
            rate = (method.work - before) / size
            if 0.5 <= size / tried <= 2.0 or rate > MUCH * other:
                break
        self.sizes[degree] = size
        return rate


def time_to_rotate(workspace: Workspace, angle: float) -> float:
    """Time [s] in which a body rotates by an ``angle`` [rad], or moves by so many of its lengths,
    at the present speeds and accelerations; 0 where nothing moves.
    """
    state, length = workspace.state, workspace.system.frames.length[:, None]
    speed, acceleration = (
        float(np.linalg.norm(np.concatenate([rate / length, rotation]), axis=1).max())
        for rate, rotation in ((state.v, state.w), (state.a, state.alpha))
    )
    root = math.sqrt(speed**2 + 2.0 * acceleration * angle)
    return 2.0 * angle / (speed + root) if root > 0.0 else 0.0


def work_of(degree: int, iterations: float, factorisations: float) -> float:
    """Work of solved steps, in iterations of degree 1.

    By timings of pendulums, tops and four-bars: the cost of an iteration is proportional to 1 + s,
    that of a Jacobian with its factors to 2 + s^2/2; at degree 1 their ratio is 1 to 2.5.
    """
    return 0.5 * (1 + degree) * iterations + (2.0 + 0.5 * degree**2) * factorisations


def work_in_tree(
    tree: TreeStages, degree: int, iterations: float, steps: float, slopes: float
) -> float:
    """Work of steps in joint coordinates, in the same unit. All nodes are evaluated at once, so it
    does not depend on the degree but for what elements evaluate node by node: loads, and the
    equations of cut joints, whose factors are those of a small matrix; slopes of loads are those of
    one node. By timings of pendulums, a slide on a spring, a four-bar, a slider-crank, and of a
    robot, a suspension and a governor with slopes.
    """
    each = 0.12 if tree.tree.bare else 0.12 + 0.26 * degree
    set_anew = 0.8
    if tree.loops is not None:
        each += 0.2 + 0.1 * degree
        set_anew = 2.0
    return each * iterations + 0.6 * steps + set_anew * slopes
