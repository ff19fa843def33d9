"""Batches: one model at many samples of its numbers, in as many processes as there are cores.

Models that differ in numbers only share all that follows from their connections, and the memory of
their runs (``msahl.jit.storage``), so a run costs little beside its time loop. What it costs is
Python, of which a process runs one thread at a time: two thirds of a short run of a small model. So
each worker is a process.
"""

import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from itertools import chain, islice
from queue import SimpleQueue
from typing import Any, Literal, Unpack, overload

from msahl.api.arguments import COUNT, Names, require
from msahl.api.model import Model, Value
from msahl.api.options import RunOptions
from msahl.api.result import Result
from msahl.api.running import at_start
from msahl.api.worker import EndedError, Outcome, outcome_of, receive, send
from msahl.jit.compiled import prepare
from msahl.results.job import Job
from msahl.run.hidden_bodies import shown_tables
from msahl.run.options import Choice, OptionError
from msahl.run.setup import build_setup
from msahl.run.tables import ERROR
from msahl.start.velocities import StartError
from msahl.subprocesses import cores, end_worker, start_worker

Sample = Mapping[str, Value]
"""Numbers of the deck by name, as ``Model.with_`` takes them."""

ERRORS = ("raise", "return")

START_SECONDS = 0.7
"""Time that a process takes until its first run."""
WORTH = 2.0
"""Seconds of runs still to be made, in processes' starts, from which processes are started."""
TRIED = 8
"""Most runs after which it is decided whether to start processes."""
CHUNK_SECONDS, MOST_SAMPLES = 0.05, 64
"""Time of the runs that a process is sent at once, and their largest number."""
AHEAD = 3
"""Chunks in progress for each process: it never waits, and memory is bounded."""
PIPE = 1 << 20
"""Bytes that a pipe holds, where the system lets one choose."""


class BatchError(Exception):
    """A process of a batch has ended without a result."""


@overload
def batch(
    model: Model,
    samples: Iterable[Sample],
    jobs: int | None = None,
    *,
    tables: Sequence[str] | None = None,
    errors: Literal["raise"] = "raise",
    **options: Unpack[RunOptions],
) -> Iterator[Result]: ...


@overload
def batch(
    model: Model,
    samples: Iterable[Sample],
    jobs: int | None = None,
    *,
    tables: Sequence[str] | None = None,
    errors: Literal["return"],
    **options: Unpack[RunOptions],
) -> Iterator[Result | Exception]: ...


def batch(
    model: Model,
    samples: Iterable[Sample],
    jobs: int | None = None,
    *,
    tables: Sequence[str] | None = None,
    errors: Literal["raise", "return"] = "raise",
    **options: Unpack[RunOptions],
) -> Iterator[Result] | Iterator[Result | Exception]:
    """Run a model at ``samples`` of its numbers, and yield the results in their order.

    Each sample is a mapping such as ``{"L": 0.8, "Bob.mass": "3 kg"}``; a pandas frame has one in
    each row. Results are to the bit those of ``model.with_(**sample).run(**options)``. ``jobs`` is
    the number of processes, at most one for each core and sample (default: one for each core, if
    there is enough to do; 1 runs everything in this one). Results have all tables, or those named
    in ``tables``. A sample that cannot be run raises ``DeckError``, ``OptionError`` or
    ``StartError``; with ``errors="return"`` these exceptions are yielded in place of results.

    Results are made while they are consumed, a few ahead; so the memory needed does not grow with
    the number of samples. Raises ``BatchError`` if a process is killed.
    """
    require(errors=(errors, Choice(ERRORS)), tables=(() if tables is None else tables, Names()))
    if jobs is not None:
        require(jobs=(jobs, COUNT))
    if not isinstance(model, Model):
        raise OptionError([f"model: it is {model!r:.200}; it must be one that msahl.load returns"])
    job = model.job(**options)
    known = [*shown_tables(job.model), ERROR]
    tables = [tables] if isinstance(tables, str) else tables
    for name in () if tables is None else tables:
        if name not in known:
            raise OptionError([f"tables: there is no '{name}'; it has {', '.join(known)}"])
    if hasattr(samples, "to_dict"):
        samples = samples.to_dict("records")
    if isinstance(samples, str | bytes | Mapping) or not isinstance(samples, Iterable):
        raise OptionError([f"samples: it is {samples!r:.200}; give a list of {{name: number}}"])
    runs = _Runs(model, job, options, tables)
    return runs.results(map(_checked, samples), jobs, errors == "return", _length(samples))


def _checked(sample: Sample) -> Sample:
    """Return a sample; raises ``OptionError`` if it is none."""
    if not isinstance(sample, Mapping) or not all(isinstance(name, str) for name in sample):
        raise OptionError([f"samples: one is {sample!r:.200}; give a list of {{name: number}}"])
    return sample


def _length(samples: Iterable[Sample]) -> int | None:
    return len(samples) if isinstance(samples, Sized) else None


class _Runs:
    """What all runs of a batch have in common."""

    def __init__(
        self, model: Model, job: Job, options: RunOptions, tables: Sequence[str] | None
    ) -> None:
        self.model, self.job, self.options, self.tables = model, job, options, tables
        self.columns = shown_tables(job.model)

    def results(
        self, samples: Iterator[Sample], jobs: int | None, returned: bool, count: int | None
    ) -> Iterator[Result | Exception]:
        """Yield the results of ``count`` samples (None: not known); with ``returned`` exceptions
        are yielded as well."""
        for sample, outcome in self._outcomes(samples, jobs, count):
            if isinstance(outcome, Exception):
                if not returned:
                    raise outcome
                yield outcome
            else:
                yield self._result(sample, outcome)

    def _result(self, sample: Sample, outcome: tuple[dict[str, Any], Any]) -> Result:
        def job() -> Job:
            return at_start(self.model.with_(**sample).job(**self.options))

        result = Result(None, *outcome, job, self.columns)
        if self.tables is not None:
            names = (*self.columns, ERROR)
            result.omitted = tuple(name for name in names if name not in self.tables)
        return result

    def _outcomes(
        self, source: Iterator[Sample], jobs: int | None, left: int | None
    ) -> Iterator[tuple[Sample, Outcome]]:
        """Yield the samples with their outcomes, in order."""
        run_time = 0.0
        if jobs is None:
            jobs = cores()
            for tried in range(TRIED) if jobs > 1 else ():
                if tried > 1 and left is not None and left * run_time < WORTH * START_SECONDS:
                    jobs = 1  # the rest is done before a process has started
                    break
                found = list(islice(source, 1))
                if not found:
                    return
                began = time.perf_counter()
                outcome = self._run_here(found[0])
                run_time = time.perf_counter() - began
                left = left and left - 1
                yield found[0], outcome
                if run_time > TRIED * START_SECONDS:
                    break
        if jobs == 1:
            for sample in source:
                yield sample, self._run_here(sample)
            return
        first = list(islice(source, 1))
        if first:
            jobs = min(jobs, cores(), left or jobs)
            yield from self._in_processes(chain(first, source), jobs, run_time)

    def _run_here(self, sample: Sample) -> Outcome:
        return outcome_of(self.model, sample, self.options, self.tables)

    def _in_processes(
        self, samples: Iterator[Sample], jobs: int, run_time: float
    ) -> Iterator[tuple[Sample, Outcome]]:
        """Yield the samples with their outcomes, by ``jobs`` processes; a run takes ``run_time``
        seconds or so, 0 if that is not known.
        """
        if not run_time:
            with suppress(StartError):  # compiled here once, not in every process
                prepare(build_setup(self.job.model, self.job.settings, None).calls)
        workers = [_Worker((self.model, self.options, self.tables)) for _ in range(jobs)]
        idle: SimpleQueue[_Worker] = SimpleQueue()
        for worker in workers:
            idle.put(worker)

        def ask(chunk: list[Sample]) -> tuple[list[Outcome], float]:
            worker, began = idle.get(), time.perf_counter()
            try:
                outcomes = worker.ask(chunk)
            finally:
                idle.put(worker)
            return outcomes, (time.perf_counter() - began) / len(chunk)

        pending: deque[tuple[list[Sample], Future[tuple[list[Outcome], float]]]] = deque()
        threads = ThreadPoolExecutor(jobs, "msahl-batch")
        try:
            while True:
                while len(pending) < AHEAD * jobs:
                    size = int(min(MOST_SAMPLES, max(1.0, CHUNK_SECONDS / max(run_time, 1e-6))))
                    chunk = list(islice(samples, size if run_time else 1))
                    if not chunk:
                        break
                    pending.append((chunk, threads.submit(ask, chunk)))
                if not pending:
                    return
                asked, future = pending.popleft()
                outcomes, run_time = future.result()
                yield from zip(asked, outcomes, strict=True)
        finally:
            for worker in workers:
                worker.stop()
            threads.shutdown(cancel_futures=True)


class _Worker:
    """A process that runs samples, see ``worker``."""

    def __init__(self, begin: Any) -> None:
        self.process = start_worker("msahl.api.worker")
        assert self.process.stdin
        assert self.process.stdout
        self.into, self.out = self.process.stdin, self.process.stdout
        if sys.platform == "linux":
            import fcntl

            with suppress(OSError):
                fcntl.fcntl(self.out, fcntl.F_SETPIPE_SZ, PIPE)
        self.begin = begin

    def ask(self, samples: list[Sample]) -> list[Outcome]:
        """Return the outcomes of ``samples``; raises ``BatchError`` if the process ends."""
        try:
            if self.begin is not None:
                send(self.into, self.begin)
                self.begin = None
            send(self.into, samples)
            found: list[Outcome] = receive(self.out)
        except (EndedError, BrokenPipeError) as error:
            status = self.process.wait()
            raise BatchError(f"a process of the batch ended with exit status {status}") from error
        return found

    def stop(self) -> None:
        """End the process, whatever it does."""
        end_worker(self.process)
