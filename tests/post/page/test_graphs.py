"""Graphs of a page: thinning keeps what a reader would see, whatever the values."""

from base64 import b64decode

import numpy as np
import pytest

from msahl.post.graph_data import HIDDEN, INTERVALS, Graph, Group, thinned
from msahl.post.page.graphs import MOST_CURVES, graphs


def unpacked(text):
    return np.frombuffer(b64decode(text), "<f4")


def test_a_long_series_shows_its_extremes_everywhere():
    rng = np.random.default_rng(5)
    count = 100 * INTERVALS + 37
    x = np.linspace(0.0, 3.0, count)
    values = rng.normal(size=(2, count))
    values[0, 12345] = 50.0
    values[1, 4567:4570] = np.nan
    few, _ = thinned(x, values[0])
    kept = np.array([thinned(x, series)[1] for series in values])
    assert kept.shape == (2, 2 * INTERVALS)
    assert (np.diff(few) > 0.0).all()
    assert (few[0], few[-1]) == (x[0], x[-1])
    assert kept[0].max() == 50.0
    np.testing.assert_array_equal(np.nanmin(values, axis=1), kept.min(axis=1))
    edges = np.linspace(0, count, INTERVALS + 1).astype(int)
    hidden = HIDDEN * np.ptp(kept, axis=1)
    for k in range(1, INTERVALS - 1):
        part = values[:, edges[k] : edges[k + 1]]
        near = kept[:, 2 * k - 1 : 2 * k + 3]
        assert (np.nanmin(part, axis=1) >= near.min(axis=1) - hidden).all()
        assert (np.nanmax(part, axis=1) <= near.max(axis=1) + hidden).all()


@pytest.mark.parametrize("periods", [0.7, 3.0, 20.0])
def test_a_smooth_curve_stays_smooth(periods):
    """With 30 times in a period, lines between them are within 1 - cos(pi/30) of a sine; pairs of
    the least and the largest value are stairs, which are wrong by a tenth."""
    x = np.linspace(0.0, 1.0, 20_000)
    values = np.sin(2.0 * np.pi * periods * x + 0.4)
    few, kept = thinned(x, values, 300)
    assert np.abs(np.interp(x, few, kept) - values).max() < 0.006


def test_a_rising_series_stays_rising():
    x = np.linspace(0.0, 1.0, 10 * INTERVALS)
    _, kept = thinned(x, x)
    assert (np.diff(kept) > 0.0).all()


def test_a_short_series_is_kept():
    x = np.linspace(0.0, 1.0, 2 * INTERVALS)
    few, kept = thinned(x, x)
    assert few is x
    assert kept is x


def test_of_many_curves_those_that_vary_most_are_drawn():
    x = np.linspace(0.0, 1.0, 5)
    curves = tuple((f"body {i}", i * x) for i in range(30))
    part = graphs([Group("Positions", (Graph("x [m]", x, curves),))])
    (record,) = part.data["graphs"]
    names = [curve["name"] for curve in record["curves"]]
    assert names == [f"body {i}" for i in range(30 - MOST_CURVES, 30)]
    assert f"and {30 - MOST_CURVES} more that vary less" in part.markup


def test_logarithmic_values_have_a_least_and_zeros_no_logarithm():
    x = np.arange(4.0)
    curves = (("a", np.array([0.0, -1e-3, 1e-30, np.nan])),)
    (record,) = graphs([Group("g", (Graph("e", x, curves, log=True),))]).data["graphs"]
    assert record["log"]
    np.testing.assert_allclose(
        unpacked(record["curves"][0]["values"]), [1e-11, 1e-3, 1e-11, np.nan], rtol=1e-6
    )  # single precision
    zeros = (("a", np.zeros(4)),)
    (record,) = graphs([Group("g", (Graph("e", x, zeros, log=True),))]).data["graphs"]
    assert not record["log"]


def test_values_beyond_single_precision_stay_finite():
    x = np.arange(3.0)
    curves = (("a", np.array([1e300, -1e300, np.inf])),)
    (record,) = graphs([Group("g", (Graph("e", x, curves),))]).data["graphs"]
    values = unpacked(record["curves"][0]["values"])
    assert np.isfinite(values[:2]).all()
    assert np.isnan(values[2])


def test_graphs_of_the_same_curves_share_a_legend():
    x = np.arange(3.0)
    one, other = (("a", x), ("b", x)), (("c", x), ("d", x))
    part = graphs([Group("g", (Graph("x", x, one), Graph("y", x, one)))])
    assert part.markup.count('class="legend"') == 1
    part = graphs([Group("g", (Graph("x", x, one), Graph("y", x, other)))])
    assert part.markup.count('class="legend"') == 2
    assert graphs([Group("g", ())]).markup == ""
