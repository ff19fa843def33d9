"""Laws along coordinates: the mean of a tension over a step, where the law does not give it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from msahl.laws.registry import COORDINATE_LAWS
from msahl.laws.spring import mean_tension
from msahl.ports import coordinate


def group_of(constants, free):
    return SimpleNamespace(
        law=np.array([list(COORDINATE_LAWS).index("spring")]),
        constants=np.array([constants]),
        free=np.array([free]),
    )


@pytest.mark.parametrize("change", [0.0, *np.logspace(-14, 1, 16), -0.3])
def test_the_mean_of_a_linear_tension_is_that_of_its_law(change):
    group, q = group_of((2.0, 30.0), 0.5), 0.8
    found = coordinate.derived_mean(group, 0, q, change)
    wanted = mean_tension(group.constants[0], q, change, 0.5)
    # A quotient of a change from SHORT of the distance on loses one digit.
    assert found == pytest.approx(wanted, rel=1e-13)


@pytest.mark.parametrize("q", [0.0, 0.7, -2.0])
@pytest.mark.parametrize("change", [0.0, *np.logspace(-14, 1, 16), -0.3])
def test_the_mean_of_a_nonlinear_tension_is_the_quotient_of_its_potential(q, change, monkeypatch):
    def sine(law, c, q, free):
        return math.sin(q), math.cos(q)

    monkeypatch.setattr(coordinate, "law_tension", sine)
    monkeypatch.setattr(
        coordinate, "law_potential", lambda law, c, q, free: 2.0 * math.sin(0.5 * q) ** 2
    )

    def exact(change):
        """(cos(q) - cos(q + dq))/dq without cancellation."""
        return math.sin(q + 0.5 * change) * np.sinc(0.5 * change / math.pi)

    mean, slope = coordinate.derived_mean(group_of((0.0, 0.0), 0.0), 0, q, change)
    # Loses a digit, or two where the potential is flat at both ends.
    assert mean == pytest.approx(exact(change), rel=1e-13, abs=1e-14)
    e = 1e-5  # error e^2 and round-off eps/e of the central difference balance near it
    difference = (exact(change + e) - exact(change - e)) / (2.0 * e)
    assert slope == pytest.approx(difference, abs=1e-9)
