"""Improves Newton's corrections where the Jacobian lacks a derivative: Broyden's method.

Forces by reactions are evaluated anew in each iteration, but the Jacobian takes the reactions as
given. Where these depend much on the motion, as the normal force of a contact does on the direction
in which it slides, corrections by it gain little, or lead away. The steps

    s_0 = y_0,    s_k = y_k + sum of s_(j+1) (s_j . y_k)/(s_j . s_j) for j = 0..k-1

    with s_k itself in the last term,

are those by a Jacobian J of which J s_j is what the residual has changed by, of all such the one
nearest to the J at the start; y_k = J^-1 F_k are Newton's. Source: C. T. Kelley, Iterative Methods
for Linear and Nonlinear Equations, SIAM 1995, section 7.3.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import copy
from msahl.jit.kernel import kernel, optional

MOST = 20
"""Steps that are kept; with more the Jacobian is evaluated anew."""
SMALLEST = 0.05
"""Least divisor of a step: with less, what the last step says of it is round-off."""
ROUGH = 1e-2
"""Residual above which a Jacobian is evaluated anew where convergence is slow: it has changed."""


class Secants(NamedTuple):
    """The steps since the Jacobian was factored, and their squares."""

    taken: np.ndarray  # (1,) how many there are
    step: np.ndarray  # (k, f, s)
    square: np.ndarray  # (k,)


def new_secants(unknowns: int, degree: int) -> Secants:
    """Return storage for steps of so many ``unknowns`` at each of ``degree`` stages."""
    return Secants(np.zeros(1, dtype=np.int64), np.zeros((MOST, unknowns, degree)), np.zeros(MOST))


@optional(False)
def go_on(secants: Secants, residual: float) -> bool:
    """Whether the Jacobian stays as it is although convergence at this ``residual`` is slow."""
    return residual <= ROUGH and secants.taken[0] < MOST


@optional()
def forget(secants: Secants) -> None:
    """Begin anew, as the Jacobian was factored."""
    secants.taken[0] = 0


@optional()
def improve(secants: Secants, y: np.ndarray) -> None:
    """Change the correction ``y`` (f, s) by the Jacobian to a step."""
    last = secants.taken[0] - 1
    for j in range(last):
        _add(y, _product(secants.step[j], y) / secants.square[j], secants.step[j + 1])
    if last >= 0:
        divisor = 1.0 - _product(secants.step[last], y) / secants.square[last]
        if abs(divisor) >= SMALLEST:
            for k in range(y.shape[0]):
                for i in range(y.shape[1]):
                    y[k, i] /= divisor
    square = _product(y, y)
    if last + 1 < MOST and square > 0.0:
        secants.taken[0] = last + 2
        secants.square[last + 1] = square
        copy(y, secants.step[last + 1])


@kernel
def _add(y: np.ndarray, factor: float, other: np.ndarray) -> None:
    """Add ``factor`` times the ``other`` to ``y``, both (f, s)."""
    for k in range(y.shape[0]):
        for i in range(y.shape[1]):
            y[k, i] += factor * other[k, i]


@kernel
def _product(a: np.ndarray, b: np.ndarray) -> float:
    """Sum of the products of the entries of two arrays (f, s)."""
    total = 0.0
    for k in range(a.shape[0]):
        for i in range(a.shape[1]):
            total += a[k, i] * b[k, i]
    return total
