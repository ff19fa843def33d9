"""The error in space of beams: by runs with more elements."""

import math
from dataclasses import replace

import numpy as np
import pytest

from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.search import find
from msahl.analysis.equilibria.tables import state_row
from msahl.deck.source import Source
from msahl.results.read import ResultError
from msahl.study.elements import SpaceError, space_error
from msahl.study.more_elements import equilibrium_error
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


@pytest.mark.parametrize(
    ("deck", "settings", "tip"),
    [
        ("bend45", ("Bend.elements=2",), (47.15009624, 15.68468948, 53.47547800)),
        ("bend45", ("Bend.elements=8",), (47.15009624, 15.68468948, 53.47547800)),
        ("bend45", ("Bend.elements=8", "Bend.degree=2"), (47.15009624, 15.68468948, 53.47547800)),
        ("elastica", ("Rod.elements=2",), (1.0 - 0.3876283607, 0.0, 0.7137915236)),
        ("princeton", ("Strip.elements=1",), (0.508 - 0.0144118248, 0.1091131153, -0.0089791967)),
    ],
)
def test_the_error_of_an_equilibrium_is_that_of_the_exact_equations(deck, settings, tip):
    """Of the tip, where displacements are largest; its true position is known to nine digits."""
    source = Source.of_file(ROOT / f"decks/elastic/{deck}.xml")
    model, text = source.model(settings), source.text({}, settings)
    found = find(search_start(model), np.zeros(3)).place.point
    error = equilibrium_error(source, text, found, np.zeros(3))
    true = np.abs(state_row(found)[-12:-9] - tip).max()
    # The order is reached by then: the estimate is within a third of the truth.
    assert error == pytest.approx(true, rel=0.35, abs=2e-10)


@pytest.mark.slow
def test_a_deck_that_starts_at_an_equilibrium_begins_there_with_any_number_of_elements(tmp_path):
    text = (ROOT / "decks/elastic/bend45.xml").read_text()
    deck = tmp_path / "bend45.xml"
    deck.write_text(text.replace("<simulation>", '<simulation start="equilibrium">'))
    settings = ("Bend.elements=1", "simulation.tFinal=20")
    found = space_error(Source.of_file(deck), settings, lambda model: model, lambda words: None)
    # At rest: the error is that of the equilibrium. With one element of degree 4 it is 0.09 m.
    assert found.changes[0] > 10.0 * found.changes[1] > 1e-3
    assert found.error == pytest.approx(found.changes[0], rel=0.1)


def test_a_node_that_is_named_by_its_number_is_a_fault():
    source = Source.of_file(ROOT / "decks/elastic/bend45.xml")
    text = source.path.read_bytes().replace(b'node="last"', b'node="5"')
    source = Source(source.path, text)
    with pytest.raises(ResultError, match="names node 5"):
        space_error(source, ("load=1",), brief(0.01), lambda words: None)
