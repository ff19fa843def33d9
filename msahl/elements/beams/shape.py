"""Shape functions of beam elements: polynomials through the Gauss-Lobatto points of [-1, 1].

Lobatto's quadrature at the nodes has the mass, Gauss's at p points the strain energy. Both are
exact enough that the error of an element of degree p is of order 2 p.
"""

from functools import cache
from typing import NamedTuple

import numpy as np


class Shape(NamedTuple):
    """Nodes and Gauss points of an element of degree p on [-1, 1], and its shape functions."""

    nodes: np.ndarray  # (p + 1,) Gauss-Lobatto points
    node_weights: np.ndarray  # (p + 1,) of Lobatto's quadrature; their sum is 2
    points: np.ndarray  # (p,) Gauss points
    weights: np.ndarray  # (p,) of Gauss's quadrature
    values: np.ndarray  # (p, p + 1) shape functions of the nodes at the Gauss points
    slopes: np.ndarray  # (p, p + 1) their derivatives


@cache
def shape(degree: int) -> Shape:
    """Return the ``Shape`` of elements of ``degree`` 1 or more; the arrays are read-only."""
    from numpy.polynomial import legendre

    polynomial = np.zeros(degree + 1)
    polynomial[degree] = 1.0
    inner = np.sort(legendre.legroots(legendre.legder(polynomial)).real)
    inner = 0.5 * (inner - inner[::-1])  # symmetric to the last digit
    nodes = np.concatenate([[-1.0], inner, [1.0]])
    at_nodes = legendre.legval(nodes, polynomial)
    points, weights = legendre.leggauss(degree)
    values, slopes = interpolation(nodes, points)
    result = Shape(
        nodes=nodes,
        node_weights=2.0 / (degree * (degree + 1) * at_nodes**2),
        points=points,
        weights=weights,
        values=values,
        slopes=slopes,
    )
    for array in result:
        array.flags.writeable = False
    return result


def interpolation(nodes: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return values and derivatives (n, k) at the n places ``at`` of Lagrange's polynomials through
    the k ``nodes``.
    """
    values = np.ones((at.size, nodes.size))
    slopes = np.zeros((at.size, nodes.size))
    for a, node in enumerate(nodes):
        others = np.delete(nodes, a)
        factors = (at[:, None] - others) / (node - others)
        values[:, a] = factors.prod(axis=1)
        for k, other in enumerate(others):
            slopes[:, a] += np.delete(factors, k, axis=1).prod(axis=1) / (node - other)
    return values, slopes


def node_stations(degree: int, lengths: np.ndarray) -> np.ndarray:
    """Return the arc lengths (elements * degree + 1,) of the nodes of elements of these ``lengths``
    [m].
    """
    share = 0.5 * (1.0 + shape(degree).nodes)
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    inner = ends[:-1, None] + lengths[:, None] * share[:-1]
    return np.append(inner.reshape(-1), ends[-1])


def gauss_stations(degree: int, lengths: np.ndarray) -> np.ndarray:
    """Return the arc lengths (elements * degree,) of the Gauss points."""
    share = 0.5 * (1.0 + shape(degree).points)
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    return (ends[:-1, None] + lengths[:, None] * share).reshape(-1)


def elements_of(degree: int, nodes: int) -> np.ndarray:
    """Return the numbers (elements, degree + 1) of the nodes of each element of a beam."""
    return np.arange(0, nodes - 1, degree)[:, None] + np.arange(degree + 1)


def strains(
    degree: int, lengths: np.ndarray, positions: np.ndarray, axes: np.ndarray
) -> np.ndarray:
    """Return Gamma and kappa (..., elements * degree, 6) at the Gauss points of a beam through
    nodes at ``positions`` (..., k, 3) [m] with the ``axes`` (..., k, 3, 3), columns d_1, d_2, d_3.

        Gamma_1 = d_1 . r' + (1 - d_1 . d_1)/2         Gamma_i = d_i . r' , i = 2, 3
        kappa_1 = (d_3 . d_2' - d_2 . d_3')/2          and cyclic

    r and d_i are the polynomials through their values at the nodes. Both are invariant to rigid
    motions exactly. The unstressed beam's are to be subtracted.
    """
    element = shape(degree)
    nodes = elements_of(degree, positions.shape[-2])
    slopes = 2.0 * element.slopes / np.asarray(lengths)[:, None, None]
    r = np.einsum("ega,...eai->...egi", slopes, positions[..., nodes, :])
    d = np.einsum("ga,...eaij->...egij", element.values, axes[..., nodes, :, :])
    d_slope = np.einsum("ega,...eaij->...egij", slopes, axes[..., nodes, :, :])
    stretch = np.einsum("...egij,...egi->...egj", d, r)
    stretch[..., 0] += 0.5 * (1.0 - (d[..., 0] ** 2).sum(axis=-1))
    p = np.einsum("...egij,...egik->...egjk", d, d_slope)  # d_j . d_k'
    twice = [p[..., 2, 1] - p[..., 1, 2], p[..., 0, 2] - p[..., 2, 0], p[..., 1, 0] - p[..., 0, 1]]
    both = np.concatenate([stretch, 0.5 * np.stack(twice, axis=-1)], axis=-1)
    return both.reshape(*positions.shape[:-2], -1, 6)
