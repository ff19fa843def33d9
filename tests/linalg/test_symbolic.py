"""The symbolic factorisation, against the elimination of dense patterns, entry by entry."""

from contextlib import nullcontext

import numpy as np
import pytest

from msahl.jit.by_size import LARGE, compiled_at_any_size
from msahl.linalg.symbolic import fill, grouped, targets, transposed

SIZES = (1, 2, 7, 30, 60)
assert max(SIZES) < LARGE, "plain Python is to be tested, too"


def random_pattern(n, seed, density=0.1):
    """A pattern (n, n) with a full diagonal, not symmetric."""
    return (np.random.default_rng(seed).random((n, n)) < density) | np.eye(n, dtype=bool)


def filled_pattern(pattern):
    """The pattern of both factors, by elimination of the dense pattern."""
    full = pattern.copy()
    for k in range(len(full)):
        full[k + 1 :, k + 1 :] |= full[k + 1 :, k, None] & full[k, k + 1 :]
    return full


def listed(lists):
    return [lists.items[a:b].tolist() for a, b in zip(lists.first, lists.first[1:], strict=False)]


@pytest.fixture(params=["plain", "compiled"])
def either(request):
    with compiled_at_any_size() if request.param == "compiled" else nullcontext():
        yield


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("n", SIZES)
def test_fill_is_that_of_the_dense_elimination(n):
    pattern = random_pattern(n, seed=n)
    filled = fill(n, *np.nonzero(pattern))
    full = filled_pattern(pattern)
    assert listed(filled.upper) == [np.flatnonzero(np.triu(full, 1)[k]).tolist() for k in range(n)]
    assert listed(filled.lower) == [
        np.flatnonzero(np.tril(full, -1)[:, k]).tolist() for k in range(n)
    ]


def test_arrays_grow_where_there_is_much_fill():
    n = 60  # an arrow that points the wrong way fills completely
    rows, columns = np.concatenate([[np.zeros(n), np.arange(n)], [np.arange(n), np.zeros(n)]], 1)
    diagonal = np.arange(n)
    filled = fill(
        n,
        np.concatenate([rows.astype(int), diagonal]),
        np.concatenate([columns.astype(int), diagonal]),
    )
    assert filled.upper.items.size == filled.lower.items.size == n * (n - 1) // 2


@pytest.mark.usefixtures("either")
@pytest.mark.parametrize("n", SIZES)
def test_targets_are_the_places_of_the_products(n):
    pattern = random_pattern(n, seed=100 + n)
    rows, columns = np.nonzero(pattern)
    filled = fill(n, rows, columns)
    size = 1 + np.diff(filled.lower.first) + np.diff(filled.upper.first)
    base = np.concatenate([[0], np.cumsum(size)])
    place = {}
    for k, (below, right) in enumerate(
        zip(listed(filled.lower), listed(filled.upper), strict=True)
    ):
        entries = [(k, k), *((i, k) for i in below), *((k, j) for j in right)]
        place |= {entry: base[k] + e for e, entry in enumerate(entries)}
    target, own = targets(filled, base, grouped(rows, columns, n))
    assert target.tolist() == [
        place[i, j]
        for below, right in zip(listed(filled.lower), listed(filled.upper), strict=True)
        for i in below
        for j in right
    ]
    assert own.tolist() == [place[i, j] for i, j in zip(rows, columns, strict=True)]


def test_a_transposed_list_names_the_lists_that_contain_a_number():
    lists = grouped(np.array([0, 0, 2, 3, 3]), np.array([3, 1, 3, 0, 1]), 4)
    out, entry = transposed(lists)
    assert listed(out) == [[3], [0, 3], [], [0, 2]]
    assert lists.items[entry].tolist() == [0, 1, 1, 3, 3]
