"""Closed forms against the independent solution, and elliptic functions against their laws."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ellipj, ellipk

from msahl.deck import read_deck
from msahl.study.dynamics import Dynamics
from msahl.study.errors import state_errors
from msahl.study.independent import solve
from tests.support.closed_forms import recognise
from tests.support.closed_forms.elliptic import first_kind, jacobi, third_kind

SHORTEN = 0.02 if os.environ.get("NUMBA_DISABLE_JIT") else 1.0
"""Factor on the time of every comparison: plain Python takes some hundred times as long."""
DECKS = Path(__file__).parents[2] / "decks"
CLOSED = (
    "thesis/single_pendulum_45",
    "thesis/single_pendulum_89",
    "thesis/single_pendulum_135",
    "thesis/top_1",
    "thesis/top_2",
    "thesis/top_3",
    "basics/ballistic_cylinder",
    "basics/ballistic_point",
    "basics/ballistic_sphere",
    "basics/conical_pendulum",
    "basics/torque_free",
    "basics/us_units",
    "forces/slide_spring",
    "forces/spring_damper",
    "forces/torsional_spring",
)


def deck(name):
    return read_deck(DECKS / f"{name}.xml")


def compare(model, t_final=10.0):
    """Largest differences of the closed form and the independent solution, over the sizes."""
    exact, times = recognise(model), np.linspace(0.0, SHORTEN * t_final, 201)
    assert exact is not None
    dynamics = Dynamics(model)
    table = dynamics.publish(solve(dynamics, times, 1e-13))
    true = exact.states(times)
    # Frame by frame: lengths over the longest, speeds over the fastest; angles as they are.
    size = np.abs(true.reshape(len(times), -1, 4, 3)).max(axis=(0, 1, 3))
    sizes = dict(
        zip(("position", "orientation", "velocity", "angular_velocity"), size, strict=True)
    )
    sizes["orientation"] = 1.0
    apart = {k: e.max() / max(sizes[k], 1.0) for k, e in state_errors(table, true).items()}
    forces, expected = dynamics.forces(times, table), exact.forces(times)
    if forces.size:
        # A joint may bear nothing.
        apart["forces"] = np.abs(forces - expected).max() / max(np.abs(expected).max(), 1.0)
    return apart


@pytest.mark.parametrize("name", CLOSED)
def test_exact_and_independent_agree(name):
    # 1e-10: what a study of errors down to 1e-8 needs; both come to about 1e-12. Each pass of the
    # unstable axis multiplies round-off by about 1e3, so after the tumbling body's second one, at
    # 9.2 s, any two solutions are 1e-10 apart, at whatever tolerance.
    apart = compare(deck(name), 8.0 if name == "basics/torque_free" else 10.0)
    assert max(apart.values()) < 1e-10, apart


@pytest.mark.parametrize(
    "name", ["basics/loads", "basics/offset_body", "thesis/double_pendulum_45"]
)
def test_no_closed_form(name):
    assert recognise(deck(name)) is None


def oblique(model, axis, angle):
    """The model of one body, rotated as a whole."""
    from msahl.algebra.rotation import compose, from_axis_angle, matrix
    from msahl.algebra.vector import times

    rotation = from_axis_angle(axis, angle)
    R = matrix(rotation)
    (body,) = model.bodies
    rotated = replace(
        body, position=times(R, body.position), orientation=compose(rotation, body.orientation)
    )
    return replace(model, gravity=times(R, model.gravity), bodies=(rotated,))


@pytest.mark.parametrize("spin", [-0.5, 1.9, 4.0, -7.0], ids=lambda w: f"w={w}")
def test_pendulum_in_any_plane_from_any_speed(spin):
    # Below and above the rate at which it passes the top, both ways; B not at the mass centre.
    model = oblique(deck("thesis/single_pendulum_89"), (1.0, -2.0, 0.5), 1.1)
    (body,) = model.bodies
    moved = replace(body, angular_velocity=(0.0, spin, 0.0), r_BG=(0.3, 0.0, 0.4))
    apart = compare(replace(model, bodies=(moved,)))
    assert max(apart.values()) < 1e-10, apart


@pytest.mark.parametrize("w", [(0.3, 0.9, 2.0), (-0.4, 0.2, -6.0), (1.0, -1.5, 0.0)])
def test_top_under_oblique_gravity(w):
    model = oblique(deck("thesis/top_1"), (0.3, 1.0, -0.4), 2.0)
    (body,) = model.bodies
    apart = compare(replace(model, bodies=(replace(body, angular_velocity=w),)))
    assert max(apart.values()) < 1e-10, apart


@pytest.mark.parametrize(
    "w", [(3.0, 0.5, 0.2), (0.2, 0.5, -3.0), (-3.0, 1.0, 0.4), (1.0, 0.1, 3.0)]
)
def test_tumbling_about_either_axis(w):
    model = deck("basics/torque_free")
    (body,) = model.bodies
    moment = ((0.1, 0.01, 0.0), (0.01, 0.2, -0.02), (0.0, -0.02, 0.25))
    moved = replace(body, angular_velocity=w, inertia=moment)
    apart = compare(replace(model, bodies=(moved,)))
    assert max(apart.values()) < 1e-10, apart


@pytest.mark.parametrize("damping", [0.0, 3.0, 10.0, 20.0], ids=lambda c: f"c={c:g}")
@pytest.mark.parametrize("gravity", [(0.0, 0.0, 0.0), (1.0, -9.0, 4.0)], ids=["floating", "heavy"])
def test_a_block_on_a_rail_under_any_damping_and_weight(damping, gravity):
    model = deck("forces/slide_spring")
    spring = replace(model.loads[0], damping=damping, free=0.3, preload=-2.0)
    apart = compare(replace(model, loads=(spring,), gravity=gravity), 4.0)
    assert max(apart.values()) < 1e-10, apart


def test_a_wheel_off_its_axis_and_a_body_hung_on_a_spring():
    wheel = deck("forces/torsional_spring")
    (body,), (hinge,) = wheel.bodies, wheel.joints
    off = replace(
        body,
        r_BG=(0.3, -0.2, 0.1),
        inertia=((0.3, 0.02, 0.01), (0.02, 0.4, 0.03), (0.01, 0.03, 0.5)),
    )
    down = tuple(9.0 * a for a in hinge.parent_axes[2])
    assert max(compare(replace(wheel, bodies=(off,), gravity=down)).values()) < 1e-10
    assert recognise(replace(wheel, bodies=(off,), gravity=(1.0, 2.0, 3.0))) is None
    hung = replace(deck("forces/spring_damper"), gravity=(9.0, 0.0, 0.0))
    assert max(compare(hung).values()) < 1e-10
    assert recognise(replace(hung, gravity=(9.0, 1.0, 0.0))) is None
    # Thrown so far back that it would pass the spring's other end.
    (bob,) = hung.bodies
    assert recognise(replace(hung, bodies=(replace(bob, velocity=(-30.0, 0.0, 0.0)),))) is None


def test_model_of_two_closed_forms_is_exact():
    top, ball = deck("thesis/top_1"), deck("basics/ballistic_sphere")
    both = replace(top, bodies=top.bodies + ball.bodies)
    assert recognise(both) is not None
    apart = compare(both, 2.0)
    assert max(apart.values()) < 1e-10, apart


@pytest.mark.parametrize("m", [0.0, 0.3, 0.99])
def test_jacobi(m):
    u = np.linspace(-30.0, 30.0, 101)
    ours, theirs = jacobi(u, m, 1.0 - m), ellipj(u, m)
    for a, b in zip(ours[1:], theirs[:3], strict=True):
        # |u| = 30 carries round-off of 30 eps into the phase; scipy's own error is as large.
        np.testing.assert_allclose(a, b, atol=1e-13)


def test_integrals():
    m, n = 0.7, -0.8
    for phi in (0.4, 1.5, 2.0, -4.0):

        def first(a):
            return 1.0 / np.sqrt(1.0 - m * np.sin(a) ** 2)

        def third(a):
            return first(a) / (1.0 - n * np.sin(a) ** 2)

        # quad is good to about 1e-14 of integrals near 1.
        assert first_kind(phi, 1.0 - m) == pytest.approx(quad(first, 0.0, phi)[0], rel=1e-12)
        value = third_kind(np.array([phi]), n, 1.0 - n, 1.0 - m)[0]
        assert value == pytest.approx(quad(third, 0.0, phi)[0], rel=1e-12)
    assert first_kind(np.pi / 2, 1.0 - m) == pytest.approx(ellipk(m), rel=1e-14)
