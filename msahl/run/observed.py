"""The tables of a run that follow from the motion of bodies: coordinates of joints."""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from msahl.model import Model
from msahl.run.joint_table import JointTable
from msahl.run.tables import ACCELERATIONS, JOINTS, STATES, has_joint_table, needs_accelerations


class RowsOfBodies(Protocol):
    """A table whose rows follow from those of the bodies."""

    def rows(self, states: np.ndarray, accelerations: np.ndarray | None) -> np.ndarray:
        """Return the rows (m, columns) that follow those of the last call."""

    def numbers(self) -> dict[str, Any]:
        """Return for a snapshot what the next rows depend on, as JSON can hold it."""

    def restore(self, numbers: dict[str, Any]) -> None:
        """Restore what ``numbers`` returned."""


class ObservedTables:
    """The tables of a ``model`` that follow from the motion of its bodies."""

    def __init__(self, model: Model) -> None:
        self.tables: dict[str, RowsOfBodies] = {}
        if has_joint_table(model):
            self.tables[JOINTS] = JointTable(model, 3 if needs_accelerations(model) else 2)

    def rows(self, of_steppers: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return the rows of every table at the times of those ``of_steppers``, which follow."""
        states, accelerations = of_steppers[STATES], of_steppers.get(ACCELERATIONS)
        return {name: table.rows(states, accelerations) for name, table in self.tables.items()}

    def numbers(self) -> dict[str, Any]:
        """Return for a snapshot what the next rows depend on, as JSON can hold it."""
        return {name: table.numbers() for name, table in self.tables.items()}

    def restore(self, numbers: dict[str, Any]) -> None:
        """Restore what ``numbers`` returned."""
        for name, table in self.tables.items():
            table.restore(numbers[name])
