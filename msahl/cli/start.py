"""Entries of the commands ``msahl`` and ``msahl-post``, each in a process of its own."""

from collections.abc import Callable
from typing import Any, NoReturn

from msahl.command_process import run_command


def main() -> NoReturn:
    """Run ``msahl`` and leave the process."""
    run_command(_msahl)


def post() -> NoReturn:
    """Run ``msahl-post`` and leave the process."""
    run_command(_post)


def _msahl() -> Callable[[], Any]:
    from msahl.cli.main import main as program

    return program


def _post() -> Callable[[], Any]:
    from msahl.post.cli import main as program

    return program
