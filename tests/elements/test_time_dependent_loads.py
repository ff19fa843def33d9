"""Loads by laws of time: their impulse and their work are exact at any step."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import legendre

from msahl.algebra.functions import MOMENTS, Law, build_laws, evaluate, moments
from msahl.algebra.vector import ZERO
from msahl.model import ConcentratedLoad
from tests.support.models import GROUND, body, build_model, pendulum, simulate

FORCE = 1000.0
PULSE = Law("linear", (0.1312, 0.1313, 0.1314, 0.0, 1.0, 0.0))
"""0.2 ms within a step of 0.01 s, and between all nodes of gauss and radau."""


def sine(frequency, phase=0.0):
    return Law("sine", (1.0, 2.0 * math.pi * frequency, phase, 0.0))


def push(law, moment=ZERO, **others):
    """A free body of 1 kg under a force along x times ``law``."""
    load = ConcentratedLoad("Push", "Bob", ZERO, (FORCE, 0.0, 0.0), GROUND.name, moment,
                            GROUND.name, law)  # fmt: skip
    return build_model([body(mass=1.0, inertia=(0.1, 0.2, 0.3))], loads=[load], **others)


def exact(law, t):
    """Velocity and position of the free body at ``t``."""
    if law is PULSE:
        return FORCE * 1e-4, FORCE * 1e-4 * (t - 0.1313)
    _, w, p, _ = law.numbers
    v = (math.cos(p) - math.cos(w * t + p)) / w
    return FORCE * v, FORCE * (math.cos(p) * t - (math.sin(w * t + p) - math.sin(p)) / w) / w


LAWS = {
    "one period a step": sine(100.0, math.pi / 2.0),
    "one period a step, drifting": sine(100.0),
    "four periods a step": sine(400.0, math.pi / 2.0),
    "a pulse": PULSE,
    "resolved": sine(3.3, 0.2),
}


@pytest.mark.parametrize("scheme", ["preserving", "gauss2", "gauss3", "gauss5", "radau2", "radau3"])
@pytest.mark.parametrize("name", LAWS)
def test_a_free_body_goes_where_the_load_takes_it(name, scheme):
    law = LAWS[name]
    run = simulate(push(law), dt=0.01, scheme=scheme)
    v, x = exact(law, 1.0)
    # A hundred steps whose impulses are up to 10 N s, each known to a few machine epsilons.
    assert run.of("velocity")[-1, 0] == pytest.approx(v, abs=1e-12)
    assert run.of("position")[-1, 0] == pytest.approx(x, abs=1e-12)
    # Work in a step is up to the square of its impulse over 2 m, 50 J.
    extremes = run.report.extremes
    assert extremes["energyErrorMax"] <= 1e-12 * max(50.0, extremes["largestKineticEnergy"])
    if scheme[:5] != "radau":  # which takes from what varies within a step
        assert run.column("Push.work")[-1] == pytest.approx(0.5 * v * v, abs=1e-10)


@pytest.mark.parametrize("scheme", ["decaying", "gauss1", "radau1"])
@pytest.mark.parametrize("name", LAWS)
def test_the_impulse_is_exact_by_every_scheme(name, scheme):
    """Their displacements are of their own order."""
    law = LAWS[name]
    run = simulate(push(law), dt=0.01, scheme=scheme)
    assert run.of("velocity")[-1, 0] == pytest.approx(exact(law, 1.0)[0], abs=1e-12)


def test_loads_of_the_same_law_share_the_work_by_their_forces():
    """Of a force and one twice as large, at the same point."""
    model = push(LAWS["resolved"])
    (load,) = model.loads
    other = replace(load, name="Other", force=(2.0 * FORCE, 0.0, 0.0))
    run = simulate(replace(model, loads=(load, other)), dt=0.02, t_final=0.1, error="off")
    one, two = run.column("Push.work"), run.column("Other.work")
    assert one[-1] > 1e3
    # Round-off of five steps.
    assert two == pytest.approx(2.0 * one, rel=1e-13)


def test_a_moment_rotates_a_free_body_as_exactly():
    law = sine(100.0)
    model = push(law, moment=(0.0, 0.0, 0.3 * FORCE))
    run = simulate(model, dt=0.01, t_final=0.3)
    v, x = exact(law, 0.3)
    assert run.of("spin")[-1, 2] == pytest.approx(v, abs=1e-12)
    # One rotation increments by 2 atan(Q/2), Q = h times the mean spin and the offset: 2e-7 of a
    # revolution less.
    q = exact(law, 0.01)[1]
    rotated = 30 * 2.0 * math.atan(q / 2.0)
    assert 4.0 * math.atan(run.of("orientation")[-1, 2] / 4.0) == pytest.approx(rotated, abs=1e-12)
    assert rotated == pytest.approx(x, rel=1e-4)


def bent(law, scheme, dt):
    """Where a pendulum ends under a load that rotates with it, across and along the arm."""
    load = ConcentratedLoad("Push", "Bob", (0.0, 0.0, 0.5), (40.0, 0.0, 30.0), "Bob", ZERO,
                            GROUND.name, law)  # fmt: skip
    model = pendulum(loads=[load])
    return simulate(model, dt=dt, t_final=0.8, scheme=scheme)


@pytest.mark.parametrize("law", [sine(60.0), PULSE], ids=["aliased", "pulse"])
def test_a_held_body_keeps_its_energy_balance_and_its_joint(law):
    """The offset by the load's first moment is one that joints allow, and its work is counted."""
    run = bent(law, "preserving", 0.02)
    extremes = run.report.extremes
    # Round-off of 40 steps.
    assert extremes["energyErrorMaxRelative"] <= 1e-12
    assert extremes["constraintViolationMax"] <= 1e-12
    # Unless joints were asked, the first moment along the arm would open this one at up to 2 h c_1
    # f/m = 0.1 m/s. What is left is by how far the arm rotations in a step, 0.02 rad.
    assert extremes["constraintViolationRateMax"] <= 2e-3


@pytest.mark.parametrize(("scheme", "order"), [("preserving", 2), ("gauss2", 4), ("radau2", 3)])
def test_smooth_laws_leave_a_scheme_its_order(scheme, order):
    law = sine(1.5, 0.4)
    truth = bent(law, "gauss5", 0.02).of("position")[-1]
    errors = [np.abs(bent(law, scheme, dt).of("position")[-1] - truth).max() for dt in (0.04, 0.02)]
    # As tests/schemes/test_orders.py has it of other models, where it fits over more steps.
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)


BREAKS = (0.1, 0.5, 0.7, 1.6, 1.7)
EVERY = (
    Law("constant", (3.0,)),
    Law("polynomial", (1.0, -2.0, 0.3, 0.5)),
    Law("sine", (2.0, 7.0, 0.3, 0.5)),
    Law("ramp", (1.0, 4.0, 0.5, 1.7)),
    *(Law(kind, (*BREAKS, 1.0, -2.0, 0.3, 2.0, 1.0)) for kind in ("linear", "cubic", "periodic")),
)


@pytest.mark.parametrize("law", EVERY, ids=lambda law: law.kind)
@pytest.mark.parametrize(
    ("a", "d"), [(0.3, 0.01), (0.2, 2.5), (-1.0, 7.0), (2.0, -1.9), (5.0, 1e-9)]
)
def test_moments_are_those_of_the_values(law, a, d):
    """Against quadrature between all breaks."""
    laws, basis = build_laws([law]), legendre.Legendre.basis
    breaks = np.add.outer(1.6 * np.arange(-3, 6), BREAKS).ravel()
    ends = np.linspace(0.0, 1.0, 41)
    ends = np.union1d(ends, np.clip((breaks - a) / d, 0.0, 1.0))
    x, w = legendre.leggauss(10)
    size = 0.5 * np.diff(ends)[:, None]
    x, w = (ends[:-1, None] + size * (x + 1.0)).ravel(), (size * w).ravel()
    values = np.array([evaluate(laws, 0, a + d * part)[0] for part in x])
    wanted = [w @ (values * basis(k)(2.0 * x - 1.0)) for k in range(MOMENTS)]
    # Sums of some hundred values of size up to 3, their arguments known to a machine epsilon.
    np.testing.assert_allclose(moments(laws, 0, a, d), wanted, atol=2e-14 * np.abs(values).max())


def test_the_moments_of_many_periods_are_those_of_their_sum():
    """However many they are: 4e9 periods take no longer than three."""
    law = Law("periodic", (*BREAKS, 1.0, -2.0, 0.3, 2.0, 1.0))
    laws = build_laws([law])
    few = moments(laws, 0, 0.1, 1.6)
    many = moments(laws, 0, 0.1, 1.6 * 2.0**32)
    assert many[0] == pytest.approx(few[0], rel=1e-14)
    assert np.abs(many[1:]).max() <= 1e-8  # of one period in 4e9


def test_a_sine_of_any_frequency_loses_no_digits():
    """Of a step of 0.1 rad and one of a million, against the closed form in long numbers."""
    for omega in (1.0, 19.0, 21.0, 1e3, 1e7):
        law = Law("sine", (1.0, omega, 0.25, 0.0))
        w, a, d = np.longdouble(omega), np.longdouble(0.3), np.longdouble(0.1)
        p = np.longdouble(0.25)
        wanted = (np.cos(w * a + p) - np.cos(w * (a + d) + p)) / (w * d)
        # The phase itself is known to a machine epsilon of its own size.
        error = 4e-16 * max(2.0, 0.1 * omega)
        found = moments(build_laws([law]), 0, 0.3, 0.1)[0]
        assert found == pytest.approx(float(wanted), abs=error)
