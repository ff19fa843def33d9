"""Fit the observed order p of convergence, error = C h^p, over the steps at which it is valid.

Between neighbouring steps the slope is log(e_i/e_j)/log(h_i/h_j). The fit is over the longest range
of steps whose slopes agree and that extends to the finest step, or to the rounding errors below
which no error falls; coarser steps are pre-asymptotic. The uncertainty is the 95 % interval of the
least-squares fit.
"""

from collections.abc import Sequence

import numpy as np
from scipy.special import stdtrit

from msahl.records import record

AGREE = 0.15
"""Largest difference of a slope from the fit of its range."""
LEAST_ORDER = 0.5
"""A fit of lower order is not convergence."""
LEAST_POINTS = 3
FLAT = 1e-9
"""Largest error, in the SI unit of the metric, that rounding errors of many steps explain."""


@record
class Fit:
    """``order`` +- ``uncertainty`` and ``constant`` C over steps ``finest`` to ``coarsest`` [s]."""

    order: float
    uncertainty: float
    constant: float
    coarsest: float
    finest: float

    def error(self, h: float) -> float:
        """Return the error at step size ``h``."""
        return float(self.constant * h**self.order)

    def step(self, error: float) -> float:
        """Return the step size at which the error is ``error``."""
        return float((error / self.constant) ** (1.0 / self.order))


def fit_order(steps: Sequence[float], errors: Sequence[float]) -> Fit | None:
    """Return the fit over the longest range with an order, of equal ones the finest; or None."""
    known = sorted((h, e) for h, e in zip(steps, errors, strict=True) if e > 0.0 and np.isfinite(e))
    best: tuple[int, Fit] | None = None
    for begin in range(len(known)):
        for end in range(begin + LEAST_POINTS, len(known) + 1):
            fit = _fit(np.array(known[begin:end])) if _is_last(known[: begin + 1]) else None
            if fit is not None and (best is None or end - begin > best[0]):
                best = end - begin, fit
    return best[1] if best else None


def _is_last(finer: list[tuple[float, float]]) -> bool:
    """Return whether errors finer than the last of ``finer`` are only rounding errors."""
    x, y = np.log(np.array(finer)).T
    slopes = np.diff(y) / np.diff(x)
    # The slope next to the range may still be half convergence, the one after it may not.
    return not slopes.size or bool(slopes[-2:].min() < LEAST_ORDER)


def _fit(points: np.ndarray) -> Fit | None:
    """Return the least-squares fit of the ``points`` (n, 2), if their slopes agree with it."""
    x, y = np.log(points).T
    slopes = np.diff(y) / np.diff(x)
    centred = x - x.mean()
    order = float(centred @ y / (centred @ centred))
    if order < LEAST_ORDER or np.abs(slopes - order).max() > AGREE:
        return None
    shift = float(y.mean() - order * x.mean())
    rest = y - shift - order * x
    statistical_dof = len(x) - 2
    deviation = np.sqrt(rest @ rest / statistical_dof / (centred @ centred))
    uncertainty = float(stdtrit(statistical_dof, 0.975) * deviation)
    return Fit(order, uncertainty, float(np.exp(shift)), float(points[-1, 0]), float(points[0, 0]))


def describe(fit: Fit | None, steps: Sequence[float], errors: Sequence[float]) -> str:
    """Say in words for which steps the order is valid."""
    if fit is None:
        if max(errors, default=0.0) <= FLAT:
            return "rounding error at every step"
        return "none: no three neighbouring steps agree"
    words = [f"asymptotic from {fit.coarsest:g} to {fit.finest:g} s"]
    if any(h > fit.coarsest for h in steps):
        words.append("pre-asymptotic above")
    if any(h < fit.finest for h in steps):
        words.append("rounding errors or errors of the reference below")
    return ", ".join(words)
