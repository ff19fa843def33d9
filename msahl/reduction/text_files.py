"""Text files of finite-element programs, line by line, and their numbers."""

import math
import re
from collections.abc import Iterator
from pathlib import Path

from msahl.input_files import open_input
from msahl.reduction.faults import ReductionError, shown

MOST_BYTES = 2**31
"""Of a file: some forty million entries of a matrix."""
LONGEST_LINE = 2**20
HEAD = 2**16
"""Bytes by which the format of a file is recognised."""
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]?\d+))?")


def head_of(path: Path) -> bytes:
    """Return the first bytes of a file; raises ``ReductionError`` if it cannot be read."""
    if not path.is_file() and path.exists():
        raise ReductionError(str(path), "is no file; it is read several times, so give a file")
    try:
        with open_input(path) as stream:
            head = stream.read(HEAD)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ReductionError(str(path), f"cannot be read: {reason}") from error
    if not head.strip():
        raise ReductionError(str(path), "the file is empty; give the file of an elastic model")
    return head


def lines_of(path: Path) -> Iterator[tuple[int, str]]:
    """Yield number and text of each line, without its end; raises ``ReductionError``."""
    head_of(path)
    size = 0
    with open_input(path) as stream:
        for number in range(1, 2**62):
            line = stream.readline(LONGEST_LINE + 1)
            size += len(line)
            if len(line) > LONGEST_LINE:
                raise ReductionError(str(path), "the line is too long for a model", number)
            if size > MOST_BYTES:
                raise ReductionError(
                    str(path), f"larger than {MOST_BYTES} bytes, the most accepted"
                )
            if not line:
                return
            yield number, line.decode("latin-1").rstrip("\r\n")


def real(text: str) -> float | None:
    """Return a finite number, also one of Fortran's, such as ``1.5D+07`` or ``1.5+7``; None if the
    text is none."""
    match = _REAL.fullmatch(text.strip())
    if match is None:
        return None
    value = float(f"{match[1]}e{match[2]}" if match[2] else match[1])
    return value if math.isfinite(value) else None


def natural(text: str) -> int | None:
    """Return a number from 0 to 10^12; None if the text is none."""
    text = text.strip()
    return int(text) if text.isascii() and text.isdigit() and len(text) <= 12 else None


def not_a_number(path: Path, number: int, text: str) -> ReductionError:
    """Return the fault of a text in the place of a number."""
    return ReductionError(str(path), f"'{shown(text)}' is not a number; correct the line", number)
