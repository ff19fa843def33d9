"""Converged positions by methods that neither program uses.

    python -m benchmarks.beams.references    writes references.csv

Bodies at rest: shooting with the differential equations of the rod along its arc length. Rod in
motion: spectral elements with Gauss-Lobatto-Legendre points, quaternions at the points, strains
R^T r' - e1 and 2 conj(q) q'. Cable in motion: Ritz's method with Legendre's polynomials in both
coordinates, energies EA (|r'| - 1)^2/2 and EI k^2/2, k = (r' x r'')/|r'|^2. Both in time by DOP853.
"""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numpy.polynomial import legendre
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import fsolve

from benchmarks.beams.problems import (
    ALONG,
    BEND,
    CEASED,
    FORCE,
    GRAVITY,
    HANGING,
    PEAK,
    PROBLEMS,
    RADIUS,
    ROD,
    ROPE,
    SPAN,
    START,
    SWINGING,
    THROW,
    TWIST,
    Problem,
)

STORED = Path(__file__).parent / "references.csv"
TOLERANCE = 1e-11
SIZES: dict[str, tuple[Any, Any]] = {
    "bend": (1e-9, 1e-12),
    "rod": ((8, 12), (16, 8)),
    "hanging": (1e-7, 1e-10),
    "swinging": (32, 36),
}
"""Tolerance, numbers and degrees of elements, number of polynomials: of a check, and of the
reference."""


def reference(problem: Problem) -> np.ndarray:
    """Return the stored positions (outputs + 1, points, 3) [m]."""
    with STORED.open(newline="") as file:
        rows = [row[3:] for row in csv.reader(file) if row[0] == problem.name]
    return np.array(rows, dtype=float).reshape(-1, len(problem.points), 3)


def bend(tolerance: float) -> np.ndarray:
    """Shooting: the moment (3,) at the clamp is sought that leaves none at the tip."""
    section = BEND.section
    stiff = np.array([section.stretch, section.shear, section.shear])
    resist = np.array([section.torsion, section.bending, section.bending])
    force = np.array([0.0, 0.0, FORCE])

    def rates(s: float, y: np.ndarray) -> np.ndarray:
        R = y[3:12].reshape(3, 3)
        along = R @ (np.array([1.0, 0.0, 0.0]) + (R.T @ force) / stiff)
        k = np.array([0.0, 0.0, 1.0 / RADIUS]) + (R.T @ y[12:]) / resist
        R_s = np.cross(R, k)  # R [k]^ has the rows of R times k
        return np.concatenate([along, R_s.reshape(-1), -np.cross(along, force)])

    def at_tip(moment: np.ndarray) -> np.ndarray:
        start = np.concatenate([np.zeros(3), np.eye(3).reshape(-1), moment])
        path = solve_ivp(rates, (0.0, BEND.length), start, "DOP853", rtol=tolerance, atol=tolerance)
        return np.asarray(path.y[:, -1])

    moment = np.zeros(3)
    for share in np.linspace(0.1, 1.0, 10):
        force = np.array([0.0, 0.0, share * FORCE])
        moment = fsolve(lambda m: at_tip(m)[12:] / FORCE, moment, xtol=1e-12)
    return at_tip(moment)[None, None, :3]


def hanging(tolerance: float) -> np.ndarray:
    """The cable in equilibrium, by collocation with ``scipy.integrate.solve_bvp``."""

    def rates(s: np.ndarray, y: np.ndarray, p: np.ndarray) -> np.ndarray:
        slope, moment = y[:2]
        across = p[1] + ROPE.mass * GRAVITY * s
        tension = p[0] * np.cos(slope) + across * np.sin(slope)
        shear = across * np.cos(slope) - p[0] * np.sin(slope)
        e = 1.0 + tension / ROPE.stretch
        return np.array([moment / ROPE.bending, -e * shear, e * np.cos(slope), e * np.sin(slope)])

    def ends(a: np.ndarray, b: np.ndarray, p: np.ndarray) -> np.ndarray:
        return np.array([a[1], a[2], a[3], b[1], b[2] - SPAN, b[3]])

    s = np.linspace(0.0, HANGING.length, 200)
    share = s / HANGING.length
    guess = [2.0 * share - 1.0, 20.0 + 0.0 * s, SPAN * share, -10.0 * share * (1.0 - share)]
    weight = ROPE.mass * GRAVITY * HANGING.length
    found = solve_bvp(
        rates, ends, s, np.array(guess), [30.0, -0.5 * weight], tol=tolerance, max_nodes=10**6
    )
    x, z = found.sol(0.5 * HANGING.length)[2:]
    return np.array([[[x, 0.0, z]]])


def swinging(count: int) -> np.ndarray:
    """The cable in motion, with ``count`` polynomials in each coordinate."""
    length = SWINGING.length
    q, weight = legendre.leggauss(2 * count)
    w = 0.5 * length * weight
    # Polynomials that vanish at the hinge.
    held = np.vstack([-((-1.0) ** np.arange(1, count + 1)), np.eye(count)])
    value, first, second = (
        legendre.legval(q, legendre.legder(held, k)).T * (2.0 / length) ** k for k in range(3)
    )
    inverse = np.linalg.inv(ROPE.mass * (value.T * w) @ value)
    weights = -ROPE.mass * GRAVITY * (value.T @ w)

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        place = y[: 2 * count].reshape(count, 2)
        a, b = first @ place, second @ place
        square = np.sum(a * a, axis=1)
        stretch = np.sqrt(square)
        k = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / square
        m = ROPE.bending * k / square * w
        n = ROPE.stretch * (stretch - 1.0) / stretch * w - 2.0 * k * m
        by_a = n[:, None] * a + m[:, None] * np.stack([b[:, 1], -b[:, 0]], axis=1)
        by_b = m[:, None] * np.stack([-a[:, 1], a[:, 0]], axis=1)
        force = -(first.T @ by_a + second.T @ by_b)
        force[:, 1] += weights
        return np.concatenate([y[2 * count :], (inverse @ force).reshape(-1)])

    place = np.zeros((count, 2))
    place[0, 0] = 0.5 * length
    observed = legendre.legval(2.0 * np.array(SWINGING.points) - 1.0, held).T
    y = _integrated(SWINGING, rates, np.concatenate([place.reshape(-1), np.zeros(2 * count)]))
    x, z = np.moveaxis(observed @ y[:, : 2 * count].reshape(-1, count, 2), -1, 0)
    return np.stack([x, np.zeros_like(x), z], axis=-1)


def rod(size: tuple[int, int]) -> np.ndarray:
    """The rod in motion, by elements of a degree."""
    elements, degree = size
    count = elements * degree + 1
    points, weight, D = _lobatto(degree)
    h = ROD.length / elements
    w, s = np.zeros(count), np.zeros(count)
    for first in range(0, count - 1, degree):
        w[first : first + degree + 1] += 0.5 * h * weight
        s[first : first + degree + 1] = 0.5 * h * (points + 1.0) + h * first / degree
    angle = 0.5 * np.arctan2(ALONG[1], ALONG[0])
    q = np.tile([np.cos(angle), 0.0, 0.0, np.sin(angle)], count)
    start = np.concatenate([(START + s[:, None] * ALONG).reshape(-1), q, np.zeros(6 * count)])
    given = ROD.section
    stiff = np.array([given.stretch, given.shear, given.shear])
    resist = np.array([given.torsion, given.bending, given.bending])
    inertia = np.array(given.inertia)
    load = np.array([*THROW, *TWIST])
    numbers = (D * 2.0 / h, 0.5 * h * weight, w, stiff, resist, given.mass, inertia, load)
    y = _integrated(ROD, lambda t, y: _rod_rates(t, y, *numbers), start)
    return y[:, : 3 * count].reshape(-1, count, 3)[:, [0, -1]]


@numba.njit  # type: ignore[untyped-decorator]
def _rod_rates(t, y, D, weight, w, stiff, resist, mass, inertia, load):  # type: ignore[no-untyped-def]
    """Rates of positions, quaternions, velocities and angular velocities in body axes."""
    nodes, count = len(D), len(w)
    x, q = y[: 3 * count].reshape(count, 3), y[3 * count : 7 * count].reshape(count, 4).copy()
    v, W = y[7 * count : 10 * count], y[10 * count :].reshape(count, 3)
    rates = np.empty_like(y)
    force, moment, R = np.zeros((count, 3)), np.zeros((count, 3)), np.empty((count, 3, 3))
    for i in range(count):
        a, b, c, d = q[i]
        rate = rates[3 * count + 4 * i : 3 * count + 4 * i + 4]
        rate[0] = -0.5 * (b * W[i, 0] + c * W[i, 1] + d * W[i, 2])
        rate[1:] = 0.5 * (a * W[i] + _cross(q[i, 1:], W[i]))
        q[i] /= np.sqrt(np.sum(q[i] * q[i]))
        R[i] = _matrix(q[i])
    for e in range((count - 1) // (nodes - 1)):
        first = e * (nodes - 1)
        for k in range(nodes):
            along, along_q = np.zeros(3), np.zeros(4)
            for j in range(nodes):
                _add(along, D[k, j], x[first + j])
                _add(along_q, D[k, j], q[first + j])
            own, here = q[first + k], R[first + k]
            bent = 2.0 * (
                own[0] * along_q[1:] - along_q[0] * own[1:] - _cross(own[1:], along_q[1:])
            )
            strain = _times(here.T, along)
            strain[0] -= 1.0
            n, m = weight[k] * _times(here, stiff * strain), weight[k] * resist * bent
            for j in range(nodes):
                _add(force[first + j], -D[k, j], n)
                _add(moment[first + j], -D[k, j], m)
            moment[first + k] += _times(here.T, _cross(along, n)) + _cross(bent, m)
    factor = max(0.0, t / PEAK if t < PEAK else (CEASED - t) / (CEASED - PEAK))
    force[0] += factor * load[:3]
    moment[0] += factor * _times(R[0].T, load[3:])
    rates[: 3 * count] = v
    for i in range(count):
        rates[7 * count + 3 * i : 7 * count + 3 * i + 3] = force[i] / (mass * w[i])
        spun = moment[i] / w[i] - _cross(W[i], inertia * W[i])
        rates[10 * count + 3 * i : 10 * count + 3 * i + 3] = spun / inertia
    return rates


@numba.njit  # type: ignore[untyped-decorator]
def _add(total, factor, a):  # type: ignore[no-untyped-def]
    for i in range(len(a)):
        total[i] += factor * a[i]


@numba.njit  # type: ignore[untyped-decorator]
def _cross(a, b):  # type: ignore[no-untyped-def]
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


@numba.njit  # type: ignore[untyped-decorator]
def _times(A, b):  # type: ignore[no-untyped-def]
    return A[:, 0] * b[0] + A[:, 1] * b[1] + A[:, 2] * b[2]


@numba.njit  # type: ignore[untyped-decorator]
def _matrix(q):  # type: ignore[no-untyped-def]
    """Rotation matrix of a quaternion of length one."""
    a, b, c, d = q
    return np.array(
        [
            [a * a + b * b - c * c - d * d, 2.0 * (b * c - a * d), 2.0 * (b * d + a * c)],
            [2.0 * (b * c + a * d), a * a - b * b + c * c - d * d, 2.0 * (c * d - a * b)],
            [2.0 * (b * d - a * c), 2.0 * (c * d + a * b), a * a - b * b - c * c + d * d],
        ]
    )


def _lobatto(degree: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points and weights on [-1, 1], and the matrix of derivatives at the points."""
    P = legendre.Legendre.basis(degree)
    x = np.sort(np.concatenate([[-1.0], P.deriv().roots().real, [1.0]]))
    difference = x[:, None] - x + np.eye(degree + 1)
    c = 1.0 / difference.prod(axis=1)
    D = c / c[:, None] / difference
    np.fill_diagonal(D, 0.0)
    np.fill_diagonal(D, -D.sum(axis=1))
    return x, 2.0 / (degree * (degree + 1) * P(x) ** 2), D


def _integrated(problem: Problem, rates: Callable[..., np.ndarray], y: np.ndarray) -> np.ndarray:
    """Return the states (outputs + 1, n); steps end where the load of the rod changes its law."""
    found = [y]
    for k in range(problem.outputs):
        span = (k * problem.interval, (k + 1) * problem.interval)
        path = solve_ivp(rates, span, found[-1], "DOP853", rtol=TOLERANCE, atol=TOLERANCE)
        found.append(path.y[:, -1])
    return np.array(found)


METHODS: dict[str, Callable[[Any], np.ndarray]] = {
    "bend": bend,
    "rod": rod,
    "hanging": hanging,
    "swinging": swinging,
}


def main() -> None:
    rows = []
    for name, problem in PROBLEMS.items():
        coarse, fine = (METHODS[name](size) for size in SIZES[name])
        change = float(np.linalg.norm(fine - coarse, axis=-1).max()) / problem.length
        print(f"{name}: a finer one changes by {change:.1e} of the length", flush=True)
        for k, outputs in enumerate(fine):
            for share, x in zip(problem.points, outputs, strict=True):
                t = f"{k * problem.interval:.12g}"
                rows.append([name, t, share, *(f"{number:.12g}" for number in x)])
    with STORED.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["problem", "time", "share", "x", "y", "z"])
        writer.writerows(rows)


if __name__ == "__main__":
    main()
