"""Compiles kernels in a process of its own, on request of ``building.build``.

A request is a line of JSON, followed by bytes where it says so:

    {"translate": [module, name], "types": types}
    {"link": [module, name], "types": types, "parts": [[name, size], ...]} and intermediate codes

The answer is {"size": n} and n bytes, or {"error": text}.
"""

import gc
import json
import sys
import traceback
from collections.abc import Mapping
from typing import Any, BinaryIO

from msahl.jit.object_file import Name, ObjectFile, as_tuples
from msahl.jit.reach import resolve

JOBS_PER_COLLECTION = 100


def _answer(request: dict[str, Any], source: BinaryIO) -> ObjectFile:
    types = request["types"]
    if "translate" in request:
        module, name = request["translate"]
        return translate(module, name, types)
    parts = {
        as_tuples(name): ObjectFile.from_bytes(source.read(size)) for name, size in request["parts"]
    }
    module, name = request["link"]
    return link(module, name, types, parts)


def translate(module: str, name: str, types: str) -> ObjectFile:
    """Return the intermediate code of one function; ``types`` are those of ``types_of``."""
    from msahl.jit import machine_code

    return machine_code.front_end(resolve(module, name), as_tuples(json.loads(types)))


def link(module: str, name: str, types: str, parts: Mapping[Name, ObjectFile]) -> ObjectFile:
    """Return the machine code of one function, with all its parts."""
    from msahl.jit import machine_code

    return machine_code.link((module, name, as_tuples(json.loads(types))), parts)


def main() -> None:
    """Answer requests until the input ends."""
    source, out = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr  # nothing else may be written among the answers
    # The compiler makes millions of objects that live on; looking through them takes a tenth.
    gc.disable()
    for number, line in enumerate(source):
        if number % JOBS_PER_COLLECTION == 0:
            gc.collect()
            gc.freeze()  # what is left is the compiler's own: the next look passes over it
        try:
            content = _answer(json.loads(line), source).as_bytes()
            head: dict[str, Any] = {"size": len(content)}
        except Exception:
            head, content = {"error": traceback.format_exc()}, b""
        out.write(json.dumps(head).encode() + b"\n" + content)
        out.flush()


if __name__ == "__main__":
    main()
