"""Rotations and vectors of complete tables, as arrays (..., 3) and quaternions (..., 4).

Tables of results hold Wiener-Milenkovic parameters.
"""

from typing import TYPE_CHECKING

import numpy as np

from msahl.algebra.vector import Vector

if TYPE_CHECKING:
    from numpy.typing import ArrayLike  # which takes longer to import than this module


def quaternions(p: np.ndarray) -> np.ndarray:
    """Return the Euler parameters (..., 4) of Wiener-Milenkovic ones: unit quaternions, scalar
    first."""
    square = (p * p).sum(axis=-1, keepdims=True) / 16.0
    return np.asarray(np.concatenate([1.0 - square, 0.5 * p], axis=-1) / (1.0 + square))


def angles(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the angle of the rotation from ``q`` to ``p`` (..., 3) [rad], also of small ones."""
    e, f = quaternions(p), quaternions(q)
    apart = np.minimum(*(np.sqrt(((e - sign * f) ** 2).sum(axis=-1)) for sign in (1.0, -1.0)))
    return np.asarray(4.0 * np.arcsin(np.minimum(0.5 * apart, 1.0)))


def rotations(p: np.ndarray) -> np.ndarray:
    """(..., 3, 3) body to inertial axes."""
    return matrices(quaternions(p))


def matrices(e: "ArrayLike") -> np.ndarray:
    """Return the rotation matrices (..., 3, 3) of Euler parameters (..., 4)."""
    e = np.asarray(e)
    K = np.zeros((*e.shape[:-1], 3, 3))
    for i, (j, k) in enumerate(_CYCLE):
        K[..., k, j], K[..., j, k] = e[..., 1 + i], -e[..., 1 + i]
    return np.asarray(np.eye(3) + 2.0 * e[..., :1, None] * K + 2.0 * K @ K)


def product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the products (..., 4) of quaternions, scalars first."""
    a, u, b, v = p[..., :1], p[..., 1:], q[..., :1], q[..., 1:]
    scalar = a * b - np.sum(u * v, axis=-1, keepdims=True)
    return np.concatenate([scalar, a * v + b * u + cross(u, v)], axis=-1)


def parameters(R: np.ndarray) -> np.ndarray:
    """Return the rescaled parameters (..., 3) of rotation matrices (..., 3, 3)."""
    e = euler_parameters(R)
    return np.asarray(4.0 * e[..., 1:] / (1.0 + e[..., :1]))


def euler_parameters(R: np.ndarray) -> np.ndarray:
    """Return the Euler parameters (..., 4), e0 >= 0, of rotation matrices (..., 3, 3).

    Of the four products 4 e_i e of Euler parameters e, that with the largest e_i is taken: no
    difference of nearly equal numbers is then divided by a small one.
    """
    trace = np.trace(R, axis1=-2, axis2=-1)[..., None]
    skew = np.stack([R[..., k, j] - R[..., j, k] for j, k in _CYCLE], axis=-1)
    both = R + np.swapaxes(R, -1, -2)
    diagonal = np.diagonal(R, axis1=-2, axis2=-1)
    products = np.empty((*R.shape[:-2], 4, 4))
    products[..., 0, 0] = 1.0 + trace[..., 0]
    products[..., 0, 1:] = products[..., 1:, 0] = skew
    products[..., 1:, 1:] = both
    products[..., range(1, 4), range(1, 4)] = 1.0 + 2.0 * diagonal - trace
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    e = np.take_along_axis(products, largest[..., None, None], axis=-2)[..., 0, :]
    e = e / np.sqrt((e * e).sum(axis=-1, keepdims=True))
    return np.where(e[..., :1] < 0.0, -e, e)


def rotated(R: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return ``R a`` for matrices R (..., 3, 3) and vectors a (..., 3)."""
    return np.asarray(np.einsum("...ij,...j->...i", R, a))


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return ``a . b`` (...) of vectors (..., 3)."""
    return np.asarray(np.einsum("...i,...i->...", a, b))


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return ``a x b`` (..., 3); numpy's own function takes three times as long."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    out[..., 0], out[..., 1], out[..., 2] = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return out


def plain_vector(a: np.ndarray) -> Vector:
    """Return an array (3,) as a tuple of floats, without minus before a zero."""
    x, y, z = (a + 0.0).tolist()
    return (x, y, z)


_CYCLE = ((1, 2), (2, 0), (0, 1))
