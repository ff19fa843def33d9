"""Wiener-Milenkovic parameters of complete tables: arrays (..., 3), as results hold them."""

import numpy as np


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


def matrices(e: np.ndarray) -> np.ndarray:
    """Return the rotation matrices (..., 3, 3) of Euler parameters (..., 4)."""
    K = np.zeros((*e.shape[:-1], 3, 3))
    for i, (j, k) in enumerate(_CYCLE):
        K[..., k, j], K[..., j, k] = e[..., 1 + i], -e[..., 1 + i]
    return np.asarray(np.eye(3) + 2.0 * e[..., :1, None] * K + 2.0 * K @ K)


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


_CYCLE = ((1, 2), (2, 0), (0, 1))
