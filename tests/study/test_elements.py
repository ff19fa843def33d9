"""The error in space of beams: by runs with more elements."""

import math
from dataclasses import replace

import pytest

from msahl.deck.source import Source
from msahl.results.read import ResultError
from msahl.study.elements import SpaceError, space_error
from tests.support.models import ROOT


def brief(t_final):
    """A change of a model: a shorter run."""
    return lambda model: replace(model, simulation=replace(model.simulation, t_final=t_final))


def test_the_order_is_twice_the_degree():
    deck = Source.of_file(ROOT / "decks/elastic/spin_up.xml")
    settings = ["Arm.elements=2", "simulation.deltaT=0.1"]
    found = space_error(deck, settings, brief(6.0), lambda words: None)
    assert found.elements == (2, 4, 8)
    assert found.order == pytest.approx(6.0, abs=0.6)  # vibrations change a little from run to run
    # The error is the sum of all changes that follow: the first, and a little more.
    assert found.changes[0] < found.error < 1.1 * found.changes[0]


def test_a_deck_without_beams_has_no_error_in_space():
    deck = Source.of_file(ROOT / "decks/basics/stop.xml")
    with pytest.raises(ResultError, match="no beams"):
        space_error(deck, (), brief(0.1), lambda words: None)


def test_changes_that_do_not_fall_give_no_error():
    lines = SpaceError((1, 2, 4), (1e-3, 2e-3), math.nan, math.nan).lines()
    assert "not known" in lines[-1]
