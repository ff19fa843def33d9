"""Define reference values: states and joint forces of a model at given times, and their horizon.

``states(t)`` (m, 12 n) has the columns of ``states.csv`` and ``forces(t)`` (m, 3 k) those of
``reactions.csv``, both instantaneous. ``horizon`` [s] is the time up to which they can be trusted;
after it only the invariants of a chaotic motion are known.
"""

from pathlib import Path
from typing import Protocol

import numpy as np

from msahl.deck import DeckError
from msahl.model import Model
from msahl.records import record
from msahl.results.read import ResultError, Run, read_run
from msahl.study.dynamics import Dynamics

SAME_TIME = 1e-9
"""Two times are equal if they differ by less than this fraction of the time span."""


class Reference(Protocol):
    """A source of reference values."""

    @property
    def description(self) -> str:
        """Return a sentence that says what the reference is."""

    @property
    def horizon(self) -> float:
        """Return the time [s] up to which it can be trusted."""

    @property
    def error(self) -> float:
        """Return its own estimated error of positions [m]."""

    def states(self, times: np.ndarray) -> np.ndarray:
        """Return the states (m, 12 n) at ``times``; NaN at a time for which there are none."""

    def forces(self, times: np.ndarray) -> np.ndarray:
        """Return the joint forces (m, 3 k) [N] at ``times``; NaN likewise."""


def position_differences(table: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the largest difference of positions (m,) [m] of the bodies in two tables (m, 12 n)."""
    difference = (table - other).reshape(len(table), -1, 12)[:, :, :3]
    return np.asarray(np.sqrt((difference**2).sum(axis=2)).max(axis=1))


@record(slots=False)
class TableReference:
    """States at the output times of a run, and at no others; forces computed from the states."""

    description: str
    times: np.ndarray
    table: np.ndarray
    horizon: float
    error: float
    dynamics: Dynamics

    @classmethod
    def of_run(cls, run: Run, description: str, dynamics: Dynamics) -> "TableReference":
        """Return a ``run`` as a reference."""
        table = run.states.to_numpy()[:, 1:]
        return cls(description, run.time, table, float(run.time[-1]), 0.0, dynamics)

    def states(self, times: np.ndarray) -> np.ndarray:
        """Return the states (m, 12 n) at ``times``; NaN at a time that is not in the table."""
        same = SAME_TIME * self.times[-1]
        near = np.searchsorted(self.times, times - same)
        near = np.minimum(near, len(self.times) - 1)
        table = self.table[near].copy()
        table[np.abs(self.times[near] - times) > same] = np.nan
        return table

    def forces(self, times: np.ndarray) -> np.ndarray:
        """Return the joint forces (m, 3 k) [N] of the states in the table; NaN at other times."""
        return self.dynamics.forces(times, self.states(times))


def stored(folder: Path, model: Model) -> TableReference:
    """Return the run in ``folder`` as a reference for runs of a ``model``; raises ``ResultError``
    if it is none.
    """
    try:
        run = read_run(folder)
    except DeckError as error:
        raise ResultError(str(error.faults[0])) from error
    if run.states.shape[1] != 1 + 12 * len(model.bodies):
        raise ResultError(f"{folder}: not a run of this deck (it has other bodies)")
    return TableReference.of_run(run, f"The reference is the stored run {folder}.", Dynamics(model))
