"""How fast a box on a slope creeps that is to stay where it stopped, by every code."""

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.curves import Curve, knob, run

SCENE, TABLE = "box on a slope", "contact_creep.csv"
HEAD = ("code", "step [s] or accuracy", "creep [m/s]")


class Creep(NamedTuple):
    """The speed [m/s] of a box that should not move, by a code at a step or an accuracy."""

    code: str
    knob: float
    speed: float


def creep_of(curve: Curve) -> Creep | None:
    """Return the creep of the most accurate run of a code, over the second half of the motion."""
    finite = [point for point in curve.sorted() if np.isfinite(point.error)]
    if not finite:
        return None
    problem, best = curve.problem, min(finite, key=lambda point: point.error)
    x = run(problem, curve.code, best.rung).x[:, 0]
    middle = problem.rows // 2
    moved = float(np.linalg.norm(x[-1] - x[middle]))
    speed = moved / (problem.grid * (problem.rows - middle))
    return Creep(curve.code.name, knob(problem, curve.code, best.rung), speed)


def save(found: list[Creep], folder: Path) -> None:
    """Write the table."""
    with (folder / TABLE).open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEAD)
        writer.writerows(found)


def load(folder: Path) -> list[Creep]:
    """Return what is stored, nothing if there is no table."""
    path = folder / TABLE
    if not path.exists():
        return []
    with path.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    return [Creep(code, float(step), float(speed)) for code, step, speed in rows]
