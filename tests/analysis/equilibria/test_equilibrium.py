"""Equilibria that are known in closed form."""

import math
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from msahl.algebra.rotation import from_axis_angle
from msahl.algebra.vector import ZERO
from msahl.analysis.equilibria import search as equilibrium_search
from msahl.analysis.equilibria.equilibrium import solve
from msahl.analysis.equilibria.equilibrium_lines import lines
from msahl.analysis.equilibria.load_path import Path
from msahl.analysis.equilibria.search import all_equilibria, by_continuation, find
from msahl.analysis.equilibria.stability import growing, is_stable, stability
from msahl.analysis.linearised.coefficients import coefficients
from msahl.analysis.linearised.point import at_start
from msahl.analysis.modes.solution import modes
from msahl.model import Joint, JointSpring
from msahl.start.velocities import StartError
from tests.support.models import GROUND, body, build_model, deck, pendulum

REST = np.zeros(3)
ABOUT_Y = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def row_of_links(points, kind="spherical"):
    """Slender links of 1 kg/m along x of their own axes, between supports at the ends; z is up."""
    bodies, lengths = [], []
    for k, (a, b) in enumerate(pairwise(points)):
        along = np.subtract(b, a)
        length = float(np.linalg.norm(along))
        J = np.diag([1e-3, 1.0 / 12.0, 1.0 / 12.0]) * length**3
        rotation = from_axis_angle((0.0, 1.0, 0.0), float(-np.arctan2(along[2], along[0])))
        middle = tuple(float(x) for x in 0.5 * np.add(a, b))
        bodies.append(body(f"L{k}", length, J, middle, orientation=rotation))
        lengths.append(length)
    names = [GROUND.name, *(link.name for link in bodies), GROUND.name]
    first, last = (tuple(float(x) for x in points[k]) for k in (0, -1))
    joints = []
    for k in range(len(points)):
        here = first if k == 0 else (0.5 * lengths[k - 1], 0.0, 0.0)
        there = last if k == len(bodies) else (-0.5 * lengths[k], 0.0, 0.0)
        axes = (ABOUT_Y, ABOUT_Y) if kind == "revolute" else ()
        joints.append(Joint(f"J{k}", kind, names[k], names[k + 1], here, there, *axes))
    return build_model(bodies, joints, gravity=(0.0, 0.0, -9.81))


def test_two_bars_between_supports_have_both_equilibria():
    knee = np.sqrt(1.0 - 0.75**2)
    assert knee == pytest.approx(0.6614378278, abs=6e-11)
    start = at_start(row_of_links([(0.0, 0.0, 0.0), (0.75, 0.0, knee), (1.5, 0.0, 0.0)]))
    found = all_equilibria(start, REST, 4)
    heights = [2.0 * s.place.point.state.x[0, 2] for s in found]
    assert len(found) == 2
    for height in (knee, -knee):
        (at,) = np.flatnonzero(np.abs(np.array(heights) - height) <= 1e-12)
        # Each bar spins freely about itself.
        assert found[at].flat == 2
        assert stability(found[at].place.point).startswith("stable" if height < 0 else "unstable")


@pytest.mark.slow
def test_rods_on_spherical_joints_hang_and_stand_in_four_ways():
    rods = row_of_links([(0.0, 0.0, 0.0), (0.6, 0.0, -0.8), (1.2, 0.0, -1.6)])
    free = replace(rods, joints=rods.joints[:2])
    found = all_equilibria(at_start(free), REST, 8)
    # Heights of the two mass centres, of rods of 1 m.
    # Newton's method ends near round-off, 1e-15; nine digits are those that order the pairs.
    heights = sorted(tuple(s.place.point.state.x[:2, 2].round(9)) for s in found)
    assert heights == [(-0.5, -1.5), (-0.5, -0.5), (0.5, 0.5), (0.5, 1.5)]


def catenary(links, kind="spherical"):
    """Links that hang in a triangle between supports two thirds of their length apart."""
    span = links * 2.0 / 3.0
    depth = np.sqrt((links / 2) ** 2 - (span / 2) ** 2)
    part = np.linspace(0.0, 1.0, links // 2 + 1)
    left = np.column_stack([part * span / 2, 0.0 * part, -depth * part])
    right = left[-2::-1] * [-1.0, 1.0, 1.0] + [span, 0.0, 0.0]
    return row_of_links([*left, *right], kind), span


@pytest.mark.slow
@pytest.mark.parametrize(
    ("links", "kind", "iterations"),
    [
        (10, "revolute", 10),
        (10, "spherical", 10),
        (100, "revolute", 15),
        (100, "spherical", 15),
        (1000, "spherical", 20),
    ],
)
def test_catenary_of_links(links, kind, iterations):
    model, span = catenary(links, kind)
    solution = find(at_start(model), REST)
    assert solution.iterations <= iterations
    exact = exact_catenary(links, span)
    found = solution.place.point.state.x[:links][:, [0, 2]]
    assert np.abs(found - exact).max() <= 1e-10 * links
    assert is_stable(solution.place.point)


@pytest.mark.parametrize(("links", "kind"), [(4, "revolute"), (10, "spherical")])
def test_motions_that_grow_are_counted_without_eigenvalues(links, kind):
    """An arch, the catenary under reversed gravity, against the eigenvalues."""
    model, _ = catenary(links, kind)
    state = find(at_start(model), REST).place.point.state
    bodies = tuple(
        replace(body, position=tuple(x), orientation=tuple(p))
        for body, x, p in zip(model.bodies, state.x.tolist(), state.p.tolist(), strict=False)
    )
    arch = at_start(replace(model, bodies=bodies, gravity=(0.0, 0.0, 9.81)))
    growth = modes(arch).value.real
    found = coefficients(arch.system, arch.state)
    for rate in (1e-3, 1.0, 0.999 * growth.max(), 1.001 * growth.max()):
        assert growing(found, rate) == np.count_nonzero(growth > rate)


def test_the_stability_of_a_large_model_is_counted():
    model, _ = catenary(102)
    point = find(at_start(model), REST).place.point
    assert stability(point).startswith("stable, no motion grows faster than")
    bodies = tuple(
        replace(body, position=tuple(x), orientation=tuple(p))
        for body, x, p in zip(
            model.bodies, point.state.x.tolist(), point.state.p.tolist(), strict=False
        )
    )
    arch = at_start(replace(model, bodies=bodies, gravity=(0.0, 0.0, 9.81)))
    assert "unstable in 2" in stability(arch)


def sprung_chain(links=3):
    """Level bars of 1 m with springs in their hinges, clamped at one end."""
    points = [(float(k), 0.0, 0.0) for k in range(links + 1)]
    model = row_of_links(points, "revolute")
    springs = [JointSpring(f"S{k}", f"J{k}", "angle", 200.0, 1.0) for k in range(links)]
    return replace(model, joints=model.joints[:-1], loads=tuple(springs))


def test_growing_loads_lead_to_the_equilibrium():
    start = at_start(sprung_chain())
    path = list(Path(start).to(1.0))
    factors, grown = [here.factor for here in path], by_continuation(start, REST)
    assert factors[0] == 0.0
    assert factors[-1] == 1.0
    assert factors == sorted(factors)
    other = solve(start, REST)
    assert grown.converged
    assert other.converged
    # Both are balanced to 1e-9 of a weight of 30 N, on springs of 200 N m.
    assert np.abs(grown.place.point.state.x - other.place.point.state.x).max() <= 1e-9
    assert np.abs(path[-1].state.x - other.place.point.state.x).max() <= 1e-9


def test_growing_loads_help_where_the_other_methods_fail(monkeypatch):
    def fails(*_):
        raise StartError("no")

    monkeypatch.setattr(equilibrium_search, "solve", fails)
    monkeypatch.setattr(equilibrium_search, "by_multipliers", fails)
    monkeypatch.setattr(equilibrium_search, "QUICK", 0)
    found = find(at_start(sprung_chain()), REST)
    assert found.method == equilibrium_search.CONTINUATION
    assert is_stable(found.place.point)


def exact_catenary(n, span):
    """(n, 2) middles of links of length and mass 1: horizontal tension h and vertical tensions that
    grow by the weight, tan(slope) = V/h at the middle of each link.
    """
    from scipy.optimize import brentq

    V = np.arange(n) - 0.5 * (n - 1)  # of the links' middles, in weights of a link

    def width(h):
        return np.sum(h / np.hypot(h, V)) - span

    h = brentq(width, 1e-6 * n, 1e3 * n, xtol=1e-15, rtol=1e-15)
    steps = np.column_stack([np.full(n, h), V]) / np.hypot(h, V)[:, None]
    ends = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    middles: np.ndarray = 0.5 * (ends[1:] + ends[:-1])
    return middles


def governor(degrees, length=0.5, h=0.2):
    """A ball on a rod, hinged to a shaft that rotates freely about z; both on one axis."""
    phi = np.radians(degrees)
    shaft = body("Shaft", 0.3, (0.01, 0.01, 0.001))
    place = (length * np.sin(phi), 0.0, h - length * np.cos(phi))
    rotation = from_axis_angle((0.0, 1.0, 0.0), float(-phi))
    ball = body("Ball", 2.0, 1e-3, place, orientation=rotation)
    z = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    joints = [
        Joint("Bearing", "revolute", GROUND.name, "Shaft", ZERO, ZERO, z, z),
        Joint(
            "Hinge",
            "revolute",
            "Shaft",
            "Ball",
            (0.0, 0.0, h),
            (0.0, 0.0, length),
            ABOUT_Y,
            ABOUT_Y,
        ),
    ]
    return build_model([shaft, ball], joints, gravity=(0.0, 0.0, -9.81))


@pytest.mark.parametrize("w", [5.0, 7.0])
def test_flyball_governor_has_the_angle_of_the_closed_form(w):
    spin = np.array([0.0, 0.0, w])
    start = at_start(governor(20.0))
    solution = solve(start, spin)
    assert solution.converged
    cosine = 9.81 / (w**2 * 0.5)
    drop = 0.2 - solution.place.point.state.x[1, 2]
    assert drop == pytest.approx(0.5 * cosine, abs=1e-13)
    found = modes(solution.place.point)
    assert found.equilibrium.holds
    assert np.allclose(found.equilibrium.axes, spin)
    # Below, the ball hangs on the axis, which is unstable at this speed.
    hanging = solve(at_start(governor(3.0)), spin, stable=False)
    assert hanging.place.point.state.x[1, 2] == pytest.approx(-0.3, abs=1e-12)
    assert stability(hanging.place.point).startswith("unstable")


def test_a_rotation_that_the_joints_prevent_is_refused():
    with pytest.raises(StartError, match="rotate steadily"):
        solve(at_start(governor(20.0)), np.array([1.0, 0.0, 0.0]))


@pytest.mark.parametrize("name", ["quarter_car", "actuator_pid", "robot"])
def test_machines_come_to_rest(name):
    solution = solve(at_start(deck(name)), REST)
    assert solution.converged
    found = modes(solution.place.point)
    assert found.equilibrium.holds
    assert stability(solution.place.point) == "stable, all motions are damped"


def test_suspension_carries_its_weight():
    model = deck("suspension")
    solution = solve(at_start(model), REST)
    assert solution.converged
    assert solution.place.balance.residual <= 1e-8
    # Four equal corners: tyres of 180 kN/m carry a quarter each, so the wheels move alike.
    state = solution.place.point.state
    wheels = [state.x[k, 2] for k, b in enumerate(model.bodies) if b.name.endswith("Wheel")]
    assert len(wheels) == 4
    assert np.ptp(wheels) <= 1e-12
    # Tyres are springs under pressure, on which the car is upright only while nothing tips it.
    assert stability(solution.place.point).startswith("unstable")


def test_pendulum_hangs_down_and_stands_up():
    found = all_equilibria(at_start(pendulum(45.0)), REST, 4)
    assert sorted(round(float(s.place.point.state.x[0, 2]), 12) for s in found) == [-5.0, 5.0]
    assert "moved" in "\n".join(lines(at_start(pendulum(45.0)), found))


@pytest.mark.slow
@pytest.mark.parametrize("angles", [(0.0, 0.0), (1.0, 2.0)])
def test_two_rods_on_hinges_have_four_equilibria(angles):
    """Standing, or anywhere: half a revolution of a hinge leads from one to the other."""
    rods, joints, parent, at, angle = [], [], GROUND.name, np.zeros(3), 0.0
    for name, more in zip("AB", angles, strict=True):
        angle += more
        along = np.array([math.sin(angle), 0.0, math.cos(angle)])
        rotation = from_axis_angle((0.0, 1.0, 0.0), angle)
        J = np.diag([0.1, 0.1, 0.01])
        rods.append(body(name, 1.0, J, tuple(at + 0.5 * along), orientation=rotation))
        hinge = (parent, name, (0.0, 0.0, 0.5 if joints else 0.0), (0.0, 0.0, -0.5))
        joints.append(Joint(f"Hinge{name}", "revolute", *hinge, ABOUT_Y, ABOUT_Y))
        parent, at = name, at + along
    start = at_start(build_model(rods, joints, gravity=(0.0, 0.0, -9.81)))
    found = all_equilibria(start, REST, 8)
    places = sorted(tuple(np.round(s.place.point.state.x[:2, 2], 9)) for s in found)
    assert places == [(-0.5, -1.5), (-0.5, -0.5), (0.5, 0.5), (0.5, 1.5)]
    # Places, displacements and angles are zero or as large as the rods.
    numbers = re.findall(r"-?\d[\d.e-]*(?=[,)]| m,| deg)", "\n".join(lines(start, found)))
    assert all(float(x) == 0.0 or abs(float(x)) > 1e-3 for x in numbers)


def test_a_direction_without_stiffness_is_not_damped():
    """A damper along a rail without a spring."""
    rail = Joint("Rail", "prismatic", GROUND.name, "B", ZERO, ZERO, ABOUT_Y, ABOUT_Y)
    damper = JointSpring("Damper", "Rail", "slide", 0.0, 2.0)
    start = at_start(build_model([body("B", 1.0, np.eye(3), ZERO)], [rail], loads=[damper]))
    head = lines(start, all_equilibria(start, REST, 1))
    assert "stable, all motions but those without stiffness are damped" in head[2]
    assert "1 direction without stiffness" in head[3]


def test_a_pendulum_that_begins_level_hangs_down():
    """Level, it has no stiffness at all: only the force says where to go."""
    bob = body("Bob", 2.0, np.diag([0.01, 0.02, 0.03]), (1.0, 0.0, 0.0))
    hinge = ("revolute", GROUND.name, "Bob", (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    model = build_model(
        [bob], [Joint("Hinge", *hinge, ABOUT_Y, ABOUT_Y)], gravity=(0.0, 0.0, -9.81)
    )
    found = solve(at_start(model), REST)
    assert found.converged
    assert found.place.point.state.x[0] == pytest.approx((0.0, 0.0, -1.0), abs=1e-12)


def test_models_without_equilibrium_have_none():
    model = build_model([body("Free")], gravity=(0.0, 0.0, -9.81))
    assert not all_equilibria(at_start(model), REST, 1)
    still = all_equilibria(at_start(replace(model, gravity=ZERO)), REST, 2)
    assert len(still) == 1
    assert still[0].flat == 6


def test_a_door_on_two_hinges_stays_where_it_is():
    """Its stiffness is round-off of terms of its weight that cancel: no mode grows by it."""
    s, c = np.sin(0.38), np.cos(0.38)
    axes = 2 * (((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),)
    rotation = from_axis_angle((0.0, 0.0, 1.0), 0.38)
    door = body("Door", 20.0, np.eye(3), (0.5 * c, 0.5 * s, 1.0), orientation=rotation)
    joints = [
        Joint(f"{z}", "revolute", GROUND.name, "Door", (0.0, 0.0, z), (-0.5, 0.0, z - 1.0), *axes)
        for z in (0.5, 1.5)
    ]
    start = at_start(build_model([door], joints, gravity=(0.0, 0.0, -9.81)))
    found = all_equilibria(start, REST, 2)
    assert len(found) == 1
    assert found[0].flat == 1
    assert np.abs(found[0].place.point.state.x - start.state.x).max() <= 1e-12
    assert modes(start).zeros == 2
    assert stability(start) == "neither stable nor unstable"
