"""Times at which a law of time changes its formula: no step of an integrator may pass over one."""

import math

import numpy as np

from msahl.law import PIECES, SINE, Law, Laws, build_laws
from msahl.model import ConcentratedLoad, Model

MOST = 10_000
"""Breaks of periodic laws beyond which there are no more: an integrator that ends a step at each
of so many takes steps as short anyway."""
PARTS = 4.0
"""Steps to a period of the fastest sine at least: fewer may see the same phase every time."""


def laws_of_time(model: Model) -> list[Law]:
    """The laws of time of loads and motions."""
    loads = [load.law for load in model.loads if isinstance(load, ConcentratedLoad) and load.law]
    return [*loads, *(motion.law for motion in model.motions)]


def breaks(model: Model, end: float) -> np.ndarray:
    """Times between 0 and ``end`` [s] at which a law begins another piece, increasing."""
    laws = build_laws(laws_of_time(model))
    times = [_breaks(laws, law, end) for law in range(len(laws.kind)) if laws.kind[law] == PIECES]
    known = np.unique(np.concatenate([np.zeros(0), *times]))
    return known[(known > 0.0) & (known < end)]


def _breaks(laws: Laws, law: int, end: float) -> np.ndarray:
    first = laws.first[law]
    count, period = int(laws.numbers[first]), float(laws.numbers[first + 1])
    own = laws.numbers[first + 2 : first + 3 + count]
    if period <= 0.0:
        return own
    begin, last = math.floor(-own[0] / period), math.ceil((end - own[0]) / period)
    turns = np.arange(begin, min(last, begin + MOST // count) + 1)
    return np.asarray((own[:-1] + period * turns[:, None]).reshape(-1))


def longest_step(model: Model) -> float:
    """Largest step [s] that resolves every sine among the laws of time."""
    laws = build_laws(laws_of_time(model))
    fastest = max(
        (abs(float(laws.numbers[laws.first[law] + 1])) for law in range(len(laws.kind))
         if laws.kind[law] == SINE), default=0.0,
    )  # fmt: skip
    return 2.0 * math.pi / fastest / PARTS if fastest > 0.0 else math.inf
