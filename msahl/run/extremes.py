"""Extremes of a run over all its steps, from what the monitor writes at every step."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from msahl.system.diagnostics import (
    BALANCE,
    CONSTRAINT_WORK,
    DISPLACEMENT,
    DISTANCE,
    KINETIC,
    LOCAL,
    ROTATION,
    SPEED,
    VIOLATION,
    VIOLATION_RATE,
)

AT_REST = 1e-12
"""Kinetic energy below which the model counts as at rest, relative to the energy at t = 0 or the
energy scale of the model."""


class Extremes:
    """Largest figures of a run, of all its subsystems together.

    ``balance`` [J] is the energy less the work of the loads at t = 0, ``scale`` [J] the work of the
    model's forces over its lengths, ``potential`` [J] the potential energy at t = 0 and
    ``exchanged`` [J] the largest change of it at output times between steps.
    """

    def __init__(self, first: Sequence[np.ndarray], scale: float) -> None:
        self.scale = scale
        self.balance = sum(float(rows[0, BALANCE]) for rows in first)
        self.potential = sum(float(rows[0, BALANCE] - rows[0, KINETIC]) for rows in first)
        self.error = self.squares = self.kinetic = self.local = self.exchanged = 0.0
        # As ``error``, at output times between steps; None without any.
        self.between: float | None = None
        self.steps = 0
        self.worst = [0.0] * (LOCAL + 1)  # largest value of each column of the monitor
        self.add(first)
        self.steps = 0

    def add(self, subsystems: Sequence[np.ndarray]) -> None:
        """Add the monitor's rows of some steps, one array (steps, 10) for each subsystem."""
        if not len(subsystems[0]):
            return
        total = np.sum([rows[:, :VIOLATION] for rows in subsystems], axis=0)
        worst = np.max(subsystems, axis=0)
        error = np.abs(total[:, BALANCE] - self.balance)
        self.error = max(self.error, float(error.max()))
        self.squares = _sum(self.squares, error * error)
        self.steps += len(error)
        self.kinetic = max(self.kinetic, float(total[:, KINETIC].max()))
        self.worst = [
            max(w, float(new)) for w, new in zip(self.worst, worst.max(axis=0), strict=True)
        ]
        self.local = _sum(self.local, worst[:, LOCAL])

    def add_rows(self, energies: Sequence[np.ndarray]) -> None:
        """Add output times between steps, by the balances and potential energies (2, rows) [J] that
        each subsystem has there.
        """
        balance, potential = np.sum(energies, axis=0)
        self.between = max(self.between or 0.0, float(np.abs(balance - self.balance).max()))
        self.exchanged = max(self.exchanged, float(np.abs(potential - self.potential).max()))

    def raise_scale(self, energy: float) -> None:
        """Raise the energy scale to this ``energy`` [J] if it is smaller."""
        self.scale = max(self.scale, energy)

    @property
    def displacement(self) -> float:
        """Largest displacement of a mass centre since t = 0 [m]."""
        return self.worst[DISPLACEMENT]

    @property
    def size(self) -> float:
        """Size of the energies whose difference the energy balance is [J]."""
        return max(abs(self.balance), self.scale, self.kinetic)

    def numbers(self) -> dict[str, Any]:
        """All figures, for a snapshot."""
        return {
            "scale": self.scale,
            "balance": self.balance,
            "error": self.error,
            "between": self.between,
            "potential": self.potential,
            "exchanged": self.exchanged,
            "squares": self.squares,
            "kinetic": self.kinetic,
            "local": self.local,
            "steps": self.steps,
            "worst": list(self.worst),
        }

    def restore(self, numbers: dict[str, Any]) -> None:
        """Restore what ``numbers`` returned."""
        self.scale, self.balance = numbers["scale"], numbers["balance"]
        self.error, self.squares = numbers["error"], numbers["squares"]
        self.between = numbers["between"]
        self.potential, self.exchanged = numbers["potential"], numbers["exchanged"]
        self.kinetic, self.local = numbers["kinetic"], numbers["local"]
        self.steps, self.worst = numbers["steps"], list(numbers["worst"])

    def as_json(self) -> dict[str, float | None]:
        """The figures by their names in ``run.json``. The relative energy error refers to the
        largest kinetic energy, and is None where that is round-off.
        """
        moves = self.kinetic > AT_REST * max(abs(self.balance), self.scale)
        return {
            "energyAtStart": self.balance,
            "largestKineticEnergy": self.kinetic,
            "energyErrorMax": self.error,
            "energyErrorMaxRelative": self.error / self.kinetic if moves else None,
            "energyErrorBetweenSteps": self.between,
            "potentialEnergyChangeBetweenSteps": None if self.between is None else self.exchanged,
            "energyErrorRms": (self.squares / max(self.steps, 1)) ** 0.5,
            "constraintViolationMax": self.worst[VIOLATION],
            "constraintViolationRateMax": self.worst[VIOLATION_RATE],
            "constraintWorkMax": self.worst[CONSTRAINT_WORK],
            "speedMax": self.worst[SPEED],
            "rotationPerStepMax": self.worst[ROTATION],
            "distanceMax": self.worst[DISTANCE],
            "displacementMax": self.worst[DISPLACEMENT],
            "localErrorMax": self.worst[LOCAL],
            "localErrorSum": self.local,
        }


def _sum(start: float, terms: np.ndarray) -> float:
    """Return ``start`` and the ``terms``, added one after the other: chunks of steps end where the
    clock says, and the sum must not depend on that.
    """
    return float(np.add.accumulate(np.append(start, terms))[-1])
