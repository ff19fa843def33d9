"""Wiener-Milenkovic parameters of complete tables: arrays (..., 3), as results hold them."""

import numpy as np


def angles(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the angle of the rotation from ``q`` to ``p`` (..., 3) [rad], also of small ones."""
    e, f = _euler(p), _euler(q)
    apart = np.minimum(*(np.sqrt(((e - sign * f) ** 2).sum(axis=-1)) for sign in (1.0, -1.0)))
    return np.asarray(4.0 * np.arcsin(np.minimum(0.5 * apart, 1.0)))


def rotations(p: np.ndarray) -> np.ndarray:
    """(..., 3, 3) body to inertial axes."""
    e = _euler(p)
    e0, v = e[..., 0], e[..., 1:]
    K = np.cross(np.eye(3), v[..., None, :])
    return np.asarray(np.eye(3) + 2.0 * e0[..., None, None] * K + 2.0 * K @ K)


def _euler(p: np.ndarray) -> np.ndarray:
    """(..., 4) Euler parameters of Wiener-Milenkovic ones."""
    square = (p * p).sum(axis=-1, keepdims=True) / 16.0
    return np.asarray(np.concatenate([1.0 - square, 0.5 * p], axis=-1) / (1.0 + square))
