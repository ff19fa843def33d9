"""When the largest error of a run has grown, and up to which time it is within an accuracy."""

from sys import float_info
from typing import Any

import numpy as np

GROWTH = 1.05
"""Factor by which the largest error must have grown to be recorded with its time."""


class ErrorHistory:
    """The ``record`` of larger and larger errors [m], each with the time [s] before it; errors are
    known ``until`` a time [s].
    """

    def __init__(self) -> None:
        self.record: list[tuple[float, float]] = []
        self.until = 0.0

    @property
    def largest(self) -> float:
        """The largest error that is recorded [m]."""
        return self.record[-1][1] if self.record else 0.0

    def note(self, errors: np.ndarray, times: np.ndarray) -> None:
        """Add the ``errors`` (m,) [m] at ``times`` (m,) [s]."""
        largest = np.maximum.accumulate(errors)
        before = np.append(self.until, times[:-1])
        while (
            k := int(np.searchsorted(largest, max(GROWTH * self.largest, float_info.min)))
        ) < len(largest):
            self.record.append((float(before[k]), float(largest[k])))
        self.until = float(times[-1])

    def horizon(self, accuracy: float) -> float:
        """Time [s] up to which the error stays within ``accuracy`` [m]."""
        return next((time for time, error in self.record if error > accuracy), self.until)

    def numbers(self) -> dict[str, Any]:
        """The history, for a snapshot."""
        return {"record": list(self.record), "until": self.until}

    def restore(self, numbers: dict[str, Any]) -> None:
        """Restore what ``numbers`` returned."""
        self.record = [(time, error) for time, error in numbers["record"]]
        self.until = numbers["until"]
