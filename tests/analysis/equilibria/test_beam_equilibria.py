"""Equilibria of beams against solutions of the exact equations, and orders in space.

References are those of the rod's differential equations by shooting, to nine digits.
"""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.vector import ZERO
from msahl.analysis.equilibria.equilibrium import search_start, solve
from msahl.analysis.equilibria.load_path import Path, grown
from msahl.analysis.equilibria.search import find
from msahl.analysis.equilibria.stability import is_stiff, stability
from msahl.analysis.equilibria.static_equations import Statics
from msahl.analysis.linearised.point import at_start
from msahl.analysis.modes.solution import modes
from msahl.elements.beams.build import build_beam
from msahl.model import ConcentratedLoad, Joint
from tests.support.beams import arc, section, straight
from tests.support.models import GROUND, build_model

RIGID = np.inf
NINE_DIGITS = 1e-9
"""To which the references are given, with some units of the last digit."""


def clamped(line, stiffness, force=ZERO, moment=ZERO):
    """A beam clamped at its first node, with a dead load at its last one."""
    beam, nodes = build_beam("Beam", line, section(stiffness))
    clamp = Joint("Clamp", "rigid", GROUND.name, nodes[0].name, ZERO, ZERO)
    load = ConcentratedLoad(
        "Load", nodes[-1].name, ZERO, tuple(force), GROUND.name, tuple(moment), GROUND.name
    )
    return replace(build_model(nodes, [clamp], [load]), beams=(beam,))


def tip(model):
    """Position (3,) and axes (3, 3) of the last node in equilibrium, and iterations."""
    from msahl.algebra.rotation import matrix
    from msahl.algebra.vector import at

    point = at_start(model)
    rest = grown(Statics(point.system, point.state), point.state)
    assert rest.converged
    last = len(model.bodies) - 1
    return rest.state.x[last], np.array(matrix(at(rest.state.p, last))), rest.iterations


def bend(degree, elements, load, shear=5.0 / 6.0):
    """The 45 degree bend of Bathe and Bolourchi, of a square section of 1 by 1 and J = 1/6."""
    E = 1e7
    stiffness = (E, shear * E / 2, shear * E / 2, E / 2 / 6, E / 12, E / 12)
    return clamped(arc(degree, elements, 100.0, np.pi / 4), stiffness, (0.0, 0.0, load))


@pytest.mark.parametrize(
    ("load", "shear", "expected"),
    [
        (450.0, 5 / 6, (52.23826185, 18.50806488, 48.50349153)),
        (600.0, 5 / 6, (47.15009624, 15.68468948, 53.47547800)),
        (600.0, 1.0, (47.15043857, 15.68480053, 53.47485879)),
    ],
)
def test_the_45_degree_bend_agrees_to_nine_digits(load, shear, expected):
    found, _, iterations = tip(bend(4, 8, load, shear))
    assert np.abs(found / expected - 1.0).max() <= NINE_DIGITS
    assert iterations <= 8


@pytest.mark.slow
def test_the_error_in_space_falls_with_twice_the_degree():
    exact = tip(bend(5, 6, 600.0))[0]
    for degree, elements in ((1, (16, 32)), (2, (8, 16)), (3, (4, 8))):
        coarse, fine = (np.abs(tip(bend(degree, n, 600.0))[0] - exact).max() for n in elements)
        # The slopes of finite elements approach 2 p; the last ones are within 6 % of it.
        assert np.log2(coarse / fine) == pytest.approx(2 * degree, rel=0.06)


@pytest.mark.parametrize(
    ("load", "expected"),
    [
        (1.0, (0.3017207738, 0.0564332363, 0.4613519497)),
        (5.0, (0.7137915236, 0.3876283607, 1.2153681176)),
    ],
)
def test_the_elastica_without_stretch_and_shear(load, expected):
    """Of length 1 and EI = 1: deflection, shortening and angle of the tip."""
    model = clamped(straight(4, 10), (RIGID, RIGID, RIGID, 1.0, 1.0, 1.0), (0.0, 0.0, load))
    x, axes, _ = tip(model)
    found = (x[2], 1.0 - x[0], np.arctan2(axes[2, 0], axes[0, 0]))
    assert np.abs(np.array(found) / expected - 1.0).max() <= NINE_DIGITS


@pytest.mark.slow
@pytest.mark.parametrize(("circles", "most"), [(1, 3e-7), (2, 6e-5)])
def test_a_moment_rolls_a_beam_up_to_circles(circles, most):
    """Of degree 4 with 8 elements: a full circle by the moment 2 pi EI/L, two by twice that. The
    error of a circle of 16 elements is that of two circles of 32, and falls with the order 8.
    """
    moment = (0.0, 0.0, 2.0 * np.pi * circles)
    closed = [
        tip(clamped(straight(4, n), (RIGID, RIGID, RIGID, 1.0, 1.0, 1.0), moment=moment))[0]
        for n in (8, 12)
    ]
    coarse, fine = (np.linalg.norm(x) for x in closed)
    assert coarse <= most
    assert np.log(coarse / fine) / np.log(1.5) == pytest.approx(8.0, abs=1.0)


PRINCETON = {
    (0, 4.448): (-3.38986e-5, -0.0053582194, 0.0),
    (15, 8.896): (-0.0022484638, -0.0106435814, 0.0421924486),
    (45, 4.448): (-0.0037482084, -0.0039764338, 0.0560635007),
    (45, 8.896): (-0.0144118248, -0.0089791967, 0.1091131153),
    (75, 8.896): (-0.0245860655, -0.0036219787, 0.1422181699),
    (90, 8.896): (-0.0260214828, 0.0, 0.1462523572),
}


@pytest.mark.parametrize("case", PRINCETON)
def test_the_princeton_beam_bends_and_twists(case):
    """Stiff along z, soft along y; the load has an angle to the stiff direction."""
    angle, load = np.radians(case[0]), case[1]
    stiffness = (2842069.4426, 1084759.3292, 1084759.3292, 2.925744068, 36.2855194, 2.428871804)
    force = (0.0, load * np.sin(angle), -load * np.cos(angle))
    found, _, _ = tip(clamped(straight(4, 6, length=0.508), stiffness, force))
    expected = np.array(PRINCETON[case])
    moved = np.array([found[0] - 0.508, found[2], found[1]])
    # Ten decimals are given.
    assert np.abs(moved - expected).max() <= 1e-9 * max(1.0, np.abs(expected).max()) + 1e-10


def test_bending_and_torsion_by_moments_at_the_tip():
    """Nachbagauer 2013, 0.2 by 0.4; of ANSYS's figures four to five digits are given."""
    E, G, h, w = 2.07e11, 2.07e11 / 2.6, 0.2, 0.4
    A, along_h, along_w = h * w, w * h**3 / 12.0, h * w**3 / 12.0
    torsion = 0.5768 * G * (along_h + along_w)
    stiffness = (E * A, 0.8331 * G * A, 0.7961 * G * A, torsion, E * along_w, E * along_h)
    found, _, _ = tip(clamped(straight(4, 4, length=2.0), stiffness, moment=(0.5e6, 2e6, 0.0)))
    assert found - (2.0, 0.0, 0.0) == pytest.approx((-1.0944e-4, -1.8644e-4, -1.81174e-2), rel=5e-5)


def test_eulers_column_buckles_at_its_load():
    """pi^2 EI/(4 L^2) for a column clamped at its foot, without stretch and shear, on both sides
    at once. Elements of degree 4 have the load to the order 8.
    """
    load = (-2.0 * np.pi**2 / 4.0, 0.0, 0.0)
    model = clamped(straight(4, 4), (RIGID, RIGID, RIGID, 1.0, 1.0, 1.0), load)
    critical = [point for point in Path(at_start(model)).to(1.0) if point.kind]
    assert critical[0].kind == "bifurcation"
    assert critical[0].factor == pytest.approx(0.5, rel=1e-8)


@pytest.mark.slow
def test_a_cantilever_buckles_sideways():
    """Under a force at its tip in the stiff plane: P = 4.0126 sqrt(EI GJ)/L^2 (Timoshenko) where
    the stiff bending is rigid: 4.012599344.
    """
    model = clamped(straight(4, 4), (RIGID, RIGID, RIGID, 1.0, RIGID, 1.0), (0.0, 0.0, -5.0))
    critical = [point for point in Path(at_start(model)).to(1.0) if point.kind]
    assert 5.0 * critical[0].factor == pytest.approx(4.012599344, rel=1e-6)


@pytest.mark.parametrize(("kind", "flat"), [("rigid", 0), ("revolute", 1)])
def test_a_slender_beam_has_stiffness_in_all_directions_but_that_of_its_joint(kind, flat):
    """A steel strip of 1 m by 30 mm by 3 mm: with its rotary inertia per mass of 7.5e-7 m^2 the
    squares of its frequencies spread by more than 1e9.
    """
    stiffness = (1.89e7, 6e6, 6e6, 21.0, 14.175, 1417.5)
    of = section(stiffness, mass=0.7065, inertia=(5.4e-5, 5.3e-7, 5.3e-5))
    beam, nodes = build_beam("Beam", straight(3, 4), of)
    joint = Joint("Clamp", kind, GROUND.name, nodes[0].name, ZERO, ZERO)
    model = build_model(nodes, [joint], beams=(beam,))
    assert solve(at_start(model), np.zeros(3)).flat == flat


@pytest.mark.parametrize(("load", "angle"), [(2.0, 10.0), (1.0, 45.0), (0.0, 0.0)])
def test_small_loads_on_a_stiff_beam_have_an_equilibrium(load, angle):
    """Forces by strains alone would have a round-off of 1e-9 of the largest force."""
    angle = np.radians(angle)
    stiffness = (2842069.4426, 1084759.3292, 1084759.3292, 2.925744068, 36.2855194, 2.428871804)
    force = (0.0, load * np.sin(angle), -load * np.cos(angle))
    found = find(search_start(clamped(straight(4, 8, length=0.508), stiffness, force)), np.zeros(3))
    assert found is not None
    assert found.place.balance.relative <= 1e-14
    (reaction,) = found.place.point.state.reaction
    # The force of the ground on the beam, and its moment about the clamp.
    x = found.place.point.state.x[-2]
    assert reaction[:3] == pytest.approx(-np.array(force), abs=1e-9)
    assert reaction[3:] == pytest.approx(-np.cross(x, force), abs=1e-9)


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_positive_stiffness_is_one_of_a_column_below_its_buckling_load(share):
    """Whose other eigenvalues are the same: the growth is that of the vibrations."""
    load = (-share * np.pi**2 / 4.0, 0.0, 0.0)
    found = find(
        search_start(clamped(straight(4, 2), (RIGID,) * 3 + (1.0,) * 3, load)), np.zeros(3)
    )
    point = found.place.point
    assert is_stiff(point) == (share < 1.0)
    assert stability(point).startswith("stable" if share < 1.0 else "unstable")
    growth = modes(point).value.real.max()
    assert (growth <= 1e-6) == (share < 1.0)
