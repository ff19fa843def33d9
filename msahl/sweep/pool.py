"""Runs points in processes of this machine, which may die: the points are then run again.

Each worker is given about a second of points at a time, with the next ones before it has finished,
and returns each row as soon as it is there. So it is known which point a worker was at when it
died, or how long that has taken. Such a point is run again after all others; if three workers have
died at it, it has failed.
"""

import os
import selectors
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import orjson

from msahl.jit.progress import CompileError
from msahl.subprocesses import THREADS, cores, end_worker, start_worker
from msahl.sweep.axes import number_text
from msahl.sweep.points import (
    TIMED_OUT,
    ChangedError,
    Job,
    NotWrittenError,
    Point,
    Row,
    crashed_row,
)
from msahl.sweep.work import Supply

CHUNK_SECONDS = 1.0
"""Work that a worker is given at a time [s]."""
MOST_POINTS = 1000
"""Most points that a worker is given at a time."""
MOST_DEATHS = 3
"""Deaths of workers at a point after which it has failed."""
MOST_STARTS = 5
"""Workers in a row that die before they are ready, after which the sweep ends."""
POLL = 0.1
"""Time between two looks at requests to stop and at time limits [s]."""
WARM_SECONDS = 60.0
"""Time that a worker may take for loading the program, beyond the limit of its first point [s]."""
FATAL = {"CompileError": CompileError, "NotWrittenError": NotWrittenError,
         "ChangedError": ChangedError, "DeckError": ChangedError}  # fmt: skip
"""What ends the sweep, by the name that a worker gives it."""


class PoolError(Exception):
    """Workers cannot be started; the message says why."""


class Worker:
    """One process, the points it was given in their order, and when it began the first of them."""

    def __init__(self, job: Job) -> None:
        try:
            self.process = start_worker("msahl.sweep.worker", dict.fromkeys(THREADS, "1"))
        except OSError as error:
            raise PoolError(f"no process can be started: {error.strerror or error}") from error
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.source, self.sink = self.process.stdout, self.process.stdin
        self.points: deque[Point] = deque()
        self.ready = self.warm = self.compiling = False
        self.since = time.monotonic()
        self._rest = b""
        self._write(job.as_json())

    def _write(self, message: Any) -> None:
        with suppress(OSError):  # it has died, which reading reports
            self.sink.write(orjson.dumps(message) + b"\n")
            self.sink.flush()

    def give(self, points: list[Point]) -> None:
        """Hand over points."""
        if not self.points:
            self.since = time.monotonic()
        self.points.extend(points)
        self._write([list(point) for point in points])

    def read(self) -> list[dict[str, Any]] | None:
        """Return the messages that have come; None if the process has ended."""
        content = os.read(self.source.fileno(), 1 << 16)
        if not content:
            return None
        *lines, self._rest = (self._rest + content).split(b"\n")
        return [orjson.loads(line) for line in lines]

    def seconds(self) -> float:
        """Seconds for which it has been at its present point, without compiling."""
        busy = self.points and self.ready and not self.compiling
        return time.monotonic() - self.since if busy else 0.0

    def kill(self) -> None:
        """End the process at once."""
        end_worker(self.process)


class Pool:
    """A scheduler of ``jobs`` processes, at most one for each core and point; a point may take
    ``timeout`` seconds if that is given.

    ``compiling`` is called when a worker begins to compile kernels. Workers of a ``lasting`` pool
    wait for more points of the same job until ``close``.
    """

    def __init__(
        self,
        jobs: int,
        timeout: float | None = None,
        compiling: Callable[[], Any] = lambda: None,
        lasting: bool = False,
    ) -> None:
        self.jobs, self.timeout, self.compiling = min(jobs, cores()), timeout, compiling
        self.lasting = lasting
        self.workers: list[Worker] = []
        self.deaths: Counter[int] = Counter()
        # Points at which a worker has died. They are run again after all others: whoever kills
        # workers at random then hardly meets the same point often enough to make it fail.
        self.suspects: deque[Point] = deque()
        self.failed_starts = 0
        self.seconds_per_point = 0.0  # seconds that a point takes, by the last ones; 0: not known
        self.job: Job
        self.work: Supply
        self.selector: selectors.BaseSelector

    def run(self, job: Job, work: Supply, stopped: Callable[[], bool]) -> None:
        """See ``work.Scheduler``."""
        self.job, self.work = job, work
        self.suspects.clear()
        with selectors.DefaultSelector() as self.selector:
            for worker in self.workers:
                self.selector.register(worker.source, selectors.EVENT_READ, worker)
            try:
                while not stopped() and not work.finished:
                    self._fill()
                    for key, _ in self.selector.select(POLL):
                        self._hear(key.data)
                    self._enforce_limit()
            finally:
                for worker in [*self.workers]:
                    if not self.lasting or worker.points:
                        self._remove(worker)

    def close(self) -> None:
        """End the workers of a lasting pool."""
        for worker in self.workers:
            worker.kill()
        self.workers.clear()

    def _fill(self) -> None:
        """Start workers that are missing, and give points to those that have few."""
        # The first worker compiles what all of them need.
        wanted = self.jobs if self.seconds_per_point else 1
        while len(self.workers) < min(wanted, max(1, self.work.left)):
            worker = Worker(self.job)
            self.workers.append(worker)
            self.selector.register(worker.source, selectors.EVENT_READ, worker)
        for worker in self.workers:
            most = self._chunk()
            if worker.ready and len(worker.points) <= most // 2:
                points = self.work.next(1 if not self.seconds_per_point else most)
                if not points and self.suspects and not worker.points:
                    points = [self.suspects.popleft()]
                if points:
                    worker.give(points)

    def _chunk(self) -> int:
        """Return the number of points for about a second of work; fewer near the end, so that all
        workers end together."""
        if not self.seconds_per_point:
            return 1
        share = self.work.left // (4 * self.jobs) + 1
        return max(1, min(MOST_POINTS, share, int(CHUNK_SECONDS / self.seconds_per_point)))

    def _hear(self, worker: Worker) -> None:
        """Take what a worker says, or notice that it has died."""
        messages = worker.read()
        if messages is None:
            self._lose(worker)
            return
        rows: list[Row] = []
        for message in messages:
            if "ready" in message:
                worker.ready, self.failed_starts = True, 0
            elif "warm" in message:
                worker.warm = True
            elif "compiling" in message:
                worker.compiling = message["compiling"]
                self.compiling() if worker.compiling else None
            elif "fatal" in message:
                kind, words = message["fatal"]
                raise FATAL[kind](words)
            else:
                worker.points.popleft()
                worker.compiling = False
                rows.append(message)
        now = time.monotonic()
        if rows:
            self._measure((now - worker.since) / len(rows))
            self.work.take(rows)
        worker.since = now

    def _measure(self, seconds: float) -> None:
        """Correct the seconds that a point takes."""
        seconds = max(seconds, 1e-6)
        self.seconds_per_point = (
            0.7 * self.seconds_per_point + 0.3 * seconds if self.seconds_per_point else seconds
        )

    def _lose(self, worker: Worker) -> None:
        """A worker has died: others do its points; that at which it died may have failed."""
        points = list(worker.points)
        self._remove(worker)
        if not worker.ready:
            self.failed_starts += 1
            if self.failed_starts >= MOST_STARTS:
                status = worker.process.returncode
                raise PoolError(f"workers end before they are ready, with exit status {status}")
        if points:
            suspect = points.pop(0)
            self.deaths[suspect.number] += 1
            if self.deaths[suspect.number] >= MOST_DEATHS:
                message = f"the process that ran it ended without a result, {MOST_DEATHS} times"
                self.work.take([crashed_row(suspect, message)])
            else:
                self.suspects.append(suspect)
        self.work.give_back(points)

    def _enforce_limit(self) -> None:
        """Kill workers whose present point takes longer than it may."""
        limit = self.timeout
        for worker in [*self.workers]:
            if limit is None or worker.seconds() <= limit + (0.0 if worker.warm else WARM_SECONDS):
                continue
            points = list(worker.points)
            self._remove(worker)
            message = f"took longer than {number_text(limit)} s (--timeout)"
            row = crashed_row(points.pop(0), message, TIMED_OUT) | {"limit": limit}
            self.work.take([row])
            self.work.give_back(points)

    def _remove(self, worker: Worker) -> None:
        self.selector.unregister(worker.source)
        self.workers.remove(worker)
        worker.kill()
