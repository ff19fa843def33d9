"""Times of the steps of a run, and its output times: equal intervals from 0 to the end."""

import math
from dataclasses import replace

import numpy as np

from msahl.model import Simulation
from msahl.records import record

SHORTEST = 1e-3
"""Shortest last interval of a grid that is cut, as a fraction of the others: forces are means over
a step, and the round-off in them grows as the step becomes shorter."""


@record
class TimeGrid:
    """``n`` intervals of size ``h`` [s] up to ``t_final`` [s].

    The intervals are ``parts`` equal ones of ``divided`` [s]. Where ``parts`` is 0, or greater than
    n because the grid was cut, the last interval has a size of its own.
    """

    h: float
    n: int
    t_final: float
    divided: float = 0.0
    parts: int = 0

    @classmethod
    def of_steps(cls, simulation: Simulation) -> "TimeGrid":
        """The steps of a run."""
        return cls.with_interval(simulation.dt, simulation.t_final)

    @classmethod
    def of_output(cls, simulation: Simulation) -> "TimeGrid":
        """The output times of a run, before ``--every`` thins them."""
        interval = simulation.output_interval or simulation.dt
        return cls.with_interval(interval, simulation.t_final)

    @classmethod
    def with_interval(cls, h: float, t_final: float) -> "TimeGrid":
        """Intervals of ``h`` [s], adjusted by round-off if a whole number of them fits."""
        n = max(1, int(np.ceil(t_final / h * (1.0 - 1e-9))))
        if abs(n * h - t_final) <= 1e-9 * t_final:
            return cls(t_final / n, n, t_final, t_final, n)
        return cls(h, n, t_final)

    @property
    def uniform(self) -> bool:
        """Whether the last interval is as long as the others."""
        return self.parts == self.n and self.t_final == self.divided

    def until(self, t: float, least: int = 1) -> "TimeGrid":
        """Return the grid that ends at ``t`` [s], with ``least`` intervals or more, and otherwise
        without a very short last one.
        """
        return replace(self, n=max(least, math.ceil(t / self.h - SHORTEST)), t_final=t)

    def time(self, k: int) -> float:
        """End of interval ``k``; as a quotient it rounds to the decimal that a reader expects."""
        if k < self.n or self.uniform:
            return self.divided * k / self.parts if self.parts else k * self.h
        return self.t_final

    def times(self, k: np.ndarray) -> np.ndarray:
        """Ends of many intervals, as ``time`` returns them."""
        ends = self.divided * k / self.parts if self.parts else k * self.h
        return ends if self.uniform else np.where(k < self.n, ends, self.t_final)

    def count(self, t: float) -> int:
        """Number of intervals that end at or before ``t``, up to round-off."""
        k = int(t / self.h * (1.0 + 1e-9))
        return self.n if t >= self.t_final * (1.0 - 1e-12) else min(k, self.n - 1)

    def step(self, k: int) -> float:
        """Size of interval ``k`` = 1..n [s]."""
        return self.h if k < self.n or self.uniform else self.t_final - (self.n - 1) * self.h
