"""What is known of a run over all its steps, thinned in the output or not.

Every accepted step leaves a row of four figures; chunk by chunk they are folded into the extremes
of the run. The energy balance is E - work of the loads: it stays what it was, exactly, for the
exact motion.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from msahl.joints import along
from msahl.kernel import kernel
from msahl.schemes import preserving
from msahl.system.arrays import Start, State, System

BALANCE, KINETIC, GAP, GAP_RATE = range(4)
AT_REST = 1e-12
"""Kinetic energy, relative to the energy at the start or the weight's, that is round-off."""


class Watch(NamedTuple):
    """Rows of one chunk, and room for the joints' gaps."""

    rows: np.ndarray  # (steps, 4) balance, kinetic energy [J], largest gap [m], gap rate [m/s]
    gap: np.ndarray  # (k, 3) by the multipliers' nodes
    rate: np.ndarray  # (k, 3)


def new_watch(state: State, steps: int) -> Watch:
    """Room for ``steps`` rows."""
    return Watch(np.zeros((steps, 4)), np.zeros_like(state.gap), np.zeros_like(state.gap))


@kernel
def look(system: System, state: State, start: Start, watch: Watch, row: int) -> None:
    """Fill a row with the figures of the accepted, prepared state."""
    kinetic, potential = preserving.observe(system, state, start, watch.gap, watch.rate)
    balance = kinetic + potential
    for k in range(state.work.size):
        balance -= state.work[k]
    along.in_metres(system.along, watch.gap, watch.rate)
    watch.rows[row, BALANCE] = balance
    watch.rows[row, KINETIC] = kinetic
    watch.rows[row, GAP] = largest_length(watch.gap)
    watch.rows[row, GAP_RATE] = largest_length(watch.rate)


@kernel
def largest_length(vectors: np.ndarray) -> float:
    """Length of the longest of ``vectors`` (k, 3)."""
    square = 0.0
    for k in range(vectors.shape[0]):
        square = max(square, vectors[k, 0] ** 2 + vectors[k, 1] ** 2 + vectors[k, 2] ** 2)
    return math.sqrt(square)


class Extremes:
    """The figures of a whole run, from the rows of all its islands."""

    def __init__(self, first: Sequence[np.ndarray], weight: float) -> None:
        self.weight = weight  # work of gravity over the bodies' lengths [J]
        self.balance = sum(float(rows[0, BALANCE]) for rows in first)
        self.error = self.squares = 0.0
        self.steps = 0
        self.kinetic = self.gap = self.rate = 0.0
        self.fold(first)
        self.steps = 0

    def fold(self, islands: Sequence[np.ndarray]) -> None:
        """Take in the rows of a chunk, one array (steps, 4) an island."""
        total = np.sum([rows[:, :GAP] for rows in islands], axis=0)
        worst = np.max([rows[:, GAP:] for rows in islands], axis=0)
        if not len(total):
            return
        error = np.abs(total[:, BALANCE] - self.balance)
        self.error = max(self.error, float(error.max()))
        self.squares += float(error @ error)
        self.steps += len(error)
        self.kinetic = max(self.kinetic, float(total[:, KINETIC].max()))
        self.gap = max(self.gap, float(worst[:, 0].max()))
        self.rate = max(self.rate, float(worst[:, 1].max()))

    def as_json(self) -> dict[str, float | None]:
        """The figures by name; the relative energy error is over the largest kinetic energy, or
        None where that is round-off itself.
        """
        moves = self.kinetic > AT_REST * max(abs(self.balance), self.weight)
        return {
            "energyAtStart": self.balance,
            "largestKineticEnergy": self.kinetic,
            "energyErrorMax": self.error,
            "energyErrorMaxRelative": self.error / self.kinetic if moves else None,
            "energyErrorRms": (self.squares / max(self.steps, 1)) ** 0.5,
            "gapMax": self.gap,
            "gapRateMax": self.rate,
        }
