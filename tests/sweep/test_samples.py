"""Samples have their distributions, are the same for the same seed, and give Sobol indices."""

import numpy as np
import pytest
from scipy import stats

from msahl.sweep.axes import Distribution
from msahl.sweep.faults import PlanError
from msahl.sweep.samples import Sample, draw, inverse, parse_sample

QUANTILES = {
    "uniform": ((2.0, 5.0), stats.uniform(2.0, 3.0)),
    "loguniform": ((1.0, 100.0), stats.loguniform(1.0, 100.0)),
    "normal": ((2.0, 0.5), stats.norm(2.0, 0.5)),
    "truncnormal": ((1.0, 2.0, 0.0, 4.0), stats.truncnorm(-0.5, 1.5, 1.0, 2.0)),
    "lognormal": ((0.3, 0.7), stats.lognorm(0.7, scale=np.exp(0.3))),
    "triangular": ((1.0, 2.0, 4.0), stats.triang(1.0 / 3.0, 1.0, 3.0)),
}


@pytest.mark.parametrize("kind", QUANTILES)
def test_quantiles_are_those_of_scipy(kind):
    numbers, reference = QUANTILES[kind]
    u = np.linspace(1e-6, 1.0 - 1e-6, 101)
    # Both are compositions of the same few functions; 1e-9 is far above their round-off.
    assert inverse(Distribution(kind, numbers), u) == pytest.approx(reference.ppf(u), rel=1e-9)


def test_a_normal_distribution_may_be_truncated_far_from_its_mean():
    found = inverse(Distribution("truncnormal", (0.0, 1.0, 9.0, 10.0)), np.array([0.1, 0.5, 0.9]))
    # The tail falls nearly as exp(-9 x): half of it is within ln 2 / 9 of its beginning.
    assert found == pytest.approx(stats.truncnorm(9.0, 10.0).ppf([0.1, 0.5, 0.9]))
    assert found[1] == pytest.approx(9.0 + np.log(2.0) / 9.0, rel=1e-3)


def test_a_triangle_may_have_its_top_at_an_end():
    u = np.array([0.25, 0.75])
    assert inverse(Distribution("triangular", (0.0, 0.0, 1.0)), u) == pytest.approx(
        1.0 - np.sqrt(1.0 - u)
    )
    assert inverse(Distribution("triangular", (0.0, 1.0, 1.0)), u) == pytest.approx(np.sqrt(u))


@pytest.mark.parametrize("kind", ["random", "lhs", "sobol", "saltelli"])
def test_the_seed_decides(kind):
    uniform = [Distribution("uniform", (0.0, 1.0))] * 2
    first, again, other = (draw(Sample(kind, 8, seed), uniform) for seed in (7, 7, 8))
    assert (first == again).all()
    assert (first != other).any()
    assert len(first) == Sample(kind, 8, 7).count(2)


def test_a_latin_hypercube_has_one_point_in_each_layer():
    points = draw(Sample("lhs", 16, 1), [Distribution("uniform", (0.0, 16.0))] * 3)
    assert (np.arange(16) == np.sort(np.floor(points), axis=0).T).all()


def test_a_saltelli_design_gives_the_indices_of_ishigami():
    a, b, n = 7.0, 0.1, 2048
    x = draw(Sample("saltelli", n, 3), [Distribution("uniform", (-np.pi, np.pi))] * 3)
    f = np.sin(x[:, 0]) * (1.0 + b * x[:, 2] ** 4) + a * np.sin(x[:, 1]) ** 2
    f = f.reshape(n, 5)
    found = stats.sobol_indices(
        func={"f_A": f[:, :1].T, "f_B": f[:, 1:2].T, "f_AB": f[:, 2:].T[:, None]}, n=n
    )
    v1 = 0.5 * (1.0 + b * np.pi**4 / 5.0) ** 2
    v13 = b**2 * np.pi**8 * (1.0 / 18.0 - 1.0 / 50.0)
    v2 = a**2 / 8.0
    v = v1 + v2 + v13
    # Sampling error of 2048 points: about 1/sqrt(2048) = 0.02.
    assert np.ravel(found.first_order) == pytest.approx([v1 / v, v2 / v, 0.0], abs=0.02)
    assert np.ravel(found.total_order) == pytest.approx([(v1 + v13) / v, v2 / v, v13 / v], abs=0.02)


@pytest.mark.parametrize(
    "text", ["sobol", "sobol:", "sobol:0", "halton:8", "lhs:-1", "saltelli:12"]
)
def test_faults(text):
    with pytest.raises(PlanError, match="--sample"):
        parse_sample(text, 0)


def test_a_sobol_sequence_that_is_not_balanced_is_noted():
    assert "sobol:64 or sobol:128" in parse_sample("sobol:100", 0).note
    assert not parse_sample("sobol:128", 0).note
    assert not parse_sample("lhs:100", 0).note
