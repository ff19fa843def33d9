"""Runs chunks of points on a worker of a cluster: what the machines of ``cluster`` call.

The points of a chunk are run by a process of their own, as ``pool`` does it, so that a point that
kills its process, or takes too long, has the same row as on one machine. The process waits for the
next chunk of the same sweep.
"""

import shutil
import tempfile
import threading
import time
import zlib
from collections import deque
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import orjson

from msahl.records import record
from msahl.sweep.points import SUMMARY, Job, Point, Row, kept_folder, numeric_versions
from msahl.sweep.pool import FATAL, Pool, PoolError

Files = dict[str, dict[str, bytes]]
"""Kept tables of points: by key, then by the name of the file."""


@dataclass
class Runner:
    """A process that runs points of a job; tables go to the folder ``scratch`` if the folder of the
    sweep is on another machine."""

    pool: Pool
    job: Job
    scratch: "tempfile.TemporaryDirectory[str] | None" = None

    def close(self) -> None:
        """End the process."""
        self.pool.close()
        if self.scratch:
            self.scratch.cleanup()


_idle: dict[bytes, list[Runner]] = {}
_lock = threading.Lock()


@record(slots=False)
class Order:
    """What all chunks of a sweep share.

    ``versions`` are those that a worker must have; tables are written to the folder of the job
    where the file ``mark`` is seen, and sent back elsewhere.
    """

    job: Job
    versions: dict[str, str]
    timeout: float | None
    mark: str

    def packed(self) -> bytes:
        """The order as compressed JSON."""
        content = {"job": self.job.as_json(), "versions": self.versions}
        return zlib.compress(orjson.dumps({**content, "timeout": self.timeout, "mark": self.mark}))

    @classmethod
    def unpacked(cls, content: bytes) -> "Order":
        """The order that ``packed`` wrote."""
        given = orjson.loads(zlib.decompress(content))
        return cls(**{**given, "job": Job.from_json(given["job"])})


@dataclass
class Chunk:
    """Points that a worker was given, and the rows that it has made of them."""

    waiting: deque[Point]
    running: dict[int, Point] = field(default_factory=dict)
    rows: list[Row] = field(default_factory=list)

    @property
    def left(self) -> int:
        """See ``work.Supply``."""
        return len(self.waiting) + len(self.running)

    @property
    def finished(self) -> bool:
        """See ``work.Supply``."""
        return not self.left

    def next(self, most: int = 1) -> list[Point]:
        """See ``work.Supply``."""
        points = [self.waiting.popleft() for _ in range(min(most, len(self.waiting)))]
        self.running.update((point.number, point) for point in points)
        return points

    def take(self, rows: list[Row]) -> None:
        """See ``work.Supply``."""
        for row in rows:
            del self.running[row["point"]]
        self.rows += rows

    def give_back(self, points: list[Point]) -> None:
        """See ``work.Supply``."""
        for point in points:
            del self.running[point.number]
        self.waiting.extend(points)


def mismatch(here: dict[str, str], there: dict[str, str]) -> str:
    """Say which versions of a worker, ``there``, differ from those ``here``; empty if none does."""
    return ", ".join(
        f"{name} {there.get(name) or 'is missing'} instead of {version}"
        for name, version in here.items()
        if there.get(name) != version
    )


def run_chunk(order: bytes, points: list[tuple[int, str, tuple[str, ...]]]) -> dict[str, Any]:
    """Run points: their "rows", the "files" that are to be kept of them, and the "seconds" taken;
    or what is "fatal", as kind and message."""
    began, given = time.perf_counter(), Order.unpacked(order)
    wrong = mismatch(given.versions, numeric_versions())
    if wrong:
        return {"fatal": ["VersionError", wrong]}
    chunk = Chunk(deque(Point(number, name, tuple(cells)) for number, name, cells in points))
    runner = _take_runner(order, given)
    try:
        runner.pool.run(runner.job, chunk, lambda: False)
        files = _collect(runner.job, chunk.rows) if runner.scratch else {}
    except (*FATAL.values(), PoolError) as error:
        runner.close()
        return {"fatal": [type(error).__name__, str(error)]}
    except BaseException:
        runner.close()
        raise
    with _lock:
        _idle.setdefault(order, []).append(runner)
    return {"rows": chunk.rows, "files": files, "seconds": time.perf_counter() - began}


def _take_runner(order: bytes, given: Order) -> Runner:
    """A process that has waited for a chunk of this sweep, or a new one; those of other sweeps
    end."""
    with _lock:
        for other in [key for key in _idle if key != order]:
            for runner in _idle.pop(other):
                runner.close()
        waiting = _idle.get(order)
        if waiting:
            return waiting.pop()
    pool = Pool(1, given.timeout, lasting=True)
    if given.job.keep == SUMMARY or Path(given.mark).is_file():
        return Runner(pool, given.job)
    scratch = tempfile.TemporaryDirectory(prefix="msahl-", ignore_cleanup_errors=True)
    return Runner(pool, replace(given.job, folder=scratch.name), scratch)


def _collect(job: Job, rows: list[Row]) -> Files:
    """Read the tables of the points, and remove them from this machine."""
    files: Files = {}
    for row in rows:
        folder = kept_folder(job.folder, row["key"])
        if row["key"] and folder.is_dir():
            files[row["key"]] = {path.name: path.read_bytes() for path in folder.iterdir()}
            shutil.rmtree(folder)
    return files
