"""Measure cost against the number of bodies: step, complete command, memory.

    python -m benchmarks.scale                       # results/scale.{md,png}, some minutes
    python -m benchmarks.scale --most 10000 -o DIR

Each run is a complete process ``msahl run`` of ten steps with Newton's method and without error
estimate, its kernels in the cache. The time of a step is that of additional steps: the loop of
three times as many less that of the first run. A step of a small model is timed by thousands.
"""

import argparse
import json
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib

from benchmarks.machine import describe
from benchmarks.process import MSAHL, Ended, run
from benchmarks.structure_decks import STRUCTURES, structure_deck

matplotlib.use("Agg")

import matplotlib.pyplot as plt

RESULTS = Path(__file__).with_name("results")
STEPS, DT = 10, 0.001
BODY_STEPS = 200_000
"""Steps times bodies by which a step is timed, unless ten steps are more."""
SIZES = {"chain": (1, 10, 100, 1000, 10_000, 100_000), "net": (10, 100, 1000, 10_000, 20_000)}
HEADS = (
    "structure",
    "bodies",
    "command [s]",
    "CPU [s]",
    "prepare [s]",
    "memory [MB]",
    "step and body [µs]",
)
OPTIONS = ["--solver", "newton", "--error", "off", "-q"]


@dataclass(frozen=True)
class Point:
    """A structure of one size."""

    structure: str
    bodies: int
    command: float  # wall seconds of the command with ten steps
    cpu: float  # its user and system seconds
    prepare: float  # part of the command before the first step, without reading the deck [s]
    memory: float  # its peak [MB]
    step: float  # seconds of a step

    @property
    def step_and_body(self) -> float:
        """Microseconds of a step and body."""
        return 1e6 * self.step / self.bodies


def measure(structure: str, n: int, folder: Path, cache: Path) -> Point:
    """Run the structure of about ``n`` bodies, first to fill the cache."""
    bodies = len(STRUCTURES[structure](n).bodies)
    deck = folder / f"{structure}{n}.xml"
    deck.write_text(structure_deck(structure, n, DT, STEPS * DT))
    _command(deck, folder, cache, STEPS)
    ended, seconds = _command(deck, folder, cache, STEPS)
    steps = max(STEPS, BODY_STEPS // bodies)
    few, many = (_command(deck, folder, cache, k * steps)[1]["loop"] for k in (1, 3))
    step = (many - few) / (2 * steps)
    prepare = seconds["prepare"]
    return Point(structure, bodies, ended.seconds, ended.cpu, prepare, ended.memory, step)


def _command(deck: Path, folder: Path, cache: Path, steps: int) -> tuple[Ended, dict[str, float]]:
    results = folder / f"{deck.stem}-{steps}"
    every = ["--every", str(steps)] if steps > STEPS else []
    words = [*MSAHL, "run", str(deck), *OPTIONS, *every, "--t-final", repr(steps * DT)]
    ended = run([*words, "-o", str(results)], cache)
    seconds = json.loads((results / "run.json").read_text())["seconds"]
    for path in results.iterdir():
        path.unlink()
    return ended, seconds


def draw(points: list[Point], path: Path) -> None:
    """Step, command and memory against the number of bodies, in one figure."""
    figure, grid = plt.subplots(1, 3, figsize=(12.0, 4.0), layout="constrained")
    titles = ("step and body [µs]", "command of ten steps [s]", "peak memory [MB]")
    for axes, title, name in zip(grid, titles, ("step_and_body", "command", "memory"), strict=True):
        for structure, marker in zip(SIZES, "os", strict=True):
            mine = [p for p in points if p.structure == structure]
            values = [getattr(p, name) for p in mine]
            axes.loglog([p.bodies for p in mine], values, marker=marker, label=structure)
        axes.set_xlabel("bodies")
        axes.set_title(title)
        axes.grid(True, which="major", alpha=0.4)
    grid[0].legend()
    figure.savefig(path, dpi=130)
    plt.close(figure)


def page(points: list[Point], machine: list[str]) -> Iterator[str]:
    """Lines of ``scale.md``."""
    yield "# Cost against the number of bodies\n"
    yield (
        "`msahl run --solver newton --error off`, ten steps, complete processes with their kernels "
        "in the cache, one run each. *prepare* is what precedes the first step after the deck has "
        "been read. A step is timed by additional steps of a longer run. Peak memory is the "
        "operating system's figure. The chain swings in a plane; the net has a closed loop for "
        "every 3 bodies and moves in space. Measured by `benchmarks/scale.py`.\n"
    )
    yield "![cost against the number of bodies](scale.png)\n"
    yield f"| {' | '.join(HEADS)} |"
    yield "|---" * len(HEADS) + "|"
    for p in points:
        yield (
            f"| {p.structure} | {p.bodies} | {p.command:.2f} | {p.cpu:.2f} | {p.prepare:.3f} | "
            f"{p.memory:.0f} | {p.step_and_body:.3g} |"
        )
    yield ""
    yield from (f"- {line}" for line in machine)


def write(points: list[Point], machine: list[str], folder: Path) -> None:
    """Write figure and page."""
    folder.mkdir(parents=True, exist_ok=True)
    draw(points, folder / "scale.png")
    (folder / "scale.md").write_text("\n".join(page(points, machine)) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure cost against the number of bodies.")
    parser.add_argument("--most", type=int, default=10**6, metavar="N")
    parser.add_argument("-o", "--output", type=Path, default=RESULTS, metavar="DIR")
    options = parser.parse_args()
    machine, points = describe(), []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cache = Path(os.environ.get("NUMBA_CACHE_DIR", folder / "cache"))
        for structure, sizes in SIZES.items():
            for n in sizes:
                if n <= options.most:
                    points.append(measure(structure, n, folder, cache))
                    print(points[-1], flush=True)
    write(points, machine, options.output)


if __name__ == "__main__":
    main()
