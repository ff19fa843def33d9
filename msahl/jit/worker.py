"""Compiles kernels in a process of its own, on request of ``building.build``.

A request is a line of JSON, followed by bytes where it says so:

    {"translate": unit}             to intermediate code
    {"link": unit, "parts": [[other, size], ...]} and the intermediate codes, to machine code

The answer is {"size": n} and n bytes, or {"error": text}.
"""

import json
import sys
import traceback
from typing import Any, BinaryIO

from msahl.jit.object_file import ObjectFile, Unit, as_tuples
from msahl.jit.reach import resolve


def translate(unit: Unit) -> ObjectFile:
    """Return the intermediate code of one function."""
    from msahl.jit import machine_code

    module, name, described = unit
    return machine_code.front_end(resolve(module, name), described)


def _answer(request: dict[str, Any], source: BinaryIO) -> ObjectFile:
    if "translate" in request:
        return translate(as_tuples(request["translate"]))
    from msahl.jit import machine_code

    codes = {
        as_tuples(unit): ObjectFile.from_bytes(source.read(size)) for unit, size in request["parts"]
    }
    return machine_code.link(as_tuples(request["link"]), codes)


def main() -> None:
    """Answer requests until the input ends."""
    source, out = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr  # nothing else may be written among the answers
    for line in source:
        try:
            content = _answer(json.loads(line), source).as_bytes()
            head: dict[str, Any] = {"size": len(content)}
        except Exception:
            head, content = {"error": traceback.format_exc()}, b""
        out.write(json.dumps(head).encode() + b"\n" + content)
        out.flush()


if __name__ == "__main__":
    main()
