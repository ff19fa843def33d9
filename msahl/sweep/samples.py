"""Samples of distributions: points of the unit cube by scipy.stats.qmc, and their values.

    random:N     independent points
    lhs:N        Latin hypercube
    sobol:N      scrambled Sobol sequence; N should be a power of 2
    saltelli:N   N (d + 2) points of d numbers, for Sobol indices (``scipy.stats.sobol_indices``)

A Saltelli design has N blocks of d + 2 points. Points 0 and 1 of a block are a and b, the first and
last d coordinates of a point of a Sobol sequence in 2 d dimensions; point 2 + j is a with its
coordinate j replaced by that of b. With the values f of a measure, shape (N, d + 2), the indices
are ``sobol_indices(func={"f_A": f[:, :1].T, "f_B": f[:, 1:2].T, "f_AB": f[:, 2:].T[:, None]},
n=N)``.
"""

import inspect
import re
import warnings
from typing import Any

import numpy as np

from msahl.records import record
from msahl.sweep.axes import Distribution
from msahl.sweep.faults import PlanError

RANDOM, LHS, SOBOL, SALTELLI = KINDS = ("random", "lhs", "sobol", "saltelli")
MOST = 10_000_000
"""Most points of a sample."""


@record
class Sample:
    """How points are drawn: the ``kind``, its number ``n``, and the seed."""

    kind: str
    n: int
    seed: int

    def count(self, dimensions: int) -> int:
        """Return the number of points."""
        return self.n * (dimensions + 2) if self.kind == SALTELLI else self.n

    @property
    def note(self) -> str:
        """What the user should know about the number of points; empty if nothing."""
        if self.kind in (SOBOL, SALTELLI) and self.n & (self.n - 1):
            above = 1 << self.n.bit_length()
            return (
                f"a Sobol sequence is balanced for powers of 2 only; {self.kind}:{above // 2} or "
                f"{self.kind}:{above} covers the ranges more evenly than {self.kind}:{self.n}"
            )
        return ""


def parse_sample(text: str, seed: int) -> Sample:
    """Return the sample that ``--sample`` describes; raises ``PlanError``."""
    match = re.fullmatch(r"(\w+):([0-9]+)", text.strip())
    if match is None or match[1] not in KINDS:
        listed = ", ".join(f"{kind}:N" for kind in KINDS)
        raise PlanError(f"--sample {text}: write one of {listed}, where N is the number of points")
    n = int(match[2])
    if not 1 <= n <= MOST:
        raise PlanError(f"--sample {text}: N is from 1 to {MOST}")
    if match[1] == SALTELLI and n & (n - 1):
        below = 1 << (n.bit_length() - 1)
        raise PlanError(f"--sample {text}: N is a power of 2, such as {below} or {2 * below}")
    return Sample(match[1], n, seed)


def draw(sample: Sample, distributions: list[Distribution]) -> np.ndarray:
    """Return the values of all points, shape (points, number of distributions)."""
    cube = _cube(sample, len(distributions))
    columns = [inverse(distribution, cube[:, k]) for k, distribution in enumerate(distributions)]
    return np.stack(columns, axis=1)


def _cube(sample: Sample, d: int) -> np.ndarray:
    """Return points of the open unit cube, shape (points, d)."""
    from scipy.stats import qmc

    generator = np.random.default_rng(sample.seed)
    if sample.kind == RANDOM:
        points = generator.random((sample.n, d))
    elif sample.kind == LHS:
        points = _engine(qmc.LatinHypercube, d, generator).random(sample.n)
    else:
        wide = 2 * d if sample.kind == SALTELLI else d
        with warnings.catch_warnings():  # that n should be a power of 2 is said by ``note``
            warnings.simplefilter("ignore", UserWarning)
            points = _engine(qmc.Sobol, wide, generator).random(sample.n)
        if sample.kind == SALTELLI:
            points = _saltelli(points, d)
    tiny = np.finfo(float).eps
    return np.clip(points, tiny, 1.0 - tiny)  # the ends would be infinite


def _engine(kind: Any, d: int, generator: np.random.Generator) -> Any:
    """Return an engine of scipy.stats.qmc; its argument ``seed`` is called ``rng`` since 1.15."""
    name = "rng" if "rng" in inspect.signature(kind.__init__).parameters else "seed"
    return kind(d, **{name: generator})


def _saltelli(points: np.ndarray, d: int) -> np.ndarray:
    """Return the design of points (n, 2 d) of a Sobol sequence, shape (n (d + 2), d)."""
    a, b = points[:, :d], points[:, d:]
    blocks = np.repeat(a[:, None, :], d + 2, axis=1)
    blocks[:, 1] = b
    for j in range(d):
        blocks[:, 2 + j, j] = b[:, j]
    return blocks.reshape(-1, d)


def inverse(distribution: Distribution, u: np.ndarray) -> np.ndarray:
    """Return the values below which the fractions ``u`` of a distribution are."""
    from scipy.special import ndtri

    numbers = distribution.numbers
    match distribution.kind:
        case "uniform":
            return numbers[0] + (numbers[1] - numbers[0]) * u
        case "loguniform":
            low, high = np.log(numbers)
            return np.clip(np.exp(low + (high - low) * u), numbers[0], numbers[1])
        case "normal":
            return numbers[0] + numbers[1] * ndtri(u)
        case "lognormal":
            return np.exp(numbers[0] + numbers[1] * ndtri(u))
        case "truncnormal":
            from scipy.stats import truncnorm  # exact as well far from the mean

            mean, deviation, least, most = numbers
            low, high = (np.array((least, most)) - mean) / deviation
            return np.clip(mean + deviation * truncnorm.ppf(u, low, high), least, most)
    low, mode, high = numbers
    split, width = (mode - low) / (high - low), high - low
    rising = low + np.sqrt(u * width * (mode - low))
    falling = high - np.sqrt((1.0 - u) * width * (high - mode))
    return np.where(u < split, rising, falling)
