"""Factors of systems with beams: those of the complete matrix, at a cost linear in the elements."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.linalg import block_lu, sparse_lu
from msahl.linalg.elimination import new_factor, products
from msahl.model import Joint
from msahl.system.build import build_system
from msahl.system.reductions import all_unknowns
from msahl.system.unknowns import choose
from tests.support.beams import ELASTIC, FLEXIBLE, cantilever
from tests.support.models import GROUND


def clamped(degree, elements):
    """A beam clamped at both ends."""
    model = cantilever(degree, elements, FLEXIBLE)
    last = model.bodies[-1]
    clamp = Joint("Other clamp", "rigid", GROUND.name, last.name, last.position, (0.0, 0.0, 0.0))
    return replace(model, joints=(*model.joints, clamp))


MODELS = {
    "one element": cantilever(1, 1, ELASTIC),
    "degree 1": cantilever(1, 4, FLEXIBLE),
    "degree 2": cantilever(2, 2, ELASTIC),
    "degree 4": cantilever(4, 1, FLEXIBLE),
    "clamped at both ends": clamped(2, 2),
}


def system_of(model, rng, share):
    """A system and its solver for all unknowns, or for a random ``share`` of those that have an
    entry on the diagonal.
    """
    system = build_system(model)
    unknowns = choose(system, all_unknowns(system))
    rows, columns = np.divmod(unknowns.dense_to, unknowns.free.size)
    own = unknowns.free[rows[rows == columns]]
    if share == 1.0:
        return system, unknowns
    return system, choose(system, np.sort(own[rng.random(own.size) < share]))


def blocks_of(system, unknowns, degree, rng):
    """Random block values (q, d, d), and the matrix (n d, n d) in the order of elimination."""
    size, lu = unknowns.free.size, unknowns.elimination
    rows, columns = np.divmod(unknowns.dense_to, size)
    values = np.zeros((system.constant.size, degree, degree))
    values[unknowns.dense_from] = 0.1 * rng.normal(size=(rows.size, degree, degree))
    # Dominant diagonals, so that any order of pivots is stable.
    values[unknowns.dense_from[rows == columns]] += 5.0 * np.eye(degree)
    matrix = np.zeros((size, degree, size, degree))
    matrix[rows, :, columns, :] = values[unknowns.dense_from].transpose(0, 2, 1)
    order = np.searchsorted(unknowns.free, lu.order)
    matrix = matrix[order][:, :, order]
    return values, matrix.reshape(size * degree, -1)


def relative(matrix):
    """Error that rounding may have, relative to the largest unknown: some units times the
    condition number, as the order of pivots is fixed.
    """
    return 1e-14 * np.linalg.cond(matrix)


@pytest.mark.parametrize("share", [1.0, 0.6])
@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_the_solution_is_that_of_the_complete_matrix(model, share):
    rng = np.random.default_rng(5)
    system, unknowns = system_of(model, rng, share)
    lu, size = unknowns.elimination, unknowns.free.size
    values, matrix = blocks_of(system, unknowns, 1, rng)
    right = rng.normal(size=size)
    factor, y = new_factor(lu), right.copy()
    for _ in range(2):  # the factors of the first time are overwritten
        sparse_lu.factor(lu, values.reshape(-1), factor)
    sparse_lu.solve(lu, factor, y)
    exact = np.linalg.solve(matrix, right)
    assert np.abs(y - exact).max() < relative(matrix) * np.abs(exact).max()
    pivots = 1.0 / factor[lu.base[:-1]]
    assert np.prod(pivots) == pytest.approx(np.linalg.det(matrix), rel=1e-10)


@pytest.mark.parametrize(("name", "degree"), [("degree 2", 2), ("clamped at both ends", 3)])
def test_blocks_of_stages_are_factored_as_the_complete_matrix(name, degree):
    model = MODELS[name]
    rng = np.random.default_rng(6)
    system, unknowns = system_of(model, rng, 0.8)
    lu, size = unknowns.elimination, unknowns.free.size
    values, matrix = blocks_of(system, unknowns, degree, rng)
    right = rng.normal(size=(size, degree))
    factor, y = new_factor(lu, degree), right.copy()
    block_lu.factor(lu, lu.source, values, factor, np.zeros(degree, dtype=np.int64))
    block_lu.solve(lu, factor, y)
    exact = np.linalg.solve(matrix, right.reshape(-1))
    assert np.abs(y.reshape(-1) - exact).max() < relative(matrix) * np.abs(exact).max()


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_the_cost_is_linear_in_the_elements(degree):
    def cost(elements):
        system = build_system(cantilever(degree, elements, ELASTIC))
        lu = choose(system, all_unknowns(system)).elimination
        return products(lu), int(lu.base[-1]), lu.supernodes.updates.rows.size

    few, more, most = np.array([cost(elements) for elements in (6, 8, 10)])
    assert (most - more == more - few).all()
    # Multiplications per node; the exact pattern of the entries would have 1 to 3 % fewer.
    assert (most - more)[0] / (2 * degree) < (1300, 2800, 4900, 7500)[degree - 1]
