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
from msahl.analysis.modes.campbell_lines import report
from msahl.analysis.modes.files import Over
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


@pytest.mark.slow
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


def round_column(ratio=1, follower=False):
    """The source of the column with nearly the same bending stiffness to all sides, under a dead
    or a ``follower`` load, here in EI/L^2."""
    text = (ROOT / "decks/elastic/column.xml").read_text()
    text = text.replace("{5*EI}", f"{{{ratio}*EI}}").replace("<elements>4<", "<elements>2<")
    if follower:
        dead = "<force><zForce>{-load*pi^2*EI/(4*length^2)}</zForce></force>"
        assert dead in text
        along = '<force basis="Column.last"><xForce>{-load*EI/length^2}</xForce></force>'
        text = text.replace(dead, along)
    return Source.of(text)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("follower", "values", "expected", "digits"),
    [
        # The error of two elements of degree 4.
        (False, (0.6, 1.0, 1.4), 1.0, 2e-8),
        # Beck's column: 20.0509 without rotary inertia, which is 1e-4 here.
        (True, (18.0, 22.0), 20.0320, 1e-4),
    ],
)
def test_a_round_column_becomes_unstable_to_all_sides(follower, values, expected, digits):
    source = round_column(follower=follower)
    found = campbell(lambda load: at_start(source.model((f"load={load!r}",))), values)
    first, second = found.critical
    assert first.mode != second.mode
    for critical in found.critical:
        assert critical.value == pytest.approx(expected, rel=digits)
        assert critical.error < 1e-6
        assert critical.grows_above
        assert bool(critical.eigenvalue.imag) == follower
    assert abs(first.value - second.value) <= first.error + second.error
    (line,) = report(found, Over("load"), "")[-1:]
    assert f"modes {first.mode} and {second.mode} grow above" in line


@pytest.mark.parametrize(("ratio", "expected"), [(1, [1.0]), (1.05, [1.0, 1.05])])
def test_bifurcations_of_a_load_path_that_are_close(ratio, expected):
    path = Path(search_start(round_column(ratio).model(())))
    factors = [point.factor for point in path.to(1.3) if point.kind]
    assert factors == pytest.approx(expected, rel=2e-8)


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
