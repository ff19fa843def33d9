"""Reactions in the joints' own axes."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.post.cli import main as post
from msahl.post.joint_axes import in_joint_axes
from msahl.results.read import read_run

DECKS = Path(__file__).parents[2] / "decks"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("axes") / "out"
    deck = DECKS / "mechanisms" / "spatial_slider_crank.xml"
    arguments = ["run", str(deck), "-q", "-o", str(folder), "--t-final", "0.2"]
    assert CliRunner().invoke(main, arguments).exit_code == 0
    return read_run(folder)


def test_a_rotated_vector_keeps_its_length(run):
    columns, rows = in_joint_axes(run)
    own = dict(zip(columns, rows.T, strict=True))
    for joint in run.model.joints:
        names = [f"{joint.name}.F{c}" for c in "xyz"]
        rotated = np.linalg.norm([own[name] for name in names], axis=0)
        given = np.linalg.norm(run.reactions[names].to_numpy(), axis=1)
        # Both are lengths of the same vectors; three products of round-off each.
        np.testing.assert_allclose(rotated, given, rtol=1e-13)


def test_a_hinge_has_no_moment_about_its_own_axis(run):
    columns, rows = in_joint_axes(run)
    own = dict(zip(columns, rows.T, strict=True))
    hinges = [joint.name for joint in run.model.joints if joint.kind == "revolute"]
    assert hinges
    for name in hinges:
        moments = np.linalg.norm([own[f"{name}.M{c}"] for c in "xyz"], axis=0)
        # The hinge carries nothing about z; round-off of the moments it carries about x and y.
        assert np.abs(own[f"{name}.Mz"]).max() < 1e-12 * max(1.0, moments.max())


def test_the_command_prints_one_row_a_row(run):
    result = CliRunner().invoke(post, ["reactions", str(run.folder)])
    assert result.exit_code == 0
    assert len(result.stdout.splitlines()) == 1 + len(run.time)
