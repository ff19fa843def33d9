"""The decaying scheme: its order, what it damps and what it keeps, and the energy it takes."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.vector import ZERO
from msahl.model import Joint, JointSpring, Law
from msahl.model.scheme import DAMPING, decaying
from tests.support.closed_forms import recognise
from tests.support.models import GROUND, body, build_model, deck, jointed, pendulum, simulate

DAMPINGS = (0.2, DAMPING, 1.0)
H = 0.01
every_damping = pytest.mark.parametrize("damping", DAMPINGS)


def oscillator(period, table=None, **others):
    """1 kg on a rail with a spring of this ``period`` [s], started at 1 m/s."""
    stiffness = (2.0 * np.pi / period) ** 2
    rail = Joint("Rail", "prismatic", GROUND.name, "Block", ZERO, ZERO)
    spring = JointSpring("Spring", "Rail", "slide", stiffness, 0.0, table=table)
    block = body("Block", mass=1.0, velocity=(0.0, 0.0, 1.0))
    return build_model([block], [rail], [spring], **others)


def energies(run):
    """Kinetic plus elastic energy of the oscillator's rows [J]."""
    v = run.of("velocity")[:, 2]
    return 0.5 * v**2 + run.column("Spring.energy")


def test_a_linear_oscillator_is_stepped_by_the_two_step_method():
    """(z - 1)(z - pole) over sigma(z) ~ (z + rho)^2, of x and v alike; BDF2 for damping 1."""
    for damping in DAMPINGS:
        run = simulate(oscillator(0.3), dt=H, t_final=1.0, scheme="decaying", damping=damping)
        x, v = run.of("position")[:, 2], run.of("velocity")[:, 2]
        decay, rho = decaying(damping), 1.0 - damping
        difference = x[2:] - (1.0 + decay.pole) * x[1:-1] + decay.pole * x[:-2]
        weighted = decay.share * (v[2:] + 2.0 * rho * v[1:-1] + rho**2 * v[:-2])
        # The first two rows start the memory. Some roundings of numbers near 1e-2.
        np.testing.assert_allclose(difference[1:], H * weighted[1:], atol=1e-15)
        if damping == 1.0:
            bdf2 = 1.5 * x[2:] - 2.0 * x[1:-1] + 0.5 * x[:-2]
            np.testing.assert_allclose(bdf2[1:], H * v[3:], atol=1e-15)


@every_damping
def test_what_the_step_cannot_see_goes_by_the_damping(damping):
    """Far below the step's resolution the factors of a step are -(1 - damping), twice."""
    run = simulate(oscillator(1e-6 * H), dt=H, t_final=2.0, scheme="decaying", damping=damping)
    energy, rho = energies(run), 1.0 - damping
    if damping == 1.0:
        # BDF2 leaves what the next order of its factors has: (1/(h omega))^2 of the amplitude.
        assert energy[4:].max() <= 1e-10 * energy[0]
    else:
        # A double root: n rho^n in the amplitude.
        n = np.array([20, 40])
        ratio = np.sqrt(energy[n[1]] / energy[n[0]])
        assert ratio == pytest.approx(2.0 * rho**20, rel=0.25)


@pytest.mark.parametrize("period", [100.0 * H, H, 1e-2 * H, 1e-6 * H])
@every_damping
def test_energy_is_never_gained_and_the_balance_holds(period, damping):
    run = simulate(oscillator(period), dt=H, t_final=10.0, scheme="decaying", damping=damping)
    energy, taken = energies(run), run.column("scheme.work")
    # Round-off of a thousand steps, each solved to 1e-14 of its own motion.
    assert np.abs(energy - energy[0] - taken).max() <= 1e-11 * energy[0]
    assert taken.max() <= 0.0
    assert energy.max() <= energy[0]


@every_damping
def test_energy_taken_is_lost_or_stored_in_smoothed_changes(damping):
    """A point on a circle: what the scheme took may come back, but never what it has lost."""
    bob = body("Bob", 2.0, 0.1, position=(3.0, 0.0, 0.0))
    rod = Joint("Rod", "distance", GROUND.name, bob.name, ZERO, ZERO, parameters=(("length", 3.0),))
    model = build_model([bob], [rod], gravity=(0.0, 0.0, -9.81))
    run = simulate(model, dt=0.05, t_final=5.0, scheme="decaying", damping=damping)
    decay = decaying(damping)
    v, rise, stored = run.of("velocity"), np.zeros(3), np.zeros(len(run.time))
    for k in range(1, len(v)):
        rise = decay.pole * rise + (1.0 - decay.pole) * (v[k] - v[k - 1])
        stored[k] = 0.25 * decay.chi * bob.mass * rise @ rise / (1.0 - decay.pole)
    taken = run.column("scheme.work")
    # Round-off of a hundred steps.
    assert np.diff(taken + stored).max() <= 1e-13 * np.abs(taken).max() + 1e-13
    risen = (taken - np.minimum.accumulate(taken)).max()
    assert 0.0 < risen <= stored.max()


@pytest.mark.slow
@every_damping
def test_a_stiff_table_loses_energy_too(damping):
    """The smoothing takes a constant stiffness, so nothing is gained on a softer branch."""
    table = Law("linear", (-1.0, -0.01, 0.0, 0.02, 1.0, -3e3, -2e2, 0.0, 6e2, 7e3))
    model = oscillator(1.0, table)
    run = simulate(model, dt=H, t_final=4.0, scheme="decaying", damping=damping)
    assert run.report.status == "completed"
    assert run.column("scheme.work").max() <= 0.0
    assert energies(run).max() <= energies(run)[0] * (1.0 + 1e-12)


@every_damping
def test_joints_stay_closed_and_a_jump_of_velocity_dies(damping):
    """A pendulum whose joint opens at the start: the preserving scheme rings for ever."""
    rates = {}
    for scheme in ("preserving", "decaying"):
        run = simulate(deck("top_3"), dt=H, t_final=5.0, scheme=scheme, damping=damping)
        assert run.report.extremes["constraintViolationMax"] < 1e-14
        F = run.force()
        # Second differences of a smooth force are of order h^2 times it; of ringing, four times.
        ringing = np.abs(np.diff(F[-200:], 2, axis=0)).max()
        rates[scheme] = ringing / np.abs(F).max()
    assert rates["decaying"] < 0.1 * rates["preserving"]


def test_momentum_linear_is_kept_angular_to_second_order():
    model = jointed(np.random.default_rng(1), 4, gravity=False, grounded=False)
    drift = []
    for h in (0.02, 0.01, 0.005):
        run = simulate(model, dt=h, t_final=1.0, scheme="decaying")
        p, L = 0.0, 0.0
        for b, given in enumerate(model.bodies):
            R, w = run.matrices(b), run.of("spin", b)
            x = run.of("position", b) + R @ np.array(given.r_BG)
            v = np.einsum("tij,tj->ti", R, run.of("velocity", b) + np.cross(w, given.r_BG))
            p = p + given.mass * v
            spin = np.einsum("tij,jk,tk->ti", R, np.array(given.inertia), w)
            L = L + given.mass * np.cross(x, v) + spin
        # Each step is solved to 1e-14 of its motion.
        assert np.abs(p - p[0]).max() <= 1e-11 * np.abs(p).max()
        drift.append(np.abs(L[-1] - L[0]).max())
    assert np.log2(np.array(drift[:-1]) / drift[1:]) == pytest.approx(2.0, abs=0.4)


def test_without_damping_it_is_the_preserving_scheme():
    first = simulate(pendulum(), dt=H, t_final=1.0, scheme="decaying", damping=0.0)
    second = simulate(pendulum(), dt=H, t_final=1.0)
    assert (first.states == second.states).all()


def test_subsystems_share_the_column_of_what_was_taken():
    one = oscillator(1e-3 * H)
    block, other = one.bodies[0], replace(one.bodies[0], name="Other", position=(0.0, 5.0, 0.0))
    rail = replace(one.joints[0], name="Other rail", child="Other", parent_point=(0.0, 5.0, 0.0))
    spring = replace(one.loads[0], name="Other spring", joint="Other rail")
    two = replace(
        one, bodies=(block, other), joints=(one.joints[0], rail), loads=(one.loads[0], spring)
    )
    taken = [
        simulate(model, dt=H, t_final=0.5, scheme="decaying").column("scheme.work")[-1]
        for model in (one, two)
    ]
    assert taken[1] == pytest.approx(2.0 * taken[0], rel=1e-12)


@pytest.mark.parametrize("name", ["top_1", "top_3"])
def test_the_reactions_of_a_top_settle_to_order_two(name):
    """The preserving scheme keeps an alternation of order 1 in them (``test_study``)."""
    model, errors = deck(name), []
    exact = recognise(model)
    for h in (0.002, 0.001, 0.0005):
        run = simulate(model, dt=h, t_final=2.0, scheme="decaying")
        late = run.time > 1.0
        error = run.force() - exact.forces(run.time - 0.5 * h)
        errors.append(np.abs(error[late]).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.1)
