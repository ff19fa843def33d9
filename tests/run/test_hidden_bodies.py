"""Tables show the frame and the interface of an elastic body; the other bodies follow from them."""

from dataclasses import replace

import numpy as np
import pytest

import msahl
from msahl.deck import read_deck
from msahl.formulations.absolute.frames import first_multiplier
from msahl.model import Model, resolve
from msahl.post.columns import all_columns
from msahl.post.defined_graphs import amplitude_graphs
from msahl.post.metrics import compute_metrics
from msahl.post.run_graphs import Choice, chosen_bodies
from msahl.results.read import read_run
from msahl.results.sample import read_sample
from msahl.run.hidden_bodies import shown_tables, with_hidden, without_hidden
from msahl.run.setup import build_setup
from msahl.run.tables import ACCELERATIONS, STATES, tables_of_model
from msahl.system.names import describe_row, state_columns
from tests.support.models import ROOT, simulate

DECKS = ROOT / "decks" / "elastic"
ROD, BLADE = DECKS / "reduced_rod.xml", DECKS / "reduced_blade.xml"
SUMS = 1e-14
"""Round-off of sums of metres and metres per second, whose order depends on the arrays' strides."""


def bodies_of(columns):
    """Names of bodies that columns of states have."""
    return list(dict.fromkeys(column.rpartition(".")[0] for column in columns if "." in column))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a short run of the rod."""
    written = tmp_path_factory.mktemp("runs") / "rod"
    msahl.load(ROD).run(t_final=1e-3, error="off").write(written)
    return written


@pytest.mark.parametrize(
    ("deck", "settings", "rates"),
    [
        (ROD, ["tFinal=2e-3", "deltaT=1e-4"], 1e-8),
        # Rates of squares at the ends of steps have an error of the order of the scheme, 2.5e-5.
        (BLADE, ["tFinal=0.05", "deltaT=1e-3", "g=10"], 1e-4),
    ],
    ids=["linear", "stiffened"],
)
def test_bodies_that_are_not_shown_follow_from_those_that_are(deck, settings, rates):
    """Places as they satisfy the constraints, and rates."""
    model = read_deck(deck, settings=settings)
    assert bool(model.elastic_bodies[0].squares) is (deck == BLADE)
    run = simulate(model, solver="newton")
    shown = without_hidden(model, {STATES: run.states})[STATES]
    assert shown.shape[1] == len(shown_tables(model)[STATES]) < run.states.shape[1]
    found = with_hidden(model, shown, run.others["amplitudes"])
    by_body, rows = (a[:, 1:].reshape(len(a), -1, 12) for a in (found, run.states))
    hidden = [body.name in model.hidden for body in model.bodies]
    assert np.abs(rows[:, hidden]).max() > 1e-3
    # The constraint violation of a run is some 1e-12 m, or 1e-12 of the largest rotation.
    assert by_body[..., :6] == pytest.approx(rows[..., :6], abs=1e-11)
    assert by_body[..., 6:] == pytest.approx(rows[..., 6:], abs=rates)


def test_files_have_the_bodies_that_the_deck_names(folder):
    header = (folder / "states.csv").read_text().partition("\n")[0].split(",")
    assert bodies_of(header) == ["Rod", "Rod.Pin", "Rod.Middle", "Rod.Wrist"]


def test_a_run_that_was_read_has_all_bodies(folder):
    """Energies need them; tables and graphs that a user sees do not list them."""
    run, sample = read_run(folder), read_sample(folder, 10**6, 10**6)
    assert list(run.states.columns) == state_columns(run.model) == sample.tables[STATES][0]
    assert sample.tables[STATES][1] == pytest.approx(run.states.to_numpy(), abs=SUMS)
    assert not any("mass" in name for name in all_columns(run))
    assert chosen_bodies(run, Choice()) == ["Rod", "Rod.Pin", "Rod.Middle", "Rod.Wrist"]
    metrics = compute_metrics(run)
    assert metrics.energy.bodies == ("Rod", "Rod.Pin", "Rod.Middle", "Rod.Wrist")
    # A vibration with 2 % damping: all energy is that of the mode, and its loss is counted.
    assert metrics.energy.error_over_kinetic.max < 1e-6
    [graph], _ = amplitude_graphs(run)
    assert graph.title == "amplitude [m]"
    assert graph.curves[0][1][0] == pytest.approx(1e-3, rel=1e-9)  # 1 mm in mode 1


def test_results_in_memory_are_those_of_the_files(folder, tmp_path):
    result = msahl.load(ROD).run(t_final=1e-3, error="off")
    again = msahl.read(folder)
    assert result.columns(STATES) == again.columns(STATES)
    assert (result.array(STATES) == again.array(STATES)).all()
    states = read_run(folder).states.to_numpy()
    assert result.as_run().states.to_numpy() == pytest.approx(states, abs=SUMS)
    again.write(tmp_path / "copy")
    assert (tmp_path / "copy" / "states.csv").read_bytes() == (folder / "states.csv").read_bytes()


def test_a_deck_may_ask_for_all_bodies(tmp_path):
    text = ROD.read_text().replace("<elasticBody", '<elasticBody allBodies="true"')
    path = tmp_path / "all.xml"
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "rod.npz").write_bytes((DECKS / "parts" / "rod.npz").read_bytes())
    path.write_text(text)
    model = read_deck(path)
    assert model.shown_bodies == model.bodies
    assert shown_tables(model) == tables_of_model(model)


def test_accelerations_are_of_the_bodies_that_are_shown(folder):
    model = read_run(folder).model
    asked: Model = replace(model, simulation=replace(model.simulation, accelerations="yes"))
    names = bodies_of(shown_tables(asked)[ACCELERATIONS])
    assert names == [body.name for body in model.shown_bodies]
    rows = np.arange(2.0 * (1 + 6 * len(model.bodies))).reshape(2, -1)
    shown = without_hidden(asked, {ACCELERATIONS: rows})[ACCELERATIONS]
    columns = tables_of_model(asked)[ACCELERATIONS]
    place = [columns.index(name) for name in shown_tables(asked)[ACCELERATIONS]]
    assert (shown == rows[:, place]).all()


@pytest.mark.slow
def test_modes_and_equilibria_show_the_bodies_that_the_deck_names():
    model = msahl.load(BLADE)
    rest, modes = model.equilibrium(), model.modes()
    assert not any(" " in name for name in modes.shape(1))
    assert "mass" not in f"{rest}{modes}"


def test_a_model_without_elastic_bodies_has_the_tables_it_had():
    model = read_deck(ROOT / "decks" / "basics" / "conical_pendulum.xml")
    tables = {STATES: np.zeros((2, 3))}
    assert without_hidden(model, tables) is tables
    assert model.shown_bodies is model.bodies


def test_messages_name_the_bodies_that_the_deck_names():
    with pytest.raises(msahl.StartError, match=r"subsystem of Rod, Rod\.Pin, Rod\.Middle, \.\.\. "):
        msahl.load(ROD).run(scheme="rk4")
    system = build_setup(read_deck(ROD), resolve(read_deck(ROD).simulation), None).integrators[0]
    model, arrays = system.model, system.workspace.system
    rows = range(3 * (first_multiplier(arrays.frames) + len(arrays.multipliers.element)))
    texts = {describe_row(model, arrays, index) for index in rows}
    assert "elastic body 'Rod', place of 'Rod.Wrist'" in texts
    assert "body 'Rod', force along x" in texts
    assert not any("mass" in text or "modes" in text for text in texts)
