"""Where the mass centres are: minimal coordinates, independent of every code that is measured.

Chain of n bodies in the x-z plane, th_i the angle of body i from z towards x, L its length:

    e_i = (sin th_i, cos th_i),  n_i = de_i/dth_i,  x_i = L (e_1 + ... + e_i)
    m (a_i - g)  = f_i - f_(i+1)          f_i  force of joint i on body i
    J th_i''     = -L n_i . f_i           f_i acts at x_i - L e_i
    a_i - a_(i-1) = L th_i'' n_i - L th_i'^2 e_i

With f_i/m = T_i e_i - k q_i n_i, where q_i = L th_i'' and k = J/(m L^2), elimination of a leaves a
banded system in (T_i, q_i): the cost is O(n), and no q is a small difference of large forces. Top:
rotation about the pivot, J_p w' = (J_p w) x w + r x m R^T g and the quaternion's rate, in body
axes.

``converged_positions`` integrates in double precision by an explicit method of order 8, ``known``
also by extrapolation in the machine's longest precision (``benchmarks.extended``): two methods in
two precisions, whose difference says how good they are.

    python -m benchmarks.reference        # both for every problem, the longest chain too (minutes)
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import lapack

from benchmarks.extended import refine
from msahl.model import Model

TOLERANCE = 1e-13
LOOSER = 1e-12
"""A second tolerance, to see how good the first is."""
AGREED = 1e-11
"""Change [m] by the last subdivision of the step at which extrapolation ends."""
LONG = np.longdouble
LARGEST_LONG = 100
"""Bodies up to which extended precision takes seconds."""
REFINEMENTS = 2
"""Corrections of a solution in double precision until its residual is one of longdouble."""
DIAGONAL, BANDS = 3, 7
"""Row of the main diagonal in a band matrix stored by diagonals, and how many those are."""


class Equation(NamedTuple):
    """y' = rate(y), and the mass centres (rows, n, 3) of each row of y."""

    start: np.ndarray
    rate: Callable[[np.ndarray], np.ndarray]
    places: Callable[[np.ndarray], np.ndarray]


class Known(NamedTuple):
    """Where mass centres are, by what, and how far a second solution is from there [m]."""

    x: np.ndarray  # (rows + 1, n, 3)
    words: str
    apart: float


def converged_positions(model: Model, t: np.ndarray, tolerance: float = TOLERANCE) -> np.ndarray:
    """(rows, n, 3) mass centres at the times ``t``, the first of which is 0."""
    equation = equation_of(model, float)
    motion = solve_ivp(
        lambda _, y: equation.rate(y),
        (0.0, t[-1]),
        equation.start,
        method="DOP853",
        t_eval=t,
        rtol=tolerance,
        atol=tolerance,
    )
    return equation.places(motion.y.T)


def known(model: Model, grid: float, rows: int, thorough: bool = False) -> Known:
    """Mass centres after ``rows`` equal intervals ``grid`` [s]; unless ``thorough``, the longest
    chain has double precision alone.
    """
    converged = converged_positions(model, grid * np.arange(rows + 1))
    if len(model.bodies) > LARGEST_LONG and not thorough:
        looser = converged_positions(model, grid * np.arange(rows + 1), LOOSER)
        words = f"DOP853 to {TOLERANCE:g}; beside it to {LOOSER:g}"
        return Known(converged, words, _distance(converged, looser))
    equation = equation_of(model, LONG)
    x, halved = refine(equation.rate, equation.places, equation.start, grid, rows, AGREED)
    digits = np.finfo(LONG).precision
    words = f"extrapolation in {digits} digits, moved {halved:.0e} m by its last subdivision"
    return Known(x, f"{words}; beside it DOP853 in double precision", _distance(converged, x))


def _distance(x: np.ndarray, y: np.ndarray) -> float:
    return float(np.linalg.norm(x - y, axis=-1).max())


def equation_of(model: Model, kind: Any) -> Equation:
    """The equation of motion of a chain or a top, in numbers of ``kind``."""
    spinning = any(any(body.angular_velocity) for body in model.bodies)
    return _top(model, kind) if spinning else chain_equation(model, kind)


def chain_equation(model: Model, kind: Any) -> Equation:
    """That of a chain of equal bodies, at rest on a line through the pivot."""
    body, n = model.bodies[0], len(model.bodies)
    L = kind(-model.joints[0].child_point[2])
    k, g = kind(body.inertia[1][1]) / (kind(body.mass) * L * L), kind(model.gravity[2])
    angle = np.arctan2(kind(body.position[0]), kind(body.position[2]))

    def rate(y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[n:], _chain_accelerations(y[:n], y[n:], k, L, g)])

    def places(y: np.ndarray) -> np.ndarray:
        x = np.zeros((len(y), n, 3), dtype=kind)
        x[..., 0] = L * np.cumsum(np.sin(y[:, :n]), axis=1)
        x[..., 2] = L * np.cumsum(np.cos(y[:, :n]), axis=1)
        return x

    start = np.concatenate([np.full(n, angle), np.zeros(n, dtype=kind)])
    return Equation(start, rate, places)


def _chain_accelerations(th: np.ndarray, th_dot: np.ndarray, k: Any, L: Any, g: Any) -> np.ndarray:
    """th'' from the equations e_i . (a_i - a_(i-1)) and n_i . (a_i - a_(i-1)); a_0 = 0."""
    n = len(th)
    own = np.full(n, 2.0, dtype=th.dtype)
    own[0] = 1.0
    c, s = np.cos(np.diff(th)), np.sin(np.diff(th))
    band = np.zeros((BANDS, 2 * n), dtype=th.dtype)
    band[DIAGONAL, 0::2] = own
    band[DIAGONAL, 1::2] = 1.0 + own * k
    # By the next body (th_j - th_i is the difference), then by the one before (its negative).
    band[DIAGONAL - 2, 2::2], band[DIAGONAL - 3, 3::2] = -c, -k * s
    band[DIAGONAL - 1, 2::2], band[DIAGONAL - 2, 3::2] = s, -k * c
    band[DIAGONAL + 2, :-2:2], band[DIAGONAL + 1, 1:-2:2] = -c, k * s
    band[DIAGONAL + 3, :-2:2], band[DIAGONAL + 2, 1:-2:2] = -s, -k * c
    right = np.zeros(2 * n, dtype=th.dtype)
    right[0::2] = -L * th_dot * th_dot
    right[0] -= g * np.cos(th[0])
    right[1] -= g * np.sin(th[0])
    return _solve_band(band, right)[1::2] / L


def _solve_band(band: np.ndarray, right: np.ndarray) -> np.ndarray:
    """In double precision, then corrected until its residual is as exact as the numbers given."""
    width = DIAGONAL
    storage = np.zeros((width + BANDS, band.shape[1]))
    storage[width:] = band
    factors, pivots, singular = lapack.dgbtrf(storage, width, width)
    if singular:
        raise ArithmeticError("singular equations of motion")

    def solve(rest: np.ndarray) -> np.ndarray:
        return lapack.dgbtrs(factors, width, width, np.asarray(rest, dtype=float), pivots)[0]

    z = solve(right).astype(right.dtype)
    if right.dtype == LONG:
        for _ in range(REFINEMENTS):
            z += solve(right - _times_band(band, z))
    return z


def _times_band(band: np.ndarray, z: np.ndarray) -> np.ndarray:
    product = band[DIAGONAL] * z
    for d in range(1, min(DIAGONAL, z.size - 1) + 1):
        product[:-d] += band[DIAGONAL - d, d:] * z[d:]
        product[d:] += band[DIAGONAL + d, :-d] * z[:-d]
    return product


def _top(model: Model, kind: Any) -> Equation:
    body = model.bodies[0]
    r = -np.array(model.joints[0].child_point, dtype=kind)
    mass, gravity = kind(body.mass), np.array(model.gravity, dtype=kind)
    J = np.array(body.inertia, dtype=kind)
    J += mass * (r @ r * np.eye(3, dtype=kind) - np.outer(r, r))
    inverse = np.linalg.inv(J.astype(float)).astype(kind)
    for _ in range(REFINEMENTS):
        inverse = inverse @ (2.0 * np.eye(3, dtype=kind) - J @ inverse)
    tilt = np.arctan2(kind(body.position[0]), kind(body.position[2])) / 2

    def rate(y: np.ndarray) -> np.ndarray:
        q0, q, w = y[0], y[1:4], y[4:]
        moment = mass * np.cross(r, _rotated(y[:4], gravity, inverse=True))
        w_dot = inverse @ (np.cross(J @ w, w) + moment)
        return np.array([-(q @ w) / 2, *((q0 * w + np.cross(q, w)) / 2), *w_dot])

    def places(y: np.ndarray) -> np.ndarray:
        return np.array([_rotated(row[:4], r) for row in y])[:, None, :]

    quaternion = np.array([np.cos(tilt), 0.0, np.sin(tilt), 0.0], dtype=kind)
    return Equation(
        np.concatenate([quaternion, np.array(body.angular_velocity, dtype=kind)]), rate, places
    )


def _rotated(quaternion: np.ndarray, a: np.ndarray, inverse: bool = False) -> np.ndarray:
    """``a`` rotated by a quaternion whose length may have drifted in its last digits."""
    q0, q = quaternion[0], quaternion[1:] * (-1.0 if inverse else 1.0)
    rotated = a + 2.0 * np.cross(q, np.cross(q, a) + q0 * a) / (quaternion @ quaternion)
    return rotated


def main() -> None:
    # The problems read decks, which the equations above have no need of.
    from benchmarks.problems import GRID, ROWS, all_problems

    for problem in all_problems(quick=False):
        solution = known(problem.model, GRID, ROWS, thorough=True)
        print(f"{problem.name}: {solution.words}: {solution.apart:.1e} m apart")


if __name__ == "__main__":
    main()
