"""The code of one kernel, as it is kept on disk and sent between processes."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from msahl.jit.arguments import Description, symbol_of

Unit = tuple[str, str, tuple[Description, ...]]
"""Module, name and types of arguments of a kernel."""
Name = tuple[str, str, str]
"""Module, name and symbol of a kernel."""


def name_of(unit: Unit) -> Name:
    """Return the name of a kernel for one set of argument types."""
    return unit[0], unit[1], symbol_of(*unit)


def types_of(unit: Unit) -> str:
    """Return the types of arguments in words. Only the compiler reads them: those of a step are
    descriptions of a thousand arrays.
    """
    return json.dumps(unit[2])


@dataclass(frozen=True)
class ObjectFile:
    """Code of one kernel, the type of its result, and the functions that it calls outside, with the
    types of their arguments (``types_of``).
    """

    code: bytes
    result: Description
    calls: tuple[Name, ...]
    types: tuple[str, ...]

    @staticmethod
    def of(code: bytes, result: Description, units: Iterable[Unit]) -> "ObjectFile":
        """Return the code of a kernel that calls ``units``."""
        known = list(units)
        return ObjectFile(code, result, tuple(map(name_of, known)), tuple(map(types_of, known)))

    def as_bytes(self) -> bytes:
        """Return the content of a file: a line of JSON, then the code."""
        head = {"result": self.result, "calls": self.calls, "types": self.types}
        return json.dumps(head).encode() + b"\n" + self.code

    @staticmethod
    def from_bytes(content: bytes) -> "ObjectFile":
        """Read what ``as_bytes`` returned; raise ValueError for anything else."""
        line, _, code = content.partition(b"\n")
        head = json.loads(line)
        if not isinstance(head, dict) or not code:
            raise ValueError("no object file")
        calls = as_tuples(head["calls"])
        return ObjectFile(code, as_tuples(head["result"]), calls, tuple(head["types"]))


def as_tuples(value: Any) -> Any:
    """Return lists as tuples, at all depths."""
    return tuple(map(as_tuples, value)) if isinstance(value, list) else value
