"""Broyden's corrections, by themselves: linear equations with a Jacobian that lacks a part."""

import numpy as np
import pytest

from msahl.schemes.collocation import secants


def iterations(A, size):
    """How many corrections by the Jacobian 1 solve A x = b of a residual to 1e-12; 50 at most."""
    b, x = np.linspace(1.0, 2.0, size), np.zeros((size, 1))
    found = secants.new_secants(size, 1)
    for k in range(50):
        y = A @ x - b[:, None]
        if np.abs(y).max() < 1e-12:
            return k
        secants.improve(found, y)
        x -= y
    return 50


@pytest.mark.parametrize("size", [1, 3, 8])
def test_linear_equations_are_solved_in_twice_as_many_steps_as_the_lacking_part_has(size):
    """Of rank one: 2 corrections (D. M. Gay, SIAM J. Numer. Anal. 16, 1979) and one for round-off;
    by the Jacobian alone the residual would double in each."""
    u = np.zeros(size)
    u[0] = 1.0
    assert iterations(np.eye(size) - 3.0 * np.outer(u, np.ones(size)), size) <= 4


def test_a_part_of_rank_two_takes_four():
    A = np.eye(6)
    A[0, 1], A[1, 0] = 2.0, -2.0
    assert iterations(A, 6) <= 6


def test_a_fresh_jacobian_forgets_the_steps():
    found = secants.new_secants(2, 1)
    for fresh, taken in ((True, 1), (False, 2), (True, 1)):
        if fresh:
            secants.forget(found)
        secants.improve(found, np.array([[1.0], [0.3]]) * (1.0 + found.taken[0]))
        assert found.taken[0] == taken


def test_it_goes_on_without_a_new_jacobian_near_a_solution_only():
    found = secants.new_secants(2, 1)
    assert not secants.go_on(None, 1e-9)
    assert secants.go_on(found, 1e-9)
    assert not secants.go_on(found, 1.0)
    found.taken[0] = secants.MOST
    assert not secants.go_on(found, 1e-9)
