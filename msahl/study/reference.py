"""What runs are judged by: states and joint forces of a scene at any time, and how far to trust.

``states(t)`` (m, 12 n) has the columns of ``states.csv`` and ``forces(t)`` (m, 3 k) those of
``reactions.csv``, both at the times themselves. ``horizon`` [s] is the time up to which they can be
trusted; past it a chaotic scene is known by its invariants only.
"""

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

    def states(self, times: np.ndarray) -> np.ndarray:
        """(m, 12 n) states at ``times``; NaN where it has none."""

    def forces(self, times: np.ndarray) -> np.ndarray:
        """(m, 3 k) joint forces [N] at ``times``; NaN where it has none."""


class StoredReference:
    """A run on file: its rows, at its own times only; forces from its states."""

    def __init__(self, folder: Path, model: Model) -> None:
        run = read_run(folder)
        self.words = f"The reference is the stored run {folder}."
        self.times = run.time
        self.table = run.states.to_numpy()[:, 1:]
        self.horizon = float(run.time[-1])
        if self.table.shape[1] != 12 * len(model.bodies):
            raise ResultError(f"{folder}: not a run of this deck (other bodies)")
        self.dynamics = Dynamics(model)

    def states(self, times: np.ndarray) -> np.ndarray:
        """(m, 12 n) states at ``times``; NaN at a time that is not on file."""
        near = np.searchsorted(self.times, times - SAME_TIME * self.horizon)
        near = np.minimum(near, len(self.times) - 1)
        table = self.table[near].copy()
        table[np.abs(self.times[near] - times) > SAME_TIME * self.horizon] = np.nan
        return table

    def forces(self, times: np.ndarray) -> np.ndarray:
        """(m, 3 k) joint forces [N] of the states on file; NaN at other times."""
        return self.dynamics.forces(times, self.states(times))


def choose_reference(wanted: str, model: Model, times: np.ndarray, accuracy: float) -> Reference:
    """The reference that ``wanted`` names: "auto", "exact", "independent" or a run's folder.

    Raises ``ResultError`` if there is none.
    """
    from msahl.study.exact import recognise
    from msahl.study.independent import independent

    exact = recognise(model) if wanted in ("auto", "exact") else None
    if exact is not None:
        return exact
    if wanted == "exact":
        raise ResultError("no closed form is known for this scene; leave --reference at auto")
    if wanted in ("auto", "independent"):
        return independent(model, times, accuracy)
    try:
        return StoredReference(Path(wanted), model)
    except DeckError as error:
        raise ResultError(str(error.faults[0])) from error
