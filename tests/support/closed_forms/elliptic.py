"""Compute elliptic functions and integrals from the complementary parameter.

    u = F(phi | m),   sn u = sin phi,   cn u = cos phi,   dn u = sqrt(1 - m sn^2 u)
    Pi(n; phi | m) = int_0^phi dt / ((1 - n sin^2 t) sqrt(1 - m sin^2 t))

m1 = 1 - m and n1 = 1 - n are arguments of their own: near a separatrix they are known much more
accurately than by the difference. Amplitudes may be of any size. Source: Abramowitz and Stegun 16.4
(descending Landen transformation), 17.2; Carlson, Computing elliptic integrals by duplication,
Numer. Math. 33 (1979).
"""

from typing import NamedTuple

import numpy as np
from scipy.special import elliprf, elliprj


class Jacobi(NamedTuple):
    """Amplitude and the three functions of an argument."""

    am: np.ndarray
    sn: np.ndarray
    cn: np.ndarray
    dn: np.ndarray


def jacobi(u: np.ndarray, m: float, m1: float) -> Jacobi:
    """Return the functions of ``u`` (real, any size), 0 <= m <= 1."""
    if m1 <= 0.0:
        return Jacobi(np.arctan(np.sinh(u)), np.tanh(u), 1.0 / np.cosh(u), 1.0 / np.cosh(u))
    a, b = [1.0], np.sqrt(m1)
    c = [np.sqrt(m)]
    while c[-1] > 1e-17 * a[-1] and len(a) < 40:
        c.append(0.5 * (a[-1] - b))
        a.append(0.5 * (a[-1] + b))
        b = np.sqrt(a[-2] * b)
    am = 2.0 ** (len(a) - 1) * a[-1] * u
    for k in range(len(a) - 1, 0, -1):
        am = 0.5 * (am + np.arcsin(c[k] / a[k] * np.sin(am)))
    sn, cn = np.sin(am), np.cos(am)
    return Jacobi(am, sn, cn, np.sqrt(cn * cn + m1 * sn * sn))


def first_kind(phi: float, m1: float) -> float:
    """Return F(phi | 1 - m1)."""
    periods = round(phi / np.pi)
    s, c = np.sin(phi - periods * np.pi), np.cos(phi - periods * np.pi)
    complete = 2.0 * periods * elliprf(0.0, m1, 1.0) if periods else 0.0
    return float(complete + s * elliprf(c * c, c * c + m1 * s * s, 1.0))


def third_kind(phi: np.ndarray, n: float, n1: float, m1: float) -> np.ndarray:
    """Return Pi(n; phi | 1 - m1)."""
    periods = np.round(phi / np.pi)
    s, c = np.sin(phi - periods * np.pi), np.cos(phi - periods * np.pi)
    complete = elliprf(0.0, m1, 1.0) + n / 3.0 * elliprj(0.0, m1, 1.0, n1)
    x, y, p = c * c, c * c + m1 * s * s, c * c + n1 * s * s
    part = s * elliprf(x, y, 1.0) + n / 3.0 * s**3 * elliprj(x, y, 1.0, p)
    return np.asarray(2.0 * periods * complete + part)
