"""What runs are judged by: states and joint forces of a scene at any time, and how far to trust.

``states(t)`` (m, 12 n) has the columns of ``states.csv`` and ``forces(t)`` (m, 3 k) those of
``reactions.csv``, both at the times themselves. ``horizon`` [s] is the time up to which they can be
trusted; past it a chaotic scene is known by its invariants only.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from msahl.deck import DeckError
from msahl.model import Model
from msahl.results.read import ResultError, read_run
from msahl.study.dynamics import Dynamics

SAME_TIME = 1e-9
"""Two times are one if they differ by less than this part of the span."""


class Reference(Protocol):
    """Where true values come from."""

    @property
    def words(self) -> str:
        """What it is, in a sentence."""

    @property
    def horizon(self) -> float:
        """Time [s] up to which it can be trusted."""

    @property
    def error(self) -> float:
        """Its own error in position [m], estimated."""

    def states(self, times: np.ndarray) -> np.ndarray:
        """(m, 12 n) states at ``times``; NaN where it has none."""

    def forces(self, times: np.ndarray) -> np.ndarray:
        """(m, 3 k) joint forces [N] at ``times``; NaN where it has none."""


@dataclass(frozen=True)
class TableReference:
    """States at the times of a run, and at no others; forces from the states."""

    words: str
    times: np.ndarray
    table: np.ndarray
    horizon: float
    error: float
    dynamics: Dynamics

    def states(self, times: np.ndarray) -> np.ndarray:
        """(m, 12 n) states at ``times``; NaN at a time that is not in the table."""
        same = SAME_TIME * self.times[-1]
        near = np.searchsorted(self.times, times - same)
        near = np.minimum(near, len(self.times) - 1)
        table = self.table[near].copy()
        table[np.abs(self.times[near] - times) > same] = np.nan
        return table

    def forces(self, times: np.ndarray) -> np.ndarray:
        """(m, 3 k) joint forces [N] of the states in the table; NaN at other times."""
        return self.dynamics.forces(times, self.states(times))


def stored(folder: Path, model: Model) -> TableReference:
    """The run in ``folder`` as a reference."""
    run = read_run(folder)
    table = run.states.to_numpy()[:, 1:]
    if table.shape[1] != 12 * len(model.bodies):
        raise ResultError(f"{folder}: not a run of this deck (other bodies)")
    words = f"The reference is the stored run {folder}."
    return TableReference(words, run.time, table, float(run.time[-1]), 0.0, Dynamics(model))


def choose_reference(
    wanted: str, model: Model, times: np.ndarray, accuracy: float, seconds: float = math.inf
) -> Reference:
    """The reference that ``wanted`` names: "auto", "exact", "independent" or a run's folder; for
    "auto" msahl's own runs at small steps where an independent one takes more than ``seconds``.

    Raises ``ResultError`` if there is none.
    """
    from msahl.study.exact import recognise
    from msahl.study.independent import TooSlowError, independent
    from msahl.study.own import own_reference

    exact = recognise(model) if wanted in ("auto", "exact") else None
    if exact is not None:
        return exact
    if wanted == "exact":
        raise ResultError("no closed form is known for this model; leave --reference at auto")
    if wanted == "independent":
        return independent(model, times, accuracy)
    if wanted == "auto":
        try:
            return independent(model, times, accuracy, seconds)
        except TooSlowError as error:
            return own_reference(model, accuracy, seconds, error.solution)
    try:
        return stored(Path(wanted), model)
    except DeckError as error:
        raise ResultError(str(error.faults[0])) from error
