"""Decks of beams have the numbers that their headers say, also with other parameters."""

import numpy as np
import pytest

import msahl
from msahl.analysis.linearised.point import at_start
from msahl.analysis.modes.solution import modes
from tests.physics.test_beams import across, ritz
from tests.support.models import ROOT, deck

ELASTIC = ROOT / "decks" / "elastic"


def tip(name, **numbers):
    """(3,) position of the marker Tip in equilibrium."""
    rest = msahl.load(ELASTIC / f"{name}.xml", **numbers).equilibrium()
    return np.array([rest[f"Tip.{axis}"] for axis in "xyz"])


@pytest.mark.parametrize(("circles", "most"), [(0.3, 1e-13), (1.0, 5e-13)])
def test_a_moment_rolls_a_strip_up(circles, most):
    """Measured: 2e-13 m after one circle, 7e-10 m after two; the error falls with the order 12."""
    moment = 2.0 * np.pi * circles
    circle = (np.sin(moment) / moment, 0.0, (1.0 - np.cos(moment)) / moment)
    assert np.abs(tip("roll_up", moment=moment) - circle).max() <= most


@pytest.mark.slow
def test_twice_the_moment_rolls_a_strip_up_to_two_circles():
    assert np.abs(tip("roll_up", moment=4.0 * np.pi)).max() <= 1e-9


def test_bending_and_torsion_by_moments():
    """Of the shooting solution five digits are given."""
    moved = tip("bending_torsion") - (2.0, 0.0, 0.0)
    assert moved == pytest.approx((-1.0944e-4, -1.8644e-4, -1.81174e-2), rel=3e-5)


def test_a_cable_with_little_stiffness_hangs_in_a_catenary():
    """The part of the bending stiffness is proportional to it: two of them give the limit."""
    a = 3.382018790853495  # 2 a sinh(4/a) = 10
    less, more = (tip("hanging_cable", EI=EI)[2] for EI in (0.1, 0.3))
    assert less == pytest.approx(-2.6541863, abs=1e-6)
    assert less - (more - less) / 2.0 == pytest.approx(-a * (np.cosh(4.0 / a) - 1.0), abs=5e-6)


@pytest.mark.parametrize(("name", "speed"), [("cantilever", 0.0), ("blade", 6.0)])
def test_frequencies_of_bars(name, speed):
    """Six elements of degree 4 leave 3e-7 of the third frequency, the four of the blade 7e-6."""
    found, _ = across(modes(at_start(deck(name))))
    assert found / ritz(1e-6, speed) - 1.0 == pytest.approx(np.zeros(3), abs=1e-5)


def test_a_bar_of_almost_no_rotary_inertia_keeps_its_slow_modes():
    """Its highest frequencies cost dense matrices the first mode, and sparse ones few digits.

    By Rayleigh's quotient rotary inertia lowers the first frequency by 4.648/2 of itself.
    """
    found = msahl.load(ELASTIC / "cantilever.xml", load=0.0, rotary=1e-8).modes(number=1)
    exact = 1.875104068711961**2 / (2.0 * np.pi) * (1.0 - 0.5 * 4.648e-8)
    # Six elements of degree 4 leave 1e-9, second order in the rotary inertia less.
    assert found.frequency[0] == pytest.approx(exact, rel=2e-9)
    assert found.frequency.size == 1
