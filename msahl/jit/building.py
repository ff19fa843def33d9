"""Compiles kernels that are not on disk: side by side, in processes of their own.

The compiler spends most of its time in Python, so threads would wait for each other. Every function
is translated once, whoever calls it; which functions it calls is known then. As soon as all parts
of an entry or unit are translated, it is linked to an object file.
"""

import atexit
import json
import queue
import subprocess
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from msahl.jit.files import Files
from msahl.jit.kernel import UNITS
from msahl.jit.object_file import Name, ObjectFile, Unit, name_of, types_of
from msahl.jit.progress import CompileError, Listener, Progress
from msahl.jit.reach import code_size, resolve
from msahl.jit.worker import link, translate
from msahl.records import record
from msahl.subprocesses import cores, end_worker, start_worker

MOST_PROCESSES = 4
"""Number of processes that a model's kernels keep busy."""
WAIT = 0.1
"""Seconds between looks at whether the user wants to stop."""
TRANSLATION, LINKING = 1.2e-4, 1.6e-4
"""Seconds to translate and to link one byte of bytecode; a first guess, corrected by the parts that
are done."""


@record(slots=False)
class Job:
    """Work for one process: to translate a function, or to link it with all that it calls."""

    name: Name
    links: bool
    expected: float  # seconds


class Build:
    """What is to be compiled: functions to be translated, and objects to be linked of them.

    ``on_disk`` returns the objects that need not be linked, ``on_done`` receives those that are.
    """

    def __init__(
        self,
        files: Files,
        on_disk: Callable[[Name], ObjectFile | None],
        on_done: Callable[[Name, ObjectFile], Any],
    ) -> None:
        self.files, self.on_disk, self.on_done = files, on_disk, on_done
        self.types: dict[Name, str] = {}
        self.codes: dict[Name, ObjectFile] = {}
        self.inside: dict[Name, list[Name]] = {}  # calls of functions that are linked with it
        self.waiting: list[Name] = []  # objects whose parts are not all translated
        self.known: set[tuple[Name, bool]] = set()  # functions and objects asked for
        self.todo: list[Job] = []
        self.expected = self.needed = 0.0  # seconds of the jobs done
        self.jobs = self.done = 0

    def add_object(self, name: Name, types: str) -> None:
        """Ask for the object of an entry or unit, and for those that it calls."""
        todo = [(name, types)]
        while todo:
            name, types = todo.pop()
            if (name, True) in self.known:
                continue
            self.known.add((name, True))
            there = self.on_disk(name)
            if there is not None:
                todo += zip(there.calls, there.types, strict=True)
                continue
            self.waiting.append(name)
            self._add_function(name, types)

    def _add_function(self, name: Name, types: str) -> None:
        """Ask for the intermediate code of a function, and of those that it calls."""
        if (name, False) in self.known:
            return
        self.known.add((name, False))
        self.types[name] = types
        code = self.files.find_code(name)
        if code is not None:
            self._take_code(name, code)
        else:
            size = len(resolve(name[0], name[1]).__code__.co_code)
            self._put(Job(name, False, TRANSLATION * size))

    def _take_code(self, name: Name, code: ObjectFile) -> None:
        """Take the intermediate code of a function, and ask for what it calls."""
        self.codes[name], self.inside[name] = code, []
        for call, types in zip(code.calls, code.types, strict=True):
            if resolve(call[0], call[1]) in UNITS:
                self.add_object(call, types)
            else:
                self.inside[name].append(call)
                self._add_function(call, types)

    def _put(self, job: Job) -> None:
        self.todo.append(job)
        self.todo.sort(key=lambda job: (job.links, job.expected))
        self.jobs += 1

    def take(self) -> Job | None:
        """Return the next job; linking comes first, as it takes longest."""
        return self.todo.pop() if self.todo else None

    def find_complete(self) -> None:
        """Put the objects on the list whose parts are all translated."""
        for name in [name for name in self.waiting if self.parts(name) is not None]:
            self.waiting.remove(name)
            self._put(Job(name, True, _linking_time(name)))

    def parts(self, name: Name) -> dict[Name, ObjectFile] | None:
        """Return the intermediate codes that make up an object; None while some are missing."""
        found: dict[Name, ObjectFile] = {}
        todo = [name]
        while todo:
            part = todo.pop()
            if part in found:
                continue
            if part not in self.codes:
                return None
            found[part] = self.codes[part]
            todo += self.inside[part]
        return found

    def finish(self, job: Job, code: ObjectFile, seconds: float) -> None:
        """Take the result of a job."""
        self.expected, self.needed = self.expected + job.expected, self.needed + seconds
        self.done += 1
        if job.links:
            self.on_done(job.name, code)
            return
        self.files.save_code(job.name, code)
        self._take_code(job.name, code)
        self.find_complete()

    def progress(self, working: dict[Job, float]) -> Progress:
        """Return the progress; ``working`` holds the times at which jobs were begun."""
        factor = self.needed / self.expected if self.expected else 1.0
        now = time.perf_counter()
        left = factor * sum(job.expected for job in self.todo)
        left += factor * sum(map(_linking_time, self.waiting))
        left += sum(max(0.0, factor * job.expected - now + t) for job, t in working.items())
        names = tuple(job.name[1] for job in working)
        known = self.jobs + len(self.waiting)
        return Progress(self.done, known, names, left / max(1, processes()))


def _linking_time(name: Name) -> float:
    """Return the seconds expected for linking an object."""
    return LINKING * code_size(resolve(name[0], name[1]))


def processes() -> int:
    """Return the number of processes to compile in."""
    return min(MOST_PROCESSES, cores())


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
        work.add_object(name_of(unit), types_of(unit))
    work.find_complete()
    jobs: dict[int, tuple[Job, float]] = {}  # of each busy worker
    with _workers() as team:
        while True:
            for k in range(processes()):
                if k not in jobs and (job := work.take()):
                    jobs[k] = job, time.perf_counter()
                    team.send(k, job, work)
            listen(work.progress(dict(jobs.values())))
            if not jobs:
                return
            if stopped():
                raise KeyboardInterrupt
            try:
                k, head, content = team.answers.get(timeout=WAIT)
            except queue.Empty:
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
        module, name, _ = job.name
        if module == "__main__" or "<" in name:  # other processes do not find it
            content = _carry_out(job, work).as_bytes()
            self.answers.put((k, {"size": len(content)}, content))
            return
        if k not in self.workers:
            process = start_worker("msahl.jit.worker")
            thread = threading.Thread(target=self._read, args=(k, process), daemon=True)
            self.workers[k] = process, thread
            thread.start()
        pipe = self.workers[k][0].stdin
        assert pipe is not None
        with suppress(BrokenPipeError):  # it has ended, which ``_read`` reports
            pipe.write(_request(job, work))
            pipe.flush()

    def end(self) -> None:
        """End all workers, whatever they are doing."""
        for process, thread in self.workers.values():
            end_worker(process)
            thread.join()

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


def _carry_out(job: Job, work: Build) -> ObjectFile:
    """Do a job in this process."""
    module, name, _ = job.name
    if job.links:
        return link(module, name, work.types[job.name], work.parts(job.name) or {})
    return translate(module, name, work.types[job.name])


def _request(job: Job, work: Build) -> bytes:
    """Return a job as ``worker`` reads it."""
    head: dict[str, Any] = {"types": work.types[job.name]}
    if not job.links:
        return json.dumps(head | {"translate": job.name[:2]}).encode() + b"\n"
    parts = {name: code.as_bytes() for name, code in (work.parts(job.name) or {}).items()}
    sizes = [(name, len(content)) for name, content in parts.items()]
    line = json.dumps(head | {"link": job.name[:2], "parts": sizes}).encode()
    return line + b"\n" + b"".join(parts.values())


@contextmanager
def _workers() -> Iterator[_Team]:
    """Lend the team of this process, which is ended with it, or at once after any failure."""
    global _team
    team, _team = _team or _Team(), None
    try:
        yield team
    except BaseException:
        team.end()
        raise
    _team = team


def end_team() -> None:
    """End the workers of this process; the next build starts others."""
    global _team
    team, _team = _team, None
    if team is not None:
        team.end()


_team: _Team | None = None
atexit.register(end_team)
