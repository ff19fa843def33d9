"""The time element as a first program might have it: 12 unknowns a body, 3 a joint, SI units.

    x1 - x0 - h (v0 + v1)/2                  = 0   [m]
    rotation(R0, R1) - h (w0 + w1)/2         = 0   [rad]      body axes
    m (v1 - v0) - h f                        = 0   [N s]
    R1 J w1 - R0 J w0 - h tau                = 0   [N m s]
    violation of every joint at the end      = 0   [m]

Two ways to describe the rotation, in Wiener-Milenkovic parameters:

    increment   c of the step,   Q = c / (1 - c.c/16)
    total       p of the body, never rescaled,   p1 - p0 = h B((p0 + p1)/8) (w0 + w1)/2

Nothing of msahl's engine is used, so that each weakness can be had alone. Everything is written so
that a complex step passes through.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numba
import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function, whose types stay visible to a type checker."""
    return cast(Function, numba.njit(cache=True)(function))


class Chain(NamedTuple):
    """Bodies, each on a ball joint to the one before (the first to the origin)."""

    mass: np.ndarray  # (n,)
    inertia: np.ndarray  # (n, 3, 3) about the mass centre, body axes
    up: np.ndarray  # (n, 3) from the mass centre to the joint towards the ground, body axes
    down: np.ndarray  # (n, 3) to the joint of the next body
    gravity: np.ndarray


class State(NamedTuple):
    x: np.ndarray  # (n, 3)
    p: np.ndarray  # (n, 3)
    v: np.ndarray  # (n, 3)
    w: np.ndarray  # (n, 3) body axes


class Start(NamedTuple):
    """A chain and its state at the start of a step: orientations R, parameters p, positions x,
    velocities v, w; step size h [s]; whether the unknowns are ``total`` parameters.
    """

    chain: Chain
    R: np.ndarray
    p: np.ndarray
    x: np.ndarray
    v: np.ndarray
    w: np.ndarray
    h: float
    total: bool


@compiled
def dot(a: np.ndarray, b: np.ndarray) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    out = np.empty_like(a)
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]
    return out


@compiled
def matrix(p: np.ndarray) -> np.ndarray:
    p0 = 2.0 - dot(p, p) / 8.0
    a = 1.0 / (4.0 - p0) ** 2
    c, s = 2.0 * p0 * a, 2.0 * a
    x, y, z = p[0], p[1], p[2]
    R = np.empty((3, 3), p.dtype)
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - s * (y * y + z * z), s * x * y - c * z, s * x * z + c * y
    R[1, 0], R[1, 1], R[1, 2] = s * x * y + c * z, 1.0 - s * (x * x + z * z), s * y * z - c * x
    R[2, 0], R[2, 1], R[2, 2] = s * x * z - c * y, s * y * z + c * x, 1.0 - s * (x * x + y * y)
    return R


@compiled
def apply(R: np.ndarray, a: np.ndarray) -> np.ndarray:
    out = np.empty(3, R.dtype)
    for i in range(3):
        out[i] = R[i, 0] * a[0] + R[i, 1] * a[1] + R[i, 2] * a[2]
    return out


@compiled
def product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    out = np.zeros((3, 3), B.dtype)
    for i in range(3):
        for j in range(3):
            for k in range(3):
                out[i, j] += A[i, k] * B[k, j]
    return out


@compiled
def residual(start: Start, z: np.ndarray, F: np.ndarray) -> None:
    """Set ``F`` (15 n,) at ``z``: per body x1, rotation, v1, w1, then all multipliers."""
    chain, R0, p0, x0, v0, w0, h, total = start
    n = chain.mass.size
    one = z[:1] * 0.0 + 1.0
    R1 = np.empty((n, 3, 3), z.dtype)
    for b in range(n):
        p = z[12 * b + 3 : 12 * b + 6]
        R1[b] = matrix(p) if total else product(R0[b], matrix(p))
    for b in range(n):
        k = 12 * b
        x1, p, v1, w1 = z[k : k + 3], z[k + 3 : k + 6], z[k + 6 : k + 9], z[k + 9 : k + 12]
        F[k : k + 3] = x1 - x0[b] - 0.5 * h * (v0[b] + v1)
        mean_w = 0.5 * h * (w0[b] + w1)
        if total:
            s = (p0[b] + p) / 8.0
            ss = dot(s, s)
            F[k + 3 : k + 6] = (
                p - p0[b] - (1.0 - ss) * mean_w - 2.0 * cross(s, mean_w) - 2.0 * dot(s, mean_w) * s
            )
        else:
            F[k + 3 : k + 6] = p / (1.0 - dot(p, p) / 16.0) - mean_w
        force = chain.mass[b] * chain.gravity * one[0]
        moment = np.zeros(3, z.dtype)
        lam = z[12 * n + 3 * b : 12 * n + 3 * b + 3]
        arm = 0.5 * (apply(R0[b] * one[0], chain.up[b]) + apply(R1[b], chain.up[b]))
        force = force + lam
        moment = moment + cross(arm, lam)
        if b + 1 < n:
            lam = z[12 * n + 3 * b + 3 : 12 * n + 3 * b + 6]
            arm = 0.5 * (apply(R0[b] * one[0], chain.down[b]) + apply(R1[b], chain.down[b]))
            force = force - lam
            moment = moment - cross(arm, lam)
        F[k + 6 : k + 9] = chain.mass[b] * (v1 - v0[b]) - h * force
        L1 = apply(R1[b], apply(chain.inertia[b] * one[0], w1))
        L0 = apply(R0[b], apply(chain.inertia[b], w0[b]))
        F[k + 9 : k + 12] = L1 - L0 - h * moment
        violation = x1 + apply(R1[b], chain.up[b])
        if b > 0:
            violation = (
                violation - z[12 * b - 12 : 12 * b - 9] - apply(R1[b - 1], chain.down[b - 1])
            )
        F[12 * n + 3 * b : 12 * n + 3 * b + 3] = violation


@compiled
def jacobian(start: Start, z: np.ndarray) -> np.ndarray:
    """Return the derivative of the residual by complex steps, exact up to rounding errors."""
    size = z.size
    J = np.empty((size, size))
    F = np.empty(size, np.complex128)
    for j in range(size):
        zc = z.astype(np.complex128)
        zc[j] += 1e-30j
        residual(start, zc, F)
        J[:, j] = F.imag / 1e-30
    return J
