"""Which coordinates have kinks: places where their second derivatives jump."""

import numpy as np

from msahl.elements.constraints.coordinate_kinds import Coordinates, from_boxes
from msahl.elements.constraints.curves import CURVE
from msahl.elements.constraints.segments import SEGMENTS


def has_kinks(group: Coordinates) -> np.ndarray:
    """(q,) which coordinates are distances from boxes or curves, or between segments."""
    found: np.ndarray = np.isin(group.kind, (CURVE, SEGMENTS)) | from_boxes(group)
    return found
