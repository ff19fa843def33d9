"""The complementarity problem of one contact with friction, by cases: see ``friction``.

open       z_n = least: the tangential part is the least of a quadratic form in a disk
sticks     w = 0 and |z_t| <= mu z_n
slides     w_n = 0 and z_t = -mu z_n d, where d = (cos a, sin a) is the direction of w_t: a zero
           of d x w_t as a function of the angle a, found by its changes of sign
"""

import math
from collections.abc import Iterator

import numpy as np

ANGLES = np.linspace(0.0, 2.0 * math.pi, 181)
FOURIER = np.stack([ANGLES**0, *(f(k * ANGLES) for k in (1, 2) for f in (np.cos, np.sin))], axis=1)
"""Angles at which the sign of d x w_t is taken, and the functions of which it consists."""
BISECTIONS = 60
ROUND_OFF = 1e-11
"""Violation, relative to the terms, that is round-off."""


def solve_one(
    W: np.ndarray, q: np.ndarray, mu: float, least: float, d: np.ndarray | None
) -> np.ndarray | None:
    """Return z (3,) of a contact with the matrix ``W`` (3, 3), None if there is none; the direction
    ``d`` of its slip may be given.
    """
    size = float(np.abs(q).max()) + float(np.abs(W[:, 0] * least).max())
    for z in _cases(W, q, mu, least, d):
        w = W @ z + q
        near = ROUND_OFF * (size + float(np.abs(W * z).max()))
        if z[0] >= least and w[0] >= -near:
            return z
    return None


def _cases(
    W: np.ndarray, q: np.ndarray, mu: float, least: float, d: np.ndarray | None
) -> Iterator[np.ndarray]:
    """Yield what may be the solution."""
    open_q = q[1:] + W[1:, 0] * least
    T = _in_disk(W[1:, 1:], open_q, mu * least) if d is None else -mu * least * d
    yield np.array([least, *T])
    if d is not None:
        yield _sliding(W, q, mu, d)
        return
    stuck = np.linalg.lstsq(W, -q, rcond=1e-13)[0]
    if math.hypot(*stuck[1:]) <= mu * stuck[0]:
        yield stuck
    if mu > 0.0:
        yield from _slides(W, q, mu)
    else:
        yield np.array([-q[0] / W[0, 0], 0.0, 0.0])


def _sliding(W: np.ndarray, q: np.ndarray, mu: float, d: np.ndarray) -> np.ndarray:
    """Return z of w_n = 0 in a slip along ``d``; not a number where it presses itself closed."""
    reduced = W[0, 0] - mu * float(W[0, 1:] @ d)
    z_n = -q[0] / reduced if reduced > 0.0 else math.nan
    return np.array([z_n, -mu * z_n * d[0], -mu * z_n * d[1]])


def _slides(W: np.ndarray, q: np.ndarray, mu: float) -> Iterator[np.ndarray]:
    """Yield z of all slips along their own directions.

    w_t times the reduced coefficient W_nn - mu W_nt.d is g + H d.
    """
    g = W[0, 0] * q[1:] - q[0] * W[1:, 0]
    for d in _parallel(g, mu * (q[0] * W[1:, 1:] - np.outer(q[1:], W[0, 1:]))):
        z = _sliding(W, q, mu, d)
        if (W[1:] @ z + q[1:]) @ d >= 0.0:
            yield z


def directions_from_rest(W: np.ndarray, mu: float) -> Iterator[np.ndarray]:
    """Yield the directions (2,) in which a slip begins that a normal force drives."""
    for d in _parallel(W[1:, 0], -mu * W[1:, 1:]):
        if (W[1:, 0] - mu * (W[1:, 1:] @ d)) @ d > 0.0:
            yield d


def _parallel(g: np.ndarray, H: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the unit vectors d (2,) to which g + H d is parallel: zeros of d x (g + H d)."""
    mean, double = 0.5 * (H[1, 0] - H[0, 1]), 0.5 * (H[1, 0] + H[0, 1])
    terms = np.array([mean, g[1], -g[0], double, 0.5 * (H[1, 1] - H[0, 0])])
    value = FOURIER @ terms
    for i in np.flatnonzero(value[:-1] * value[1:] <= 0.0):
        a = _zero(terms.tolist(), *ANGLES[i : i + 2].tolist())
        yield np.array([math.cos(a), math.sin(a)])


def _zero(terms: list[float], low: float, high: float) -> float:
    """Return a zero of the sum of ``terms`` between the angles ``low`` and ``high``."""
    mean, c, s, c_2, s_2 = terms

    def at(a: float) -> float:
        once, twice = (
            c * math.cos(a) + s * math.sin(a),
            c_2 * math.cos(2 * a) + s_2 * math.sin(2 * a),
        )
        return mean + once + twice

    at_low = at(low)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        value = at(middle)
        if value * at_low > 0.0:
            low, at_low = middle, value
        else:
            high = middle
    return 0.5 * (low + high)


def _in_disk(A: np.ndarray, b: np.ndarray, radius: float) -> np.ndarray:
    """Return T (2,) with |T| <= radius that makes T.A.T/2 + b.T the least."""
    if radius == 0.0:
        return np.zeros(2)
    values, vectors = np.linalg.eigh(A)
    c = vectors.T @ b
    free = -c / np.maximum(values, 1e-300)
    if np.hypot(*free) <= radius:
        return vectors @ free
    low, high = 0.0, float(np.hypot(*c)) / radius
    for _ in range(2 * BISECTIONS):
        middle = 0.5 * (low + high)
        if np.hypot(*(c / (values + middle))) > radius:
            low = middle
        else:
            high = middle
    return vectors @ (-c / (values + high))
