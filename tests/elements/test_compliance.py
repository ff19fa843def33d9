"""Springs and bushings in the compliance form: the same motion, at any stiffness."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.vector import ZERO
from msahl.analysis.linearised.coefficients import coefficients
from msahl.analysis.linearised.point import at_start
from msahl.formulations.absolute.frames import first_multiplier
from msahl.model import Bushing, Joint, JointSpring, SpringDamper
from msahl.model.scheme import EXPONENTIAL
from msahl.system.build import build_system
from msahl.system.names import describe_row
from tests.support.evaluation import evaluate_at
from tests.support.models import GROUND, body, build_model, deck, simulate

AXES = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
STEP = 0.01


def tower(compliance, stiffness=400.0):
    """Three bodies: the first on a slide with a spring, the second on it by a bushing with one
    direction that only damps, the third hung on both by a spring with preload.
    """
    k, form = stiffness, {"compliance": compliance}
    bodies = [
        body("A", velocity=(0.0, 0.0, 0.4)),
        body("B", position=(0.5, 0.0, 0.1), angular_velocity=(0.3, -0.5, 0.8)),
        body("C", position=(1.1, 0.2, -0.6), mass=0.5, velocity=(0.0, 1.0, 0.0)),
    ]
    slide = Joint("Slide", "prismatic", GROUND.name, "A", ZERO, ZERO, AXES, AXES)
    loads = [
        JointSpring("Spring", "Slide", "slide", k, 0.8, 0.02, 3.0, **form),
        Bushing(
            *("Mount", "A", "B", (0.3, 0.0, 0.1), (-0.2, 0.0, 0.0), AXES, AXES),
            *((k, 2.0 * k, k, 0.5 * k, 0.0, k), (0.5, 0.0, 0.0, 0.1, 0.2, 0.0)),
            **form,
        ),
        SpringDamper(
            *("Thread", "B", "C", (0.1, 0.0, 0.0), (0.0, 0.1, 0.0), k, 0.3),
            *(0.8, 2.0),
            **form,
        ),
    ]
    return build_model(bodies, [slide], loads, gravity=(0.0, 0.0, -9.81), dt=STEP, t_final=0.1)


@pytest.fixture(scope="module")
def forms():
    return tower(False), tower(True)


@pytest.mark.parametrize("scheme", ["preserving", "decaying", "gauss2", "radau2"])
def test_the_motion_is_that_of_the_stiffness_form(forms, scheme):
    """The discrete equations are the same, and so are works and elastic energies: in absolute
    coordinates, as the compliance form is; those of joint coordinates are others.
    """
    runs = [simulate(model, scheme=scheme, full=True) for model in forms]
    for name in ("states", "reactions", "work"):
        stiffness, compliance = (getattr(run, name) for run in runs)
        # Each of ten steps is solved to 1e-14 of its motion; loads are 1e3 times that over h^2.
        assert np.abs(compliance - stiffness).max() <= 1e-10 * np.abs(stiffness).max()


def test_rotations_by_the_exponential_map_as_well(forms):
    runs = [
        simulate(replace(m, simulation=replace(m.simulation, rotation_update=EXPONENTIAL)))
        for m in forms
    ]
    assert runs[1].states == pytest.approx(runs[0].states, abs=1e-10)


def test_steps_of_controlled_size_are_those_of_the_stiffness_form(forms):
    """Rejected steps give their elongations back."""
    runs = [
        simulate(
            replace(m, simulation=replace(m.simulation, scheme="radau", local_tolerance=1e-5)),
            t_final=0.3,
        )
        for m in forms
    ]
    assert runs[1].report.steps == runs[0].report.steps
    assert runs[1].states == pytest.approx(runs[0].states, abs=1e-9)


def test_forces_at_one_configuration_and_their_derivatives_are_the_same(forms):
    """So are accelerations, equilibria, modes and linear models, which are made of these."""
    points = [at_start(model) for model in forms]
    here = [evaluate_at(point.system, point.state) for point in points]
    for name in ("force", "force_by_place", "force_by_rate", "constraint_jacobian", "violation"):
        stiffness, compliance = (getattr(found, name) for found in here)
        # Sums in another order.
        size = np.abs(stiffness).max(initial=0.0)
        np.testing.assert_allclose(compliance, stiffness, rtol=1e-13, atol=1e-15 * size)
    for point in points:
        found = coefficients(point.system, point.state)
        assert found.constraint.shape[0] == 5
    np.testing.assert_allclose(points[1].state.a, points[0].state.a, rtol=1e-13, atol=1e-13)


def test_redundant_joints_leave_the_loads_as_they_are():
    """The multipliers of redundant joints are relaxed; those of springs are determined."""
    model = deck("cranks")
    stay = SpringDamper(
        *("Stay", model.grounds[0].name, "Beam", ZERO, (0.05, 0.0, -0.1), 5e4, 3.0), compliance=True
    )
    runs = [
        simulate(replace(model, loads=(replace(stay, compliance=form),)), t_final=0.2, full=True)
        for form in (False, True)
    ]
    assert runs[1].report.degrees_of_freedom["byRank"] == 1
    assert runs[1].states == pytest.approx(runs[0].states, abs=1e-11)
    assert runs[1].work == pytest.approx(runs[0].work, abs=1e-10)


def test_their_equations_have_names():
    """Those of a bushing are displacements first, then rotations, without what only damps."""
    model = tower(True)
    system = build_system(model)
    springs = system.forces.compliance
    first = first_multiplier(system.frames)
    rows = 3 * (first + springs.place[:, 0]) + springs.place[:, 1]
    assert [describe_row(model, system, int(row)) for row in rows] == [
        "spring 'Spring', law 1",
        *(f"spring 'Mount', law {k}" for k in (1, 2, 3)),
        *(f"spring 'Mount', angular law {k}" for k in (1, 2)),
        "spring 'Thread', law 1",
    ]


@pytest.mark.parametrize("h", [0.001, 0.01, 0.1])
def test_no_stiffness_is_too_large(h):
    """A pendulum on a spring of 1e12 N/m: a constraint's iterations, energy to round-off."""
    run = simulate(deck("spring_compliance"), dt=h, t_final=min(3.0, 300 * h))
    report = run.report
    # The steps of 0.1 s are a twentieth of the swing; the stiffness form needs hundreds.
    assert report.iterations <= (3 if h < 0.1 else 8) * report.steps
    assert report.subdivisions == 0
    assert report.extremes["energyErrorMaxRelative"] <= 1e-12
    # Static elongation 1e-11 m, and twice that where it rings.
    assert np.linalg.norm(run.of("position"), axis=1) == pytest.approx(1.0, abs=1e-10)


def test_a_stiff_spring_is_a_rod_in_the_limit():
    """The motion differs from that with a joint in proportion to the compliance."""
    model = deck("spring_compliance")
    (thread,) = model.loads
    ends = (thread.parent, thread.child, thread.parent_point, thread.child_point)
    rod = Joint("Thread", "distance", *ends, parameters=(("length", 1.0),))
    exact = simulate(replace(model, joints=(rod,), loads=()), t_final=1.0).of("position")
    apart = []
    for stiffness in (1e6, 1e8):
        stiff = replace(thread, stiffness=stiffness)
        run = simulate(replace(model, loads=(stiff,)), t_final=1.0)
        apart.append(np.abs(run.of("position") - exact).max())
    assert apart[0] <= 1e-4
    assert apart[1] == pytest.approx(0.01 * apart[0], rel=0.5)
    stiffest = simulate(replace(model, loads=(replace(thread, stiffness=1e15),)), t_final=1.0)
    assert stiffest.of("position") == pytest.approx(exact, abs=1e-12)
