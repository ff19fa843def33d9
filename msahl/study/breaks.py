"""Times at which a law of time changes its formula: no step of an integrator may pass over one."""

import math
from collections.abc import Iterator

import numpy as np

from msahl.algebra.functions import SINE, Law, Laws, build_laws, piece_of
from msahl.model import ConcentratedLoad, Model

MOST = 10_000
"""Breaks of one law beyond which no more are told: steps that end at each of so many are short
anyway."""
SAME = 1e-12
"""Part of the span by which two breaks differ at least."""
PARTS = 4.0
"""Steps to a period of the fastest sine at least: fewer may see the same phase every time."""


def laws_of_time(model: Model) -> list[Law]:
    """The laws of time of loads and motions."""
    loads = [load.law for load in model.loads if isinstance(load, ConcentratedLoad) and load.law]
    return [*loads, *(motion.law for motion in model.motions)]


def breaks(model: Model, end: float) -> np.ndarray:
    """Times between 0 and ``end`` [s] at which a law begins another piece, increasing."""
    laws = build_laws(laws_of_time(model))
    times = {time for law in range(len(laws.kind)) for time in _breaks(laws, law, end)}
    return np.array(sorted(times))


def _breaks(laws: Laws, law: int, end: float) -> Iterator[float]:
    time = 0.0
    for _ in range(MOST):
        _, time = piece_of(laws, law, time + SAME * end)  # not the piece that ends there
        if time >= end:
            return
        yield time


def longest_step(model: Model) -> float:
    """Largest step [s] that resolves every sine among the laws of time."""
    laws = build_laws(laws_of_time(model))
    fastest = max(
        (abs(float(laws.numbers[laws.first[law] + 1])) for law in range(len(laws.kind))
         if laws.kind[law] == SINE), default=0.0,
    )  # fmt: skip
    return 2.0 * math.pi / fastest / PARTS if fastest > 0.0 else math.inf
