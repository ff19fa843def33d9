"""Runs points on the workers of a Dask cluster, which may come, go and die.

Points are sent in chunks of about a second of work, at most ``AHEAD`` for each thread of a worker
at a time, so the scheduler holds few of them whatever the size of the plan. Dask runs the chunks of
a worker that died on others. Rows return to this process, which alone writes the journal.
"""

import os
import queue
import re
import time
import uuid
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msahl.printable import printable
from msahl.sweep.chunks import Files, Order, mismatch, run_chunk
from msahl.sweep.faults import ClusterError
from msahl.sweep.points import (
    SUMMARY,
    Job,
    NotWrittenError,
    Point,
    Resolver,
    crashed_row,
    is_kept,
    kept_folder,
    numeric_versions,
    put_in_place,
)
from msahl.sweep.pool import CHUNK_SECONDS, FATAL, MOST_DEATHS, MOST_POINTS, POLL
from msahl.sweep.work import Supply

if TYPE_CHECKING:
    from distributed import Client, Future

AHEAD = 2
"""Chunks for each thread of a worker: one that runs, and the next."""
CONNECT_SECONDS = 30.0
"""Time to wait for the scheduler, and for its file."""
LOST_SECONDS = 30.0
"""Time without connection to the scheduler after which the sweep ends."""
GATHER_SECONDS = 60.0
"""Time to wait for the rows of a chunk that has ended, before it is run again."""
SEE_WORKERS = 1.0
"""Time between two looks at the workers [s]."""
NETWORK = ("tcp", "tls", "ws", "wss", "ucx")
"""Protocols of addresses that have a port."""
MISSING = "Dask is not installed here; install it: pip install 'msahl[cluster]'"


class Cluster:
    """A scheduler: the Dask scheduler at an ``address`` such as tcp://host:8786, or the one that
    wrote the file of this name.

    A point may take ``timeout`` seconds if that is given. ``tell`` is called with messages.
    """

    def __init__(
        self,
        address: str,
        timeout: float | None = None,
        tell: Callable[[str], Any] = lambda message: None,
    ) -> None:
        self.address, self.timeout, self.tell = address, timeout, tell
        self.chunks: dict[Future[Any], list[Point]] = {}
        self.ended: queue.SimpleQueue[Future[Any]] = queue.SimpleQueue()
        self.deaths: Counter[int] = Counter()
        self.seconds_per_point = 0.0  # seconds that a point takes, by the last ones; 0: not known
        self.threads = 0  # of all workers
        self.seen = self.heard = 0.0  # when the workers were counted, the scheduler answered
        self.announced = False
        self.client: Client
        self.order: bytes
        self.job: Job
        self.work: Supply

    def run(self, job: Job, work: Supply, stopped: Callable[[], bool]) -> None:
        """See ``work.Scheduler``. Raises ``ClusterError`` as well."""
        self.job, self.work = replace(job, source=Resolver(job).deck.source), work
        with self._connected(stopped), self._marked() as mark:
            self._refuse_other_versions()
            sent = replace(self.job, folder=str(Path(job.folder).absolute()))
            self.order = Order(sent, numeric_versions(), self.timeout, str(mark)).packed()
            while not stopped() and not work.finished:
                self._look_at_workers()
                self._fill()
                with suppress(queue.Empty):
                    self._hear(self.ended.get(timeout=POLL))

    @contextmanager
    def _connected(self, stopped: Callable[[], bool]) -> Iterator[None]:
        """Connect to the scheduler, and give up what is under way there at the end."""
        try:
            import distributed
        except ImportError:
            raise ClusterError(MISSING) from None
        with warnings.catch_warnings(), _silence():
            # Dask warns of versions that differ; those that matter are refused below.
            warnings.simplefilter("ignore")
            where = self._where(stopped)
            try:
                self.client = distributed.Client(
                    **where, timeout=CONNECT_SECONDS, set_as_default=False
                )
            except (OSError, ValueError, TypeError) as error:
                reason = printable(str(error) or type(error).__name__)
                raise ClusterError(
                    f"no scheduler at {self.address}: {reason}; start one with 'dask scheduler'"
                ) from error
            self.heard = time.monotonic()
            try:
                yield
            finally:
                with suppress(Exception):  # the scheduler may be gone
                    self.client.cancel(list(self.chunks), force=True)
                self.chunks.clear()
                self.client.close(timeout=5.0)

    def _where(self, stopped: Callable[[], bool]) -> dict[str, str]:
        """The argument of Dask's client: an address, or a file as soon as it is there."""
        if "://" in self.address:
            if not _has_port(self.address):
                raise ClusterError(
                    f"{self.address}: the port of the scheduler is missing; write it as in "
                    "tcp://host:8786"
                )
            return {"address": self.address}
        if _names_a_port(self.address):
            return {"address": self.address}
        path, began = Path(self.address), time.monotonic()
        if not path.is_file():
            if not _may_be_written(self.address):
                raise ClusterError(_no_address(self.address))
            self.tell(f"waiting for the file {self.address} of a scheduler")
        while not path.is_file():
            if stopped() or time.monotonic() - began > CONNECT_SECONDS:
                raise ClusterError(
                    f"{self.address}: no scheduler has written this file; start one with "
                    f"'dask scheduler --scheduler-file {self.address}', or name host and port, as "
                    "in tcp://host:8786"
                )
            time.sleep(POLL)
        return {"scheduler_file": self.address}

    @contextmanager
    def _marked(self) -> Iterator[Path]:
        """Put a file into the folder of the sweep, by which workers see whether they share it."""
        mark = Path(self.job.folder).absolute() / f".sweep-{uuid.uuid4().hex}"
        if self.job.keep == SUMMARY:
            yield mark
            return
        mark.touch()
        try:
            yield mark
        finally:
            mark.unlink(missing_ok=True)

    def _refuse_other_versions(self) -> None:
        """Raise ``ClusterError`` if a worker has other software; those that come later are asked
        with each chunk."""
        for address, found in self.client.run(numeric_versions, on_error="return").items():
            if isinstance(found, Exception):
                raise ClusterError(_unusable(f"the worker {address}", found))
            wrong = mismatch(numeric_versions(), found)
            if wrong:
                raise ClusterError(_other_versions(f"the worker {address}", wrong))

    def _look_at_workers(self) -> None:
        """Count the threads of the workers now and then; raise ``ClusterError`` if the scheduler
        does not answer any more."""
        now = time.monotonic()
        if now - self.seen < SEE_WORKERS:
            return
        self.seen = now
        try:
            if self.client.status == "running":
                self.threads = sum(self.client.nthreads().values())
                self.heard = now
        except (OSError, ValueError, TimeoutError):
            self.threads = 0
        if now - self.heard > LOST_SECONDS or self.client.status == "closed":
            raise ClusterError(
                f"lost the scheduler at {self.address}; what was done is kept: start it again, and "
                "repeat the command"
            )
        if not self.threads and not self.announced:
            self.announced = True
            self.tell(f"waiting for workers at {self.address}")

    def _fill(self) -> None:
        """Send chunks until every thread has the next one."""
        while len(self.chunks) < AHEAD * self.threads and self.client.status == "running":
            points = self.work.next(self._chunk())
            if not points:
                return
            future = self.client.submit(
                run_chunk, self.order, [tuple(point) for point in points], pure=False
            )
            self.chunks[future] = points
            future.add_done_callback(self.ended.put)

    def _chunk(self) -> int:
        """Return the number of points for about a second of work; fewer near the end, so that all
        workers end together, and one if points kill workers."""
        if not self.seconds_per_point or self.deaths:
            return 1
        share = self.work.left // (2 * AHEAD * max(1, self.threads)) + 1
        return max(1, min(MOST_POINTS, share, int(CHUNK_SECONDS / self.seconds_per_point)))

    def _hear(self, future: "Future[Any]") -> None:
        """Take the rows of a chunk that has ended, or have it run again."""
        from distributed import KilledWorker

        points = self.chunks.pop(future, None)
        if points is None:
            return
        try:
            result = future.result(timeout=GATHER_SECONDS)
        except KilledWorker:
            self._lose(points)
            return
        except (OSError, TimeoutError, EOFError):  # the worker died with the rows
            self.work.give_back(points)
            return
        except BaseException as error:
            if future.status == "cancelled" or type(error).__name__.endswith("CancelledError"):
                self.work.give_back(points)  # the scheduler was restarted, or lost
                return
            if isinstance(error, Exception):
                raise ClusterError(_unusable("a worker", error)) from error
            raise
        if "fatal" in result:
            self._raise(*result["fatal"])
        self._measure(result["seconds"] / len(points))
        self._keep(result["files"])
        self.work.take(result["rows"])

    def _raise(self, kind: str, words: str) -> None:
        """Raise what a worker says is fatal."""
        if kind == "VersionError":
            raise ClusterError(_other_versions("a worker", words))
        raise FATAL.get(kind, ClusterError)(words)

    def _measure(self, seconds: float) -> None:
        """Correct the seconds that a point takes: at once if they are fewer, since the first chunks
        of a worker start a process and may compile."""
        before = self.seconds_per_point or seconds
        self.seconds_per_point = max(1e-6, min(seconds, 0.7 * before + 0.3 * seconds))

    def _lose(self, points: list[Point]) -> None:
        """Several workers have died with these points: they are run one by one, and one with which
        workers die again has failed."""
        if len(points) == 1:
            message = f"the process that ran it ended without a result, {MOST_DEATHS} times"
            self.work.take([crashed_row(points[0], message)])
            return
        self.deaths.update(point.number for point in points)
        self.work.give_back(points)

    def _keep(self, files: Files) -> None:
        """Write the tables that a worker has sent back."""
        for key, content in files.items():
            final = kept_folder(self.job.folder, key)
            part = final.with_name(f"{final.name}.{os.getpid()}.part")
            try:
                if is_kept(self.job.folder, key, self.job.keep):
                    continue
                part.mkdir(parents=True, exist_ok=True)
                for name, data in content.items():
                    (part / name).write_bytes(data)
                put_in_place(self.job, part, key)
            except OSError as error:
                reason = f"{error.filename or part}: {error.strerror or error}"
                raise NotWrittenError(reason) from error


def _has_port(address: str) -> bool:
    """Whether an address with a protocol of the network names a port: Dask waits for a minute for
    one without, and cannot be stopped. Other protocols, such as inproc, have none."""
    protocol, _, rest = address.partition("://")
    if protocol not in NETWORK:
        return True
    return re.fullmatch(r"[^/]+:[0-9]{1,5}/?", rest) is not None


def _names_a_port(address: str) -> bool:
    """Whether an address without protocol is host:port, not the name of a file."""
    host, colon, port = address.rpartition(":")
    return bool(colon and host and port.isdigit())


def _may_be_written(address: str) -> bool:
    """Whether a file that there is not may be one that a scheduler writes: a name alone is rather
    that of a host.
    """
    named = _has_folder(address) or address.endswith(".json")
    return named and Path(address).parent.is_dir()


def _has_folder(address: str) -> bool:
    return "/" in address or os.sep in address


def _no_address(address: str) -> str:
    """What is wrong with an address that has no port and is no file."""
    if _has_folder(address):
        return f"{address}: there is no folder {Path(address).parent} that could hold this file"
    host = address.rstrip(":") or "host"
    return (
        f"{address}: neither an address nor a file; write a host with its protocol and port, as in "
        f"tcp://{host}:8786, and a file that a scheduler is yet to write with its folder, as in "
        f"./{address}"
    )


def _other_versions(who: str, wrong: str) -> str:
    return (
        f"{who} has other software than this machine, so its results may differ: {wrong}; install "
        "the same versions there"
    )


def _unusable(who: str, error: Exception) -> str:
    if isinstance(error, ModuleNotFoundError):
        return f"{who} has no package {error.name}; install msahl there, in the same version"
    return f"{who} failed: {type(error).__name__}: {printable(str(error))}"


@contextmanager
def _silence() -> Iterator[None]:
    """Keep Dask's loggers, each of which has its own level, from writing to the terminal."""
    import logging

    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        yield
    finally:
        logging.disable(before)
