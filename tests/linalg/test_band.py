"""Banded factorisation and the order of nodes against dense matrices and known bandwidths."""

import numpy as np
import pytest

from msahl.jit.by_size import compiled_once
from msahl.linalg import band_lu
from msahl.linalg.band_order import band_order


def banded(n, b, rng):
    """A random matrix (n, n) of half-width ``b`` with a profile, its band and ends of rows."""
    matrix, band, end = np.zeros((n, n)), np.zeros((n, 3 * b + 1)), np.zeros(n, dtype=np.int64)
    for i in range(n):
        first, last = max(0, i - b), min(n, i + 1 + int(rng.integers(0, b + 1)))
        matrix[i, first:last] = rng.normal(size=last - first)
        band[i, first - i + b : last - i + b] = matrix[i, first:last]
        end[i] = last
    return matrix, band, end


@pytest.mark.parametrize(("n", "b"), [(1, 0), (6, 5), (40, 3), (30, 12)])
def test_a_banded_matrix_is_solved_with_exchanged_rows(n, b):
    rng = np.random.default_rng(n)
    matrix, band, end = banded(n, b, rng)
    # Zeros on the diagonal, as in constraint equations: pivots must be searched for.
    matrix[np.arange(0, n - 1, 2), np.arange(0, n - 1, 2)] = 0.0
    band[np.arange(0, n - 1, 2), b] = 0.0
    right, expected = rng.normal(size=n), None
    for of in (lambda kernel: kernel, compiled_once):
        factors, pivot, last, z = band.copy(), np.zeros(n, dtype=np.int64), end.copy(), right.copy()
        of(band_lu.factor)(factors, b, pivot, last)
        of(band_lu.solve)(factors, b, pivot, last, z)
        # Random matrices of this size have condition numbers up to some 1e4.
        assert np.abs(matrix @ z - right).max() <= 1e-11
        expected = z if expected is None else expected
        assert np.abs(z - expected).max() <= 1e-11 * np.abs(expected).max()


def test_a_ring_and_a_chain_are_narrow_in_any_numbering():
    rng, n = np.random.default_rng(1), 50
    names = rng.permutation(n)
    chain = names[:-1], names[1:]
    ring = names, np.roll(names, 1)
    alone = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    for (first, second), widest in ((chain, 1), (ring, 2), (alone, 0)):
        order = band_order(n, first, second)
        assert sorted(order) == list(range(n))
        place = np.argsort(order)
        assert np.abs(place[first] - place[second]).max(initial=0) <= widest
