"""Observed orders of the schemes of higher order: docs/validation/orders.md in small."""

import numpy as np
import pytest

from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.collocation.tableau import new_tableau
from tools.validation import orders as orders_module

LONG = np.longdouble
longer = pytest.mark.skipif(
    np.finfo(LONG).eps == np.finfo(float).eps, reason="longdouble is double on this machine"
)


@pytest.fixture(scope="module")
def orders():
    """In absolute coordinates, of which the steps below are; see ``tests.formulations``."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SubsystemIntegrator, "joint_coordinates", False)
        yield orders_module


STEPS = {
    "double pendulum": {
        "gauss1": (128, 160, 192),
        "gauss2": (32, 40, 48),
        "gauss3": (14, 16, 20),
        "gauss4": (8, 10, 12),
        "radau1": (1024, 1280, 1536),
        "radau2": (48, 56, 64),
        "radau3": (20, 24, 28),
    },
    "asymmetric top": {
        "gauss1": (64, 96, 128),
        "gauss2": (12, 14, 16),
        "gauss3": (5, 6, 7),
        "gauss4": (3, 4, 5),
        "radau1": (512, 768, 1024),
        "radau2": (24, 28, 32),
        "radau3": (10, 12, 14),
    },
    "four-bar": {
        "gauss1": (128, 160, 192),
        "gauss2": (32, 40, 48),
        "gauss3": (16, 20, 24),
        "gauss4": (14, 16, 20),
        "radau1": (1024, 1280, 1536),
        "radau2": (48, 56, 64),
        "radau3": (20, 24, 28),
    },
    "spring": {
        "gauss1": (128, 160, 192),
        "gauss2": (32, 40, 48),
        "gauss3": (16, 20, 24),
        "gauss4": (10, 12, 14),
        "radau1": (1536, 1792, 2048),
        "radau2": (64, 96, 128),
        "radau3": (28, 32, 40),
    },
    "Andrews": {
        "gauss1": (128, 160, 192),
        "gauss2": (40, 48, 56),
        "gauss3": (16, 20, 24),
        "radau1": (1024, 1280, 1536),
        "radau2": (64, 96, 128),
        "radau3": (32, 40, 48),
    },
}
"""Steps from row to row, past the first that are too coarse and before round-off. What is omitted
has no such steps in double precision: its error is round-off before its slope has settled."""
LONG_STEPS = {
    "double pendulum": (10, 12, 14),
    "asymmetric top": (2, 3, 4),
    "four-bar": (16, 18, 20),
    "spring": (12, 14, 16),
}
"""Likewise of gauss5 in extended precision; Andrews' mechanism takes minutes (see the page)."""
CASES = [(name, word) for name, words in STEPS.items() for word in words]


def assert_order(orders, name, word, ladder):
    wanted = {"position", "orientation", "velocity", "angular_velocity"} | (
        {"reaction"} if name != "spring" else set()
    )
    found = {quantity: ladder.mean_slope(quantity) for quantity in ladder.known}
    assert found == pytest.approx(dict.fromkeys(wanted, orders.order_of(word)), abs=orders.NEAR)


@pytest.mark.sampled
@pytest.mark.parametrize(("name", "word"), CASES)
def test_every_quantity_has_the_order_of_the_theory(orders, name, word):
    assert_order(orders, name, word, orders.climb(name, word, float, STEPS[name][word]))


@pytest.mark.slow
@longer
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("double pendulum", marks=pytest.mark.slow),
        "asymmetric top",
        pytest.param("four-bar", marks=pytest.mark.slow),
        pytest.param("spring", marks=pytest.mark.slow),
    ],
)
def test_order_10_shows_in_extended_precision(orders, name):
    ladder = LONG_STEPS[name]
    # At half the finest step a reference of order 10 is a thousand times nearer.
    found = orders.climb(name, "gauss5", LONG, ladder, best=2 * ladder[-1])
    assert_order(orders, name, "gauss5", found)


@longer
def test_steps_in_extended_precision_are_those_that_are_compiled(orders):
    case = orders.CASES["double pendulum"]
    compiled, plain = (orders.run_case(case, "gauss5", number, 6) for number in (float, LONG))
    assert plain.states.dtype == plain.reactions.dtype == LONG
    apart = orders.errors(compiled, plain)
    # Round-off of 24 steps in double precision; what they lack of the motion is 1e-12 to 1e-11.
    assert max(apart.values()) < 1e-14


@longer
@pytest.mark.parametrize("degree", [1, 2, 3, 4, 5])
def test_a_rule_is_known_to_extended_precision(orders, degree):
    eps = np.finfo(LONG).eps
    long, short = orders.longdouble.gauss(degree), new_tableau("gauss", degree)
    for power in range(2 * degree):
        integral = LONG(1.0) / (power + 1)
        assert abs(long.force_weight @ long.force_time**power - integral) < 4 * eps
        pushed = long.multiplier_weight @ np.append(LONG(0.0), long.constraint_time[:-1]) ** power
        assert abs(pushed + 1.0 - long.multiplier_weight.sum() - integral) < 4 * eps
    # As of the rule in double precision: numbers of the size of s^2, and inverses of them.
    assert np.abs(long.beta @ long.basis_rate - np.eye(degree)).max() < 200 * eps
    assert np.abs(long.alpha.sum(axis=1) + 0.5 * long.constraint_time**2).max() < 20 * eps
    for key, value in long._asdict().items():
        np.testing.assert_allclose(np.asarray(value, float), getattr(short, key), atol=1e-13)
