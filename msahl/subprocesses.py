"""How a process of this program starts another one: its command and its environment."""

import os
import sys
from pathlib import Path


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
