"""Define when two numbers are equal within a tolerance."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

RTOL, ATOL = 1e-9, 1e-12
"""Defaults of ``msahl-post compare``: far above the rounding errors of a run, far below its
discretisation error."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Numbers a and b (b of the reference) are equal if |a - b| <= ``atol`` + ``rtol`` |b|."""

    rtol: float = RTOL
    atol: float = ATOL

    def of(self, b: "np.ndarray") -> "np.ndarray":
        """Return the largest accepted |a - b|, with the shape of ``b``."""
        accepted: np.ndarray = self.atol + self.rtol * abs(b)
        return accepted
