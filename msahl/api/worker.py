"""A process that runs samples of a model for ``msahl.api.batch``, and the messages to and from it.

A message is a pickle with the arrays in it apart, so that they are copied once. Both ends are this
program and the pipe between them is open to nobody else.
"""

import pickle
import struct
import sys
from collections.abc import Mapping, Sequence
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from msahl.api.model import Model, Value

SIZES = struct.Struct("<QQ")  # bytes of the pickle, number of arrays

Outcome = tuple[dict[str, Any], dict[str, "np.ndarray"]] | Exception
"""Report and tables of a run, or why there is none."""


class EndedError(Exception):
    """The other end of the pipe is closed."""


def send(stream: IO[bytes], message: Any) -> None:
    """Write a message."""
    buffers: list[pickle.PickleBuffer] = []
    content = pickle.dumps(message, protocol=5, buffer_callback=buffers.append)
    parts = [buffer.raw() for buffer in buffers]
    stream.write(SIZES.pack(len(content), len(parts)))
    stream.write(struct.pack(f"<{len(parts)}Q", *(part.nbytes for part in parts)))
    stream.write(content)
    for part in parts:
        stream.write(part)
    stream.flush()


def receive(stream: IO[bytes]) -> Any:
    """Read a message; raises ``EndedError`` if there is none to come."""
    length, count = SIZES.unpack(_read(stream, SIZES.size))
    sizes = struct.unpack(f"<{count}Q", _read(stream, 8 * count))
    content = _read(stream, length)
    return pickle.loads(content, buffers=[_read(stream, size) for size in sizes])


def _read(stream: IO[bytes], size: int) -> bytearray:
    """Read so many bytes."""
    data = bytearray(size)
    view, begin = memoryview(data), 0
    while begin < size:
        count = stream.readinto(view[begin:])  # type: ignore[attr-defined]
        if not count:
            raise EndedError
        begin += count
    return data


def outcome_of(
    model: "Model",
    changes: "Mapping[str, Value]",
    options: Mapping[str, Any],
    tables: Sequence[str] | None,
) -> Outcome:
    """Run a ``model`` with changed numbers; the exceptions of a user's mistake are returned."""
    from msahl.api.running import run_job
    from msahl.deck import DeckError
    from msahl.run.options import OptionError
    from msahl.start.velocities import StartError

    try:
        result = run_job(model.with_(**changes).job(**options), tables)
    except (DeckError, OptionError, StartError, MemoryError) as error:
        return error
    return result.report, {name: result.array(name) for name in result.tables}


def main() -> None:
    """Answer each list of samples with the list of their outcomes, until the input ends."""
    source, out = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr  # nothing else may be written among the answers
    try:
        model, options, tables = receive(source)
        while True:
            samples = receive(source)
            send(out, [outcome_of(model, changes, options, tables) for changes in samples])
    except (EndedError, BrokenPipeError):
        return


if __name__ == "__main__":
    main()
