"""A process that runs samples of a model for ``msahl.api.batch``, and the messages to and from it.

A message is a pickle with the arrays in it apart, so that they are copied once. Both ends are this
program and the pipe between them is open to nobody else.
"""

import pickle
import struct
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
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


def outcomes_of(
    model: "Model",
    samples: "Sequence[Mapping[str, Value]]",
    options: Mapping[str, Any],
    tables: Sequence[str] | None,
) -> Iterator[Outcome]:
    """Run a ``model`` with the numbers of each of ``samples``, which are read at once if they can
    be; the exceptions of a user's mistake are yielded in place of outcomes.
    """
    from msahl.api.model import read_together

    models = read_together(model, samples) if len(samples) > 1 else None

    def read(k: int) -> "Model":
        return model.with_(**samples[k]) if models is None else models[k]

    for k in range(len(samples)):
        yield _outcome_of(partial(read, k), options, tables)


def _outcome_of(
    read: "Callable[[], Model]", options: Mapping[str, Any], tables: Sequence[str] | None
) -> Outcome:
    """Run the model that ``read`` returns, or return the exception of a user's mistake."""
    from msahl.api.running import run_job
    from msahl.deck import DeckError
    from msahl.run.options import OptionError
    from msahl.start.velocities import StartError

    try:
        result = run_job(read().job(**options), tables)
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
            send(out, list(outcomes_of(model, samples, options, tables)))
    except (EndedError, BrokenPipeError):
        return


if __name__ == "__main__":
    main()
