"""Strains and stress resultants of beams in beams.csv."""

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.elements.beams.shape import shape
from msahl.run.tables import BEAMS, tables_of_model
from tests.support.models import ROOT, simulate

ELASTIC = ROOT / "decks/elastic"


def by_point(columns, rows):
    """Strains and resultants (rows, points, 12)."""
    assert columns[1].endswith(".stretch")
    return rows[:, 1:].reshape(len(rows), -1, 12)


@pytest.mark.parametrize("deck", ["bend45", "elastica"])
def test_the_energy_is_that_of_strains_and_resultants(deck):
    """Both tables have the instant of the output time; strains that cannot change have no energy,
    whatever their resultants are."""
    model = read_deck(ELASTIC / f"{deck}.xml")
    run = simulate(model, error="off")
    (beam,) = model.beams
    found = by_point(tables_of_model(model)[BEAMS], run.others[BEAMS])
    weights = np.outer(beam.lengths, 0.5 * shape(beam.degree).weights).ravel()
    energy = 0.5 * np.einsum("g,tgi,tgi->t", weights, found[..., :6], found[..., 6:])
    assert energy[-1] > 0.0
    assert run.work[:, -1] == pytest.approx(energy, rel=1e-9, abs=1e-12 * energy.max())


def test_sections_of_an_elastica_in_equilibrium_carry_its_load(tmp_path):
    deck, folder = ELASTIC / "elastica.xml", tmp_path / "found"
    words = ["equilibrium", str(deck), "--set", "Rod.elements=4", "-q", "-o", str(folder)]
    assert CliRunner().invoke(main, words).exit_code == 0
    columns = (folder / "beams.csv").read_text().splitlines()[0].split(",")
    rows = np.loadtxt(folder / "beams.csv", delimiter=",", skiprows=1, ndmin=2)
    found = by_point(columns, rows)[0]
    # The load of 5 N is the force in every section; in the section's axes it has its size. At
    # Gauss points directors have the length one but for the error of the elements.
    force = np.linalg.norm(found[:, 6:9], axis=1)
    assert force == pytest.approx(np.full(len(found), 5.0), rel=1e-4)
    # Near the clamp the moment is the load times the tip's place, 5 N 0.6123716 m.
    assert np.abs(found[:, 10]).max() == pytest.approx(5.0 * 0.6123716, rel=0.03)
