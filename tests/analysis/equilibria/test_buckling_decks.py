"""Decks of beams that buckle, snap through or follow their load: what their headers promise.

References are closed forms, or the exact equations by collocation with Chebyshev polynomials and by
integrating the elastica from its tip, which share nothing with the elements.
"""

from itertools import takewhile

import numpy as np
import pytest

from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.load_path import Path, grown
from msahl.analysis.equilibria.static_equations import Statics
from msahl.analysis.linearised.point import at_start
from msahl.analysis.modes.campbell import campbell
from msahl.analysis.modes.following import Request
from msahl.deck.source import Source
from tests.support.models import ROOT


def elastic(name, *settings):
    """The model of a deck of beams."""
    return Source.of_file(ROOT / f"decks/elastic/{name}.xml").model(settings)


def first_critical(model, most=80):
    """The first limit point or bifurcation of the path under growing loads."""
    points = zip(range(most), Path(search_start(model)).to(2.0), strict=False)
    return next(point for _, point in points if point.kind)


@pytest.mark.parametrize(
    ("name", "settings", "kind", "expected", "digits"),
    [
        # Degree 4 with 4 elements has the load to 2e-11.
        ("column", (), "bifurcation", 1.0, 1e-9),
        # The stiff bending is 1e9 times the soft one, and round-off 1e9 times as large.
        ("lateral_buckling", (), "bifurcation", 1.0, 2e-7),
        pytest.param(
            "lee_frame", (), "limit point", 18.556727538 / 20.0, 1e-7, marks=pytest.mark.slow
        ),
        pytest.param("deep_arch", (), "limit point", 0.897308997, 1e-7, marks=pytest.mark.slow),
    ],
)
def test_the_first_critical_load(name, settings, kind, expected, digits):
    critical = first_critical(elastic(name, *settings))
    assert critical.kind == kind
    assert critical.factor == pytest.approx(expected, rel=digits)


@pytest.mark.slow
def test_an_arch_with_few_elements_has_its_limit_load_to_a_thousandth():
    """Eight elements of degree 4: the curvature of the buckled arch changes within an element."""
    critical = first_critical(elastic("deep_arch", "Arch.elements=8", "Arch.degree=4"))
    assert critical.factor == pytest.approx(0.897308997, rel=2e-3)


def test_a_frequency_of_the_column_is_zero_at_its_buckling_load():
    """With an estimate of the error that contains the truth."""

    def point_of(load):
        return at_start(elastic("column", "Column.elements=2", f"load={load!r}"))

    found = campbell(point_of, [0.6, 0.9, 1.2], Request(None, 0.0, "auto"), (), 1.0)
    (critical,) = found.critical
    # Two elements of degree 4 have the load to 1e-8.
    assert critical.value == pytest.approx(1.0, abs=critical.error + 2e-8)
    assert critical.error < 1e-6
    assert critical.eigenvalue == 0.0


@pytest.mark.parametrize(
    ("load", "tip"),
    [
        (10.0, (-0.0921231811894, 0.0, 0.546983264594)),
        (36.0, (0.285341437183, 0.0, -0.454598386786)),
    ],
)
def test_a_follower_force_bends_a_cantilever_by_more_than_a_revolution(load, tip):
    start = search_start(elastic("follower", f"load={load}"))
    rest = grown(Statics(start.system, start.state), start.state)
    assert rest.converged
    # The error of 16 elements of degree 4 is 5e-8.
    assert np.abs(rest.state.x[-2] - tip).max() <= 1e-7


def test_directions_are_not_counted_under_a_follower_force():
    """It has no potential, so none of the points is a bifurcation."""
    path = Path(search_start(elastic("follower", "Rod.elements=4"))).to(1.0)
    points = list(takewhile(lambda point: point.factor < 0.2, path))
    assert [point.unstable for point in points[1:]] == [None] * (len(points) - 1)
    assert not any(point.kind for point in points)
