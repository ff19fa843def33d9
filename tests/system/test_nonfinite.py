"""Numbers beyond what a computer holds: named by element, and in no table.

The check of a model refuses most of these numbers; here the run has to do without it.
"""

import numpy as np
import pytest

from msahl.algebra.vector import ZERO
from msahl.model import ConcentratedLoad, Joint, JointMotion, Law
from msahl.start.velocities import StartError
from tests.schemes.midpoint.test_decaying import oscillator
from tests.support.models import DOWN, GROUND, body, build_model, drag, pendulum, simulate

SOLVERS = ("newton", "auto", "root")
every_solver = pytest.mark.parametrize("solver", SOLVERS)


def push(size, *coefficients):
    law = Law("polynomial", coefficients)
    return ConcentratedLoad("Push", "Bob", ZERO, (size, 0.0, 0.0), GROUND.name, ZERO, GROUND.name,
                            law)  # fmt: skip


STARTS = {
    "a speed that cannot be squared": build_model([body(velocity=(1e200, 0.0, 0.0))]),
    "a spin that cannot be squared": build_model([body(angular_velocity=(0.0, 1e160, 0.0))]),
    "a weight": pendulum(),
}


@pytest.mark.parametrize("model", STARTS.values(), ids=STARTS)
def test_a_start_that_cannot_be_is_refused_by_name(model):
    if model.gravity == DOWN:
        model = pendulum().__class__(**{**_fields(model), "gravity": (0.0, 0.0, 1e308)})
    with pytest.raises(StartError, match="numbers of body 'Bob' went beyond"):
        simulate(model, dt=0.01, t_final=1.0, checked=True)


def _fields(model):
    return {name: getattr(model, name) for name in model.__dataclass_fields__}


GROWING = {
    "load 'Push'": build_model([body()], loads=[push(1e300, 0.0, 1e18)]),
    "load 'Wind'": build_model(
        [body(velocity=(1e100, 0.0, 0.0))], loads=[drag("Wind", "Bob", ZERO, 1e200)]
    ),
    "motion 'Motor'": build_model(
        [body()],
        [Joint("Hinge", "revolute", GROUND.name, "Bob", ZERO, ZERO)],
        motions=(JointMotion("Motor", "Hinge", "angle", Law("polynomial", (*[0.0] * 400, 1.0))),),
        t_final=30.0,
        dt=6.0,
    ),
}


@every_solver
@pytest.mark.parametrize("name", GROWING)
def test_what_grows_beyond_all_numbers_is_named_and_never_written(name, solver):
    run = simulate(GROWING[name], solver=solver, checked=True)
    assert run.report.status == "not converged"
    assert name in run.report.message
    for table in (run.states, run.reactions, run.work):
        assert len(table) == run.report.output_times
        assert np.isfinite(table).all()
    assert all(value is None or np.isfinite(value) for value in run.report.extremes.values())


@every_solver
def test_a_step_beyond_all_expectation_is_refused_with_its_reason(solver):
    run = simulate(build_model([body()], loads=[push(1e200, 0.0, 1.0)]), dt=1.0, solver=solver)
    assert (run.report.status, run.report.output_times) == ("not converged", 1)
    assert "times farther away" in run.report.message


@every_solver
def test_a_stiffness_near_the_largest_number_is_still_a_spring(solver):
    # The square of its frequency is 4e305; a step from rest at the slack place reverses the speed.
    run = simulate(oscillator(1e-152), dt=0.01, t_final=1.0, solver=solver, checked=True)
    assert run.report.status == "completed"
    assert np.abs(run.of("velocity")[:, 2]) == pytest.approx(1.0, abs=1e-12)
