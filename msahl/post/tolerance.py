"""When two numbers count as the same."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

RTOL, ATOL = 1e-9, 1e-12
"""Defaults of ``msahl-post compare``: far above round-off of a run, far below what it resolves."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Two numbers a, b (b the reference's) are the same if |a - b| <= ``atol`` + ``rtol`` |b|."""

    rtol: float = RTOL
    atol: float = ATOL

    def of(self, b: "np.ndarray") -> "np.ndarray":
        """Largest accepted |a - b|, shaped as ``b``."""
        accepted: np.ndarray = self.atol + self.rtol * abs(b)
        return accepted
