"""The thesis's models at the thesis's steps, and the conditions in which its program died.

Hainge (2010) lost the double pendulum after 19 to 26 s of 100 at a step of 0.002 s, and no step of
any triple pendulum converged.
"""

import numpy as np
import pytest

from msahl.deck import read_deck
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.midpoint import equations, free_equations
from tests.support.models import THESIS, deck, simulate

STEPS = [0.1, 0.04, 0.01, 0.004, 0.002]

every_deck = pytest.mark.parametrize("path", THESIS, ids=lambda path: path.stem)
every_step = pytest.mark.parametrize("h", STEPS)


def check(run, t_final, h):
    report, extremes = run.report, run.report.extremes
    assert (report.status, report.message) == ("completed", "")
    assert (report.steps, report.time) == (round(t_final / h), t_final)
    # The promise of the method, over all steps: round-off, some 1e-13, with workspace to spare.
    assert extremes["energyErrorMaxRelative"] < 1e-9
    assert extremes["constraintViolationMax"] < 1e-9


@every_deck
@every_step
def test_ten_seconds_at_every_step_of_the_thesis(path, h):
    check(simulate(read_deck(path), dt=h, t_final=10.0, every=1000), 10.0, h)


@pytest.mark.slow
@every_deck
@every_step
def test_a_hundred_seconds_at_every_step_of_the_thesis(path, h):
    check(simulate(read_deck(path), dt=h, t_final=100.0, every=10000), 100.0, h)


@pytest.mark.parametrize("degrees", [45, 89, 135])
def test_where_the_thesis_stopped_the_double_pendulum_goes_on(degrees):
    """0.002 s, past 26 s, every step by the compiled Newton alone."""
    model = deck(f"double_pendulum_{degrees}")
    run = simulate(model, dt=0.002, t_final=30.0, solver="newton", every=1000)
    check(run, 30.0, 0.002)
    assert (run.report.subdivisions, run.report.scipy_steps) == (0, 0)
    # A Newton step or two each; nothing is near failing.
    assert run.report.iterations < 2.2 * run.report.steps


@every_step
@pytest.mark.parametrize("solver", ["newton", "root"])
@pytest.mark.parametrize("degrees", [5, 45, 89, 135])
def test_the_first_step_of_the_triple_pendulum_converges(degrees, solver, h):
    run = simulate(deck(f"triple_pendulum_{degrees}"), dt=h, t_final=h, solver=solver)
    report, extremes = run.report, run.report.extremes
    assert (report.status, report.subdivisions) == ("completed", 0)
    assert extremes["constraintViolationMax"] < 1e-12
    # Hardly anything moves yet: round-off of the potential energy, not of the kinetic.
    assert extremes["energyErrorMax"] < 1e-13 * abs(extremes["energyAtStart"])
    # Powell's method goes on for a while at round-off before it stops.
    assert report.iterations <= {"newton": 8, "root": 40}[solver]


@every_deck
def test_the_jacobian_is_as_well_conditioned_at_small_steps(path):
    """Unscaled, its condition number would grow as h^-2: by 1e10 from the first to the last."""
    conditions = []
    for h in (0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        workspace = SubsystemIntegrator(read_deck(path), "newton", True, 1).workspace
        size = workspace.unknowns.free.size
        equations.predict(workspace.system, workspace.state, workspace.start, h, workspace.Z)
        z = workspace.Z.reshape(-1)[workspace.unknowns.free].copy()
        A = np.zeros(size * size)
        free_equations.jacobian(workspace, h, z, A)
        conditions.append(np.linalg.cond(A.reshape(size, size)))
    # The unknowns and rows are lengths whatever h, so the matrix tends to a limit; what is left of
    # h is the motion over the step itself: the tops rotate by up to 0.76 rad in 0.1 s.
    assert np.array(conditions) == pytest.approx(conditions[-1], rel=0.05)
    # The pendulums' bobs are small beside their arms: (L/k)^2 = 6250, and a little more.
    assert max(conditions) < 1.5e4
