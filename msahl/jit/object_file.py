"""The code of one kernel, intermediate or for the machine, as it is kept on disk and sent between
processes."""

import json
from dataclasses import dataclass
from typing import Any

from msahl.jit.arguments import Description

Unit = tuple[str, str, tuple[Description, ...]]
"""Module, name and types of arguments of a unit that machine code calls."""


@dataclass(frozen=True)
class ObjectFile:
    """Code of one kernel, the type of its result, and the functions that it calls outside."""

    code: bytes
    result: Description
    units: tuple[Unit, ...]

    def as_bytes(self) -> bytes:
        """Return the content of a file: one line of JSON, then the object code."""
        head = {"result": self.result, "units": self.units}
        return json.dumps(head).encode() + b"\n" + self.code

    @staticmethod
    def from_bytes(content: bytes) -> "ObjectFile":
        """Read what ``as_bytes`` returned; raise ValueError for anything else."""
        line, _, code = content.partition(b"\n")
        head = json.loads(line)
        if not isinstance(head, dict) or not code:
            raise ValueError("no object file")
        units = tuple((module, name, as_tuples(types)) for module, name, types in head["units"])
        return ObjectFile(code, as_tuples(head["result"]), units)


def as_tuples(value: Any) -> Any:
    """Return lists as tuples, at all depths."""
    return tuple(map(as_tuples, value)) if isinstance(value, list) else value
