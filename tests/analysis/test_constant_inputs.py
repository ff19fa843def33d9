"""Inputs in analyses of one configuration: constants, and no states."""

import numpy as np
import pytest

import msahl
from msahl.analysis.constant_inputs import with_constant_inputs, with_inputs
from tests.support.models import ROOT

DECK = ROOT / "decks" / "forces" / "actuator_input.xml"
FORCE, STIFFNESS, MASS = 4.0, 8.0, 2.0
EVENT = '<events><event name="off" when="t &gt; 1"><set name="force">0</set></event></events>'


def test_they_are_signals_and_back():
    model = msahl.load(DECK).records
    constant = with_constant_inputs(model)
    assert not constant.states
    assert with_inputs(constant.signals) == model.signals


def test_what_an_event_sets_stays_a_state():
    text = DECK.read_text().replace("</loads>", f"</loads>{EVENT}")
    model = msahl.load(text).records
    assert with_constant_inputs(model).states == model.states


def test_the_equilibrium_has_the_value_of_the_input():
    found = msahl.load(DECK).equilibrium()
    assert found["Cart.x"] == pytest.approx(FORCE / STIFFNESS, rel=1e-12)
    assert found.model.records.states[0].initial == FORCE
    assert found.model.records.states[0].is_input


def test_a_run_from_the_equilibrium_can_be_driven():
    """There it stays, until the force is twice as large: then x = x0 + F/k (1 - cos w t)."""
    text = DECK.read_text().replace("<simulation>", '<simulation start="equilibrium">')
    run = msahl.load(text).co_simulation(scheme="gauss3", dt=0.05)
    run.advance(0.5)
    rest = FORCE / STIFFNESS
    assert run["Cart.x"] == pytest.approx(rest, abs=1e-12)
    assert "Spring.stiffness" in run.variables
    assert "Spring.freeSlide" not in run.variables  # counts from the equilibrium there
    run.set({"force": 2.0 * FORCE})
    run.advance(1.0)
    moved = rest * (1.0 - np.cos(np.sqrt(STIFFNESS / MASS) * 0.5))
    assert run["Cart.x"] == pytest.approx(rest + moved, abs=1e-9)  # order 6 at w h = 0.1


def test_it_is_an_input_of_the_linear_model():
    """x'' = (F - k x)/m: no state of its own, and the gain 1/k at rest."""
    linear = msahl.load(DECK).linearize(["force"], ["Rail.slide"], at="equilibrium")
    assert len(linear.states) == 2
    gain = linear.D - linear.C @ np.linalg.solve(linear.A, linear.B)
    assert gain[0, 0] == pytest.approx(1.0 / STIFFNESS, rel=1e-9)


def test_modes_have_no_eigenvalue_of_it():
    found = msahl.load(DECK).modes(at="equilibrium").frame
    frequency = np.sqrt(STIFFNESS / MASS) / (2.0 * np.pi)
    assert found["frequency"].tolist() == pytest.approx([frequency], rel=1e-9)
