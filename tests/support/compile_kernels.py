"""Compile the kernels that the tests need, in several processes, unless they are on disk already.

    python -m tests.support.compile_kernels [PROCESSES]

Processes that run tests side by side would each compile the kernels that they meet first.
"""

import multiprocessing
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path

from click.testing import CliRunner

from msahl.jit.compiled import STORE
from msahl.model.scheme import AUTO, EXPONENTIAL
from tests.support.models import DECKS, deck, simulate

DONE = "tests"
"""Name that is kept in the store once everything is compiled."""
MODELS = ("four_bar", "double_pendulum_89")
"""One with scalar constraints, which take longer to compile, and one without."""
FRICTION = "friction_hinge"
JOBS = (
    *((FRICTION, {"scheme": scheme}) for scheme in (AUTO, "gauss3")),
    *((name, {"scheme": AUTO}) for name in MODELS),
    *((name, {"scheme": "gauss3", "solver": "root"}) for name in MODELS),
    *((name, {"scheme": "gauss3"}) for name in MODELS),
    *((name, {"reactions": "instantaneous"}) for name in MODELS),
    *((name, {"rotation_update": EXPONENTIAL, "solver": "root"}) for name in MODELS),
    *((name, {"rotation_update": EXPONENTIAL}) for name in MODELS),
    *((name, {"solver": "root"}) for name in MODELS),
    *((name, {}) for name in MODELS),
    *((name, None) for name in MODELS),
)
"""Models with their options, the most expensive first; None stands for the reports on a run."""
SETTINGS = ("reactions", "rotation_update")
"""Options that a deck gives."""


def compile_job(job) -> str:
    """Compile what one of the ``JOBS`` needs; return a line about it."""
    name, options = job
    began = time.perf_counter()
    if options is None:
        report_on(name)
    else:
        model = deck(name)
        given = {key: options[key] for key in SETTINGS if key in options}
        others = {key: value for key, value in options.items() if key not in given}
        model = replace(model, simulation=replace(model.simulation, **given))
        simulate(model, t_final=2.0 * model.simulation.dt, **others)
    chosen = "reports" if options is None else " ".join(map(str, options.values()))
    return f"{name} {chosen}: {time.perf_counter() - began:.1f} s"


def report_on(name: str) -> None:
    """Run the deck for a moment and evaluate its results."""
    from msahl.cli.main import main
    from msahl.post.cli import main as post

    (path,) = (path for path in DECKS if path.stem == name)
    with tempfile.TemporaryDirectory() as folder:
        out = str(Path(folder) / "out")
        CliRunner().invoke(main, ["run", str(path), "--t-final", "0.01", "-q", "-o", out])
        for command in ("energy", "constraints"):
            CliRunner().invoke(post, [command, out])


def main(processes: int) -> None:
    """Compile all ``JOBS`` in so many processes."""
    if os.environ.get("NUMBA_DISABLE_JIT") or STORE.load(DONE) is not None:
        return
    print("compiling the kernels of the tests", flush=True)
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        for job in as_completed([pool.submit(compile_job, job) for job in JOBS]):
            print(f"  {job.result()}", flush=True)
    STORE.save(DONE, b"")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2)
