"""Derivatives of measures of a run by numbers of its deck, as a value."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from msahl.records import record

HEADER = ("measure", "parameter", "value", "derivative", "unit", "error")


class GradientError(ValueError):
    """Derivatives that cannot be computed; the message has one line for each fault."""


@record(slots=False)
class Gradients:
    """Values of measures and their derivatives by parameters.

    ``values`` (m,) are those of the run's tables; ``jacobian`` (m, n) the derivatives, in the SI
    unit of the measure by the unit of the parameter in the deck, and ``errors`` (m, n) their
    estimated errors, nan where they are not known. ``columns`` hold the derivatives (rows, n) of
    columns at all output times. ``remarks`` say what to mind.
    """

    measures: tuple[str, ...]
    parameters: tuple[str, ...]
    values: np.ndarray
    jacobian: np.ndarray
    errors: np.ndarray
    units: tuple[tuple[str, ...], ...]
    columns: Mapping[str, np.ndarray]
    remarks: tuple[str, ...] = ()

    def of(self, measure: str) -> dict[str, float]:
        """Return the derivatives of one measure by the parameters' names.

        Raises ``GradientError`` if there is no such measure.
        """
        if measure not in self.measures:
            known = ", ".join(f"'{name}'" for name in self.measures)
            raise GradientError(f"there is no measure {measure!r:.200}; there are {known}")
        row = self.jacobian[self.measures.index(measure)]
        return dict(zip(self.parameters, row.tolist(), strict=True))

    def rows(self) -> list[tuple[Any, ...]]:
        """Return the rows of ``gradients.csv``, under ``HEADER``."""
        return [
            (
                measure,
                name,
                *(float(value) for value in (self.values[i], self.jacobian[i, j])),
                self.units[i][j],
                float(self.errors[i, j]),
            )
            for i, measure in enumerate(self.measures)
            for j, name in enumerate(self.parameters)
        ]

    def as_json(self) -> list[dict[str, Any]]:
        """Return the rows for ``run.json``; what is not known is null."""
        return [
            {
                name: None if isinstance(value, float) and not math.isfinite(value) else value
                for name, value in zip(HEADER, row, strict=True)
            }
            for row in self.rows()
        ]
