"""Factorisation row by row with blocks: solutions of numpy, and no more fill-in than necessary."""

import numpy as np
import pytest

from msahl.linalg import row_lu
from msahl.linalg.symbolic import Lists

RNG = np.random.default_rng(7)


def lists(pattern):
    return Lists(
        np.append(0, np.cumsum(pattern.sum(axis=1))), np.argwhere(pattern)[:, 1].astype(np.int64)
    )


def chain(n):
    pattern = np.eye(n, k=1, dtype=bool) | np.eye(n, k=-1, dtype=bool)
    shuffled = RNG.permutation(n)
    return pattern[np.ix_(shuffled, shuffled)]


def star(n):
    pattern = np.eye(n, dtype=bool)
    pattern[0] = pattern[:, 0] = True
    return pattern


PATTERNS = {
    "none": np.zeros((4, 4), dtype=bool),
    "chain": chain(9),
    "one way": np.eye(6, k=1, dtype=bool),
    "star": star(8),
    "random": RNG.random((12, 12)) < 0.15,
    "full": np.ones((5, 5), dtype=bool),
}


@pytest.mark.parametrize("m", [1, 2, 4])
@pytest.mark.parametrize("name", PATTERNS)
def test_solutions_are_those_of_the_dense_matrix(name, m):
    pattern = PATTERNS[name]
    n = len(pattern)
    plan = row_lu.plan(lists(pattern))
    own = row_lu.new_factors(plan, m)
    own.row[:] = 7.0  # what the last row left
    blocks = RNG.normal(size=(n, n, m, m)) * (pattern | np.eye(n, dtype=bool))[:, :, None, None]
    blocks = blocks[plan.order][:, plan.order]
    for i in range(n):
        row_lu.clear_row(plan, own, i)
        for j in np.flatnonzero(blocks[i].any(axis=(1, 2))):
            own.row[j] = blocks[i, j]
        row_lu.eliminate_row(plan, own, i)
    A, b = blocks.transpose(0, 2, 1, 3).reshape(n * m, n * m), RNG.normal(size=(n, m))
    b[: n // 2] = 0.0  # where there is no work
    for solve, matrix in ((row_lu.solve, A), (row_lu.solve_transposed, A.T)):
        own.right[:] = b
        solve(plan, own)
        scale = np.abs(own.right).max() * np.abs(A).max()
        # Round-off, which grows as pivots are not searched for beyond a block.
        assert np.abs(matrix @ own.right.reshape(-1) - b.reshape(-1)).max() <= 1e-11 * scale


@pytest.mark.parametrize("pattern", [chain(200), star(200)], ids=["chain", "star"])
def test_chains_and_stars_are_factored_without_fill_in(pattern):
    plan = row_lu.plan(lists(pattern))
    assert plan.lower.items.size == plan.upper.items.size == 199
