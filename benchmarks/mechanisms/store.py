"""Keep what was measured: errors and work in one table, which repeat, seconds in another.

A row of the first is a run of one code at one rung of its ladder. Rows without a rung say why a
code was refined no more, or why it cannot take the model; those of the code "reference", how far
two ways to the true motion are apart.
"""

import csv
import math
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks import ours
from benchmarks.curves import LARGEST_ORDER, Code, Curve, Point, knob, order_of
from benchmarks.mechanisms.peers import PEERS
from benchmarks.precision_asked import Found
from benchmarks.problems import Problem
from benchmarks.reference import Known

ERRORS, SECONDS = "mechanisms_errors.csv", "mechanisms_seconds.csv"
HEADS = {
    ERRORS: ("mechanism", "code", "rung", "step [s] or accuracy", "position error [m]", "steps",
             "iterations", "note"),
    SECONDS: ("mechanism", "code", "rung", "loop, samples [s]"),
}  # fmt: skip
REFERENCE = "reference"
SCHEMES = ("preserving", "gauss2", "gauss3", "gauss4", "gauss5", "radau3")
"""Of msahl, beside the one that takes a tolerance."""
LARGE, FEWER = 50, ("gauss2", "gauss3")
"""From so many bodies on msahl is measured by fewer schemes: each run prepares for long."""


class Refused(NamedTuple):
    """A code that cannot take a model, and why."""

    code: str
    why: str


def codes(problem: Problem) -> Iterator[Code | Refused]:
    """Every code, in the order in which they are measured."""
    large = problem.bodies >= LARGE
    for scheme in FEWER if large else SCHEMES:
        yield Code(f"msahl {scheme}", ours, order_of(scheme))
    for name in () if large else ours.BY_TOLERANCE:
        yield Code(name, ours, LARGEST_ORDER, controlled=True)
    for module in PEERS.values():
        for name in module.VARIANTS:
            why = module.cannot(problem.model, name)
            controlled = name in getattr(module, "CONTROLLED", ())
            code = Code(name, module, module.ORDERS[name], controlled)
            yield Refused(name, why) if why else code


def save(found: Found, refused: Iterable[Refused], folder: Path) -> None:
    """Replace what the tables in ``folder`` have on this mechanism."""
    name = found.problem.name
    errors = [[name, REFERENCE, "", "", found.known.apart, "", "", found.known.words]]
    errors += [[name, code, "", "", "", "", "", why] for code, why in refused]
    seconds: list[list[object]] = []
    for curve in found.curves:
        code = curve.code
        errors.append([name, code.name, "", "", "", "", "", curve.stopped])
        for p in curve.sorted():
            step = knob(found.problem, code, p.rung)
            errors.append([name, code.name, p.rung, step, p.error, p.steps, p.iterations, p.note])
            seconds.append([name, code.name, p.rung, " ".join(map(repr, p.samples))])
    for file, rows in ((ERRORS, errors), (SECONDS, seconds)):
        kept = [row for row in _read(folder / file) if row[0] != name]
        _write(folder / file, [*kept, *rows])


def load(problems: Iterable[Problem], folder: Path) -> list[Found]:
    """Return what the tables have on each of the ``problems``, without the true motion."""
    errors, seconds = _read(folder / ERRORS), _read(folder / SECONDS)
    samples = {tuple(row[:3]): [float(s) for s in row[3].split()] for row in seconds}
    found = []
    for problem in problems:
        rows = [row for row in errors if row[0] == problem.name]
        if rows:
            found.append(_found(problem, rows, samples))
    return found


def refusals(problem: Problem, folder: Path) -> dict[str, str]:
    """Return why codes cannot take the model, by code."""
    rows = [row for row in _read(folder / ERRORS) if row[0] == problem.name]
    ran = {row[1] for row in rows if row[2]} | {REFERENCE}
    return {row[1]: row[7] for row in rows if row[1] not in ran}


def _found(
    problem: Problem, rows: list[list[str]], samples: dict[tuple[str, ...], list[float]]
) -> Found:
    apart, words = next((float(r[4]), r[7]) for r in rows if r[1] == REFERENCE)
    found = Found(problem, Known(np.zeros(0), words, apart))
    for code in codes(problem):
        mine = [row for row in rows if row[1] == code[0]]
        if isinstance(code, Refused) or not any(row[2] for row in mine):
            continue
        curve = Curve(problem, code, stopped=next((r[7] for r in mine if not r[2]), ""))
        for _, name, rung, _, error, steps, iterations, note in (r for r in mine if r[2]):
            taken = samples.get((problem.name, name, rung), [])
            curve.points[int(rung)] = Point(
                int(rung), float(error), taken, int(steps), int(iterations), note
            )
        found.curves.append(curve)
    return found


def _read(path: Path) -> list[list[str]]:
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return list(csv.reader(file))[1:]


def _write(path: Path, rows: Iterable[Iterable[object]]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADS[path.name])
        writer.writerows(rows)


def microseconds(point: Point | None) -> float:
    """Return the time of a step [us], nan if there is no such run."""
    return 1e6 * point.seconds / point.steps if point and point.steps else math.nan
