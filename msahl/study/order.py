"""The observed order: error = C h^p, where it holds.

Between neighbouring steps the slope is log(e_i/e_j)/log(h_i/h_j). The fit is over the longest
stretch of steps whose slopes agree and that reaches the finest step, or the round-off below which
nothing falls any more; coarser steps are pre-asymptotic. Its uncertainty is the 95 % interval of
the least squares.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

AGREE = 0.15
"""How far slopes of one stretch may be from their fit."""
LEAST_ORDER = 0.5
"""A flatter fit is no convergence."""
LEAST_POINTS = 3
FLAT = 1e-9
"""Largest error, in the measure's SI unit, that round-off over many steps explains."""


@dataclass(frozen=True, slots=True)
class Fit:
    """``order`` +- ``uncertainty`` and ``constant`` C over steps ``finest`` to ``coarsest`` [s]."""

    order: float
    uncertainty: float
    constant: float
    coarsest: float
    finest: float

    def error(self, h: float) -> float:
        """Error at step ``h``."""
        return float(self.constant * h**self.order)

    def step(self, error: float) -> float:
        """Step at which the error is ``error``."""
        return float((error / self.constant) ** (1.0 / self.order))


def fit_order(steps: Sequence[float], errors: Sequence[float]) -> Fit | None:
    """The fit over the longest stretch that has an order (of equals the finest); None if none."""
    known = sorted((h, e) for h, e in zip(steps, errors, strict=True) if e > 0.0 and np.isfinite(e))
    best: tuple[int, Fit] | None = None
    for begin in range(len(known)):
        for end in range(begin + LEAST_POINTS, len(known) + 1):
            fit = _fit(np.array(known[begin:end])) if _is_last(known[: begin + 1]) else None
            if fit is not None and (best is None or end - begin > best[0]):
                best = end - begin, fit
    return best[1] if best else None


def _is_last(finer: list[tuple[float, float]]) -> bool:
    """Whether a stretch that starts with the last of ``finer`` has only round-off before it."""
    x, y = np.log(np.array(finer)).T
    slopes = np.diff(y) / np.diff(x)
    # The slope next to the stretch may be half spoilt only, the one after it not.
    return not slopes.size or bool(slopes[-2:].min() < LEAST_ORDER)


def _fit(points: np.ndarray) -> Fit | None:
    """Least squares through the ``points`` (n, 2), if their slopes agree with it."""
    x, y = np.log(points).T
    slopes = np.diff(y) / np.diff(x)
    centred = x - x.mean()
    order = float(centred @ y / (centred @ centred))
    if order < LEAST_ORDER or np.abs(slopes - order).max() > AGREE:
        return None
    shift = float(y.mean() - order * x.mean())
    rest = y - shift - order * x
    coordinate = len(x) - 2
    spread = np.sqrt(rest @ rest / coordinate / (centred @ centred))
    uncertainty = float(stdtrit(coordinate, 0.975) * spread)
    return Fit(order, uncertainty, float(np.exp(shift)), float(points[-1, 0]), float(points[0, 0]))


def describe(fit: Fit | None, steps: Sequence[float], errors: Sequence[float]) -> str:
    """Where the order holds, in words."""
    if fit is None:
        if max(errors, default=0.0) <= FLAT:
            return "round-off at every step"
        return "none: no three neighbouring steps agree"
    words = [f"asymptotic from {fit.coarsest:g} to {fit.finest:g} s"]
    if any(h > fit.coarsest for h in steps):
        words.append("pre-asymptotic above")
    if any(h < fit.finest for h in steps):
        words.append("round-off or the reference's error below")
    return ", ".join(words)
