"""The code of one kernel, intermediate or for the machine, as it is kept on disk and sent between
processes.
"""

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


@dataclass(frozen=True)
class ObjectFile:
    """Code of one kernel, the type of its result, and the functions that it calls outside.

    ``types`` holds the types of arguments of the ``calls``, as JSON: nobody reads them unless the
    code of one of these is missing.
    """

    code: bytes
    result: Description
    calls: tuple[Name, ...]
    types: bytes

    @staticmethod
    def of(code: bytes, result: Description, units: Iterable[Unit]) -> "ObjectFile":
        """Return the code of a kernel that calls ``units``."""
        known = list(units)
        types = json.dumps([types for _, _, types in known]).encode()
        return ObjectFile(code, result, tuple(map(name_of, known)), types)

    @property
    def units(self) -> list[Unit]:
        """The functions that it calls, with the types of their arguments."""
        types = as_tuples(json.loads(self.types))
        return [(call[0], call[1], part) for call, part in zip(self.calls, types, strict=True)]

    def as_bytes(self) -> bytes:
        """Return the content of a file: two lines of JSON, then the code."""
        head = {"result": self.result, "calls": self.calls}
        return b"\n".join((json.dumps(head).encode(), self.types, self.code))

    @staticmethod
    def from_bytes(content: bytes) -> "ObjectFile":
        """Read what ``as_bytes`` returned; raise ValueError for anything else."""
        line, _, rest = content.partition(b"\n")
        types, _, code = rest.partition(b"\n")
        head = json.loads(line)
        if not isinstance(head, dict) or not code:
            raise ValueError("no object file")
        return ObjectFile(code, as_tuples(head["result"]), as_tuples(head["calls"]), types)


def as_tuples(value: Any) -> Any:
    """Return lists as tuples, at all depths."""
    return tuple(map(as_tuples, value)) if isinstance(value, list) else value
