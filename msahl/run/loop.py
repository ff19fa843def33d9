"""The time loop: chunks of steps of every island, their rows to the sink, a look at the clock.

Interruptions are honoured between chunks, so every row on disk is an accepted state.
"""

import errno
import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np

from msahl.elements import forces
from msahl.jit.compiled import is_kept, keep, trouble
from msahl.model import (
    INSTANTANEOUS,
    Model,
    Simulation,
    decays,
    degree_of,
    is_exponential,
    local_tolerance_of,
    order_of,
    reactions_of,
    tolerance_of,
)
from msahl.run.attempts import KNOWN_NUMBERS, Attempts
from msahl.run.error_estimate import (
    Companion,
    ErrorEstimate,
    Steps,
    choose_companion,
    unresolved_friction,
)
from msahl.run.snapshot import (
    ResumeError,
    Snapshot,
    counters,
    digest,
    recall,
    remember,
    set_counters,
)
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.verdict import Figures, judge, never_begun
from msahl.schemes.fixed_stepper import MAX_SUBDIVISIONS
from msahl.schemes.midpoint.free_equations import FAR
from msahl.schemes.outcome import TOLERANCE, Outcome, Stopped
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Chunk
from msahl.start.velocities import StartError
from msahl.system.diagnostics import Extremes
from msahl.system.momentum import Momentum, drift, is_alone, momentum
from msahl.system.names import describe_row, reaction_columns, state_columns, work_columns
from msahl.system.nonfinite import overflow
from msahl.system.subsystems import split

if TYPE_CHECKING:
    from msahl.schemes.collocation.stepper import AdaptiveStepper

CHUNK_SECONDS = 0.1
"""About how long the loop goes on between output, progress and a look at interruptions: less than
the 2 s in which it answers, should the machine become ten times slower."""
PATIENCE = 5.0 * CHUNK_SECONDS
"""Seconds after which a chunk is broken off if its steps have turned hard."""
SLOWEST = 16_000
"""Unknowns that a loop solves in a second at least, rescues apart: what the first chunk goes by."""
CHUNK_NUMBERS = 2_000_000
"""Most numbers published at once: bounds the memory whatever the scene and the run."""

SAVE_SECONDS = 2.0
"""Least time from one saved snapshot to the next: the most that a killed run loses."""
SAVE_SHARE = 0.01
"""Most of the run's time that saving may take: where the disk is slow it is done less often."""

WORTH_TELLING = 1e-12
"""Way an inconsistent velocity would go in a step, relative to the bodies' length, that is told."""
NO_ERRORS = np.zeros((0, 3))
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What the system says where there is no room."""
COLUMNS = (state_columns, reaction_columns, work_columns)
"""What heads the tables of states, reactions and work."""


class Sink(Protocol):
    """Where rows go: tables with the columns of ``system.names``, the time first."""

    def write(
        self, states: np.ndarray, reactions: np.ndarray, work: np.ndarray, errors: np.ndarray
    ) -> None:
        """Append rows; ``errors`` (m, 3) are time and estimated errors of positions and of
        orientations [m], without rows where they are not known.
        """

    def restart(self) -> None:
        """Drop all rows: the run begins anew, with smaller steps."""


ESTIMATE, LOCAL, OFF = ERRORS = ("estimate", "local", "off")
"""What is found out about the error: the global one, the sum of the steps' own, nothing."""


@dataclass(frozen=True, slots=True)
class Options:
    """What the user chose beside the deck; ``full`` makes no exact reduction of the equations,
    ``accuracy`` [m] replaces the deck's, and ``error`` says how the error is estimated: None is
    the global error where that is cheap.
    """

    solver: str = "auto"
    every: int = 1
    full: bool = False
    accuracy: float | None = None
    error: str | None = None


@dataclass(slots=True)
class Report:
    """What happened; becomes ``run.json``."""

    status: str = "running"
    message: str = ""
    output_times: int = 0
    steps: int = 0
    time: float = 0.0
    joints: int = 0
    subsystems: int = 0
    planar_subsystems: int = 0
    unknowns: int = 0
    degrees_of_freedom: dict[str, int] = field(default_factory=dict)
    non_unique_reactions: dict[str, list[str]] = field(default_factory=dict)
    iterations: int = 0
    factorisations: int = 0
    scipy_steps: int = 0
    subdivisions: int = 0
    warnings: list[str] = field(default_factory=list)
    resumed: list[float] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)
    extremes: dict[str, float | None] = field(default_factory=dict)
    step_control: dict[str, Any] | None = None
    error: dict[str, Any] | None = None
    verdict: dict[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The fields by name, as ``run.json`` shows them."""
        return {camel(name): value for name, value in asdict(self).items()}


def camel(name: str) -> str:
    """The name in camelCase, as ``run.json`` has it."""
    first, *rest = name.split("_")
    return first + "".join(word.capitalize() for word in rest)


@dataclass(frozen=True, slots=True)
class Grid:
    """Times of the steps' ends: ``n`` steps of ``h``, the last one shorter if it must."""

    h: float
    n: int
    t_final: float
    whole: bool

    @classmethod
    def of(cls, simulation: Simulation) -> "Grid":
        """The steps of a run."""
        return cls.between(simulation.dt, simulation.t_final)

    @classmethod
    def of_rows(cls, simulation: Simulation) -> "Grid":
        """The rows of a run, before they are thinned."""
        return cls.between(simulation.interval or simulation.dt, simulation.t_final)

    @classmethod
    def between(cls, dt: float, t_final: float) -> "Grid":
        """A ``t_final`` that is a whole number of steps to round-off is taken as just that."""
        n = max(1, int(np.ceil(t_final / dt * (1.0 - 1e-9))))
        whole = abs(n * dt - t_final) <= 1e-9 * t_final
        return cls(t_final / n if whole else dt, n, t_final, whole)

    def time(self, k: int) -> float:
        """End of step ``k``; as a quotient it rounds to the decimal a reader expects."""
        return self.t_final * k / self.n if self.whole else min(k * self.h, self.t_final)

    def times(self, k: np.ndarray) -> np.ndarray:
        """Ends of many steps, as ``time`` has them."""
        return self.t_final * k / self.n if self.whole else np.minimum(k * self.h, self.t_final)

    def count(self, t: float) -> int:
        """How many steps end until ``t``, those that do but for round-off among them."""
        k = int(t / self.h * (1.0 + 1e-9))
        return self.n if t >= self.t_final * (1.0 - 1e-12) else min(k, self.n - 1)

    def step(self, k: int) -> float:
        """Size of step ``k`` = 1..n."""
        return self.h if k < self.n or self.whole else self.t_final - (self.n - 1) * self.h


def no_run(status: str, message: str) -> Report:
    """What is told of a run that took no step."""
    return Report(status=status, message=message, verdict=never_begun(status).as_json())


def not_written(error: OSError, rows: str = "") -> str:
    """Why results could not be written, and what to do; ``rows`` says which of them are there."""
    if error.errno in (errno.ENOENT, errno.ENOTDIR, errno.ESTALE):
        return f"{error.filename}: the folder was removed or renamed while the run wrote into it"
    told = f"{error.filename}: {error.strerror or error}{rows}"
    return f"{told}. Make room there" if error.errno in FULL else told


def run(
    model: Model,
    options: Options,
    sink: Sink,
    progress: Callable[[int, float], Any] = lambda steps, t: None,
    stopped: Callable[[], bool] = lambda: False,
    tell: Callable[[str], Any] = lambda message: None,
    save: Callable[[Snapshot], Any] | None = None,
    since: Snapshot | None = None,
) -> Report:
    """Run ``model`` to its end, into ``sink``; ``progress`` is told of steps done and time, and
    ``tell`` what takes long before the first of them. ``save`` is given snapshots from time to
    time and when the run is stopped; a run that begins with one goes on ``since`` then, with the
    rows that the other would have had.

    A step that does not converge, a request to stop (``stopped``, KeyboardInterrupt), and a sink or
    ``save`` that raises OSError end the run, and the report says so. A start that cannot be is
    raised, as ``StartError``, and a snapshot of another scene as ``ResumeError``.
    """
    # What overflows is told in our own words (``_finite_steps``), not in numpy's.
    with np.errstate(all="ignore"):
        if tolerance_of(model) is None:
            return _Run(model, options, sink, save).go(progress, stopped, tell, since)
        return _run_to_tolerance(model, options, sink, save, progress, stopped, tell, since)


def _run_to_tolerance(
    model: Model,
    options: Options,
    sink: Sink,
    save: Callable[[Snapshot], Any] | None,
    progress: Callable[[int, float], Any],
    stopped: Callable[[], bool],
    tell: Callable[[str], Any],
    since: Snapshot | None,
) -> Report:
    """Run until the estimated global error is within the tolerance of ``model``: run, compare,
    run again with smaller steps. The rows of the last run stay.
    """
    attempts = Attempts(model)
    if since:
        attempts.recall(since.numbers["attempts"], since.memory)
    while True:
        simulation = replace(model.simulation, local_tolerance=attempts.local)
        run = _Run(replace(model, simulation=simulation), options, sink, save, attempts)
        report = run.go(progress, stopped, tell, since)
        if report.status != "completed" or not attempts.goes_on(run.estimate, run.size):
            return report
        since = None
        sink.restart()


class _Run:
    """One run under way."""

    def __init__(
        self,
        model: Model,
        options: Options,
        sink: Sink,
        save: Callable[[Snapshot], Any] | None,
        attempts: Attempts | None = None,
    ) -> None:
        began = time.perf_counter()
        self.model, self.options, self.sink, self.save = model, options, sink, save
        self.attempts = attempts
        self.grid = Grid.of(model.simulation)
        self.shown = Grid.of_rows(model.simulation)
        self.columns = [names(model) for names in COLUMNS]
        numbers = sum(len(columns) for columns in self.columns)
        a_step = math.ceil(self.grid.h / self.shown.h) + 1
        rows = max(self.grid.n, self.shown.n) + 1
        self.chunk = max(a_step, min(4096, rows, CHUNK_NUMBERS // numbers))
        # Islands whose steps follow from a tolerance go together: their figures are added up.
        together = options.full or local_tolerance_of(model) is not None
        subsystems = [model] if together else split(model)
        instantaneous = reactions_of(model) == INSTANTANEOUS
        self.integrators = [
            SubsystemIntegrator(i, options.solver, options.full, self.chunk, instantaneous)
            for i in subsystems
        ]
        stepper = self.integrators[0].stepper
        self.adaptive = (
            cast("AdaptiveStepper", stepper) if local_tolerance_of(model) is not None else None
        )
        self.reached = 0.0  # end of the last good step of these [s]
        self.estimate = self._estimate()
        place = [{name: i for i, name in enumerate(columns)} for columns in self.columns]
        self.places = [
            [
                [whole[c] for c in names(integrator.model)[1:]]
                for whole, names in zip(place, COLUMNS, strict=True)
            ]
            for integrator in self.integrators
        ]
        self.report = Report(
            joints=len(model.joints) + len(model.couplings),
            subsystems=len(subsystems),
            planar_subsystems=sum(integrator.axis is not None for integrator in self.integrators),
            unknowns=sum(
                integrator.workspace.unknowns.free.size for integrator in self.integrators
            ),
            degrees_of_freedom=_degrees_of_freedom(model, self.integrators),
            warnings=[w for integrator in self.integrators for w in _warnings(integrator)],
            seconds={
                "prepare": time.perf_counter() - began,
                "loop": 0.0,
                "output": 0.0,
                "checkpoints": 0.0,
            },
        )

    def _estimate(self) -> ErrorEstimate | None:
        """The estimate of the global error, unless it is not wanted or too expensive."""
        model, options, attempts = self.model, self.options, self.attempts
        accuracy = options.accuracy or model.simulation.limits.accuracy
        if options.error in (LOCAL, OFF):
            return None
        companion: Companion | None = attempts.known if attempts else None
        if companion is None:
            asked = options.error == ESTIMATE or accuracy is not None or attempts is not None
            companion = choose_companion(
                model, self.integrators, options.full, self.chunk, self.grid.n, asked
            )
        if companion is None:
            return None
        estimate = ErrorEstimate(model, self.integrators, companion, accuracy)
        if attempts and self.shown.n * sum(map(len, self.columns)) <= KNOWN_NUMBERS:
            estimate.keep_rows()
        return estimate

    def go(
        self,
        progress: Callable[[int, float], Any],
        stopped: Callable[[], bool],
        tell: Callable[[str], Any],
        since: Snapshot | None,
    ) -> Report:
        """Take all steps, or those ``since`` a snapshot."""
        report = self.report
        kinds = {
            f"{integrator.stepper.kind}-{self.options.solver}" for integrator in self.integrators
        }
        compiles = not all(is_kept(kind) for kind in kinds)
        if compiles:
            tell("compiling the step for this kind of scene, once")
        self.workspace = digest(self._all_runners) if self.save or since else ""
        for integrator in self.integrators:
            integrator.show_start()
        if (
            min(
                self._finite_steps(
                    1, OutputSchedule.at_ends(np.ones(1, dtype=bool)), self.grid.time
                )
            )
            < 1
        ):
            raise StartError(self.report.message)
        first = [integrator.workspace.monitor.rows[:1] for integrator in self.integrators]
        t_final = self.grid.t_final
        self.extremes = Extremes(first, sum(_energy_scale(r, t_final) for r in self.integrators))
        self.extremes.compare_with(sum(map(_work_of_reactions, self.integrators)))
        self.momenta = [_momentum(integrator) for integrator in self.integrators]
        report.status = "completed"
        if since:
            self._recall(since)
        else:
            errors = self.estimate.begin(self.integrators) if self.estimate else NO_ERRORS
            self._publish(np.zeros(1), errors)
        self.handed = self._standing()
        for integrator in self._all_runners:
            integrator.stepper.requests.stopped = stopped
        try:
            self._take_all(progress, stopped, 1 if compiles else self._first_steps())
        except Stopped:  # in the middle of a hard step
            self._go_back()
            self._interrupt()
            self._save()
        except KeyboardInterrupt:  # a second request to stop, in the middle of a chunk
            report.status = "interrupted"
            report.message = f"stopped at once, after t = {self.now:g} s"
            self._go_back()
        for kind in kinds:
            keep(kind)
        if trouble():
            tell(trouble())
        return self._finish()

    def _first_steps(self) -> int:
        """How many steps the first chunk is given."""
        return int(CHUNK_SECONDS * SLOWEST / max(1, self.report.unknowns))

    def _take_all(
        self, progress: Callable[[int, float], Any], stopped: Callable[[], bool], steps: int
    ) -> None:
        """Chunks of steps to the end, or as far as they go, the first of so many ``steps``."""
        report = self.report
        saved, pause = time.perf_counter(), SAVE_SECONDS
        take = self._take if self.adaptive is None else self._take_paced
        while not self.ended and report.status == "completed":
            began = time.perf_counter()
            take(max(1, min(steps, self.chunk)))
            seconds = time.perf_counter() - began
            progress(report.steps, self.now)
            # The first chunk may compile, and tells little; sizes grow until they fill their time.
            wanted = steps * CHUNK_SECONDS / max(seconds, 1e-9)
            steps = max(1, min(16 * steps, int(wanted), self.chunk))
            if report.status != "completed" or self.ended:
                break
            if stopped():
                self._interrupt()
            if report.status == "interrupted" or time.perf_counter() - saved > pause:
                pause = max(SAVE_SECONDS, self._save() / SAVE_SHARE)
                saved = time.perf_counter()

    def _interrupt(self) -> None:
        self.report.status = "interrupted"
        self.report.message = f"stopped at t = {self.now:g} s"

    @property
    def now(self) -> float:
        """Time that the run has come to [s]."""
        if self.adaptive is None:
            return self.grid.time(self.report.steps)
        return min(self.reached, self.grid.t_final)

    @property
    def ended(self) -> bool:
        """Whether all steps are taken."""
        if self.adaptive is None:
            return self.report.steps == self.grid.n
        return self.report.output_times == 1 + math.ceil(self.shown.n / self.options.every)

    def _save(self) -> float:
        """Have a snapshot of this moment kept; the seconds it took."""
        if self.save is None:
            return 0.0
        began = time.perf_counter()
        report = self.report
        numbers = {
            "steps": report.steps,
            "outputTimes": report.output_times,
            "resumed": report.resumed,
            "seconds": dict(report.seconds),
            "extremes": dict(vars(self.extremes)),
            "subsystems": [counters(integrator) for integrator in self._all_runners],
            "error": self.estimate and self.estimate.figures(),
            "attempts": self.attempts and self.attempts.as_numbers(),
        }
        memory = remember(self._all_runners)
        if self.attempts:
            memory = np.append(memory, self.attempts.memory())
        try:
            self.save(Snapshot(self.workspace, numbers, memory))
        except OSError as error:
            self._not_written(error)
        seconds = time.perf_counter() - began
        report.seconds["checkpoints"] += seconds
        return seconds

    def _recall(self, since: Snapshot) -> None:
        """Go back to where the run stood."""
        report, numbers = self.report, since.numbers
        if since.workspace != self.workspace:
            raise ResumeError(
                "the scene does not come out as it did when the run began, to the last digit: "
                "another machine, or other libraries. Leave --resume out to run it anew"
            )
        for integrator, counted in zip(self._all_runners, numbers["subsystems"], strict=True):
            set_counters(integrator, counted)
        recall(self._all_runners, since.memory)
        self.reached = float(self.integrators[0].workspace.state.time[0])
        vars(self.extremes).update(numbers["extremes"])
        if self.estimate:
            self.estimate.recall(numbers["error"])
        report.steps, report.output_times = numbers["steps"], numbers["outputTimes"]
        report.resumed = [*numbers["resumed"], self.now]
        for phase, seconds in numbers["seconds"].items():
            report.seconds[phase] = report.seconds.get(phase, 0.0) + seconds

    def _take(self, steps: int) -> None:
        """One chunk of about ``steps`` equal steps: advance, watch, publish."""
        began, first = time.perf_counter(), self.report.steps
        stride = self.estimate.companion.stride if self.estimate else 1
        steps = min(max(stride, steps - steps % stride), self.grid.n - first)
        if first + steps == self.grid.n and not self.grid.whole and steps > 1:
            steps -= 1  # the last step has a size of its own
        schedule, times = self._schedule(first, steps)
        taken = min(self._advance(schedule))
        done = min(self._finite_steps(taken, schedule, lambda k: self.grid.time(first + k)))
        self.report.seconds["loop"] += time.perf_counter() - began
        sizes = np.full(done, self.grid.step(first + done))
        ends = self.grid.times(np.arange(first + 1, first + done + 1))
        self._hand_over(Steps(self.grid.time(first), sizes, ends), schedule, times)

    def _take_paced(self, steps: int) -> None:
        """One chunk of about ``steps`` steps whose sizes follow from the tolerance."""
        assert self.adaptive is not None
        began, report, shown = time.perf_counter(), self.report, self.shown
        # No step goes past a chunk's worth of rows, counted from the first of all: so steps are the
        # same whatever the clock makes of the chunks.
        last = -(-report.output_times // self.chunk) * self.chunk
        rows = np.minimum(np.arange(report.output_times, last + 1) * self.options.every, shown.n)
        times = shown.times(np.unique(rows))
        begin = self.now
        chunk = Chunk(steps, begin=begin, times=times)
        steps, outcome, schedule, sizes, ends = self.adaptive.advance(chunk)
        times_of = np.append(begin, ends)
        done = min(self._finite_steps(steps, schedule, lambda k: float(times_of[k])))
        self.reached = float(ends[done - 1]) if done else begin
        report.seconds["loop"] += time.perf_counter() - began
        if steps == 0:
            report.status, report.message = "not converged", self._no_pair(outcome)
        self._hand_over(Steps(begin, sizes[:done], ends[:done]), schedule, times)

    def _hand_over(self, steps: Steps, schedule: OutputSchedule, times: np.ndarray) -> None:
        """Publish what good ``steps`` have left of the chunk's rows, and go on."""
        done = len(steps.sizes)
        schedule = schedule.until(done)
        times = times[: schedule.due[-1]]
        if self._publish(times, self._follow(steps, schedule, times)):
            self.report.steps += done
            self.extremes.fold(
                [integrator.workspace.monitor.rows[:done] for integrator in self.integrators]
            )
            self.extremes.compare_with(sum(map(_work_of_reactions, self.integrators)))
            self.handed = self._standing()
        else:
            self._go_back()

    def _standing(self) -> tuple[np.ndarray, list[dict[str, Any]]]:
        """Where the islands stand."""
        counted = [integrator.stepper.counters for integrator in self.integrators]
        return remember(self.integrators), counted

    def _go_back(self) -> None:
        """Bring the islands back to the last step handed over: no error of the report is to be of
        steps without rows. What these cost stays counted, for the verdict to say where it went.
        """
        memory, counted = self.handed
        for integrator, before in zip(self.integrators, counted, strict=True):
            integrator.stepper.restore(before)
        recall(self.integrators, memory)

    def _schedule(self, first: int, steps: int) -> tuple[OutputSchedule, np.ndarray]:
        """Rows of the ``steps`` equal steps after ``first``, as many as there is room for; their
        times.
        """
        grid, shown, every = self.grid, self.shown, self.options.every
        ends = np.arange(first + 1, first + steps + 1)
        if shown == grid:
            schedule = OutputSchedule.at_ends((ends % every == 0) | (ends == grid.n))
            rows = ends[np.diff(schedule.due) > 0]
        else:
            last = shown.count(grid.time(first + steps))
            rows = np.arange(shown.count(grid.time(first)) + 1, last + 1)
            rows = rows[(rows % every == 0) | (rows == shown.n)]
            # By the steps' own times: where chunks begin is the clock's affair.
            schedule = OutputSchedule.passed(shown.times(rows), grid.time(first), grid.times(ends))
            schedule = schedule.until(
                max(1, int(np.searchsorted(schedule.due, self.chunk, "right")) - 1)
            )
        return schedule, shown.times(rows[: schedule.due[-1]])

    def _follow(self, steps: Steps, schedule: OutputSchedule, times: np.ndarray) -> np.ndarray:
        """Bring the companion, if there is one, to where the run is: the rows of errors."""
        if self.estimate is None:
            return NO_ERRORS
        began = time.perf_counter()
        try:
            errors = self.estimate.follow(self.integrators, steps, schedule, times)
        except Stopped:  # the two stand apart now, which is nothing to go on from
            raise KeyboardInterrupt from None
        seconds = self.report.seconds
        seconds["companion"] = seconds.get("companion", 0.0) + time.perf_counter() - began
        return errors

    @property
    def _all_runners(self) -> list[SubsystemIntegrator]:
        """Those of the run and of its companion."""
        return [*self.integrators, *(self.estimate.companion.integrators if self.estimate else ())]

    def _advance(self, schedule: OutputSchedule) -> list[int]:
        """Advance every island; the steps each has taken."""
        steps = schedule.steps
        h = self.grid.step(self.report.steps + steps)
        taken = []
        for i, integrator in enumerate(self.integrators):
            # Easy steps that turn hard must not keep waiting whoever asks the run to stop. The
            # other islands go as far as the first.
            patience = math.inf if i else PATIENCE
            chunk = Chunk(steps, h=h, schedule=schedule)
            done, outcome, *_ = integrator.advance(chunk, patience)
            if outcome.converged:
                steps = done
            taken.append(done)
            if not outcome.converged and done == min(taken):
                self.report.status = "not converged"
                self.report.message = self._failure(self.report.steps + done, integrator, outcome)
        return taken

    def _finite_steps(
        self, done: int, schedule: OutputSchedule, begin: Callable[[int], float]
    ) -> list[int]:
        """Steps of each island before the first that left a nan or an overflow, at most ``done``;
        ``begin`` tells when each begins.

        A step can be solved and still be too large to be squared or multiplied.
        """
        finite = []
        for integrator in self.integrators:
            good = np.isfinite(integrator.workspace.monitor.rows[:done]).all(axis=1)
            steps = np.repeat(np.arange(done), np.diff(schedule.due[: done + 1]))
            for table in integrator.workspace.tables:
                np.logical_and.at(good, steps, np.isfinite(table[: len(steps)]).all(axis=1))
            first_bad = done if good.all() else int(np.argmin(good))
            finite.append(first_bad)
            if first_bad < done and first_bad == min(finite):
                whose = integrator.find_nonfinite(self.grid.h) or "a result"
                self.report.status = "not converged"
                self.report.message = overflow(begin(first_bad), whose)
        return finite

    def _publish(self, times: np.ndarray, errors: np.ndarray) -> bool:
        """Bring the islands' first rows together, in the columns of the whole scene; whether the
        sink took them.
        """
        if not times.size:
            return True
        began = time.perf_counter()
        tables = [np.zeros((times.size, len(columns))) for columns in self.columns]
        for table in tables:
            table[:, 0] = times
        for integrator, places in zip(self.integrators, self.places, strict=True):
            for table, part, columns in zip(
                tables, integrator.workspace.tables, places, strict=True
            ):
                # A decaying scheme's work is of all islands.
                table[:, columns] += part[: times.size]
        try:
            states, reactions, work = tables
            self.sink.write(states, reactions, work, errors)
        except OSError as error:
            self._not_written(error)
            return False
        self.report.output_times += times.size
        self.report.seconds["output"] += time.perf_counter() - began
        return True

    def _not_written(self, error: OSError) -> None:
        self.report.status = "not written"
        self.report.message = not_written(error, f"; rows up to t = {self.now:g} s are whole")

    def _finish(self) -> Report:
        report = self.report
        report.time = self.now
        report.iterations = sum(
            int(integrator.workspace.counts[0]) for integrator in self.integrators
        )
        report.factorisations = sum(
            int(integrator.workspace.counts[1]) for integrator in self.integrators
        )
        report.scipy_steps = sum(r.stepper.scipy_steps for r in self.integrators)
        report.subdivisions = sum(r.stepper.subdivisions for r in self.integrators)
        for integrator in self.integrators:
            integrator.review_reactions()
            report.non_unique_reactions |= integrator.shared
        report.extremes = self.extremes.as_json()
        if degree_of(self.model):
            report.extremes |= {"localErrorMax": None, "localErrorSum": None}  # of order 2
        if self.adaptive:
            report.step_control, local = self.adaptive.as_json()
            report.extremes |= local
        if decays(self.model):
            taken = -sum(
                float(integrator.workspace.state.work[-1]) for integrator in self.integrators
            )
            report.extremes |= {"energyTaken": taken}
            if self.estimate:
                way = (report.extremes["speedMax"] or 0.0) * self._longest_step
                kinetic = report.extremes["largestKineticEnergy"] or 0.0
                self.estimate.add_damped(taken, self.extremes.size, kinetic, way)
        if self.estimate and not self.adaptive:
            way = min(self.grid.h, report.time) * (report.extremes["speedMax"] or 0.0)
            way -= self._length * (report.extremes["rotationPerStepMax"] or 0.0)
            rubbed = [unresolved_friction(r, self.grid.h, report.time) for r in self.integrators]
            self.estimate.add_unresolved(way, self.extremes.way, max(rubbed))
        if self.options.error == OFF:
            report.extremes |= {"localErrorMax": None, "localErrorSum": None}
        if self.attempts and self.estimate:
            self.attempts.enter(report, self.estimate)
        report.error = self.estimate.as_json() if self.estimate else None
        report.verdict = judge(self._figures(), self.model.simulation.limits).as_json()
        return report

    def _figures(self) -> Figures:
        report, integrators = self.report, self.integrators
        pivots = [
            float(r.workspace.pivots[0])
            for r in integrators
            if r.workspace.system.relaxation == 0.0
        ]
        return Figures(
            status=report.status,
            time=report.time,
            steps=report.steps,
            iterations=report.iterations,
            subdivisions=report.subdivisions,
            scipy_steps=report.scipy_steps,
            joints=report.joints,
            dt=self._longest_step,
            order=order_of(self.model),
            by_cayley=not degree_of(self.model) and not is_exponential(self.model),
            tolerance=self.attempts.goal if self.attempts else None,
            local_tolerance=local_tolerance_of(self.model),
            length=self._length,
            energy_size=self.extremes.size,
            extremes=report.extremes,
            momentum=self._momentum_lost(),
            condition=max(pivots, default=0.0) or None,
            velocity_change=max(
                (r.change.rate for r in integrators if r.change.method != "none"), default=0.0
            ),
            shared=report.non_unique_reactions,
            error=report.error,
            horizon=self.estimate.horizon if self.estimate else None,
        )

    @property
    def _longest_step(self) -> float:
        """Size of the longest step [s]."""
        return (
            float(self.report.step_control["stepMax"]) if self.report.step_control else self.grid.h
        )

    @property
    def _length(self) -> float:
        """Length of the longest body [m]."""
        return max(float(r.workspace.system.frames.length[:-1].max()) for r in self.integrators)

    @property
    def size(self) -> float:
        """Size of the model [m]: its longest body, or the longest way of one if that is longer."""
        return max(self._length, self.extremes.way)

    def _momentum_lost(self) -> tuple[float | None, float | None]:
        """Of the islands that nothing outside pulls at, the most; no decaying scheme keeps the
        angular momentum exactly.
        """
        lost = [
            drift(r.workspace.system, before, now, float(r.workspace.state.time[0]))
            for r, before in zip(self.integrators, self.momenta, strict=True)
            if before is not None and (now := _momentum(r)) is not None
        ]
        linear = max((part for part, _ in lost), default=None)
        angular = max((part for _, part in lost), default=None)
        exact = not decays(self.model) and not is_exponential(self.model)
        return linear, angular if exact else None

    def _no_pair(self, outcome: Outcome) -> str:
        assert self.adaptive is not None
        (integrator,), tried = self.integrators, self.adaptive.smallest_tried(self.grid.h)
        name = integrator.find_nonfinite(tried)
        if name is not None:
            return overflow(self.now, name)
        why = f"the steps' own errors stay above their share of {self.adaptive.tolerance:g} m"
        if not outcome.converged:
            why = (
                f"the residual stays at {outcome.residual:.1e} of the step's motion, worst in "
                f"{_row(integrator, outcome.worst)}"
            )
        return (
            f"no step from t = {self.now:g} s, down to {tried:.3g} s, meets the tolerance: {why}. "
            "Look at the last rows for forces or speeds that grow without bound, or jump."
        )

    def _failure(self, step: int, integrator: SubsystemIntegrator, outcome: Outcome) -> str:
        name = integrator.find_nonfinite(self.grid.h)
        if name is not None or np.isnan(outcome.residual):
            return overflow(self.grid.time(step), name or _row(integrator, outcome.worst))
        if np.isinf(outcome.residual):
            return (
                f"steps from t = {self.grid.time(step):g} s, down to "
                f"{self.grid.h / 2**MAX_SUBDIVISIONS:.3g} s, lead {FAR:g} times as far as the "
                "motion before and the bodies' own lengths let expect. Look for forces or "
                "speeds that "
                "come out of nowhere, and try a smaller --dt."
            )
        return (
            f"step {step + 1} from t = {self.grid.time(step):g} s did not converge, nor did steps "
            f"down to {self.grid.h / 2**MAX_SUBDIVISIONS:.3g} s: the residual stayed at "
            f"{outcome.residual:.1e} of the step's motion (solved: {TOLERANCE:g}), worst in "
            f"{_row(integrator, outcome.worst)}. Try a smaller --dt, and look at the last rows for "
            "forces or speeds that grow without bound."
        )


def _row(integrator: SubsystemIntegrator, worst: int) -> str:
    """Row ``worst`` of an island's equations in words."""
    return describe_row(integrator.model, integrator.workspace.system, worst)


def _energy_scale(integrator: SubsystemIntegrator, t_final: float) -> float:
    """What energies are to be compared with [J]: the work of gravity and of the loads over the
    bodies' own lengths, and the kinetic energy of bodies that go by these within the run.
    """
    system = integrator.workspace.system
    frames = system.frames
    moving = frames.inverse_mass > 0.0
    mass, length = 1.0 / frames.inverse_mass[moving], frames.length[moving]
    work = np.linalg.norm(system.bodies.gravity) * (mass @ length)
    for scale in forces.work_scales(system.forces, frames.length):
        work += scale
    return float(work + mass @ (length / t_final) ** 2)


def _work_of_reactions(integrator: SubsystemIntegrator) -> float:
    """Work of the joints' reactions over the longest body's length and over one radian [J]."""
    reaction, length = (
        integrator.workspace.state.reaction,
        integrator.workspace.system.frames.length[:-1].max(),
    )
    return float(np.abs(reaction[:, :3]).sum() * length + np.abs(reaction[:, 3:]).sum())


def _momentum(integrator: SubsystemIntegrator) -> Momentum | None:
    """Momentum of an island that keeps its own."""
    workspace = integrator.workspace
    if not is_alone(workspace.system):
        return None
    return momentum(workspace.system, workspace.state, workspace.start)


def _degrees_of_freedom(model: Model, integrators: list[SubsystemIntegrator]) -> dict[str, int]:
    """Degrees of freedom by count (Hainge 2010, eq. 1.1) and by rank of the joints' equations."""
    n = 6 * len(model.bodies)
    rank = sum(integrator.rank for integrator in integrators)
    return {
        "byCount": n - rank - sum(integrator.redundant for integrator in integrators),
        "byRank": n - rank,
    }


def _warnings(integrator: SubsystemIntegrator) -> list[str]:
    """What a reader of the results must know of their start, in sentences."""
    return _assembly_warnings(integrator) + _velocity_warnings(integrator)


def _assembly_warnings(integrator: SubsystemIntegrator) -> list[str]:
    moved = integrator.moved
    if moved is None or moved.violation == 0.0:
        return []
    changes = [
        f"body '{body.name}' by {way:.3g} m and {turn:.3g} rad"
        for body, way, turn in zip(integrator.model.bodies, moved.ways, moved.turns, strict=True)
    ]
    return [f"joints open by {moved.violation:.3g} m were closed: moved {', '.join(changes)}"]


def _velocity_warnings(integrator: SubsystemIntegrator) -> list[str]:
    change, dt = integrator.change, integrator.model.simulation.dt
    length = float(integrator.workspace.system.frames.length.max())
    if change.method == "none" or change.rate * dt <= WORTH_TELLING * length:
        return []
    if change.method == "asGiven":
        return [
            f"initial velocities open a joint at {change.rate:.3g} m/s and were left as given: the "
            "scheme keeps that as an alternation of velocities and reactions"
        ]
    kept = "angular velocities kept" if change.method == "keepAngular" else "least change by mass"
    head = f"initial velocities opened a joint at {change.rate:.3g} m/s and were changed ({kept}): "
    changes = [
        f"body '{body.name}' by {np.linalg.norm(dv):.3g} m/s"
        + (f" and {np.linalg.norm(dw):.3g} rad/s" if dw.any() else "")
        for body, dv, dw in zip(integrator.model.bodies, change.dv, change.dw, strict=True)
        if dv.any() or dw.any()
    ]
    return [head + ", ".join(changes)]
