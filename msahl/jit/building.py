"""Compiles kernels that are not on disk: side by side, in processes of their own.

The compiler spends most of its time in Python, so threads would wait for each other. Every function
is translated once, whoever calls it; which functions it calls is known then. As soon as all parts
of an entry or unit are translated, it is linked to an object file.
"""

import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from msahl.jit.files import Files
from msahl.jit.kernel import UNITS
from msahl.jit.object_file import ObjectFile, Unit
from msahl.jit.progress import CompileError, Listener, Progress
from msahl.jit.reach import code_size, resolve
from msahl.jit.worker import translate

MOST_PROCESSES = 4
"""Number of processes that a model's kernels keep busy."""
WAIT = 0.1
"""Seconds between looks at whether the user wants to stop."""
TRANSLATION, LINKING = 1.2e-4, 1.6e-4
"""Seconds to translate and to link one byte of bytecode; a first guess, corrected by the parts that
are done."""


@dataclass(frozen=True)
class Job:
    """Work for one process: to translate a function, or to link it with all that it calls."""

    unit: Unit
    links: bool
    expected: float  # seconds


class Build:
    """What is to be compiled: functions to be translated, and objects to be linked of them.

    ``on_disk`` returns the objects that need not be linked, ``on_done`` receives those that are.
    """

    def __init__(
        self,
        files: Files,
        on_disk: Callable[[Unit], ObjectFile | None],
        on_done: Callable[[Unit, ObjectFile], Any],
    ) -> None:
        self.files, self.on_disk, self.on_done = files, on_disk, on_done
        self.codes: dict[Unit, ObjectFile] = {}
        self.todo: list[Job] = []
        self.objects: dict[Unit, bool] = {}  # whether its link job was given out
        self.known: set[Unit] = set()
        self.there: set[Unit] = set()
        self.expected = self.needed = 0.0  # seconds of the jobs done
        self.jobs = self.done = 0

    def add_object(self, unit: Unit) -> None:
        """Ask for the object of an entry or unit."""
        todo = [unit]
        while todo:
            unit = todo.pop()
            if unit in self.objects or unit in self.there:
                continue
            there = self.on_disk(unit)
            if there is None:
                self.objects[unit] = False
                self._add_function(unit)
            else:
                self.there.add(unit)
                todo += there.units

    def _add_function(self, unit: Unit) -> None:
        """Ask for the intermediate code of a function, and of those that it calls."""
        todo = [unit]
        while todo:
            unit = todo.pop()
            if unit in self.known:
                continue
            self.known.add(unit)
            code = self.files.find_code(unit)
            if code is None:
                size = len(resolve(unit[0], unit[1]).__code__.co_code)
                self._put(Job(unit, False, TRANSLATION * size))
                continue
            self.codes[unit] = code
            todo += self._inside(code)

    def _inside(self, code: ObjectFile) -> list[Unit]:
        """Return the calls of functions that are linked with it; ask for the objects of units."""
        inside = []
        for unit in code.units:
            if resolve(unit[0], unit[1]) in UNITS:
                self.add_object(unit)
            else:
                inside.append(unit)
        return inside

    def _put(self, job: Job) -> None:
        self.todo.append(job)
        self.jobs += 1

    def take(self) -> Job | None:
        """Return the next job; linking comes first, as it takes longest."""
        for unit, given in self.objects.items():
            if not given and self.parts(unit) is not None:
                self.objects[unit] = True
                self._put(Job(unit, True, LINKING * code_size(resolve(unit[0], unit[1]))))
        self.todo.sort(key=lambda job: (job.links, job.expected))
        return self.todo.pop() if self.todo else None

    def parts(self, unit: Unit) -> dict[Unit, ObjectFile] | None:
        """Return the intermediate codes that make up an object; None while some are missing."""
        found: dict[Unit, ObjectFile] = {}
        todo = [unit]
        while todo:
            part = todo.pop()
            if part in found:
                continue
            if part not in self.codes:
                return None
            found[part] = self.codes[part]
            todo += (u for u in found[part].units if resolve(u[0], u[1]) not in UNITS)
        return found

    def finish(self, job: Job, code: ObjectFile, seconds: float) -> None:
        """Take the result of a job."""
        self.expected, self.needed = self.expected + job.expected, self.needed + seconds
        self.done += 1
        if job.links:
            self.on_done(job.unit, code)
            return
        self.files.save_code(job.unit, code)
        self.codes[job.unit] = code
        for unit in self._inside(code):
            self._add_function(unit)

    def progress(self, working: dict[Job, float]) -> Progress:
        """Return the progress; ``working`` holds the times at which jobs were begun."""
        factor = self.needed / self.expected if self.expected else 1.0
        now = time.perf_counter()
        left = sum(factor * job.expected for job in self.todo)
        left += sum(
            LINKING * factor * code_size(resolve(unit[0], unit[1]))
            for unit, given in self.objects.items()
            if not given
        )
        left += sum(max(0.0, factor * job.expected - now + t) for job, t in working.items())
        waiting = sum(not given for given in self.objects.values())
        names = tuple(job.unit[1] for job in working)
        return Progress(self.done, self.jobs + waiting, names, left / max(1, processes()))


def processes() -> int:
    """Return the number of processes to compile in."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min(MOST_PROCESSES, cores or 1))


def build(
    work: Build,
    units: Iterable[Unit],
    listen: Listener = lambda progress: None,
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Compile ``units`` and all units that they call, as far as they are not on disk.

    Raises ``CompileError``, and KeyboardInterrupt as soon as ``stopped`` says so.
    """
    for unit in units:
        work.add_object(unit)
    jobs: dict[int, tuple[Job, float]] = {}  # of each busy worker
    with _workers() as team:
        while True:
            for k in range(processes()):
                if k not in jobs and (job := work.take()):
                    jobs[k] = job, time.perf_counter()
                    team.send(k, job, work)
            if not jobs:
                listen(work.progress({}))
                return
            listen(work.progress(dict(jobs.values())))
            try:
                k, head, content = team.answers.get(timeout=WAIT)
            except queue.Empty:
                if stopped():
                    raise KeyboardInterrupt from None
                continue
            if "error" in head:
                raise CompileError(head["error"])
            job, began = jobs.pop(k)
            work.finish(job, ObjectFile.from_bytes(content), time.perf_counter() - began)


class _Team:
    """Worker processes, and the queue of what they answer."""

    def __init__(self) -> None:
        self.answers: queue.Queue[tuple[int, dict[str, Any], bytes]] = queue.Queue()
        self.workers: dict[int, tuple[subprocess.Popen[bytes], threading.Thread]] = {}

    def send(self, k: int, job: Job, work: Build) -> None:
        """Give a job to worker ``k``, which is started if needed."""
        if job.unit[0] == "__main__" or "<" in job.unit[1]:
            content = translate(job.unit).as_bytes() if not job.links else _linked(job, work)
            self.answers.put((k, {"size": len(content)}, content))
            return
        if k not in self.workers:
            process = subprocess.Popen(
                [sys.executable, "-m", "msahl.jit.worker"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                start_new_session=True,  # Ctrl-C is for the process that waits
            )
            thread = threading.Thread(target=self._read, args=(k, process), daemon=True)
            self.workers[k] = process, thread
            thread.start()
        pipe = self.workers[k][0].stdin
        assert pipe is not None
        pipe.write(_request(job, work))
        pipe.flush()

    def end(self) -> None:
        """End all workers, whatever they are doing."""
        for process, thread in self.workers.values():
            process.kill()
            process.wait()
            thread.join()
            for pipe in (process.stdin, process.stdout):
                assert pipe is not None
                with suppress(OSError):  # a request that nobody reads any more
                    pipe.close()

    def _read(self, k: int, process: subprocess.Popen[bytes]) -> None:
        """Put the answers of a worker in the queue."""
        pipe = process.stdout
        assert pipe is not None
        for line in pipe:
            if not line.endswith(b"\n"):  # it was killed in the middle of it
                break
            head = json.loads(line)
            self.answers.put((k, head, pipe.read(head.get("size", 0))))
        status = process.wait()
        self.answers.put((k, {"error": f"a compiling process ended with status {status}"}, b""))


def _linked(job: Job, work: Build) -> bytes:
    """Link in this process."""
    from msahl.jit import machine_code

    return machine_code.link(job.unit, work.parts(job.unit) or {}).as_bytes()


def _request(job: Job, work: Build) -> bytes:
    """Return a job as ``worker`` reads it."""
    if not job.links:
        return json.dumps({"translate": job.unit}).encode() + b"\n"
    parts = {unit: code.as_bytes() for unit, code in (work.parts(job.unit) or {}).items()}
    sizes = [(unit, len(content)) for unit, content in parts.items()]
    head = json.dumps({"link": job.unit, "parts": sizes}).encode()
    return head + b"\n" + b"".join(parts.values())


@contextmanager
def _workers() -> Iterator[_Team]:
    """A team whose processes are ended in any case."""
    team = _Team()
    try:
        yield team
    finally:
        team.end()
