"""Keep the runs in a table: errors and iterations, which repeat, and seconds, which do not."""

import csv
import statistics
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.beams.problems import PROBLEMS
from benchmarks.beams.setting import Setting

TABLE = "beams.csv"
HEAD = ("problem", "program", "family", "elements", "step [s]", "error over length", "iterations",
        "preparation [s]", "seconds [s], samples")  # fmt: skip


@dataclass
class Run:
    """A setting of a program, the largest ``error`` over the length of the beam, and seconds of the
    processor: of the solver, and of what precedes it."""

    problem: str
    program: str
    setting: Setting
    error: float
    iterations: int
    preparation: float
    samples: list[float] = field(default_factory=list)

    @property
    def seconds(self) -> float:
        return statistics.median(self.samples)


def save(runs: Iterable[Run], folder: Path) -> None:
    """Write the runs, and keep those of other problems."""
    runs = list(runs)
    measured = {run.problem for run in runs}
    kept = [run for run in load(folder) if run.problem not in measured]
    order = list(PROBLEMS)
    with (folder / TABLE).open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEAD)
        writer.writerows(map(_row, sorted(kept + runs, key=lambda run: order.index(run.problem))))


def load(folder: Path) -> list[Run]:
    """Return the runs in a folder."""
    path = folder / TABLE
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(_runs(csv.reader(file)))


def front(runs: Iterable[Run], factor: float = 1.0) -> list[Run]:
    """Return the runs, the fastest first, than which no other one is as exact and ``factor`` times
    as fast.
    """
    kept: list[Run] = []
    for run in sorted(runs, key=lambda run: (run.seconds, run.error)):
        if all(run.error < o.error or run.seconds < factor * o.seconds for o in kept):
            kept.append(run)
    return kept


def _row(run: Run) -> tuple[object, ...]:
    family, elements, step = run.setting
    samples = " ".join(f"{sample:.3e}" for sample in run.samples)
    return (run.problem, run.program, family, elements, "" if step is None else f"{step:.6g}",
            f"{run.error:.4e}", run.iterations, f"{run.preparation:.3e}", samples)  # fmt: skip


def _runs(rows: Iterator[list[str]]) -> Iterator[Run]:
    next(rows)
    for problem, program, family, elements, step, error, iterations, before, samples in rows:
        setting = Setting(family, int(elements), float(step) if step else None)
        times = [float(word) for word in samples.split()]
        yield Run(problem, program, setting, float(error), int(iterations), float(before), times)
