"""Coefficients of the explicit Runge-Kutta schemes of order 4 and 8.

    y_i = y_0 + h sum_j a_ij dy/dt_j ,  j < i ,  at t_0 + c_i h ;    y_1 = y_0 + h sum_i b_i dy/dt_i

Source: W. Kutta, Beitrag zur naeherungsweisen Integration totaler Differentialgleichungen, Z.
Math. Phys. 46 (1901), for order 4; G. J. Cooper, J. H. Verner, Some explicit Runge-Kutta methods
of high order, SIAM J. Numer. Anal. 9 (1972), for order 8 in eleven stages.
"""

import math
from functools import cache
from typing import NamedTuple

import numpy as np

R = math.sqrt(21.0)
ROWS: dict[str, list[list[float]]] = {
    "rk4": [[], [1 / 2], [0, 1 / 2], [0, 0, 1], [1 / 6, 1 / 3, 1 / 3, 1 / 6]],
    "rk8": [
        [],
        [1 / 2],
        [1 / 4, 1 / 4],
        [1 / 7, (-7 - 3 * R) / 98, (21 + 5 * R) / 49],
        [(11 + R) / 84, 0, (18 + 4 * R) / 63, (21 - R) / 252],
        [(5 + R) / 48, 0, (9 + R) / 36, (-231 + 14 * R) / 360, (63 - 7 * R) / 80],
        [
            (10 - R) / 42,
            0,
            (-432 + 92 * R) / 315,
            (633 - 145 * R) / 90,
            (-504 + 115 * R) / 70,
            (63 - 13 * R) / 35,
        ],
        [1 / 14, 0, 0, 0, (14 - 3 * R) / 126, (13 - 3 * R) / 63, 1 / 9],
        [
            *(1 / 32, 0, 0, 0, (91 - 21 * R) / 576, 11 / 72),
            *((-385 - 75 * R) / 1152, (63 + 13 * R) / 128),
        ],
        [
            *(1 / 14, 0, 0, 0, 1 / 9, (-733 - 147 * R) / 2205),
            *((515 + 111 * R) / 504, (-51 - 11 * R) / 56, (132 + 28 * R) / 245),
        ],
        [
            *(0, 0, 0, 0, (-42 + 7 * R) / 18, (-18 + 28 * R) / 45, (-273 - 53 * R) / 72),
            *((301 + 53 * R) / 72, (28 - 28 * R) / 45, (49 - 7 * R) / 18),
        ],
        [1 / 20, 0, 0, 0, 0, 0, 0, 49 / 180, 16 / 45, 49 / 180, 1 / 20],
    ],
}
"""By scheme, the rows a_i of all stages, then the weights b."""


class Butcher(NamedTuple):
    """Coefficients of a scheme of s stages."""

    a: np.ndarray  # (s + 1, s), the last row has the weights b
    c: np.ndarray  # (s + 1,) times as fractions of the step, the last one 1


@cache
def butcher(scheme: str) -> Butcher:
    """Return the coefficients of an explicit ``scheme``; all steps share them."""
    rows = ROWS[scheme]
    a = np.zeros((len(rows), len(rows) - 1))
    for i, row in enumerate(rows):
        a[i, : len(row)] = row
    return Butcher(a, a.sum(axis=1))
