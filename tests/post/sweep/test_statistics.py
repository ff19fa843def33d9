"""Statistics and Sobol indices of sweeps with known answers."""

import math

import numpy as np
import pytest
from scipy import stats

from msahl.post.sweep.read import read_sweep
from msahl.post.sweep.statistics import groups, independent, indices_of, sobol, statistics_of
from msahl.sweep.axes import Distribution
from msahl.sweep.samples import Sample, draw
from tests.support.sweep_folders import ishigami, ishigami_indices, write_sweep

UNIFORM = Distribution("uniform", (-math.pi, math.pi))
N = 1024


def ishigami_sweep(folder, n=N, seed=3, lost=()):
    points = draw(Sample("saltelli", n, seed), [UNIFORM] * 3)
    values = [None if k in lost else v for k, v in enumerate(ishigami(points))]
    status = ["not converged" if k in lost else "completed" for k in range(len(points))]
    parameters = {f"x{j + 1}": points[:, j] for j in range(3)}
    sample = {"kind": "saltelli", "n": n, "seed": seed}
    return read_sweep(write_sweep(folder, parameters, {"f final": values}, status, sample=sample))


def test_indices_of_ishigami_lie_in_their_intervals(tmp_path):
    sweep = ishigami_sweep(tmp_path / "sweep")
    found = indices_of(sweep, sweep.measures[0])
    first, total = ishigami_indices()
    assert found.parameters == ("x1", "x2", "x3")
    assert (found.rows, found.planned) == (N, N)
    for exact, value, interval in (
        (first, found.first, found.first_interval),
        (total, found.total, found.total_interval),
    ):
        assert np.all((interval[:, 0] < value) & (value < interval[:, 1]))
        # Six intervals of 95 %: one in four samples would have one that misses. This one has none.
        assert np.all((interval[:, 0] <= exact) & (exact <= interval[:, 1]))
        assert np.all(interval[:, 1] - interval[:, 0] < 0.2)


def test_95_percent_intervals_hold_the_indices_in_about_95_percent_of_samples(tmp_path):
    """Over 20 seeds and 6 indices; the sample is balanced, so intervals are rather too wide."""
    first, total = ishigami_indices()
    hits = []
    for seed in range(20):
        points = draw(Sample("saltelli", 128, seed), [UNIFORM] * 3)
        values = ishigami(points).reshape(128, 5)
        draws = np.random.default_rng(seed).integers(0, 128, (200, 128))
        tries = sobol(values[draws])
        for exact, each in zip((first, total), tries, strict=True):
            low, high = np.percentile(each, [2.5, 97.5], axis=0)
            hits += list((low <= exact) & (exact <= high))
    # 120 trials: three standard deviations of the rate are 3 sqrt(0.95 0.05 / 120) = 0.06.
    assert np.mean(hits) > 0.89


def test_indices_are_those_of_scipy(tmp_path):
    sweep = ishigami_sweep(tmp_path / "sweep", 256)
    f = sweep.measures[0].values.reshape(256, 5)
    theirs = stats.sobol_indices(
        func={"f_A": f[:, 0], "f_B": f[:, 1], "f_AB": f[:, 2:].T[:, None]}, n=256
    )
    ours = indices_of(sweep, sweep.measures[0])
    # The same sums in another order: a few roundings of numbers up to 10.
    np.testing.assert_allclose(ours.first, theirs.first_order.ravel(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(ours.total, theirs.total_order.ravel(), rtol=0, atol=1e-12)


def test_rows_with_failed_points_are_omitted_and_counted(tmp_path):
    lost = (3, 4, 77)  # two points of row 0, one of row 15
    sweep = ishigami_sweep(tmp_path / "sweep", 256, lost=lost)
    found = indices_of(sweep, sweep.measures[0])
    assert (found.rows, found.planned) == (254, 256)
    values = sweep.measures[0].values.reshape(256, 5)
    first, total = sobol(np.delete(values, [0, 15], axis=0)[None])
    np.testing.assert_array_equal(found.first, first[0])
    np.testing.assert_array_equal(found.total, total[0])


def test_a_constant_measure_has_no_indices(tmp_path):
    points = draw(Sample("saltelli", 8, 0), [UNIFORM] * 2)
    parameters = {"a": points[:, 0], "b": points[:, 1]}
    sample = {"kind": "saltelli", "n": 8, "seed": 0}
    folder = write_sweep(tmp_path / "s", parameters, {"f max": [1.5] * 32}, sample=sample)
    sweep = read_sweep(folder)
    assert indices_of(sweep, sweep.measures[0]) is None
    # Only the points a and b of each row are independent.
    assert independent(sweep).sum() == 16


def test_statistics_of_known_numbers(tmp_path):
    values = [2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0, None, None]
    status = ["completed"] * 9 + ["crashed"]
    verdict = ["PASS"] * 7 + ["FAIL", "PASS", ""]
    sample = {"kind": "random", "n": 10, "seed": 0}
    folder = write_sweep(
        tmp_path / "s", {"a": np.arange(10.0)}, {"f max": values}, status, verdict, sample
    )
    sweep = read_sweep(folder)
    ((words, among),) = groups(sweep)
    found = statistics_of(sweep, sweep.measures[0], among, words)
    assert (found.points, found.used, found.bad) == (10, 8, 1)
    assert found.mean == 5.0
    assert found.deviation == pytest.approx(math.sqrt(32.0 / 7.0), rel=1e-15)
    # Student's t of 7 degrees of freedom at 97.5 %: 2.3646 (tables).
    half = 2.364624251 * found.deviation / math.sqrt(8.0)
    assert found.interval == pytest.approx((5.0 - half, 5.0 + half), rel=1e-9)
    # Chi squared of 7 degrees of freedom at 97.5 % and 2.5 %: 16.0128 and 1.68987 (tables).
    ends = [math.sqrt(32.0 / x) for x in (16.01276427, 1.689869181)]
    assert found.deviation_interval == pytest.approx(ends, rel=1e-8)
    assert (found.least, found.largest) == (2.0, 9.0)


def test_the_interval_of_the_mean_holds_it_in_95_percent_of_samples(tmp_path):
    generator = np.random.default_rng(11)
    sample = {"kind": "random", "n": 20, "seed": 0}
    folder = write_sweep(tmp_path / "s", {"a": np.arange(20.0)}, {"f": [1.0] * 20}, sample=sample)
    sweep = read_sweep(folder)
    measure, hits = sweep.measures[0], 0
    for _ in range(400):
        measure.values[:] = generator.normal(3.0, 2.0, 20)
        low, high = statistics_of(sweep, measure, np.ones(20, dtype=bool)).interval
        hits += low <= 3.0 <= high
    # Standard deviation of the rate: sqrt(0.95 0.05 / 400) = 0.011; three of them.
    assert hits / 400 == pytest.approx(0.95, abs=0.033)


def test_what_is_listed_divides_a_sample_into_groups(tmp_path):
    sample = {"kind": "lhs", "n": 3, "seed": 0}
    parameters = {"scheme": ["a", "a", "a", "b", "b", "b"], "L": [1.0, 2.0, 3.0] * 2}
    folder = write_sweep(
        tmp_path / "s", parameters, {"f max": [1.0, 2.0, 3.0, 11.0, 12.0, None]}, sample=sample,
        listed=("scheme",),
    )  # fmt: skip
    sweep = read_sweep(folder)
    found = [statistics_of(sweep, sweep.measures[0], among, w) for w, among in groups(sweep)]
    assert [(each.group, each.mean, each.used, each.points) for each in found] == [
        ("scheme = a", 2.0, 3, 3),
        ("scheme = b", 11.5, 2, 3),
    ]
