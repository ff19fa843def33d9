"""Runs points of a sweep in a process of its own, for ``pool``.

    python -m msahl.sweep.worker

Lines of JSON come in: first the job, then lists of points. Lines of JSON go out: {"ready": true},
{"warm": true} after a few steps at the first point, {"compiling": true or false}, the row of each
point as it ends, and {"fatal": [kind, message]}. The process ends when its input does, even in the
middle of a point: then the sweep was killed.
"""

import os
import queue
import signal
import sys
import threading
from typing import Any

import orjson


def main() -> None:
    """Answer until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the sweep decides what an interruption does
    out = os.dup(1)
    os.dup2(2, 1)  # nothing else may be written among the rows
    sys.stdout = sys.stderr
    lines: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_read, args=(lines,), daemon=True).start()

    def tell(message: Any) -> None:
        rest = orjson.dumps(message) + b"\n"
        try:
            while rest:
                rest = rest[os.write(out, rest) :]
        except OSError:  # nobody reads any more
            os._exit(0)

    _serve(lines, tell)


def _read(lines: "queue.SimpleQueue[bytes]") -> None:
    for line in sys.stdin.buffer:
        lines.put(line)
    os._exit(0)


def _serve(lines: "queue.SimpleQueue[bytes]", tell: Any) -> None:
    """Run the points that come in; ``tell`` writes one line."""
    from msahl.deck import DeckError
    from msahl.jit.compiled import STOPWATCH
    from msahl.jit.progress import CompileError
    from msahl.sweep.points import (
        ChangedError,
        Job,
        NotWrittenError,
        Point,
        crashed_row,
        run_points,
        warm_up,
    )

    STOPWATCH.tell = lambda: tell({"compiling": True})
    STOPWATCH.listen = lambda progress: None if progress.names else tell({"compiling": False})
    job = Job.from_json(orjson.loads(lines.get()))
    tell({"ready": True})
    warm = False
    while True:
        points = [Point(n, name, tuple(cells)) for n, name, cells in orjson.loads(lines.get())]
        while points:
            try:
                if not warm:
                    warm_up(job, points[0])
                    tell({"warm": True})
                    warm = True
                for row in run_points(job, points[:]):
                    points.pop(0)
                    tell(row)
            except (ChangedError, CompileError, DeckError, NotWrittenError) as error:
                tell({"fatal": [type(error).__name__, str(error)]})
                return
            except Exception as error:  # a fault of ours must not end the sweep
                tell(crashed_row(points.pop(0), f"{type(error).__name__}: {error}"))


if __name__ == "__main__":
    main()
