"""Write the page on beams and its picture from what is stored."""

import math
from itertools import groupby
from pathlib import Path

import matplotlib.pyplot as plt

from benchmarks.beams.problems import PROBLEMS, Problem
from benchmarks.beams.processes import PROCESSES, TARGET
from benchmarks.beams.store import Run, front
from benchmarks.multiples import finish_axes, save
from benchmarks.verdict import Verdict, table_of_verdicts

PAGE, PICTURE, MACHINE = "beams.md", "beams.png", "beams_machine.txt"
OURS, PEER = "msahl", "Exudyn"
HUES = {OURS: "C0", PEER: "C1"}
LARGEST = 1e-2
"""Error, over the length, below which msahl is to be ahead."""
LIMITS = (1e-7, 5e-2)
"""Errors shown, over the length."""
LEAST = 1e-5
"""The least one that is judged; the references are known to 2e-6 or better."""
TARGETS = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
GRID = [LARGEST * 10.0 ** (-k / 20.0) for k in range(round(20 * math.log10(LARGEST / LEAST)) + 1)]

ABOUT = {
    "bend": "The arc of Bathe and Bolourchi (radius 100 m, E = 1e7 Pa, section 1 m by 1 m, no "
    "lateral contraction, shear factor 5/6, torsion constant 1/6 m^4) under 600 N: the position of "
    "its tip. `decks/elastic/bend45.xml`.",
    "rod": "The free rod of Simo and Vu-Quoc (10 m), thrown by a force and moments: both ends "
    "every 0.5 s, up to 10 s. `decks/elastic/spaghetti.xml`.",
    "hanging": "A cable of 10 m and 1 kg/m, hinged to two supports of one height 8 m apart; "
    "EA = 1e5 N, EI = 100 N m^2, no shear: its middle. Both programs begin at an arc of a circle.",
    "swinging": "The same cable, hinged at one end, released from rest along the horizontal: its "
    "middle and its free end every 0.2 s, up to 4 s.",
}
HOW = """\
- *Error*: largest distance of the points from their converged positions over all output times,
  divided by the length of the beam. The converged positions are those of a third method
  (`references.py`): shooting along the arc length (bend), collocation of the boundary value problem
  (hanging cable), spectral elements with DOP853 (rod), Ritz's method with DOP853 (swinging cable).
- *Seconds*: processor time of the solver alone, median of five, the programs in turn in one
  process. Other processes on the machine count little. Exudyn: the call of `SolveStatic` or
  `SolveDynamic`. msahl: the search of the equilibrium, or the time loop, after the model and its
  matrices have been built and its kernels have been loaded. *Preparation* is what precedes it
  without reading a deck: assembly, start values, reductions; Exudyn: the calls that build the
  model, and `Assemble`. A single short motion takes msahl longer to prepare than to compute.
- *Reached*: the fastest of all runs that is at least as exact. Both programs are run with many
  numbers of elements, steps and settings (`beams.csv` has all whose error is below 5 %); only the
  best count. `-` says that no run is as exact: after one that took more than a second no smaller
  step, and no more elements, are tried.
- Both have the same stiffnesses, masses and rotary inertias, with one exception: the cable of ANCF
  has no rotary inertia, that of msahl 1e-5 kg m, a relative difference of 1e-7."""


def write_page(runs: list[Run], machine: list[str], folder: Path) -> None:
    """Write page and picture; an empty ``machine`` keeps what is known of it."""
    if machine:
        (folder / MACHINE).write_text("\n".join(f"- {line}" for line in machine) + "\n")
    by_problem = {name: list(own) for name, own in groupby(runs, lambda run: run.problem)}
    draw(by_problem, folder / PICTURE)
    (folder / PAGE).write_text(report(by_problem, folder))


def report(runs: dict[str, list[Run]], folder: Path) -> str:
    """Return the text of the page."""
    path = folder / MACHINE
    parts = [
        "# Beams",
        "Error against seconds of elastic beams by msahl and by Exudyn (geometrically exact beams "
        "of two nodes; cables of the absolute nodal coordinate formulation, ANCF, in the plane). "
        "`python -m benchmarks.beams.measure` writes this page, `pip install -e .[bench]` installs "
        "Exudyn.",
        path.read_text().strip() if path.exists() else "",
        f"## Who is ahead\n\n{table_of_verdicts(map(_verdict, runs, runs.values()))}",
        f"![error against time]({PICTURE})",
        "Lines join the runs that no other run of the program surpasses; dots are all runs.",
        f"## How it is measured\n\n{HOW}",
        *(_section(PROBLEMS[name], own) for name, own in runs.items()),
        _processes(folder),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def fastest(runs: list[Run], program: str, error: float) -> Run | None:
    """Return the fastest run of a program whose error is at most ``error``."""
    good = [run for run in runs if run.program == program and run.error <= error]
    return min(good, key=lambda run: run.seconds, default=None)


def ahead(runs: list[Run], error: float) -> bool:
    """Return whether msahl reaches an error sooner."""
    ours, peer = fastest(runs, OURS, error), fastest(runs, PEER, error)
    return ours is not None and (peer is None or ours.seconds < peer.seconds)


def _verdict(name: str, runs: list[Run]) -> Verdict:
    """Where msahl is ahead between the largest and the least error judged."""
    what = PROBLEMS[name].title
    intervals = []
    for won, group in groupby(GRID, lambda error: ahead(runs, error)):
        errors = list(group)
        intervals.append((won, errors[0], errors[-1]))
    text = "; ".join(
        f"{OURS if won else PEER} from {first:.1e} to {last:.1e}" for won, first, last in intervals
    )
    asked = f"{OURS} ahead from {LARGEST:.0e} to {LEAST:.0e}"
    return Verdict(what, asked, text, all(won for won, _, _ in intervals))


def _section(problem: Problem, runs: list[Run]) -> str:
    title = problem.title[0].upper() + problem.title[1:]
    lines = [
        f"| error at most | {OURS} [ms] | {PEER} [ms] | {PEER} / {OURS} | preparation [ms] "
        f"| {OURS} by | {PEER} by |",
        "|---|---|---|---|---|---|---|",
    ]
    for error in TARGETS:
        found = [fastest(runs, program, error) for program in (OURS, PEER)]
        times = [f"{1e3 * run.seconds:.3g}" if run else "-" for run in found]
        words = [f"{run.setting.family}; {run.setting.words}" if run else "-" for run in found]
        ours, peer = found
        ratio = f"{peer.seconds / ours.seconds:.2g}" if ours and peer else "-"
        before = " / ".join(f"{1e3 * run.preparation:.3g}" if run else "-" for run in found)
        cells = [f"{error:.0e}", *times, ratio, before, *words]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n\n".join((f"## {title}", ABOUT[problem.name], "\n".join(lines)))


def _processes(folder: Path) -> str:
    """Seconds of complete processes."""
    path = folder / PROCESSES
    if not path.exists():
        return ""
    lines = [
        "## Complete processes",
        f"Seconds on the wall from the start of Python to its end, with one run, the fastest that "
        f"has an error of at most {TARGET:.0e}. msahl imports numba and its kernels, which are in "
        "its store; Exudyn's library is compiled beforehand.",
        "",
        "| problem | program | seconds |",
        "|---|---|---|",
    ]
    for row in path.read_text().split():
        name, program, seconds = row.split(",")
        lines.append(f"| {PROBLEMS[name].title} | {program} | {seconds} |")
    return "\n".join([lines[0], "", *lines[1:]])


def draw(runs: dict[str, list[Run]], path: Path) -> None:
    """Draw error against seconds, a picture for each problem."""
    figure, grid = plt.subplots(2, 2, figsize=(8.0, 6.5), layout="constrained")
    for axes, (name, own) in zip(grid.flat, runs.items(), strict=False):
        for program, hue in HUES.items():
            found = [run for run in own if run.program == program]
            if not found:
                continue
            dots = [(run.seconds, run.error) for run in found]
            axes.loglog(*zip(*dots, strict=True), color=hue, marker=".", linestyle="", alpha=0.3)
            best = [(run.seconds, run.error) for run in front(found)]
            axes.loglog(*zip(*best, strict=True), color=hue, marker="o", markersize=3)
        finish_axes(axes, PROBLEMS[name].title, LIMITS, LARGEST)
    save(figure, HUES, ("seconds of the solver", "largest error / length"), path)
