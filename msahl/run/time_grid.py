"""Times of the steps of a run, and its output times: equal intervals from 0 to the end."""

from dataclasses import dataclass

import numpy as np

from msahl.model import Simulation


@dataclass(frozen=True, slots=True)
class TimeGrid:
    """``n`` intervals of size ``h`` [s] up to ``t_final`` [s]. Where ``uniform`` is false, the last
    interval is shorter.
    """

    h: float
    n: int
    t_final: float
    uniform: bool

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
        uniform = abs(n * h - t_final) <= 1e-9 * t_final
        return cls(t_final / n if uniform else h, n, t_final, uniform)

    def time(self, k: int) -> float:
        """End of interval ``k``; as a quotient it rounds to the decimal that a reader expects."""
        return self.t_final * k / self.n if self.uniform else min(k * self.h, self.t_final)

    def times(self, k: np.ndarray) -> np.ndarray:
        """Ends of many intervals, as ``time`` returns them."""
        return self.t_final * k / self.n if self.uniform else np.minimum(k * self.h, self.t_final)

    def count(self, t: float) -> int:
        """Number of intervals that end at or before ``t``, up to round-off."""
        k = int(t / self.h * (1.0 + 1e-9))
        return self.n if t >= self.t_final * (1.0 - 1e-12) else min(k, self.n - 1)

    def step(self, k: int) -> float:
        """Size of interval ``k`` = 1..n [s]."""
        return self.h if k < self.n or self.uniform else self.t_final - (self.n - 1) * self.h
