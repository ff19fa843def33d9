"""Compute statistics of measures over the points of a sweep, and Sobol indices of a sample.

Points without a value (failed, or the measure is not defined there) are omitted and counted. For
confidence intervals points count as independent: that is true of a random sample; the intervals of
Latin hypercubes and Sobol sequences are then usually wider than necessary.

Sobol indices are those of ``scipy.stats.sobol_indices``: first order by Saltelli et al. (2010),
total order by Jansen, from f(a), f(b) and f(a with the coordinate j of b), shape (n, d + 2); each
centred by the mean of f(a) and f(b). Rows with a missing value are omitted, for which scipy has no
provision: it needs n to be a power of 2.
"""

import numpy as np
from scipy import stats

from msahl.post.sweep.read import Measured, SweepRuns
from msahl.records import record

LEVEL = 0.95
"""Confidence level of all intervals."""
RESAMPLES = 999
"""Bootstrap samples of the intervals of Sobol indices."""
SALTELLI = "saltelli"
QUANTILES = (0.05, 0.5, 0.95)


@record(slots=False)
class Statistics:
    """Statistics of a measure over ``used`` points of ``points`` of a ``group``; ``bad`` of those
    used have the verdict FAIL. ``interval`` and ``deviation_interval`` are confidence intervals of
    the mean and of the standard deviation, None for fewer than two points."""

    measure: Measured
    group: str
    points: int
    used: int
    bad: int
    mean: float
    deviation: float | None
    interval: tuple[float, float] | None
    deviation_interval: tuple[float, float] | None
    least: float
    largest: float
    quantiles: tuple[float, ...]


@record(slots=False)
class Indices:
    """Sobol indices of a measure: ``first`` and ``total`` order (d,) by parameter, with confidence
    intervals (d, 2) by the bootstrap; ``rows`` of ``planned`` rows of the design were used."""

    measure: Measured
    parameters: tuple[str, ...]
    first: np.ndarray
    total: np.ndarray
    first_interval: np.ndarray
    total_interval: np.ndarray
    rows: int
    planned: int


def independent(sweep: SweepRuns) -> np.ndarray:
    """Return which points (n,) are a sample of the distributions: of a Saltelli design the points a
    and b of each row, as all others repeat their coordinates; else all."""
    sample = sweep.sample
    if sample is None or sample.get("kind") != SALTELLI:
        return np.ones(sweep.count, dtype=bool)
    size = 2 + sum(parameter.drawn for parameter in sweep.parameters)
    return np.asarray((sweep.numbers - 1) % size < 2)


def groups(sweep: SweepRuns) -> list[tuple[str, np.ndarray]]:
    """Return the independent points (n,) of a sample, apart for each combination of the values of
    what is not sampled, with its words; all in one group without such combinations."""
    among = independent(sweep)
    listed = [parameter for parameter in sweep.varied if not parameter.drawn]
    if not listed or not any(parameter.drawn for parameter in sweep.varied):
        return [("", among)]
    keys = list(zip(*(parameter.cells for parameter in listed), strict=True))
    found = []
    for key in dict.fromkeys(keys):
        words = ", ".join(p.said(cell) for p, cell in zip(listed, key, strict=True))
        found.append((words, among & np.array([each == key for each in keys])))
    return found


def statistics_of(
    sweep: SweepRuns, measure: Measured, among: np.ndarray, group: str = ""
) -> Statistics:
    """Return the statistics of a measure over the points ``among`` (n,) those of a sweep."""
    known = among & np.isfinite(measure.values)
    values = measure.values[known]
    n = len(values)
    mean = float(values.mean()) if n else np.nan
    deviation = float(values.std(ddof=1)) if n > 1 else None
    interval = spread = None
    if deviation is not None:
        half = float(stats.t.ppf(0.5 + 0.5 * LEVEL, n - 1)) * deviation / np.sqrt(n)
        interval = (mean - half, mean + half)
        spread = _deviation_interval(deviation, n)
    return Statistics(
        measure=measure,
        group=group,
        points=int(among.sum()),
        used=n,
        bad=int((sweep.bad & known).sum()),
        mean=mean,
        deviation=deviation,
        interval=interval,
        deviation_interval=spread,
        least=float(values.min(initial=np.inf)),
        largest=float(values.max(initial=-np.inf)),
        quantiles=tuple(np.quantile(values, QUANTILES)) if n else (),
    )


def _deviation_interval(deviation: float, n: int) -> tuple[float, float]:
    """Return the confidence interval of the standard deviation of n values that are normally
    distributed."""
    low, high = stats.chi2.ppf([0.5 + 0.5 * LEVEL, 0.5 - 0.5 * LEVEL], n - 1)
    return deviation * float(np.sqrt((n - 1) / low)), deviation * float(np.sqrt((n - 1) / high))


def has_indices(sweep: SweepRuns) -> bool:
    """Return whether the plan is a Saltelli design, from which Sobol indices follow."""
    sample = sweep.sample
    return sample is not None and sample.get("kind") == SALTELLI


def indices_of(sweep: SweepRuns, measure: Measured, seed: int = 0) -> Indices | None:
    """Return the Sobol indices of a measure; None if it does not vary or too few rows are known."""
    names = tuple(p.name for p in sweep.parameters if p.drawn)
    width = len(names) + 2
    rows = -(-sweep.planned // width)
    design = np.full(rows * width, np.nan)
    design[sweep.numbers.astype(int) - 1] = measure.values
    values = design.reshape(rows, width)
    values = values[np.isfinite(values).all(axis=1)]
    if len(values) < 2 or float(np.ptp(values)) == 0.0:
        return None
    first, total = sobol(values[None])
    draws = np.random.default_rng(seed)
    tries = [
        sobol(values[draws.integers(0, len(values), (1, len(values)))]) for _ in range(RESAMPLES)
    ]
    ends = [50.0 * (1.0 - LEVEL), 50.0 * (1.0 + LEVEL)]
    intervals = [
        np.nanpercentile(np.concatenate([each[k] for each in tries]), ends, axis=0).T
        for k in (0, 1)
    ]
    return Indices(
        measure, names, first[0], total[0], intervals[0], intervals[1], len(values), rows
    )


def sobol(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return first and total indices (s, d) of designs (s, n, d + 2): f(a), f(b), f(ab_j)."""
    a, b, mixed = values[..., :1], values[..., 1:2], values[..., 2:]
    both = np.concatenate([a, b], axis=-2)[..., 0]
    mean = both.mean(axis=-1)[:, None, None]
    variance = both.var(axis=-1)[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        first = ((b - mean) * (mixed - a)).mean(axis=-2) / variance
        total = 0.5 * ((a - mixed) ** 2).mean(axis=-2) / variance
    return first, total
