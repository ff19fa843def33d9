"""Find the times at which a law of time changes its formula; integrators must end a step there."""

import math
from collections.abc import Iterator

import numpy as np

from msahl.algebra.functions import SINE, Law, Laws, build_laws, piece_of
from msahl.model import Model

MOST = 10_000
"""Largest number of breakpoints of one law; steps that end at each of so many are short anyway."""
SAME = 1e-12
"""Least difference of two breakpoints, as a fraction of the time span."""
STEPS_PER_PERIOD = 4.0
"""Least number of steps per period of the fastest sine: fewer may always see the same phase."""


def laws_of_time(model: Model) -> list[Law]:
    """Return the laws of time of loads and motions."""
    loads = [load.law for load in model.concentrated if load.law]
    return [*loads, *(motion.law for motion in model.motions)]


def breakpoints(model: Model, end: float) -> np.ndarray:
    """Return the times between 0 and ``end`` [s] at which a law begins another piece, sorted."""
    laws = build_laws(laws_of_time(model))
    times = {time for law in range(len(laws.kind)) for time in _of_law(laws, law, end)}
    return np.array(sorted(times))


def _of_law(laws: Laws, law: int, end: float) -> Iterator[float]:
    time = 0.0
    for _ in range(MOST):
        _, time = piece_of(laws, law, time + SAME * end)  # not the piece that ends there
        if time >= end:
            return
        yield time


def longest_step(model: Model) -> float:
    """Return the largest step [s] that resolves every sine among the laws of time."""
    laws = build_laws(laws_of_time(model))
    rates = (
        abs(float(laws.numbers[laws.first[law] + 1]))
        for law in range(len(laws.kind))
        if laws.kind[law] == SINE
    )
    fastest = max(rates, default=0.0)
    return 2.0 * math.pi / fastest / STEPS_PER_PERIOD if fastest > 0.0 else math.inf
