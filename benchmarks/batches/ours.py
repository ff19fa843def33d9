"""The plan by ``msahl.batch``."""

import time
from collections.abc import Sequence
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np

import msahl
from benchmarks.batches.plan import CORES, DECK, GRID, SPAN, Clock, Sample

SCHEMES = ("preserving", "gauss3", "gauss4", "gauss5")
PLACES = ("PendulumBob", "2ndBall")


class Taken(NamedTuple):
    """What a batch took [s], what its processes computed [s], and the sum of its time loops."""

    seconds: float
    computed: float
    loops: float


def options(scheme: str, h: float) -> dict[str, Any]:
    """Return the options of a run whose error is not estimated, with rows at the grid."""
    given = {"scheme": scheme, "dt": h, "t_final": SPAN, "error": "off", "output_interval": GRID}
    # By default scipy solves the first step, as a check, which takes as long as twenty others.
    return {**given, "solver": "newton"}


def positions(plan: Sequence[Sample], scheme: str, h: float) -> np.ndarray:
    """(samples, rows, 2, 3) mass centres at the grid."""
    model, found = msahl.load(DECK), []
    for result in msahl.batch(model, [s._asdict() for s in plan], 1, **options(scheme, h)):
        if not result.completed:
            return np.full((1, 1, 2, 3), np.inf)
        columns = [[result[f"{name}.{axis}"] for axis in "xyz"] for name in PLACES]
        found.append(np.moveaxis(np.array(columns), 2, 0))
    return np.array(found)


def take(
    plan: Sequence[Sample],
    given: dict[str, Any],
    tables: list[str] | None = None,
    jobs: int = CORES,
) -> Taken:
    """Carry out the plan in two processes or so many ``jobs``, from the deck to the last table."""
    clock, loops = Clock(), 0.0
    model = msahl.load(DECK)
    given_samples = [sample._asdict() for sample in plan]
    for result in msahl.batch(model, given_samples, jobs, tables=tables, **given):
        loops += result.seconds["loop"]
    return Taken(*clock.read(), loops)


def computed_by_loops(plan: Sequence[Sample], given: dict[str, Any]) -> float:
    """Return what the time loops of the plan compute in one process [s], waiting not counted."""
    with patch("time.perf_counter", time.process_time):
        return take(plan, given, jobs=1).loops
