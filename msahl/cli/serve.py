"""The command ``msahl serve``: keep the program in memory for the commands that follow."""

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NoReturn

import click

from msahl.cli.console import say, stop
from msahl.resources import example_deck, folder

if TYPE_CHECKING:
    from msahl.serve.server import Server

PATIENCE = 10.0
"""Seconds in which a server ends on request."""


@click.command(short_help="Keep the program in memory, for commands that start in milliseconds.")
@click.option("--idle", type=click.FloatRange(min=0.01), default=15.0, show_default=True,
              help="Minutes without commands after which the server ends.")  # fmt: skip
@click.option("--stop", "stops", is_flag=True, help="End the server, after its last command.")
def serve(idle: float, stops: bool) -> None:
    """Start a server in the background, which carries out the commands that follow.

    From then on msahl run, check, equilibrium, explain, inverse, kinematics and schema start in a
    copy of the server's process, without loading anything: with the same output, files, exit
    status and signals. The server is for this user, this installation and the present settings of
    the environment only; commands for which it is not right start by themselves, as all do where
    MSAHL_SERVER=0. It ends when it is idle, and when the program is changed. For Linux.

    Example: msahl serve && make -j2
    """
    if sys.platform != "linux":
        stop("msahl serve: servers need Linux; all commands work without one")
    from msahl.serve.client import socket_path
    from msahl.serve.server import alive

    running = alive(socket_path())
    if stops:
        _stop(running, socket_path())
    elif running:
        say(f"msahl serve: process {running} is serving already")
    else:
        _start(60.0 * idle)


def _stop(process: int, path: str) -> None:
    """End a server, and wait until it no longer takes commands."""
    if not process:
        say("msahl serve: no server is running")
        return
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGTERM)
    until = time.monotonic() + PATIENCE
    while Path(path).exists():
        if time.monotonic() > until:
            return say(
                f"msahl serve: process {process} ends after the commands that it carries out"
            )
        time.sleep(0.01)


def _start(idle: float) -> None:
    """Load the program, and leave a copy of this process behind that serves."""
    server = _server(idle)
    told, tell = os.pipe()
    process = os.fork()
    if not process:
        os.close(told)
        _serve(server, tell)
    os.close(tell)
    with open(told, encoding="utf-8") as file:  # noqa: PTH123
        fault = file.read()
    if fault:
        stop(f"msahl serve: {fault}")
    say(f"msahl serve: process {process} is serving; it ends when idle for {idle / 60.0:g} minutes")


def _serve(server: "Server", tell: int) -> NoReturn:
    """Serve, in the process that was left behind; ``tell`` is closed when it does, and gets what
    prevents it.
    """
    status = 1
    try:
        _detach()
        server.serve(lambda: os.close(tell))
        status = 0
    except OSError as error:
        os.write(tell, f"{error.filename or server.path}: {error.strerror or error}".encode())
    finally:
        os._exit(status)


def _detach() -> None:
    """Part this process from its terminal, its files and its working folder."""
    os.setsid()
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in range(3):
        os.dup2(nowhere, number)
    os.close(nowhere)
    os.chdir("/")


def _server(idle: float) -> "Server":
    """Load the program as runs use it; return the server of what was loaded."""
    from msahl.jit.compiled import LOADED, load_in_advance
    from msahl.jit.object_file import name_of
    from msahl.serve.server import Server, Sources

    sources = Sources(_sources())  # before anything is loaded of them
    _warm()

    def program() -> None:
        from msahl.cli import run
        from msahl.cli.main import main

        run.STARTED = time.perf_counter()
        main()

    def loaded() -> list[str]:
        modules = [name for name in sys.modules if name.startswith("msahl.")]
        return modules + ["\t".join(name_of(unit)) for unit in LOADED]

    def load(names: list[str]) -> None:
        for name in names:
            if "\t" not in name:
                import_module(name)
        kernels = (name.split("\t") for name in names if "\t" in name)
        load_in_advance((module, function, symbol) for module, function, symbol in kernels)

    return Server(program, loaded, load, sources, idle)


def _sources() -> Iterator[Path]:
    """Yield the files of the program, and the folder in which other packages are installed."""
    import numpy as np

    yield Path(np.__file__).parents[1]
    for place, pattern in ((Path(__file__).parents[1], "*.py"), (folder("schemas"), "*.xsd")):
        yield from place.rglob(pattern)


def _warm() -> None:
    """Load what runs need, by short ones."""
    from msahl.cli.kernels import TYPICAL, call, silence
    from msahl.cli.main import COMMANDS, DENSE, main

    for name in COMMANDS:
        if name not in DENSE:
            main.get_command(click.get_current_context(), name)
    with silence(), TemporaryDirectory() as place:
        for name in TYPICAL:
            call(main, "check", str(example_deck(name)))
            for solver in ("auto", "newton"):
                words = (str(example_deck(name)), "-q", "-o", f"{place}/{name}-{solver}")
                call(main, "run", *words, "--t-final", "0.05", "--solver", solver)
