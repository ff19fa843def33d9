"""Shape functions of beams: exactness of quadratures and interpolation, invariance of strains."""

import numpy as np
import pytest

from msahl.algebra.rotation import from_axis_angle
from msahl.algebra.rotation_arrays import rotations
from msahl.elements.beams.shape import gauss_stations, node_stations, shape, strains
from tests.support.beams import arc

EPS = np.finfo(float).eps


@pytest.mark.parametrize("degree", range(1, 9))
def test_quadratures_and_interpolation_are_exact_for_polynomials(degree):
    of = shape(degree)
    for k in range(2 * degree):
        exact = (1.0 + (-1.0) ** k) / (k + 1.0)
        # Sums of terms of at most 2, each known to a few machine epsilons.
        assert of.weights @ of.points**k == pytest.approx(exact, abs=64 * EPS)
        assert of.node_weights @ of.nodes**k == pytest.approx(exact, abs=64 * EPS)
    for k in range(degree + 1):
        slope = k * of.points ** max(k - 1, 0)
        # Slopes have terms of up to degree^2.
        assert of.values @ of.nodes**k == pytest.approx(of.points**k, abs=64 * EPS)
        assert of.slopes @ of.nodes**k == pytest.approx(slope, abs=64 * degree**2 * EPS)


def test_neighbouring_elements_share_a_node():
    nodes = node_stations(2, np.array([1.0, 3.0]))
    points = gauss_stations(2, np.array([1.0, 3.0]))
    assert nodes == pytest.approx([0.0, 0.5, 1.0, 2.5, 4.0])
    assert points[:2].sum() == pytest.approx(1.0)
    assert points[2:].sum() == pytest.approx(5.0)


def test_strains_of_an_arc_are_those_of_a_circle_with_the_order_of_the_degree():
    errors = [np.abs(arc_strains(4, n) - [1, 0, 0, 0, 0, 0.1]).max() for n in (1, 2)]
    # At Gauss points the slope of an interpolation through Lobatto's points has the order p + 1.
    assert errors[1] < 1e-5
    assert errors[0] / errors[1] > 2**4


def arc_strains(degree, elements):
    line = arc(degree, elements, radius=10.0, angle=1.0)
    return strains(degree, line.lengths, line.positions, line.axes)


def test_rigid_motions_of_a_curved_beam_change_no_strain():
    rng = np.random.default_rng(23)
    line = arc(3, 2, radius=1.0, angle=2.0)
    before = strains(3, line.lengths, line.positions, line.axes)
    worst = 0.0
    for _ in range(10_000):
        A = rotations(np.array(from_axis_angle(tuple(rng.normal(size=3)), rng.uniform(-3, 3))))
        shift = rng.normal(size=3)
        after = strains(3, line.lengths, line.positions @ A.T + shift, A @ line.axes)
        worst = max(worst, np.abs(after - before).max())
    # Positions of size 5 times slopes of up to 2 p^2 / (length of an element, 1 m).
    assert worst < 1000 * EPS
