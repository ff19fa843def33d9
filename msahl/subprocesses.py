"""How a process of this program starts and ends others, and how many there may be."""

import os
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from subprocess import Popen

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables of the environment that limit the threads of numpy's linear algebra."""


def use_one_thread() -> None:
    """Have numpy, which is imported later, use one thread, unless the environment says otherwise.

    Starting the threads takes longer than all that a run has to do with dense matrices.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")


def command_of(module: str) -> list[str]:
    """Return the command that runs a module of the program.

    ``-P``: files of the user's folder, such as a ``queue.py``, are not taken for Python's modules.
    """
    return [sys.executable, "-P", "-m", module]


def environment() -> dict[str, str]:
    """Return the environment of such a process: it finds the modules that this one finds."""
    given = os.environ.get("PYTHONPATH")
    places = [place or str(Path.cwd()) for place in sys.path]
    return os.environ | {"PYTHONPATH": os.pathsep.join([given, *places] if given else places)}


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def start_worker(module: str, variables: Mapping[str, str] | None = None) -> "Popen[bytes]":
    """Start a process that runs a ``module``, with pipes to its input and from its output;
    ``variables`` of the environment count where none are set.
    """
    import subprocess  # which a run does without

    return subprocess.Popen(
        command_of(module),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**(variables or {}), **environment()},
        # An interruption by the terminal is for this process alone, on Unix and on Windows.
        start_new_session=True,
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )


def end_worker(process: "Popen[bytes]") -> None:
    """End a process at once, whatever it does."""
    process.kill()
    process.wait()
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with suppress(OSError):
                stream.close()
