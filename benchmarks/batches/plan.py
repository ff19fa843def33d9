"""The plan that all codes carry out: double pendulums with a mass and an angle of their own."""

import os
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

import msahl
from msahl.model import Model

DECK = Path(__file__).with_name("double_pendulum.xml")
SPAN, GRID = 10.0, 0.5
"""Length of a run and interval at whose ends positions are compared [s]."""
CORES = 2


class Sample(NamedTuple):
    """Mass of the second bob [kg], and angle from below at which both start [deg]."""

    m: float
    phi: float


def samples(count: int, seed: int = 7) -> list[Sample]:
    """Return so many samples: masses of 1 to 3 kg, angles of 30 to 90 degrees."""
    numbers = np.random.default_rng(seed).uniform((1.0, 30.0), (3.0, 90.0), (count, 2))
    return [Sample(*row) for row in numbers.tolist()]


def model_of(sample: Sample) -> Model:
    """Return the records of a sample, from which the peers are built."""
    return msahl.load(DECK, **sample._asdict()).records


def error(found: np.ndarray, true: np.ndarray) -> float:
    """Return the largest distance [m] of any mass centre (samples, rows, 2, 3) from the truth."""
    return float(np.linalg.norm(found - true, axis=-1).max())


class Clock:
    """Seconds since it was made: on the clock, and computed by this process and those that it
    started and that have ended. The latter do not depend on what else the machine does.
    """

    def __init__(self) -> None:
        self._began, self._computed = time.perf_counter(), self._computing()

    def read(self) -> tuple[float, float]:
        """Return both."""
        return time.perf_counter() - self._began, self._computing() - self._computed

    def _computing(self) -> float:
        times = os.times()
        return times.user + times.system + times.children_user + times.children_system
