"""The tables of a run that follow from the motion of bodies."""

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from msahl.model import Model
from msahl.run.body_rows import TablesOfSteppers
from msahl.run.tables import (
    AMPLITUDES,
    BEAMS,
    JOINTS,
    MARKERS,
    SYSTEM,
    has_joint_table,
    needs_accelerations,
)

if TYPE_CHECKING:
    from msahl.run.joint_table import JointTable


class ObservedTable(Protocol):
    """A table whose rows follow from the tables that the steppers fill."""

    def rows(self, tables: TablesOfSteppers) -> np.ndarray:
        """Return the rows (m, columns) at the times of these tables, which follow."""


class ObservedTables:
    """The tables of a ``model`` that follow from the motion of its bodies."""

    def __init__(self, model: Model) -> None:
        self.tables: dict[str, ObservedTable] = {}
        self.joints: JointTable | None = _joint_table(model)
        if self.joints:
            self.tables[JOINTS] = self.joints
        if model.markers:
            from msahl.run.marker_table import MarkerTable

            self.tables[MARKERS] = MarkerTable(model)
        if model.groups:
            from msahl.run.system_table import SystemTable

            self.tables[SYSTEM] = SystemTable(model)
        if model.beams:
            from msahl.run.beam_table import BeamTable

            self.tables[BEAMS] = BeamTable(model)
        if model.elastic_bodies:
            from msahl.run.amplitude_table import AmplitudeTable

            self.tables[AMPLITUDES] = AmplitudeTable(model)

    def rows(self, of_steppers: TablesOfSteppers) -> dict[str, np.ndarray]:
        """Return the rows of every table at the times of those ``of_steppers``, which follow."""
        return {name: table.rows(of_steppers) for name, table in self.tables.items()}

    def numbers(self) -> dict[str, Any]:
        """Return for a snapshot what the next rows depend on, as JSON can hold it."""
        return self.joints.numbers() if self.joints else {}

    def restore(self, numbers: dict[str, Any]) -> None:
        """Restore what ``numbers`` returned."""
        if self.joints:
            self.joints.restore(numbers)


def _joint_table(model: Model) -> "JointTable | None":
    """Return the table of the joints' coordinates, None if it is not written."""
    if not has_joint_table(model):
        return None
    from msahl.run.joint_table import JointTable

    return JointTable(model, 3 if needs_accelerations(model) else 2)
