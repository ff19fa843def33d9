"""Edges of boxes: how far the nearest points of the lines of two segments are beyond their ends."""

import numpy as np

from msahl.elements.constraints.segments import half_lengths, last_three
from msahl.jit.kernel import kernel, optional

SHORTER = 1e-6
"""Fraction of an edge at its ends that counts as beyond them: of what is nearest at an end, as of
edges of two boxes that lie flush on each other, the corner there is as near but for its square."""

ALONG = 1e-12
"""Square of the sine between edges below which they do not cross: round-off moves the point in
which they do by a thousandth of them. What overhangs by this angle is nearer by its square."""


@kernel
def _past(x: float, half: float) -> float:
    return max(abs(x) - half * (1.0 - SHORTER), 0.0)


@optional(0.0)
def past_ends(ends: np.ndarray, q: int, m: np.ndarray, k: int) -> float:
    """Return by how much the nearest points of the lines of coordinate ``q`` are beyond the ends of
    its segments [m], by its products ``m`` from number ``k`` on; 0 where these cross, and their
    length where they are parallel.
    """
    (p, q_e, s), half = last_three(m, k), half_lengths(ends, q)
    square = 1.0 - s * s
    if square <= ALONG:
        return half[0] + half[1]
    return _past((p - s * q_e) / square, half[0]) + _past((s * p - q_e) / square, half[1])
