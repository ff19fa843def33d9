"""Keep what was measured: errors and work in one table, which repeat, seconds in another.

A row of the first is a run of one code at one rung of its ladder. Rows without a rung say why a
code was refined no more, or why it cannot take the model; those of the code "reference", how far
two ways to the true motion are apart. The benchmark of contacts has tables of its own: ``Kept``.
"""

import csv
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np

from benchmarks import ours
from benchmarks.curves import LARGEST_ORDER, Code, Curve, Point, knob
from benchmarks.mechanisms.peers import PEERS
from benchmarks.precision_asked import Found
from benchmarks.problems import Problem
from benchmarks.reference import Known
from msahl.model.scheme import order_of

HEADS = {
    "errors": ("code", "rung", "step [s] or accuracy", "position error [m]", "steps",
               "iterations", "note"),
    "seconds": ("code", "rung", "loop, samples [s]"),
}  # fmt: skip
REFERENCE = "reference"
SCHEMES = ("preserving", "gauss2", "gauss3", "gauss4", "gauss5", "radau3", "rk4", "rk8")
"""Of msahl, beside the one that takes a tolerance."""
LARGE, FEWER = 50, ("gauss2", "gauss3")
"""From so many bodies on msahl is measured by fewer schemes: each run prepares for long."""


class Refused(NamedTuple):
    """A code that cannot take a model, and why."""

    code: str
    why: str


class Kept(NamedTuple):
    """The tables ``NAME_errors.csv`` and ``NAME_seconds.csv`` of one benchmark, of which each of
    the ``codes`` measures problems that are called ``what``.
    """

    name: str
    what: str
    codes: Callable[[Problem], Iterable[Code | Refused]]

    def path(self, table: str, folder: Path) -> Path:
        """Return where a table is in the ``folder``."""
        return folder / f"{self.name}_{table}.csv"

    def read(self, table: str, folder: Path) -> list[list[str]]:
        """Return the rows of a table, none if it does not exist."""
        path = self.path(table, folder)
        if not path.exists():
            return []
        with path.open(newline="") as file:
            return list(csv.reader(file))[1:]

    def write(self, table: str, folder: Path, rows: Iterable[Iterable[object]]) -> None:
        """Write a table."""
        with self.path(table, folder).open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow((self.what, *HEADS[table]))
            writer.writerows(rows)


def codes(problem: Problem) -> Iterator[Code | Refused]:
    """Every code, in the order in which they are measured."""
    large = problem.bodies >= LARGE
    for scheme in FEWER if large else SCHEMES:
        yield Code(f"msahl {scheme}", ours, order_of(scheme))
    for name in () if large else ours.BY_TOLERANCE:
        yield Code(name, ours, LARGEST_ORDER, controlled=True)
    yield from codes_of(PEERS.values(), problem)


def codes_of(modules: Iterable[ModuleType], problem: Problem) -> Iterator[Code | Refused]:
    """Every code of other programs."""
    for module in modules:
        for name in module.VARIANTS:
            why = module.cannot(problem.model, name)
            controlled = name in getattr(module, "CONTROLLED", ())
            code = Code(name, module, module.ORDERS[name], controlled)
            yield Refused(name, why) if why else code


MECHANISMS = Kept("mechanisms", "mechanism", codes)


def save(found: Found, refused: Iterable[Refused], folder: Path, kept: Kept = MECHANISMS) -> None:
    """Replace what the tables in ``folder`` have on this problem."""
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
    for table, rows in (("errors", errors), ("seconds", seconds)):
        others = [row for row in kept.read(table, folder) if row[0] != name]
        kept.write(table, folder, [*others, *rows])


def load(problems: Iterable[Problem], folder: Path, kept: Kept = MECHANISMS) -> list[Found]:
    """Return what the tables have on each of the ``problems``, without the true motion."""
    errors, seconds = (kept.read(table, folder) for table in HEADS)
    samples = {tuple(row[:3]): [float(s) for s in row[3].split()] for row in seconds}
    found = []
    for problem in problems:
        rows = [row for row in errors if row[0] == problem.name]
        if rows:
            found.append(_found(problem, kept.codes(problem), rows, samples))
    return found


def refusals(problem: Problem, folder: Path, kept: Kept = MECHANISMS) -> dict[str, str]:
    """Return why codes cannot take the model, by code."""
    rows = [row for row in kept.read("errors", folder) if row[0] == problem.name]
    ran = {row[1] for row in rows if row[2]} | {REFERENCE}
    return {row[1]: row[7] for row in rows if row[1] not in ran}


def _found(
    problem: Problem,
    codes: Iterable[Code | Refused],
    rows: list[list[str]],
    samples: dict[tuple[str, ...], list[float]],
) -> Found:
    apart, words = next((float(r[4]), r[7]) for r in rows if r[1] == REFERENCE)
    found = Found(problem, Known(np.zeros(0), words, apart))
    for code in codes:
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


def microseconds(point: Point | None) -> float:
    """Return the time of a step [us], nan if there is no such run."""
    return 1e6 * point.seconds / point.steps if point and point.steps else math.nan
