"""Observed orders of the schemes of higher order: docs/validation/orders.md in small."""

import sys

import pytest
from scenes import ROOT

TOOLS = ROOT / "tools" / "validation"


@pytest.fixture(scope="module")
def orders():
    sys.path.insert(0, str(TOOLS))
    try:
        import orders

        yield orders
    finally:
        sys.path.remove(str(TOOLS))


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
        "gauss5": (4, 5, 6),
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
"""Steps from row to row, past the first that are too coarse and before round-off. What is left out
has no such steps: its error is round-off before its slope has settled (see the page)."""
CASES = [(name, word) for name, words in STEPS.items() for word in words]


@pytest.mark.parametrize(("name", "word"), CASES)
def test_every_quantity_has_the_order_of_the_theory(orders, name, word):
    ladder = orders.climb(name, word, STEPS[name][word])
    wanted = {"position", "orientation", "velocity", "spin"} | (
        {"reaction"} if name != "spring" else set()
    )
    found = {quantity: ladder.mean_slope(quantity) for quantity in ladder.known}
    assert found == pytest.approx(dict.fromkeys(wanted, orders.order_of(word)), abs=orders.NEAR)
