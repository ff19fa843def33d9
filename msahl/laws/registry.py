"""Every law of force, by the name of its element in the deck."""

from collections.abc import Sequence

import numpy as np

from msahl.laws.drag import DRAG
from msahl.laws.law import PointLaw

POINT_LAWS: dict[str, PointLaw] = {law.name: law for law in (DRAG,)}
"""Laws of forces at points of bodies."""


def constants(
    forces: Sequence[tuple[PointLaw, tuple[tuple[str, float], ...]]],
) -> np.ndarray:
    """Return the numbers (k, p) that the kernels of laws take, in the order of their fields; rows
    of laws with fewer of them are filled with zeros.
    """
    rows = [[dict(values)[field.name] for field in law.fields] for law, values in forces]
    width = max(map(len, rows), default=0)
    return np.array([row + [0.0] * (width - len(row)) for row in rows]).reshape(-1, width)
