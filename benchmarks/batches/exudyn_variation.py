"""The plan by Exudyn's ``ParameterVariation`` in two processes."""

import contextlib
import io
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

os.environ.setdefault("EXUDYN_MODULE", "fast")

import exudyn
from exudyn.processing import ParameterVariation

from benchmarks.batches.plan import CORES, GRID, SPAN, Clock, Sample, model_of
from benchmarks.exudyn_peer import motion

VARIANT = "exudyn index 2 EP"


def positions(plan: Sequence[Sample], h: float) -> np.ndarray:
    """(samples, rows, 2, 3) mass centres at the grid; infinite if a run does not converge."""
    try:
        return _all_positions(plan, h)
    except exudyn.SolverError:
        return np.full((1, 1, 2, 3), np.inf)


def _all_positions(plan: Sequence[Sample], h: float) -> np.ndarray:
    return np.array([_positions(sample, h) for sample in plan])


def seconds(plan: Sequence[Sample], h: float) -> tuple[float, float]:
    """Time of the plan, from numbers to positions at the grid, as of ``Clock``."""
    cases: dict[str, Any] = {"case": list(range(len(plan)))}
    clock = Clock()
    with contextlib.redirect_stdout(io.StringIO()):
        ParameterVariation(
            parameterFunction=_run,
            parameters=cases,
            useMultiProcessing=True,
            numberOfThreads=CORES,
            showProgress=False,
            parameterFunctionData={"plan": list(plan), "h": h},
        )
    return clock.read()


def _run(parameters: dict[str, Any]) -> Any:
    """Run one case; Exudyn's processes call it."""
    given = parameters["functionData"]
    return _positions(given["plan"][int(parameters["case"])], given["h"])


def _positions(sample: Sample, h: float) -> np.ndarray:
    return motion(model_of(sample), h, round(SPAN / h), VARIANT, every=round(GRID / h)).x
