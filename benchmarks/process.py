"""Measure what a user waits for: complete processes, cold and warm, and their peak memory."""

import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from benchmarks.chain_deck import chain_deck
from benchmarks.problems import THESIS

IMPORTS = [sys.executable, "-c", "import numpy, lxml, click"]
MSAHL = [sys.executable, "-c", "from msahl.cli.start import main; main()"]
LAUNCH = Path(__file__).with_name("launch.py")
LONG_STEP = 0.002
FREE_SPACE = 8e9
"""Free bytes on the disk from which the long run may write every row (about 3 GB)."""


class Ended(NamedTuple):
    seconds: float
    memory: float  # peak resident [MB]
    cpu: float  # seconds of user and system time


class Starts(NamedTuple):
    """Seconds and memory of a command, first (empty cache) and later."""

    cold: Ended
    warm: Ended  # medians
    phases: dict[str, float]  # as the last run.json has them [s]


class LongRun(NamedTuple):
    steps: int
    every: int
    ended: Ended
    size: float  # of the folder written [MB]
    info: dict[str, object]  # run.json


def measure_starts(repeats: int) -> tuple[Ended, dict[str, Starts]]:
    """The bare imports, and ``msahl run`` of 5000 steps of the single pendulum by solver."""
    deck = THESIS / "single_pendulum_45.xml"
    solvers = ("newton", "auto")
    imports: list[Ended] = []
    warm: dict[str, list[Ended]] = {solver: [] for solver in solvers}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # The byte code of our own sources is part of an installation, not of the first run.
        run([*MSAHL, "check", str(deck)], folder)
        commands = {
            solver: [*MSAHL, "run", str(deck), "-q", "--solver", solver, "-o", str(folder / solver)]
            for solver in solvers
        }
        cold = {s: run(commands[s], folder / f"cache-{s}") for s in solvers}
        for _ in range(repeats):
            imports.append(run(IMPORTS, folder))
            for solver in solvers:
                warm[solver].append(run(commands[solver], folder / f"cache-{solver}"))
        phases = {s: json.loads((folder / s / "run.json").read_text())["seconds"] for s in solvers}
    starts = {s: Starts(cold[s], _median(warm[s]), phases[s]) for s in solvers}
    return _median(imports), starts


def measure_long_run(steps: int) -> LongRun:
    """``steps`` steps of the chain of ten bodies by ``msahl run``, every row written if there is
    free space."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        every = 1 if shutil.disk_usage(folder).free > FREE_SPACE else 10
        deck = folder / "chain.xml"
        deck.write_text(chain_deck(10, LONG_STEP, steps * LONG_STEP))
        results = folder / "results"
        command = [*MSAHL, "run", str(deck), "-q", "--solver", "newton", "-o", str(results)]
        ended = run([*command, "--every", str(every)], folder / "cache")
        size = sum(path.stat().st_size for path in results.iterdir()) / 1e6
        info = json.loads((results / "run.json").read_text())
    return LongRun(steps, every, ended, size, info)


def run(command: list[str], cache: Path) -> Ended:
    """Run ``command`` with numba's cache in ``cache``; raises if it fails."""
    # Byte code is kept, as it is for users; some environments switch that off.
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run(
        [sys.executable, "-I", "-S", str(LAUNCH), *command],
        env=kept | {"NUMBA_CACHE_DIR": str(cache)},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return Ended(*map(float, done.stdout.splitlines()[-1].split()))


def _median(runs: list[Ended]) -> Ended:
    return Ended(*(statistics.median(values) for values in zip(*runs, strict=True)))
