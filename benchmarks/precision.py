"""Loop seconds to an error: ``python -m benchmarks.precision [--quick] [-o DIR]``.

Results: precision.md and a picture of each problem. ``--quick``
is a smoke test on three problems and with short runs; its figures mean nothing.
"""

import argparse
import statistics
import time
from collections.abc import Iterable
from pathlib import Path

from benchmarks import ours
from benchmarks.curves import (
    TARGETS,
    Curve,
    Point,
    Reached,
    all_codes,
    knob,
    take_samples_in_turn,
    trace,
)
from benchmarks.equivalent import FROM, TABLEAUS, check
from benchmarks.machine import describe
from benchmarks.peers import PEERS, versions
from benchmarks.pictures import draw_curves
from benchmarks.precision_asked import JUDGED, Found, StepCost, verdicts
from benchmarks.problems import GRID, ROWS, Problem, all_problems
from benchmarks.reference import known
from benchmarks.speed import RESULTS, tell
from benchmarks.verdict import table_of_verdicts

LIMITS = {1: (4.0, 10.0), 100: (8.0, 20.0), FROM: (20.0, 40.0)}
"""Loop seconds of one run and of all runs of a code, by least number of bodies."""
QUICK = ("single 45", "top 1", "chain 10")
QUICK_LIMITS = (0.05, 0.1)
STEP = 0.01
"""At which a step of gauss3 is compared with one of the lowest order [s]."""
CHECKED = (0.005, 400)
"""Step and steps of the runs that show a formula to be its peer's."""
FAMILIES = ("msahl", "exudyn", "mujoco", "drake")
HEADER = ("problem", "bodies", "code", "step [s] or accuracy", "position error [m]", "loop [s]",
          "samples", "steps", "us per step", "iterations per step", "note")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="smoke test")
    parser.add_argument("--problem", action="append", help="only this one (more than once: these)")
    parser.add_argument("--code", default="", help="only codes with this in their names")
    parser.add_argument("-o", "--output", type=Path, default=None, metavar="DIR")
    options = parser.parse_args()
    folder = options.output or (RESULTS / "quick" if options.quick else RESULTS)
    folder.mkdir(parents=True, exist_ok=True)
    began = time.perf_counter()
    machine = [*describe(), ""]
    names = options.problem or (QUICK if options.quick else None)
    problems = [s for s in all_problems(quick=False) if names is None or s.name in names]
    found = []
    for problem in problems:
        found.append(measure(problem, options.quick, options.code))
        draw_curves(problem.name, found[-1].curves, folder / picture(problem))
        # After every problem: what was measured is there to be read should a later one be stopped.
        machine[-1] = f"complete benchmark: {time.perf_counter() - began:.0f} s"
        (folder / "precision.md").write_text(report(found, machine, options.quick))
    print((folder / "precision.md").read_text())


def measure(problem: Problem, quick: bool, wanted: str = "") -> Found:
    """Every code with ``wanted`` in its name on one problem."""
    tell(f"{problem.name}: reference")
    found = Found(problem, known(problem.model, GRID, ROWS))
    limits = QUICK_LIMITS if quick else LIMITS[max(n for n in LIMITS if n <= problem.bodies)]
    for code in (c for c in all_codes(problem) if wanted in c.name):
        began = time.perf_counter()
        curve = trace(problem, code, found.known.x, *limits)
        found.curves.append(curve)
        tell(f"{problem.name}: {code.name}, {time.perf_counter() - began:.1f} s")
    if not quick:
        take_samples_in_turn(found.curves)
    found.step = step_cost(problem, repeats=1 if quick else 5)
    return found


def step_cost(problem: Problem, repeats: int) -> StepCost:
    """A step of gauss3 and one of the lowest order, in turn."""
    steps = max(20, 2000 // problem.bodies)
    names = ("msahl gauss3", "msahl preserving")
    samples: dict[str, list[float]] = {name: [] for name in names}
    for _ in range(repeats + 1):
        for name in names:
            samples[name].append(ours.loop_seconds(problem.model, STEP, steps, name) / steps)
    # The first is omitted: it may have compiled.
    return StepCost(STEP, *(statistics.median(samples[name][1:]) for name in names))


def picture(problem: Problem) -> str:
    return f"precision_{problem.name.replace(' ', '_')}.png"


def report(found: list[Found], machine: list[str], quick: bool) -> str:
    parts = [
        "# Work and precision" + (" (smoke test: the figures mean nothing)" if quick else ""),
        f"Loop seconds until the largest position error of any mass centre, at every {GRID:g} s of "
        f"{GRID * ROWS:g} s of motion, is 1e-6 m and 1e-9 m: the best code of each family.",
        _summary(found),
        "\n".join(f"- {line}" for line in machine),
        "Medians of runs taken in turn (A B C, A B C, ...). How to read the columns: "
        "`benchmarks/README.md`.",
        "## Asked and measured",
        table_of_verdicts(verdicts(found)),
        "## Loop seconds to an error",
        *(part for one in found for part in (f"### {one.problem.name}", _table(one.curves),
          f"![{one.problem.name}]({picture(one.problem)})")),
        "## What a run of ours is made of",
        "Of the coarsest run that is as good as the error; iterations are Newton's.",
        _work_table(found),
        "## References",
        _reference_table(found),
        _equivalents(found),
        "## Codes and settings",
        _settings(),
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def _summary(found: list[Found]) -> str:
    """Proposed for the project's README."""
    heads = [f"{family} {target:.0e}" for target in JUDGED for family in FAMILIES]
    lines = [f"| problem | {' | '.join(heads)} |", "|---|" + "---|" * len(heads)]
    for one in found:
        cells = [
            one.best_cell(family, target, _seconds) for target in JUDGED for family in FAMILIES
        ]
        lines.append(f"| {one.problem.name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _seconds(reached: Reached) -> str:
    if reached.how == "-":
        return "-"
    sign = {"<=": "≤ ", ">=": "> ", "": ""}[reached.how]
    return f"{sign}{reached.seconds:.2g}"


def _table(curves: list[Curve]) -> str:
    heads = [f"{target:.0e} m [s]" for target in TARGETS]
    lines = [f"| code | {' | '.join(heads)} | remark |", "|---|" + "---|" * (len(heads) + 1)]
    for curve in curves:
        reached = [curve.reach(target) for target in TARGETS]
        cells = [f"- ({_seconds(r)})" if r.how == ">=" else _seconds(r) for r in reached]
        reasons = list(dict.fromkeys(r.reason for r in reached if r.reason and r.how != "<="))
        remark = "; ".join(reasons)
        lines.append(f"| {curve.code.name} | {' | '.join(cells)} | {remark} |")
    return "\n".join(lines)


def _work_table(found: list[Found]) -> str:
    names = ("problem", "error", "scheme", "h [s]", "steps", "iterations/step", "µs/step",
             "µs/iteration/body")  # fmt: skip
    lines = [f"| {' | '.join(names)} |", "|" + "---|" * len(names)]
    for one in found:
        for target in JUDGED:
            for curve, point in _ours_at(one, target):
                each = 1e6 * point.seconds
                per = each / max(point.iterations, 1) / one.problem.bodies
                cells = [one.problem.name, f"{target:.0e}", curve.code.name.removeprefix("msahl "),
                         f"{knob(one.problem, curve.code, point.rung):.4g}", f"{point.steps}",
                         f"{point.iterations / point.steps:.2f}", f"{each / point.steps:.3g}",
                         f"{per:.3g}"]  # fmt: skip
                lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _ours_at(found: Found, target: float) -> Iterable[tuple[Curve, Point]]:
    for curve in found.curves:
        point = curve.at(target)
        if point and curve.code.module is ours:
            yield curve, point


def _reference_table(found: list[Found]) -> str:
    lines = ["| problem | reference | the two apart [m] |", "|---|---|---|"]
    lines += [f"| {f.problem.name} | {f.known.words} | {f.known.apart:.1e} |" for f in found]
    return "\n".join(lines)


def _equivalents(found: list[Found]) -> str:
    """Formulas in place of peers, checked on a chain that those can do."""
    if not any(curve.code.estimated for one in found for curve in one.curves):
        return ""
    problem = next(s for s in all_problems(quick=True) if s.name == "chain 100")
    h, steps = CHECKED
    at_end = known(problem.model, h * steps, 1).x[-1]
    lines = [
        f"For chains of {FROM} the errors of these codes are those of their formulas in the "
        "chain's angles (`equivalent.py`), and the seconds are steps times the peer's own seconds "
        f"a step. Both ways on the {problem.name}, {steps} steps of {h:g} s:",
        "",
        "| code | error, the peer's own [m] | its formula's [m] |",
        "|---|---|---|",
    ]
    for code, tableau in TABLEAUS.items():
        if tableau.package in PEERS:
            own, formula = check(problem.model, h, steps, code, at_end)
            lines.append(f"| {code} | {own:.4e} | {formula:.4e} |")
    return "\n".join(lines)


def _settings() -> str:
    lines = ["- **msahl**: `--solver newton`, each scheme by its name, its defaults, step fixed."]
    for module in PEERS.values():
        lines += [f"- **{code}**: {text}." for code, text in module.SETTINGS.items()]
    return "\n".join([versions(), "", *lines])


if __name__ == "__main__":
    main()
