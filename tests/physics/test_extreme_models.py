"""Models far from what a step resolves, or from each other's size: they run, and stay bounded."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.algebra.vector import ZERO, times
from msahl.model.scheme import ORDER_TWO
from tests.schemes.midpoint.test_decaying import energies, oscillator
from tests.support.closed_forms import recognise
from tests.support.models import DOWN, chain, deck, pendulum, simulate, tensor

every_scheme = pytest.mark.parametrize("scheme", ORDER_TWO)
HEIGHT = (0.0, 0.0, 0.2)
TILT = 1e-3


@every_scheme
@pytest.mark.parametrize("spin", [1e3, 1e4, 1e5])
def test_a_sleeping_top_sleeps_however_many_revolutions_a_step(spin, scheme):
    """Ten to a thousand radians a step of 1 ms: it precesses at m g a / (C w), tilted as it was."""
    model = deck("top_1")
    rotation = from_axis_angle((1.0, 0.0, 0.0), TILT)
    (body,) = model.bodies
    body = replace(
        body,
        position=times(matrix(rotation), HEIGHT),
        orientation=rotation,
        velocity=ZERO,
        angular_velocity=(0.0, 0.0, spin),
    )
    run = simulate(replace(model, bodies=(body,)), dt=1e-3, t_final=2.0, scheme=scheme)
    assert (run.report.status, run.report.subdivisions) == ("completed", 0)
    assert run.report.extremes["energyErrorMaxRelative"] < 1e-12
    x = run.of("position")
    # Nutation for the start's missing precession: its angle squared, 2e-13 at 1e3 rad/s.
    assert np.ptp(x[:, 2]) < 1e-12
    rate = 1.0 * 3.0 * 0.2 / (0.75 * spin)
    precession = np.arctan2(x[-1, 0] - x[0, 0], -x[-1, 1])
    # The discrete nutation, one rotation of some 2e-8 rad a step, is 1e-3 of the displacement.
    assert abs(precession) == pytest.approx(2.0 * rate, rel=2e-2)


@every_scheme
@pytest.mark.parametrize("ratio", [1e-6, 1e-3, 1e3, 1e6])
def test_a_chain_of_light_and_heavy_links_swings(ratio, scheme):
    model = chain(5)
    bodies = list(model.bodies)
    for i in (1, 3):
        own = bodies[i]
        bodies[i] = replace(
            own, mass=ratio * own.mass, inertia=tensor(ratio * np.array(own.inertia))
        )
    model = replace(model, bodies=tuple(bodies), gravity=DOWN)
    run = simulate(model, dt=0.01, t_final=10.0, scheme=scheme)
    assert (run.report.status, run.report.subdivisions) == ("completed", 0)
    assert run.report.extremes["energyErrorMaxRelative"] < 1e-12
    assert run.report.extremes["constraintViolationMax"] < 1e-12


@every_scheme
@pytest.mark.parametrize("solver", ["newton", "auto"])
def test_a_spring_with_a_period_of_a_millionth_of_the_step_is_bounded(scheme, solver):
    given = {"dt": 0.01, "t_final": 1000.0, "every": 1000, "scheme": scheme, "solver": solver}
    run = simulate(oscillator(1e-8), **given)
    assert (run.report.status, run.report.steps) == ("completed", 100_000)
    energy = energies(run)
    # 1e5 steps, each solved to 1e-14 of its forces.
    assert energy.max() <= energy[0] * (1.0 + 1e-9)
    if scheme == "preserving":
        assert energy.min() >= energy[0] * (1.0 - 1e-9)


@pytest.mark.slow
def test_a_million_steps_of_a_pendulum():
    run = simulate(pendulum(), dt=0.002, t_final=2000.0, every=10_000, solver="newton")
    assert run.report.steps == 1_000_000
    # Asked for; it comes to 1e-12 and 6e-13 m.
    assert run.report.extremes["energyErrorMaxRelative"] < 1e-10
    assert run.report.extremes["constraintViolationMax"] < 1e-9


@pytest.mark.parametrize("h", [1e-4, 1e-5, 1e-6])
def test_reactions_are_not_lost_in_noise_at_small_steps(h):
    """Multipliers are forces times h^2/2m: of 1e-11 m at 1e-6 s. Asked for are 1e-5 N."""
    model = pendulum(arm=(0.0, 0.0, 1.0))
    run = simulate(model, dt=h, t_final=2000 * h, solver="newton")
    middle = run.time[1:] - 0.5 * h
    assert np.abs(run.force()[1:] - recognise(model).forces(middle)).max() < 1e-5
