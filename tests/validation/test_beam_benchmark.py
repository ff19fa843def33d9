"""The beams of the benchmarks: their models, converged positions, and what is stored of them."""

import numpy as np
import pytest

from benchmarks.beams import ours, references
from benchmarks.beams.page import OURS, PAGE, PEER, PICTURE, ahead, fastest, write_page
from benchmarks.beams.problems import (
    BEND,
    HANGING,
    PROBLEMS,
    ROD,
    SWINGING,
    first_guess,
    load_factor,
)
from benchmarks.beams.setting import Setting
from benchmarks.beams.store import Run, front, load, save


def run(program, error, seconds, problem="bend"):
    return Run(problem, program, Setting("degree 3", 4), error, 7, 1e-3, [seconds] * 3)


@pytest.mark.parametrize(
    ("problem", "setting", "within"),
    [
        # Measured errors over the length, with a margin of two: the settings are coarse.
        (BEND, Setting("degree 4", 2), 4e-5),
        (HANGING, Setting("degree 3", 4), 2e-5),
        (ROD, Setting("degree 3, preserving", 4, 0.025), 8e-3),
        (SWINGING, Setting("degree 2, preserving", 4, 0.02), 1e-2),
    ],
)
def test_msahl_and_the_stored_references_agree(problem, setting, within):
    found = ours.solve(problem, setting)
    assert found.points.shape == (problem.outputs + 1, len(problem.points), 3)
    error = np.linalg.norm(found.points - references.reference(problem), axis=-1).max()
    assert error < within * problem.length


def test_the_references_at_rest_are_found_again():
    """At the looser tolerance of their check."""
    for name in ("bend", "hanging"):
        loose, _ = references.SIZES[name]
        found = references.METHODS[name](loose)
        np.testing.assert_allclose(found, references.reference(PROBLEMS[name]), atol=1e-7)


def test_the_first_guess_is_an_arc_of_the_cables_length_between_the_supports():
    points, slopes = first_guess(np.linspace(0.0, 1.0, 1001))
    np.testing.assert_allclose(points[[0, -1]], [[0.0, 0.0], [8.0, 0.0]], atol=1e-12)
    steps = np.diff(points, axis=0)
    # A chord is shorter than its arc by (length/radius)^2/24 of it, here 2e-7.
    assert np.linalg.norm(steps, axis=1).sum() == pytest.approx(10.0, rel=1e-6)
    assert np.tan(slopes[0]) == pytest.approx(steps[0, 1] / steps[0, 0], rel=1e-2)


def test_the_load_of_the_rod_grows_and_ceases():
    assert [load_factor(t) for t in (0.0, 1.25, 2.5, 3.75, 5.0, 8.0)] == [0, 0.5, 1, 0.5, 0, 0]


def test_what_is_ahead_is_the_fastest_run_that_is_exact_enough():
    runs = [run(OURS, 1e-3, 2.0), run(OURS, 1e-5, 3.0), run(PEER, 5e-3, 1.0), run(PEER, 1e-5, 9.0)]
    assert fastest(runs, OURS, 1e-2) is runs[0]
    assert fastest(runs, PEER, 1e-6) is None
    assert not ahead(runs, 1e-2)
    assert ahead(runs, 1e-3)
    assert not ahead(runs, 1e-6)


def test_only_runs_that_none_surpasses_are_drawn_as_a_line():
    runs = [run(OURS, 1e-3, 2.0), run(OURS, 1e-2, 2.2), run(OURS, 1e-4, 3.0)]
    assert front(runs) == [runs[0], runs[2]]
    assert front(runs, 1.5) == runs


def test_runs_are_stored_beside_those_of_other_problems(tmp_path):
    bend = [run(OURS, 1e-3, 2.0), run(PEER, 1e-2, 1.0)]
    rod = [Run("rod", OURS, Setting("degree 3, gauss2", 4, 0.1), 6e-4, 446, 0.03, [0.07])]
    save(rod, tmp_path)
    save(bend, tmp_path)
    assert load(tmp_path) == bend + rod
    write_page(load(tmp_path), ["a machine"], tmp_path)
    text = (tmp_path / PAGE).read_text()
    assert "| 45 degree bend | msahl ahead from 1e-02 to 1e-05 |" in text
    assert "degree 3, gauss2; 4 elements, 100 ms" in text
    assert (tmp_path / PICTURE).exists()
