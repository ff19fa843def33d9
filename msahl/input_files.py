"""Opens files that users name, which may be pipes."""

import os
from io import BufferedReader
from pathlib import Path


def open_input(path: Path) -> BufferedReader:
    """Open a file or a pipe for reading; a pipe into which nobody writes is empty, where it would
    otherwise be waited for without end. Raises ``OSError``.
    """
    return open(path, "rb", opener=_at_once)


def _at_once(path: str, flags: int) -> int:
    if not hasattr(os, "O_NONBLOCK"):
        return os.open(path, flags)
    number = os.open(path, flags | os.O_NONBLOCK)
    os.set_blocking(number, True)  # those who write into it are waited for
    return number
