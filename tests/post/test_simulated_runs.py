"""Measures of real runs with joint motions, springs, redundant joints and joints of many kinds."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main as msahl
from msahl.post.cli import main as msahl_post
from msahl.post.metrics import compute_metrics
from msahl.post.run_report import build_report
from msahl.post.summary import (
    constraints_table,
    energy_table,
    events_table,
    reactions_table,
)
from msahl.results.read import read_run

DECKS = Path(__file__).parents[2] / "decks"
ROUND_OFF = 1e-12
"""Gathered over a few thousand steps, in parts of the largest energy."""


@pytest.fixture(scope="module")
def run_of(tmp_path_factory):
    """Runs of decks by name and options, each made once."""
    made = {}

    def run(deck, *options):
        if (deck, options) not in made:
            folder = tmp_path_factory.mktemp("run")
            words = [str(DECKS / f"{deck}.xml"), "-o", str(folder), *options]
            result = CliRunner().invoke(msahl, ["run", *words])
            assert result.exit_code == 0, result.output
            made[deck, options] = read_run(folder)
        return made[deck, options]

    return run


@pytest.mark.parametrize(
    "deck",
    [
        "forces/joint_motion_sine",
        "forces/torsional_spring",
        "joints/revolute",
        "joints/parallel_cylinders",
        "joints/rolling_disk",
        "joints/knife_edge",
        "mechanisms/bricard",
    ],
)
def test_ideal_joints_do_no_work_and_stay_closed(run_of, deck):
    metrics = compute_metrics(run_of(deck))
    size = metrics.energy.largest_kinetic
    assert np.abs(metrics.work.reaction).max() < ROUND_OFF * size
    assert metrics.energy.error_over_kinetic.max < 10 * ROUND_OFF
    violation = metrics.constraints.violation
    assert violation[~np.isnan(violation)].max(initial=0.0) < ROUND_OFF


def test_the_work_of_the_reaction_sees_forces_and_moments(run_of):
    run = run_of("joints/revolute")
    columns = [f"Hinge.{c}" for c in ("Mx", "My", "Mz")]
    rotated = run.reactions.copy()
    rotated[columns] += 1.0  # along the axis as well, where an ideal joint has none
    wrong = compute_metrics(run.__class__(**(vars(run) | {"reactions": rotated}))).work.reaction
    assert np.abs(wrong).max() > 1e-4


def test_a_joint_motion_has_load_work_and_a_violation_in_radians(run_of):
    run = run_of("forces/joint_motion_sine")
    metrics = compute_metrics(run)
    found = metrics.constraints
    assert found.names == ("Hinge", "Motor")
    assert np.isnan(found.violation[:, 1, 0]).all()
    assert not np.isnan(found.violation[:, 0]).any()
    assert not np.isnan(found.violation[:, 1, 1]).any()
    assert metrics.energy.work == pytest.approx(run.work["Motor.work"])
    assert metrics.reactions.load[:, 1, 1] == pytest.approx(run.reactions["Motor.load"])
    assert np.isnan(metrics.reactions.load[:, 1, 0]).all()
    (hinge, motor) = constraints_table([("run", metrics)]).shown()
    assert motor[2:4] == ["", ""]
    assert "" not in hinge


@pytest.mark.parametrize("deck", ["forces/joint_motion_constant", "mechanisms/four_bar"])
def test_revolutions_are_counted_in_thinned_runs(run_of, deck):
    found = compute_metrics(run_of(deck, "--every", "37")).constraints
    motor = found.names.index("Motor")
    assert found.violation[:, motor, 1].max() < ROUND_OFF


@pytest.mark.parametrize(
    ("deck", "spring"), [("forces/torsional_spring", True), ("joints/revolute", False)]
)
def test_elastic_energy_is_part_of_the_balance(run_of, deck, spring):
    run = run_of(deck)
    metrics = compute_metrics(run)
    energy = metrics.energy
    if spring:
        told = run.work.filter(like=".energy").sum(axis=1)
        assert energy.elastic == pytest.approx(told, rel=1e-10, abs=1e-12)
        assert energy.elastic.max() > 0.1 * energy.largest_kinetic
    (row,) = energy_table([("run", metrics)]).rows
    assert (row[-2] is not None, row[-1] is not None) == (spring, spring)


@pytest.mark.slow
def test_reactions_that_are_not_unique_are_marked(run_of):
    run = run_of("mechanisms/bricard")
    metrics = compute_metrics(run)
    assert run.info["nonUniqueReactions"]
    shared = run.info["nonUniqueReactions"]
    assert [row[-1] for row in reactions_table(metrics.reactions).rows] == [
        f"not {', '.join(shared[name])}" if name in shared else "yes"
        for name in metrics.reactions.names
    ]
    text = str([block for block in build_report(run, metrics) if not hasattr(block, "png")])
    assert "1 by rank, 0 by count" in text
    assert "redundant" in text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("deck", "found"),
    [
        ("contact/trebuchet", ["releases", "Sling", "LetGo", "the stone flies"]),
        ("contact/bouncing_ball", ["impact", "Floor", "The first 50 of"]),
    ],
)
def test_the_report_lists_contacts_and_events(run_of, deck, found):
    run = run_of(deck)
    text = "".join(str(block) for block in build_report(run, compute_metrics(run), viewer=False))
    assert all(word in text for word in ["Contacts and events", *found])
    table = events_table(run)
    assert [row[0] for row in table.rows] == run.events["time"].tolist()[: len(table.rows)]
    assert ("message" in [c.key for c in table.columns]) == bool(run.model.events)


ALWAYS = ("path", "positions", "error", "energy")
JOINTED = (*ALWAYS, "constraints", "reactions")
"""Pictures of a run, and those of one with constraint equations."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("deck", "kinds"),
    [
        ("forces/joint_motion_sine", {"linkage", *JOINTED, "joints", "work"}),
        ("joints/cylindrical", {*JOINTED, "joints", "work"}),
        ("forces/spring_damper", {"linkage", *ALWAYS}),
        ("forces/point_motion", {"linkage", *JOINTED}),
        ("joints/knife_edge", {"linkage", *JOINTED, "joints", "work"}),
    ],
)
def test_pictures_there_is_data_for(run_of, deck, kinds, tmp_path):
    words = ["plot", str(run_of(deck).folder), "-o", str(tmp_path)]
    result = CliRunner().invoke(msahl_post, words)
    assert result.exit_code == 0, result.output
    assert {path.stem.partition("-")[0] for path in tmp_path.iterdir()} == kinds
