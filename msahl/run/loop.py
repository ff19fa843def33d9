"""The time loop: chunks of steps of every subsystem, their rows to the sink, a look at the clock.

Requests to stop are honoured between chunks, so every row on disk is an accepted state.
"""

import math
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from msahl.check import require_sound
from msahl.check.loads import speed_jumps
from msahl.events.search import Event, NoStep
from msahl.jit.compiled import prepare, trouble
from msahl.model import Model, Options, resolve
from msahl.model.settings import EQUILIBRIUM
from msahl.records import record
from msahl.run.attempts import Attempts
from msahl.run.companion import Steps
from msahl.run.conclusion import conclude
from msahl.run.contacts import (
    events_that_never_happened,
    forget_events,
    omitted_heights,
    rows_of_events,
)
from msahl.run.error_estimate import NO_ERRORS
from msahl.run.mesh_error import FinerMesh
from msahl.run.messages import not_written, stop_not_found, stops_at_once
from msahl.run.output import tables_of
from msahl.run.record import Record
from msahl.run.report import COMPLETED, INTERRUPTED, NOT_CONVERGED, NOT_WRITTEN, Report
from msahl.run.saved_run import restore_snapshot, take_snapshot
from msahl.run.setup import RunSetup, build_setup, new_report
from msahl.run.snapshot import SavedSteps, Snapshot, digest
from msahl.run.stop import fulfilled_at_start, margin_after, time_of_stop, words_of
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.tables import ERROR, EVENTS, STATES, Sink
from msahl.schemes.outcome import Stopped
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Advance, Chunk
from msahl.start.velocities import StartError
from msahl.system.nonfinite import overflow

CHUNK_SECONDS = 0.1
"""Time that a chunk should take, so that the run answers a request to stop within 2 s even on a
machine ten times slower."""
PATIENCE = 5.0 * CHUNK_SECONDS
"""Seconds after which a chunk is cut short if its steps need scipy or subdivisions."""
SLOWEST = 16_000
"""Lower bound on unknowns solved per second, without scipy; sizes the first chunk."""
SAVE_SECONDS = 2.0
"""Least time from one saved snapshot to the next: the most that a killed run loses."""
SAVE_SHARE = 0.01
"""Largest fraction of the run's time that saving may take: on a slow disk it is done less often."""


@record(slots=False)
class Hooks:
    """Functions that a run calls.

    ``progress`` receives the steps done and the time [s], ``tell`` messages about what takes long.
    ``stopped`` says whether to stop. ``save`` is given a snapshot every few seconds, and when the
    run is stopped. ``accepted`` receives the steps that were handed over, the rows in them with
    their times, and the degree of the steps.
    """

    progress: Callable[[int, float], Any] = lambda steps, t: None
    stopped: Callable[[], bool] = lambda: False
    tell: Callable[[str], Any] = lambda message: None
    save: Callable[[Snapshot], Any] | None = None
    accepted: Callable[[Steps, OutputSchedule, np.ndarray, int], Any] | None = None


def run(
    model: Model,
    options: Options,
    sink: Sink,
    hooks: Hooks = Hooks(),
    since: Snapshot | None = None,
    checked: bool = False,
    finer: FinerMesh | None = None,
) -> Report:
    """Run ``model`` to its end, into ``sink``. A run ``since`` a snapshot writes the rows that the
    interrupted run would have written after it.

    The model is checked first and ``ModelError`` raised with its faults, unless it is ``checked``:
    the reader of decks returns no other models. With a ``finer`` mesh of its beams the error by
    their mesh is estimated as well.

    A step that does not converge, a request to stop (``stopped``, KeyboardInterrupt), and a sink or
    ``save`` that raises OSError end the run, and the report says so. Raises ``StartError`` if there
    is no consistent start, or if the model should begin at an equilibrium, which is found before
    (``analysis.equilibria.begin``); ``ResumeError`` for a snapshot of another system.
    """
    if not checked:
        require_sound(model)
    require_start(model)
    settings = resolve(model.simulation, options)
    # An overflow is reported by ``_finite_steps`` and not by numpy.
    with np.errstate(all="ignore"):
        if settings.tolerance is None:
            setup = build_setup(model, settings, None, finer)
            report = TimeLoop(setup, sink, hooks).run(since)
            setup.release(report)
            return report
        return _run_to_tolerance(model, options, sink, hooks, since, finer)


def require_start(model: Model) -> None:
    """Raise ``StartError`` if a sound ``model`` is to start where it cannot."""
    if model.simulation.start == EQUILIBRIUM:
        raise StartError("the model is to start at an equilibrium, which has not been found yet")
    for index, message in speed_jumps(model.motions, model.simulation):
        raise StartError(f"motion '{model.motions[index].name}': {message}")


def _run_to_tolerance(
    model: Model,
    options: Options,
    sink: Sink,
    hooks: Hooks,
    since: Snapshot | None,
    finer: FinerMesh | None,
) -> Report:
    """Run until the estimated global error is within the tolerance: run, compare, run again with
    smaller steps. The rows of the last run stay.
    """
    attempts = Attempts(resolve(model.simulation, options))
    if since:
        attempts.restore(since.numbers["attempts"], since.memory)
    while True:
        simulation = replace(model.simulation, local_tolerance=attempts.local)
        settings = resolve(simulation, options)
        setup = build_setup(replace(model, simulation=simulation), settings, attempts, finer)
        loop = TimeLoop(setup, sink, hooks)
        report = loop.run(since)
        completed = report.status == COMPLETED
        again = completed and attempts.prepare_next(setup.estimate, loop.record.size)
        setup.release(report)
        if not again:
            return report
        since = None
        sink.restart()


class TimeLoop:
    """Takes the steps of one run."""

    record: Record

    def __init__(self, setup: RunSetup, sink: Sink, hooks: Hooks) -> None:
        self.setup, self.sink, self.hooks = setup, sink, hooks
        self.report = new_report(setup)
        self.report.seconds["prepare"] = time.perf_counter() - setup.began
        self.system = ""  # digest of the systems, if snapshots are taken or restored
        self.stopping = False  # whether the run ends where a condition begins to hold
        self.accepted: SavedSteps  # where the steps stood after the last chunk

    def run(self, since: Snapshot | None) -> Report:
        """Take all steps, or those after the snapshot ``since``."""
        hooks = self.hooks
        self.begin(since)
        for integrator in self.setup.all_integrators:
            integrator.stepper.requests.stopped = hooks.stopped
        try:
            prepare(self.setup.calls, hooks.stopped)
            self._take_all(self._first_steps())
        except Stopped:  # in the middle of a hard step
            self._go_back()
            self._interrupt()
            self._save()
        except KeyboardInterrupt:  # a second request to stop, in the middle of a chunk
            self.report.end(INTERRUPTED, f"stopped at once, after t = {self._time:g} s")
            if not self.setup.plan.ended:
                self._go_back()
        if trouble():
            hooks.tell(trouble())
        if self.setup.model.stops and self.report.status == COMPLETED and not self.stopping:
            words = words_of(self.setup.model)
            self.report.warnings.append(f"stop: '{words}' did not begin to hold during the run")
        if self.report.status == COMPLETED:
            self.report.warnings += events_that_never_happened(self.setup.integrators)
        conclude(self.setup, self.record, self.report)
        return self.report

    def begin(self, since: Snapshot | None) -> None:
        """Write the rows at t = 0, or restore a snapshot."""
        setup = self.setup
        if self.hooks.save or since:
            self.system = digest(setup.all_integrators)
        for integrator in setup.integrators:
            integrator.show_start()
        at_start = OutputSchedule.at_ends(np.ones(1, dtype=bool))
        if self._finite_steps(1, at_start, np.zeros(1)) < 1:
            raise StartError(self.report.message)
        if fulfilled_at_start(setup.integrators):
            raise StartError(stops_at_once(words_of(setup.model)))
        self.record = Record(setup.model, setup.integrators, setup.output.grid.t_final)
        self.report.status = COMPLETED
        if since:
            restore_snapshot(since, self.system, setup, self.record, self.report)
        else:
            self._publish(np.zeros(1), self._errors_at_start())
        self.accepted = SavedSteps.of(setup.integrators)
        self._arm(0.0)

    def _errors_at_start(self) -> np.ndarray:
        """The row of errors at t = 0, if they are estimated."""
        integrators, estimate, mesh = self.setup.integrators, self.setup.estimate, self.setup.mesh
        if estimate is None:
            return NO_ERRORS
        errors = estimate.begin(integrators)
        if mesh:
            errors[:, 1] += mesh.begin(integrators)
        return errors

    def _arm(self, time: float) -> None:
        """Let conditions that begin to hold after ``time`` [s] end the run."""
        for integrator in self.setup.integrators:
            integrator.stepper.arm(time)

    @property
    def _time(self) -> float:
        """Time up to which rows are written [s]."""
        return self.setup.plan.progress.time

    def _first_steps(self) -> int:
        """Number of steps of the first chunk."""
        times = [integrator.storage.step_time for integrator in self.setup.all_integrators]
        if min(times) > 0.0:
            return int(CHUNK_SECONDS / sum(times))
        return int(CHUNK_SECONDS * SLOWEST / max(1, self.report.unknowns))

    def _take_all(self, steps: int) -> None:
        """Take chunks to the end, or as far as they go, the first of so many ``steps``."""
        report, plan, most = self.report, self.setup.plan, self.setup.output.chunk
        saved, pause = time.perf_counter(), SAVE_SECONDS
        while not plan.ended and report.status == COMPLETED:
            began = time.perf_counter()
            self.take_chunk(max(1, min(steps, most)))
            seconds = time.perf_counter() - began
            self.hooks.progress(plan.progress.steps, self._time)
            # The first chunk may compile; chunks grow until they take their time.
            wanted = steps * CHUNK_SECONDS / max(seconds, 1e-9)
            steps = max(1, min(16 * steps, int(wanted), most))
            if report.status != COMPLETED or plan.ended:
                break
            if self.hooks.stopped():
                self._interrupt()
            if report.status == INTERRUPTED or time.perf_counter() - saved > pause:
                pause = max(SAVE_SECONDS, self._save() / SAVE_SHARE)
                saved = time.perf_counter()

    def _interrupt(self) -> None:
        self.report.end(INTERRUPTED, f"stopped at t = {self._time:g} s")

    def _save(self) -> float:
        """Save a snapshot; returns the seconds it took."""
        if self.hooks.save is None:
            return 0.0
        began = time.perf_counter()
        try:
            self.hooks.save(self.snapshot())
        except OSError as error:
            self._end_unwritten(error)
        seconds = time.perf_counter() - began
        self.report.add_seconds("checkpoints", seconds)
        return seconds

    def snapshot(self) -> Snapshot:
        """Snapshot of the run after the last chunk."""
        return take_snapshot(self.system, self.setup, self.record, self.report)

    def go_to(self, since: Snapshot) -> None:
        """Go to where a snapshot of the same run was taken; raises ``ResumeError`` for another."""
        restore_snapshot(since, self.system, self.setup, self.record, self.report)
        self.accepted.update(self.setup.integrators)
        self._arm(0.0)
        self.report.status, self.report.message = COMPLETED, ""

    def take_chunk(self, steps: int) -> None:
        """Take one chunk of about ``steps`` steps, check it, and hand it over."""
        began = time.perf_counter()
        chunk = self.setup.plan.next_chunk(steps, self._stride)
        advance = self._advance(chunk)
        begins = np.append(chunk.begin, advance.ends)
        done = self._finite_steps(advance.steps, advance.schedule, begins)
        self.report.add_seconds("loop", time.perf_counter() - began)
        if advance.event and done == advance.steps:
            self.report.end(COMPLETED, "")  # a step that failed would be after the end
            self._end_within(done, advance.event)
        else:
            schedule, parts = advance.schedule.until(done), advance.parts
            sizes, ends = advance.sizes[:done], advance.ends[:done]
            good = Advance(done, advance.outcome, schedule, sizes, ends, parts=parts)
            self._hand_over(good, chunk)

    def _end_within(self, step: int, event: Event) -> None:
        """Take the present chunk again up to the ``step`` in which an ``event`` ends the run, and
        let the run end there.
        """
        self._go_back()
        plan, stride = self.setup.plan, self._stride
        last = plan.progress.steps + plan.kept_before(step)
        while plan.progress.steps < last and self.report.status == COMPLETED:
            steps = plan.most_kept(last - plan.progress.steps)
            groups = steps - steps % stride
            chunk = plan.next_chunk(groups or steps, stride if groups else 1)
            self._hand_over(self._advance(chunk), chunk)
        if self.report.status != COMPLETED:
            return
        begin, words = plan.progress.time, words_of(self.setup.model)
        self._arm(math.inf)
        try:
            # A condition that a jump of velocities fulfils holds after it, and not at its time.
            found = event.after if event.at_start else None
            t = found or time_of_stop(self._margin_at, event, begin)
        except NoStep:
            self.report.end(NOT_CONVERGED, stop_not_found(words, begin, event.after))
            return
        finally:
            self._go_back()
        if t is None:
            self._arm(event.after)
            return
        plan.end_at(t)
        self.stopping = True
        self.report.stop = {"time": t, "condition": words}

    def _margin_at(self, t: float) -> float:
        """Return the margin of the conditions at ``t`` [s], at the end of steps from the last ones
        handed over.
        """
        self._go_back()
        return margin_after(self.setup.integrators, self.setup.plan.approach, t)

    @property
    def _stride(self) -> int:
        """Steps of the run in one step of its companion."""
        return self.setup.estimate.companion.stride if self.setup.estimate else 1

    def _advance(self, chunk: Chunk) -> Advance:
        """Advance every subsystem by a multiple of the stride, where that is possible; returns the
        shortest advance.
        """
        shortest: Advance | None = None
        event: Event | None = None
        parts: dict[int, tuple[float, ...]] = {}
        for integrator in self.setup.integrators:
            # Steps that become hard must not delay the answer to a request to stop. The other
            # subsystems go as far as the first.
            patience = math.inf if shortest else PATIENCE
            advance = _complete(
                integrator, chunk, integrator.advance(chunk, patience), self._stride
            )
            for k, ends in advance.parts.items():
                parts[k] = tuple(sorted({*parts.get(k, ()), *ends}))
            if shortest is None or advance.steps < shortest.steps:
                shortest, event = advance, advance.event
                failure = None if event else self.setup.plan.failure(integrator, advance)
                if failure:
                    self.report.end(NOT_CONVERGED, failure)
            elif advance.event and advance.steps == shortest.steps:
                event = min(event or advance.event, advance.event, key=lambda of: of.after)
            if advance.outcome.converged and chunk.ends.size:
                # The step in which the run ends may have an earlier event here.
                chunk = chunk._replace(last=min(chunk.last, advance.steps + bool(event)))
        assert shortest is not None
        return shortest._replace(event=event, parts=parts)

    def _finite_steps(self, done: int, schedule: OutputSchedule, begins: np.ndarray) -> int:
        """Number of steps before the first one that left a NaN or an infinite value, at most
        ``done``; ``begins`` (steps,) are the times at which they begin [s].

        A step can be solved and still be too large to be squared or multiplied.
        """
        least = done
        for integrator in self.setup.integrators:
            good = np.isfinite(integrator.workspace.monitor.rows[:done]).all(axis=1)
            steps = np.repeat(np.arange(done), np.diff(schedule.due[: done + 1]))
            for table in tables_of(integrator).values():
                np.logical_and.at(good, steps, np.isfinite(table[: len(steps)]).all(axis=1))
            first_bad = done if good.all() else int(np.argmin(good))
            if first_bad < least or (first_bad == least < done):
                least = first_bad
                h = self.setup.output.grid.h
                whose = integrator.find_nonfinite(h) or integrator.find_undefined(h)
                message = overflow(float(begins[first_bad]), whose or "a result")
                self.report.end(NOT_CONVERGED, message)
        return least

    def _hand_over(self, advance: Advance, chunk: Chunk) -> None:
        """Publish the rows of good steps, and accept the steps if that succeeds."""
        times = chunk.times[: advance.schedule.due[-1]]
        steps = Steps(chunk.begin, advance.sizes, advance.ends, advance.parts)
        if self._publish(times, self._follow(steps, advance.schedule, times)):
            self.setup.plan.accept(advance)
            self.record.add(advance.steps, advance.schedule.between)
            if self.hooks.accepted:
                degree = self.setup.integrators[0].stepper.counters.get("degree", 0)
                self.hooks.accepted(steps, advance.schedule, times, degree)
            if not self.setup.plan.ended:  # nothing follows from which to go back
                self.accepted.update(self.setup.integrators)
        else:
            self._go_back()

    def _go_back(self) -> None:
        """Return to the last step handed over, so that no figure of the report belongs to a step
        without rows. The work done since then stays counted, for the verdict to report it.
        """
        self.accepted.restore(self.setup.integrators)

    def _follow(self, steps: Steps, schedule: OutputSchedule, times: np.ndarray) -> np.ndarray:
        """Advance the companion, if there is one, and the run of a finer mesh; returns the rows of
        errors.
        """
        estimate, mesh, integrators = self.setup.estimate, self.setup.mesh, self.setup.integrators
        if estimate is None:
            return NO_ERRORS
        began = time.perf_counter()
        try:
            errors = estimate.follow(integrators, steps, schedule, times)
            if mesh:
                by_mesh = mesh.follow(integrators, steps, schedule, times)
                errors[:, 1] += by_mesh[: len(errors)]
            errors[:, 1] += omitted_heights(integrators, errors[:, 0])
        except Stopped:  # run and companion stand at different times, so no snapshot is possible
            raise KeyboardInterrupt from None
        self.report.add_seconds("companion", time.perf_counter() - began)
        return errors

    def _publish(self, times: np.ndarray, errors: np.ndarray) -> bool:
        """Write the first rows of the chunk and those of ``errors``; whether the sink took them."""
        events = rows_of_events(self.setup.integrators)
        if not times.size and not events.size:
            return True
        began = time.perf_counter()
        try:
            tables = self.setup.tables.rows(times) if times.size else {}
            if times.size:
                self.record.capsules.add(tables[STATES])
            if self.sink.takes_observed and times.size:
                tables |= self.setup.observed.rows(tables)
            self.sink.write({**tables, ERROR: errors, EVENTS: events})
        except OSError as error:
            self._end_unwritten(error)
            return False
        forget_events(self.setup.all_integrators)
        self.setup.plan.progress.output_times += times.size
        self.report.add_seconds("output", time.perf_counter() - began)
        return True

    def _end_unwritten(self, error: OSError) -> None:
        extent = f"; rows up to t = {self._time:g} s are complete"
        self.report.end(NOT_WRITTEN, not_written(error, extent))


def _complete(
    integrator: SubsystemIntegrator, chunk: Chunk, advance: Advance, stride: int
) -> Advance:
    """Take the steps that an ``advance`` which was cut short lacks to a multiple of ``stride``.

    A step of the companion replaces so many steps of the run. If the clock could cut them, it would
    decide on the companion's step sizes, and so on the last digits of the estimated error.
    """
    missing = -advance.steps % stride
    if advance.event or not advance.outcome.converged or not missing:
        return advance
    if advance.steps >= chunk.last:
        return advance
    last = min(advance.steps + missing, chunk.last)
    rest = integrator.advance(chunk._replace(first=advance.steps, last=last))
    taken, parts = rest.steps, {**advance.parts, **rest.parts}
    return rest._replace(sizes=np.full(taken, chunk.h), ends=chunk.ends[:taken], parts=parts)
