"""Steps by tolerance end at breakpoints, of time and of quantities, and follow driven motions."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from msahl.algebra.functions import Law
from msahl.algebra.vector import ZERO
from msahl.model import ConcentratedLoad, Joint
from msahl.model.loads import JointSpring
from msahl.run.subsystem import SubsystemIntegrator
from tests.schemes.collocation.test_step_control import adaptive
from tests.support.models import (
    GROUND,
    body,
    build_model,
    deck,
    friction,
    pendulum,
)
from tests.support.models import (
    simulate_and_estimate as simulate,
)

TOLERANCES = [1e-3, 1e-6, 1e-9]
RAIL = Joint("Rail", "prismatic", GROUND.name, "Bob", ZERO, ZERO)


def push(force, *times):
    """A triangle of ``force`` over three times."""
    law = Law("linear", (*times, 0.0, 1.0, 0.0))
    return ConcentratedLoad("Push", "Bob", ZERO, (force, 0.0, 0.0), GROUND.name, ZERO,
                            GROUND.name, law)  # fmt: skip


PULSES = {
    "3 ms on a pendulum": pendulum(loads=[push(100.0, 2.7301, 2.7316, 2.7331)]),
    "on what is at rest until then": pendulum(0.0, loads=[push(1.0, 4.0, 4.15, 4.3)]),
}


@pytest.mark.parametrize("name", PULSES)
def test_a_pulse_is_met_however_long_the_steps_before(name):
    model = PULSES[name]
    # Fixed steps of order 4 with the exact impulse: within 1e-10 m of ten times as many.
    known = simulate(model, dt=5e-4, t_final=6.0, scheme="gauss2", every=20).of("position")
    for tolerance in TOLERANCES:
        run = simulate(adaptive(model, tolerance), dt=0.01, t_final=6.0)
        # A pendulum lets an error grow with time, to a few times what was added.
        assert np.abs(run.of("position") - known).max() <= 5.0 * tolerance
        assert run.report.steps < 200


def falling(*table):
    """A body that falls 4 m, on a rail, to a spring of this table."""
    half = len(table) // 2
    pad = JointSpring("Pad", "Rail", "slide", 0.0, 0.0, table=Law("linear", table))
    assert table[half - 1] == -4.0
    return build_model([body(position=ZERO)], [RAIL], [pad], gravity=(0.0, 0.0, -9.81))


@pytest.mark.slow
def test_a_ball_meets_the_spring_it_falls_on():
    """A table in two slopes, zero from 4 m below upwards: three bounces in 6 s. No energy is lost,
    so the ball comes back to where it began, and energy gives its lowest place.
    """
    model = falling(-4.5, -4.2, -4.0, -2400.0, -600.0, 0.0)
    known = simulate(adaptive(model, 1e-12), dt=0.01, t_final=6.0).of("position")[:, 2]
    assert known.max() <= 1e-12  # never above the start
    # 3e-3, 5e-4, 3e-4: there the secant began with a rate that was wrong, and found no level.
    for tolerance, full in product((*TOLERANCES, 3e-3, 5e-4, 3e-4), (False, True)):
        run = simulate(adaptive(model, tolerance), dt=0.01, t_final=6.0, full=full)
        # An error in speed is one of time at the next bounce, and twice the speed times it then.
        assert np.abs(run.of("position")[:, 2] - known).max() <= 10.0 * tolerance
        # The spring gives back what it took, as no step goes past a breakpoint.
        assert run.report.extremes["energyErrorMaxRelative"] <= max(1e-12, 0.1 * tolerance)
    # Energy gives the lowest place, ``rest`` below the second entry, where 60 J are stored.
    m, g = 2.0, 9.81
    rest = np.roots([3000.0, 600.0 - m * g, 60.0 - m * g * 4.2]).max()
    # Rows are 0.01 s apart: at most 0.005 s from the reversal, where a = 6000/m rest + 600/m - g.
    a = 3000.0 * rest + 300.0 - g
    assert 0.0 <= known.min() + 4.2 + rest <= 0.5 * a * 0.005**2 + 1e-9


def test_friction_stops_where_it_should():
    """A slide at 1 m/s under friction of 0.3 of its weight, risen at 1e-4 m/s: it stops after
    v^2/(2 mu g), less what the last creeping takes."""
    slide = Joint("Rail", "prismatic", GROUND.name, "Bob", ZERO, ZERO,
                  parent_axes=AXES, child_axes=AXES)  # fmt: skip
    rub = friction("Rub", "Rail", "slide", 0.3, 1.0, 1e-4)
    model = build_model([body(velocity=(1.0, 0.0, 0.0))], [slide], [rub], gravity=(0.0, 0.0, -9.81))
    run = simulate(adaptive(model, 1e-6), dt=0.01, t_final=1.0)
    assert run.report.status == "completed"
    # Friction is less than full below a few widths: 1e-4 m/s for 1e-4 s, and creeps on no more.
    assert run.of("position")[-1, 0] == pytest.approx(1.0 / (2 * 0.3 * 9.81), abs=2e-6)


AXES = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
"""A joint's axis, its z, along x."""


@pytest.mark.parametrize("scheme", ["auto", "radau"])
def test_driven_shafts_rotate_as_they_must(scheme):
    """Where all motion is prescribed steps are held by output between steps, by works, and by the
    rotation.
    """
    model = deck("universal")
    known = simulate(model, dt=1e-3, scheme="gauss4", every=2)
    for tolerance in TOLERANCES:
        run = simulate(adaptive(model, tolerance, scheme), every=1)
        assert run.report.verdict["word"] == "PASS", run.report.verdict["reasons"]
        # Rotations are errors of lengths of a quarter of a metre; output between steps are put on
        # the joints.
        wrong = np.abs(run.matrices() - known.matrices()).max()
        assert wrong <= max(10.0 * tolerance, 1e-11)
        # The shafts' energy is 0.1 J: what of it the motor gives and takes is as exact.
        work = np.abs(run.column("Motor.work") - known.column("Motor.work")).max()
        assert work <= max(10.0 * tolerance, 1e-9)


def test_a_step_after_one_that_went_beyond_all_numbers():
    """Reactions that friction depends on are iterated from those of the last attempt: not from its
    nan. The next attempt succeeds as the first
    one does.
    """
    model = deck("friction_slide")
    simulation = replace(model.simulation, scheme="gauss", degree=2)
    integrator = SubsystemIntegrator(replace(model, simulation=simulation), "newton", False, 4)
    method, h = integrator.stepper.method, 0.1 * simulation.dt
    before = integrator.stepper._saved()
    first = method.take_step(h, 0.1)
    assert first.converged
    integrator.stepper._go_back(before)
    method.subsystem.stages.reaction[:] = math.nan
    assert not method.take_step(h, 0.1).converged
    integrator.stepper._go_back(before)
    assert method.take_step(h, 0.1).converged
