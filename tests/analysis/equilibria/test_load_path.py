"""Paths of equilibria against closed forms: snap-through and buckling."""

import numpy as np
import pytest

from msahl.algebra.vector import IDENTITY, ZERO
from msahl.analysis.equilibria.load_path import Path
from msahl.analysis.linearised.point import at_start
from msahl.model import Bushing, ConcentratedLoad, Joint
from msahl.start.velocities import StartError
from tests.support.models import GROUND, body, build_model, deck

ROUND_OFF = 1e-12
"""Of lengths and load factors of about 1, after a solution to the last digits."""
UP, DOWNWARD = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
SIDEWAYS = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
ENDS = (GROUND.name, "Bob")


def spring_force(z):
    """Force [N] that presses the block of the truss down to the height ``z``."""
    return 2000.0 * z * (np.sqrt(1.09) / np.sqrt(1.0 + z * z) - 1.0)


def column(force, sides):
    """A rigid column of 2 m, without weight, that bends on an elastic foot of 6 N m/rad to one side
    or to two, under a vertical force at its top.
    """
    bob = body(position=UP)
    foot = Joint(
        "Foot", "revolute" if sides == 1 else "spherical", *ENDS, ZERO, DOWNWARD, SIDEWAYS, SIDEWAYS
    )
    stiffness = (0.0, 0.0, 0.0, 6.0, 6.0, 6.0)
    spring = Bushing("Spring", *ENDS, ZERO, DOWNWARD, IDENTITY, IDENTITY, stiffness, 6 * (0.0,))
    load = ConcentratedLoad("Load", "Bob", UP, (0.0, 0.0, -force), GROUND.name, ZERO, GROUND.name)
    return build_model([bob], [foot], [spring, load])


@pytest.fixture(scope="module")
def snap_through():
    """The points of the path of a truss that snaps through, among them those at a wanted load."""
    return list(Path(at_start(deck("snap_through"))).to(1.0, wanted=(0.2,)))


@pytest.mark.slow
def test_snap_through_follows_its_closed_form(snap_through):
    points = snap_through
    for point in points:
        z = point.state.x[0, 2]
        assert spring_force(z) == pytest.approx(30.0 * point.factor, abs=30.0 * ROUND_OFF)
        between = abs(z) < np.sqrt(1.09 ** (1 / 3) - 1.0)
        # At a limit point the stiffness is zero but for its round-off.
        assert point.kind or point.unstable == (1 if between else 0)
    # The load rises, falls and rises through 6 N.
    assert sum(point.factor == 0.2 for point in points) == 3
    assert points[-1].factor == 1.0


@pytest.mark.slow
def test_limit_points_are_the_extrema_of_the_load(snap_through):
    limits = [point for point in snap_through if point.kind]
    height = np.sqrt(1.09 ** (1 / 3) - 1.0)
    assert [point.kind for point in limits] == ["limit point", "limit point"]
    for sign, point in zip((1.0, -1.0), limits, strict=True):
        # The arc length is found to 1e-10, of which the height is about a tenth.
        assert point.state.x[0, 2] == pytest.approx(sign * height, abs=1e-9)
        assert 30.0 * point.factor == pytest.approx(sign * spring_force(height), abs=1e-10)


@pytest.mark.parametrize("sides", [1, 2])
def test_a_column_buckles_at_its_critical_load(sides):
    points = list(Path(at_start(column(6.0, sides))).to(1.0))
    (critical,) = [point for point in points if point.kind]
    assert critical.kind == "bifurcation"
    # P = k / L = 3 N, of the 6 N of the deck; its arc length is found to 1e-10.
    assert critical.factor == pytest.approx(0.5, abs=2e-10)
    assert points[-1].unstable == sides


def test_a_load_that_nothing_balances_is_an_error():
    model = build_model([body()], [], [], gravity=(0.0, 0.0, -9.81))
    with pytest.raises(StartError, match="load factor"):
        list(Path(at_start(model)).to(1.0))
