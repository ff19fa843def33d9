"""Reactions at the output times: order 2 where means have order 1, and nothing else changed."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.formulations.absolute.frames import first_multiplier
from msahl.model import INSTANTANEOUS
from msahl.post.cli import main as post
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.common import accelerations
from msahl.schemes.common.accelerations import new_instant
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Chunk
from tests.support.closed_forms import recognise
from tests.support.models import deck, simulate

SINGLE = Path(__file__).parents[2] / "decks" / "thesis" / "single_pendulum_45.xml"


def instantaneous(model):
    return replace(model, simulation=replace(model.simulation, reactions=INSTANTANEOUS))


@pytest.mark.parametrize("name", ["single_pendulum_45", "top_1", "top_3"])
@pytest.mark.parametrize("solver", ["newton", "auto"])
def test_they_are_true_to_order_two_at_their_rows(name, solver):
    model, errors = deck(name), []
    exact = recognise(model)
    for h in (0.004, 0.002, 0.001):
        run = simulate(instantaneous(model), dt=h, t_final=2.0, solver=solver)
        errors.append(np.abs(run.force() - exact.forces(run.time)).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    "name",
    [
        "double_pendulum_89",
        "four_bar",
        "bricard",
        "gyroscope",
        "friction_hinge",
        "torsional_spring",
    ],
)
@pytest.mark.parametrize("every", [1, 7])
def test_the_motion_is_the_same_to_the_last_bit(name, every):
    model = deck(name)
    given = {"dt": 0.01, "t_final": 1.0, "solver": "newton", "every": every}
    plain, run = simulate(model, **given), simulate(instantaneous(model), **given)
    assert (run.states == plain.states).all()
    assert (run.work == plain.work).all()
    assert run.report.iterations == plain.report.iterations


@pytest.mark.parametrize("name", ["four_bar", "spatial_slider_crank", "universal"])
def test_loads_and_moments_agree_with_the_means_in_the_limit(name):
    """At a row the mean of the means before and after it is of order 2 as well."""
    differences = []
    for h in (0.002, 0.001, 0.0005):
        model = deck(name)
        means = simulate(model, dt=h, t_final=0.2, solver="newton").reactions[:, 1:]
        rows = simulate(instantaneous(model), dt=h, t_final=0.2, solver="newton").reactions[:, 1:]
        both = 0.5 * (means[1:-1] + means[2:]) - rows[1:-1]
        # A joint motion's power is its mean load times the rate at the output time: of order 1 in
        # the means.
        steady = [i for i, c in enumerate(columns(model)) if not c.endswith(".power")]
        differences.append(np.abs(both[:, steady]).max())
    assert np.log2(np.array(differences[:-1]) / differences[1:]) == pytest.approx(2.0, abs=0.3)


def columns(model):
    from msahl.system.names import reaction_columns

    return reaction_columns(model)[1:]


@pytest.mark.slow
def test_the_command_says_which_they_are(tmp_path):
    folders = {}
    for kind in ("mean", "instantaneous"):
        out = folders[kind] = tmp_path / kind
        words = ["run", str(SINGLE), "--t-final", "1", "--reactions", kind, "-o", str(out)]
        result = CliRunner().invoke(main, words)
        assert result.exit_code == 0, result.output
        assert json.loads((out / "run.json").read_text())["options"]["reactions"] == kind
    a, b = (pd.read_csv(out / "reactions.csv") for out in folders.values())
    assert list(a.columns) == list(b.columns)
    assert (a.iloc[0] == b.iloc[0]).all()
    assert not (a.iloc[1:] == b.iloc[1:])["Pivot.Fz"].any()
    told = CliRunner().invoke(post, ["work", str(folders["instantaneous"])])
    assert told.exit_code == 0
    assert "run the deck again without --reactions instantaneous" in told.output
    report = CliRunner().invoke(post, ["report", str(folders["instantaneous"])])
    assert report.exit_code == 0, report.output


@pytest.mark.parametrize("name", ["friction_hinge", "friction_slide"])
def test_friction_presses_by_the_reaction_that_it_makes(name):
    """Asked again from its own answer the reaction stands still, up to the rounding of its sums."""
    model = deck(name)
    integrator = SubsystemIntegrator(model, "newton", False, 8)
    schedule = OutputSchedule.at_ends(np.zeros(5, dtype=bool))
    integrator.advance(Chunk(5, h=model.simulation.dt, schedule=schedule))
    workspace, instant = integrator.workspace, new_instant(integrator.workspace.system)
    state = workspace.state
    state.reaction[:] = 0.0
    accelerations.accelerate(workspace.system, state, workspace.start, instant)
    once = state.reaction.copy()
    accelerations.accelerate(workspace.system, state, workspace.start, instant)
    assert np.abs(once).max() > 0.0
    assert np.abs(state.reaction - once).max() <= 1e-13 * np.abs(once).max()


@pytest.mark.parametrize(("name", "full"), [("bricard", False), ("four_bar", True)])
def test_reactions_of_redundant_joints_are_the_least_to_round_off(name, full):
    """The relaxation of 1e-9 by which they are solved leaves nothing, nor do multipliers that are
    undetermined: against the eigenvectors of S = G M^-1 G^T, without those of its zeros.
    """
    model = deck(name)
    integrator = SubsystemIntegrator(model, "newton", full, 8)
    schedule = OutputSchedule.at_ends(np.zeros(5, dtype=bool))
    integrator.advance(Chunk(5, h=model.simulation.dt, schedule=schedule))
    workspace = integrator.workspace
    instant = new_instant(workspace.system)
    accelerations.accelerate(workspace.system, workspace.state, workspace.start, instant)
    free = instant.unknowns.free
    held = free >= 3 * first_multiplier(workspace.system.frames)
    A = np.zeros(free.size**2)
    A[instant.unknowns.dense_to] = instant.values[instant.unknowns.dense_from]
    A = A.reshape(free.size, free.size)
    G = A[np.ix_(held, ~held)] @ np.linalg.inv(A[np.ix_(~held, ~held)])
    values, vectors = np.linalg.eig(-G @ A[np.ix_(~held, held)])
    assert workspace.system.relaxation > 0.0
    assert (np.abs(values) < 1e-12).any()
    inverse = np.divide(1.0, values, out=np.zeros_like(values), where=np.abs(values) > 1e-9)
    rows, found = (part.reshape(-1)[free] for part in (instant.rows, instant.solution))
    along = np.linalg.solve(vectors, rows[held] - G @ rows[~held])
    least = (vectors @ (inverse * along)).real
    # The digits that eigenvectors have. With the relaxation it is 1e-6.
    assert np.abs(found[held] - least).max() <= 1e-11 * np.abs(least).max()
