"""Define when two numbers are equal within a tolerance."""

from typing import TYPE_CHECKING

from msahl.records import record

if TYPE_CHECKING:
    import numpy as np

RTOL, ATOL = 1e-9, 1e-12
"""Defaults of ``msahl-post compare``: far above the rounding errors of a run, far below its
discretisation error."""


@record
class Tolerance:
    """Numbers a and b (b of the reference) are equal if |a - b| <= ``atol`` + ``rtol`` |b|."""

    rtol: float = RTOL
    atol: float = ATOL

    def of(self, b: "np.ndarray") -> "np.ndarray":
        """Return the largest accepted |a - b|, with the shape of ``b``."""
        accepted: np.ndarray = self.atol + self.rtol * abs(b)
        return accepted
