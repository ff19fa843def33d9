"""Elements of beams: nodes at stations, and loads per length."""

import numpy as np
import pytest

from msahl.beams.mesh import mesh


def test_elements_are_equal_without_stations():
    assert mesh(2, 4, ()).ends == (0.0, 0.25, 0.5, 0.75, 1.0)
    assert mesh(2, 4, (0.0, 0.5, 0.25, 1.0)).ends == (0.0, 0.25, 0.5, 0.75, 1.0)


def test_elements_end_at_stations():
    found = mesh(3, 8, (0.3, 0.31))
    assert found.ends[0] == 0.0
    assert found.ends[-1] == 1.0
    assert len(found.ends) == 9
    assert np.diff(found.ends).max() == pytest.approx(0.15)
    assert found.stations[found.node_at(0.31) - 1] == pytest.approx(0.31)
    assert len(mesh(3, 1, (0.3, 0.31)).ends) == 4  # more than asked for


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_loads_per_length_have_their_resultant(degree):
    of = mesh(degree, 5, (0.3, 0.7))
    shares = of.shares(0.3, 0.7, 2.0, 5.0)
    at = of.stations[np.array(list(shares)) - 1]
    force = np.array(list(shares.values()))
    assert force.sum() == pytest.approx(0.4 * 3.5, rel=1e-14)
    assert at.min() == pytest.approx(0.3)
    # Lobatto's formula is exact to degree 2 p - 1: the moment of a linear load needs 2.
    moment = 0.4 * (0.3 * 3.5 + 0.4 * (2.0 / 2.0 + 3.0 / 3.0))
    if degree > 1:
        assert force @ at == pytest.approx(moment, rel=1e-14)
