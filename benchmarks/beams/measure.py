"""Error against seconds of beams, by msahl and Exudyn in one process.

    python -m benchmarks.beams.measure [NAME...] [--quick] [--page] [-o DIR]

Writes beams.csv, beams.md and beams.png. Problems that are not named keep what was measured before.
It needs Exudyn in the environment: pip install -e .[bench]
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np

from benchmarks.beams import ours
from benchmarks.beams.page import write_page
from benchmarks.beams.problems import PROBLEMS, Problem
from benchmarks.beams.processes import measure_processes
from benchmarks.beams.references import reference
from benchmarks.beams.setting import FailedRunError, Setting
from benchmarks.beams.store import Run, front, load, save
from benchmarks.machine import describe
from benchmarks.mechanisms.clock import processor_time
from benchmarks.peers import import_peers
from benchmarks.speed import RESULTS, tell

PEERS, MISSING = import_peers({"exudyn": "benchmarks.beams.exudyn_models"})
LONGEST, SHORT = 1.0, 0.2
"""Seconds of a run after which its family gets no smaller step, nor, if its step was the largest,
more elements; and up to which a run is repeated at once."""
WORST = 0.05
"""Largest error, over the length, that is of interest."""
NEAR = 1.3
"""How much slower a run may be than one as exact and be measured again."""
SAMPLES = 5
STEPPED = 0.95
"""Ratio of the errors of neighbouring steps above which the elements decide them."""
QUICK = 23
"""A quick measurement makes each so many-th run."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(PROBLEMS))
    parser.add_argument("--quick", action="store_true", help="only try whether everything runs")
    parser.add_argument("--page", action="store_true", help="write the page from what is stored")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR")
    options = parser.parse_args()
    folder = options.output or (RESULTS / "quick" if options.quick else RESULTS)
    folder.mkdir(parents=True, exist_ok=True)
    machine = [] if options.page else describe()
    for package, why in MISSING.items():
        tell(f"{package} is not measured ({why}); pip install -e .[bench] installs it")
    for name in [] if options.page else options.names or list(PROBLEMS):
        with processor_time():
            runs = measure(PROBLEMS[name], options.quick)
        save(runs, folder)
    runs = load(folder)
    if not options.page and not options.quick:
        measure_processes(runs, folder)
    write_page(runs, machine, folder)


def measure(problem: Problem, quick: bool) -> list[Run]:
    """Try all settings of all programs on a problem; measure the good ones again, in turn."""
    exact = reference(problem)
    found: list[tuple[ModuleType, list[Run]]] = []
    for module in (ours, *PEERS.values()):
        wanted = list(module.settings(problem))
        if quick:
            wanted = wanted[QUICK // 2 :: QUICK]
        runs = list(_tried(problem, module, wanted, exact))
        found.append((module, runs))
        tell(f"{problem.name}: {len(runs)} runs of {module.NAME}")
    again = [(module, run) for module, runs in found for run in front(runs, NEAR)]
    for _ in range(1 if quick else SAMPLES):
        for module, run in again:
            run.samples.append(module.solve(problem, run.setting).seconds)
    for _, run in again:
        del run.samples[0]  # taken when others of its kind were not
    return [run for _, runs in found for run in runs]


def _tried(
    problem: Problem, module: ModuleType, wanted: list[Setting], exact: np.ndarray
) -> Iterator[Run]:
    """Yield the runs whose error is of interest; one that fails is none."""
    finished: set[tuple[str, int]] = set()
    expensive: dict[str, int] = {}
    before: dict[tuple[str, int], float] = {}
    for setting in wanted:
        curve = setting[:2]
        if curve in finished or setting.elements > expensive.get(setting.family, np.inf):
            continue
        try:
            outcome = module.solve(problem, setting)
            if outcome.seconds < SHORT:  # the first run of a kind loads what it needs
                outcome = module.solve(problem, setting)
        except FailedRunError as failure:
            tell(f"{problem.name}: {setting.family}, {setting.words}: {str(failure)[:80]}")
            continue
        error = float(np.linalg.norm(outcome.points - exact, axis=-1).max()) / problem.length
        if outcome.seconds > LONGEST and curve not in before:
            expensive[setting.family] = setting.elements
        if outcome.seconds > LONGEST or error > STEPPED * before.get(curve, np.inf):
            finished.add(curve)
        before[curve] = error
        if error < WORST:  # false of NaN
            yield Run(
                problem.name,
                module.NAME,
                setting,
                error,
                outcome.iterations,
                outcome.preparation,
                [outcome.seconds],
            )


if __name__ == "__main__":
    main()
