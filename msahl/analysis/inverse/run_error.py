"""The error of a run whose motion is given, as part of the error bars of its loads.

The positions of a run are smooth, so no spline through them shows how far they are wrong. The run
estimated that itself: e [m] in its positions and orientations, e_F [N] in its reactions and e_M
[N m] in their moments. With the largest range X of the given coordinates [m], their largest
acceleration A [m/s^2], the duration T and the largest force F of the balance, the error bars of
forces are raised by

    max(2 e_F, 10 F e max(1 / X, 2 / (A T^2)))

and those of torques by max(2 max(e_M, l e_F), 10 l F ...), with the size l of the model. The second
is the relative error of the motion: that of an oscillation of amplitude X, or in a run shorter than
a period of the displacement A T^2 / 2. Both factors are by experiment: without them, the loads of
``preserving`` on the models of ``tests/analysis/inverse/test_inverse.py`` are off by up to 4 times
the second and 0.4 times the first.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

REACTIONS, MOTION = 2.0, 10.0
"""Factors of the estimated errors of reactions, and of the relative error of the motion."""


class RunError(NamedTuple):
    """The largest errors that a run estimated; nan if it did not, or not to its end."""

    position: float  # of positions and orientations [m]
    force: float  # of reactions [N]
    moment: float  # [N m]

    @property
    def is_known(self) -> bool:
        """Whether the run estimated its error."""
        return bool(np.isfinite(self).all())


UNKNOWN = RunError(np.nan, np.nan, np.nan)


def run_error(info: Mapping[str, Any]) -> RunError | None:
    """Return the errors in ``run.json``; None unless ``msahl run`` integrated the motion."""
    if info.get("command"):
        return None
    estimate = info.get("error") or {}
    if not estimate or estimate.get("complete") is False:
        return UNKNOWN
    position = max(float(estimate.get(name, np.nan)) for name in ("position", "orientation"))
    # A model without joints has no reactions.
    return RunError(position, *(float(estimate.get(name) or 0.0) for name in ("force", "moment")))


def raised_by(
    error: RunError,
    rates: np.ndarray,
    accelerations: np.ndarray,
    time: np.ndarray,
    largest: float,
    size: float,
    rotates: Sequence[bool],
) -> np.ndarray:
    """(k,) by how much the error bars of drives rise, by their units: ``rotates`` of torques.

    Rates and accelerations (m, y) of the given coordinates in metres, ``largest`` force of the
    balance [N], ``size`` of the model [m].
    """
    steps = np.diff(time)[:, None] * 0.5 * (rates[1:] + rates[:-1])
    place = np.concatenate([np.zeros((1, rates.shape[1])), np.cumsum(steps, axis=0)])
    X = float(np.ptp(place, axis=0).max(initial=0.0))
    AT2 = float(np.abs(accelerations).max(initial=0.0)) * float(time[-1]) ** 2
    inverse = max(1.0 / X if X else 0.0, 2.0 / AT2 if AT2 else 0.0)
    by_motion = MOTION * largest * error.position * inverse
    force = max(REACTIONS * error.force, by_motion)
    moment = max(REACTIONS * max(error.moment, size * error.force), size * by_motion)
    return np.where(np.asarray(rotates, dtype=bool), moment, force)
