"""Measure everything and write it down: ``python -m benchmarks.speed [--quick] [-o DIR]``.

Results: speed.md and two pictures. ``--quick`` is a smoke test: one step
size, no chain of 1000, few repeats; its figures mean nothing.
"""

import argparse
import sys
import time
from pathlib import Path

from benchmarks import ours, pictures
from benchmarks.asked import Results, verdicts
from benchmarks.loops import SETTINGS, Measured, measure
from benchmarks.machine import describe
from benchmarks.peers import versions
from benchmarks.problems import all_problems, chain
from benchmarks.process import Starts, measure_long_run, measure_starts
from benchmarks.verdict import table_of_verdicts
from benchmarks.writers import ROWS, measure_writers, table_of_writers

RESULTS = Path(__file__).parent / "results"
LONG_STEPS = 1_000_000
HEADER = ("problem", "bodies", "h [s]", "code", "us per step and body", "us per step",
          "steps timed", "samples", "energy RMS / max kinetic", "violation [m]",
          "position error [m]", "errors over [s]", "note")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="smoke test, under a minute")
    parser.add_argument("-o", "--output", type=Path, default=None, metavar="DIR")
    options = parser.parse_args()
    folder = options.output or (RESULTS / "quick" if options.quick else RESULTS)
    began = time.perf_counter()
    machine = describe()
    results = measure_all(options.quick)
    folder.mkdir(parents=True, exist_ok=True)
    machine.append(f"complete benchmark: {time.perf_counter() - began:.0f} s")
    (folder / "speed.md").write_text(report(results, machine, options.quick))
    pictures.draw_all(results.loops, folder)
    print((folder / "speed.md").read_text())


def measure_all(quick: bool) -> Results:
    """Complete processes first, while this one is still small."""
    results = Results()
    tell("complete processes")
    results.imports, results.starts = measure_starts(repeats=1 if quick else 7)
    results.long_run = measure_long_run(LONG_STEPS // (100 if quick else 1))
    tell("writers")
    results.writers, results.computing = measure_writers(
        repeats=1 if quick else 3, rows=5_001 if quick else ROWS
    )
    for problem in all_problems(quick):
        for h in problem.steps:
            tell(f"{problem.name}, h = {h:g} s")
            results.loops += measure(
                problem, h, repeats=1 if quick else 5, sample=0.02 if quick else 0.15
            )
    if not quick:
        tell("chain of 1000, 10 s")
        model, newton = chain(1000), ours.VARIANTS["msahl newton"]
        results.long_chain = ours.loop_report(model, 0.01, 1000, newton)
    return results


def tell(what: str) -> None:
    print(what, file=sys.stderr, flush=True)


def report(results: Results, machine: list[str], quick: bool) -> str:
    parts = [
        "# Speed" + (" (smoke test: the figures mean nothing)" if quick else ""),
        "\n".join(f"- {line}" for line in machine),
        "Times are medians of samples taken in turn (A B C, A B C, ...) in this one run. How to "
        "read the columns: `benchmarks/README.md`.",
        "## Asked and measured",
        table_of_verdicts(verdicts(results)),
        "## Loops",
        _loop_table(results.loops),
        "![time per step and body](bodies.png)",
        "![error against time](precision.png)",
        "## Complete processes",
        _process_table(results),
        "## Writing a table",
        table_of_writers(results.writers, results.computing),
        "## Codes and settings",
        _settings(),
    ]
    return "\n\n".join(parts) + "\n"


def _loop_table(rows: list[Measured]) -> str:
    names = (
        "problem",
        "h",
        "code",
        "µs/step/body",
        "energy",
        "violation [m]",
        "position [m]",
        "note",
    )
    lines = [f"| {' | '.join(names)} |", "|" + "---|" * len(names)]
    for r in rows:
        time_text = f"{1e6 * r.per_step_and_body:.3g}" if r.samples else "-"
        errors = [f"{e:.1e}" for e in r.errors] if r.errors else ["-", "-", "-"]
        cells = [r.problem.name, f"{r.h:g}", r.code, time_text, *errors, r.note]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _process_table(results: Results) -> str:
    lines = ["| process | first [s] | later [s] | peak memory, later [MB] |", "|---|---|---|---|"]
    if results.imports:
        bare = results.imports
        what = "`python -c 'import numpy, lxml, click'`"
        lines.append(f"| {what} | | {bare.seconds:.3f} | {bare.memory:.0f} |")
    for solver, s in results.starts.items():
        what = f"`msahl run single_pendulum_45.xml --solver {solver}`"
        times = f"{s.cold.seconds:.2f} | {s.warm.seconds:.3f} | {s.warm.memory:.0f}"
        lines.append(f"| {what} | {times} |")
    lines += ["", *(_phases(solver, s) for solver, s in results.starts.items())]
    if results.long_run:
        run = results.long_run
        lines += [
            "",
            f"{run.steps} steps of the chain of ten bodies by `msahl run --solver newton "
            f"--every {run.every}`, first run: {run.ended.seconds:.1f} s, peak memory "
            f"{run.ended.memory:.0f} MB, {run.size:.0f} MB written; its `run.json`: "
            f"{run.info['seconds']}.",
        ]
    return "\n".join(lines)


def _phases(solver: str, starts: Starts) -> str:
    phases = ", ".join(f"{name} {seconds:.3f}" for name, seconds in starts.phases.items())
    return f"- {solver}, later, by phase [s]: {phases} (loop includes loading the kernels)"


def _settings() -> str:
    lines = [f"- **{code}**: {text}." for code, text in SETTINGS.items()]
    return "\n".join([versions(), "", *lines])


if __name__ == "__main__":
    main()
