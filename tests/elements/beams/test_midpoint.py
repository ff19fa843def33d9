"""Beams over steps of the schemes of order 2: derivatives, conservation, action and reaction."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.jit.compiled import compiled
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.midpoint import equations, newton
from msahl.system.diagnostics import energy_balance
from msahl.system.momentum import momentum
from tests.support.beams import ELASTIC, FLEXIBLE, STIFF, free_beam
from tests.support.evaluation import dense_matrix

DAMPED = (0.01, 0.02, 0.03, 0.01, 0.02, 0.03)
UNDAMPED = (0.0,) * 6
INEXTENSIBLE = (np.inf, np.inf, np.inf, 10.0, 12.0, 15.0)


def begun(model, scheme="preserving"):
    """The workspace of a model at t = 0."""
    model = replace(model, simulation=replace(model.simulation, scheme=scheme))
    return SubsystemIntegrator(model, "newton", True, 10).workspace


@pytest.mark.parametrize("scheme", ["preserving", "decaying"])
@pytest.mark.parametrize("damping", [UNDAMPED, DAMPED])
@pytest.mark.parametrize("stiffness", [ELASTIC, INEXTENSIBLE])
def test_the_jacobian_is_the_derivative_of_the_residual(scheme, damping, stiffness):
    rng, h = np.random.default_rng(1), 0.05
    workspace = begun(free_beam(rng, 2, 2, stiffness, damping, center=(0.01, 0.02, -0.03)), scheme)
    system, state, start = workspace.system, workspace.state, workspace.start
    state.strain_rise[:] = 0.01 * rng.normal(size=state.strain_rise.shape)
    equations.predict(system, state, start, h, workspace.Z)
    free, Z = workspace.unknowns.free, workspace.Z
    Z.reshape(-1)[free] += 0.02 * rng.normal(size=free.size)

    def residual(z):
        F, moved = np.zeros_like(Z), Z.copy()
        moved.reshape(-1)[free] = z
        equations.residual(system, state, start, h, moved, F)
        return F.reshape(-1)[free]

    z, step = Z.reshape(-1)[free].copy(), 1e-6
    residual(z)
    equations.jacobian(system, start, h, Z, workspace.values)
    A = dense_matrix(system, workspace.values)[np.ix_(free, free)]
    differences = np.array(
        [(residual(z + d) - residual(z - d)) / (2 * step) for d in step * np.eye(z.size)]
    ).T
    # Second differences of entries of order 1: 1e-12 by curvature, 1e-10 by round-off; more by the
    # large stresses of a damped beam that is hit.
    assert np.abs(A - differences).max() < (2e-8 if damping == DAMPED else 1e-9)


@pytest.mark.parametrize("stiffness", [ELASTIC, STIFF, INEXTENSIBLE, FLEXIBLE])
def test_energy_and_momenta_stay_at_any_stiffness(stiffness):
    """Steps of 0.05 s are ten times the period of the stretch of the elastic beam, and 1e4 times
    that of the stiff one.
    """
    workspace = begun(free_beam(np.random.default_rng(1), 2, 2, stiffness))
    system, state, start, monitor = (
        workspace.system,
        workspace.state,
        workspace.start,
        workspace.monitor,
    )
    energy = energy_balance(system, state, start, monitor.violation, monitor.rate)
    before = momentum(system, state, start)
    for _ in range(12):
        residual, _ = newton.take_step(workspace, 0.05, 1.0)
        assert residual < 1e-12
    now = momentum(system, state, start)
    drift = energy_balance(system, state, start, monitor.violation, monitor.rate) - energy
    # A residual of 3e-15 of the motion lets the energy drift by twice as much a step.
    assert abs(drift) < 12 * 1e-14 * energy
    assert np.abs(now.P - before.P).max() < 12 * 1e-15 * before.P_size
    assert np.abs(now.L - before.L).max() < 12 * 1e-14 * before.P_size
    assert np.abs(monitor.violation).max() < 1e-13


@pytest.mark.parametrize("scheme", ["preserving", "decaying"])
def test_damping_and_decay_are_in_the_balance(scheme):
    stiffness, damping = (np.inf, np.inf, np.inf, 10.0, 12.0, 15.0), (0.01,) * 6
    workspace = begun(free_beam(np.random.default_rng(1), 2, 2, stiffness, damping), scheme)
    system, state, start, monitor = (
        workspace.system,
        workspace.state,
        workspace.start,
        workspace.monitor,
    )
    energy = energy_balance(system, state, start, monitor.violation, monitor.rate)
    for _ in range(12):
        newton.take_step(workspace, 0.05, 1.0)
    drift = energy_balance(system, state, start, monitor.violation, monitor.rate) - energy
    assert state.work[0] < -1e-6  # the bending that the motion begins with
    assert abs(drift) < 12 * 1e-14 * energy


def test_internal_forces_are_in_equilibrium_and_do_the_work_of_the_strains():
    """Forces and moments of arbitrary resultants have no resultant, and no work in a rigid motion
    of finite size.
    """
    rng = np.random.default_rng(5)
    workspace = begun(free_beam(rng, 3, 1, ELASTIC, center=(0.01, 0.02, -0.03)))
    system, state, start = workspace.system, workspace.state, workspace.start
    frames, Z, F = system.frames, workspace.Z, np.zeros_like(workspace.Z)
    Z[:] = 0.0
    first = system.multipliers.node[0]
    loads = np.zeros((2, *F.shape))
    for side, force in enumerate((0.0, 1.0)):
        Z[first:] = force * rng.normal(size=Z[first:].shape)
        equations.residual(system, state, start, 0.05, Z, loads[side])
    pushed, n = loads[1] - loads[0], frames.length.size - 1
    mass = 1.0 / frames.inverse_mass[:n, None]
    forces = mass * pushed[frames.displacement[:n]]
    moments = mass * frames.length[:n, None] * pushed[frames.rotation[:n]]
    moments += np.cross(state.x[:n], forces)
    size = np.abs(forces).sum()
    assert size > 0.1
    assert np.abs(forces.sum(axis=0)).max() < 1e-14 * size
    assert np.abs(moments.sum(axis=0)).max() < 1e-14 * size


@pytest.mark.slow
def test_energy_and_momenta_stay_over_ten_thousand_steps():
    workspace = begun(free_beam(np.random.default_rng(1), 3, 4, ELASTIC))
    system, state, start, monitor = (
        workspace.system,
        workspace.state,
        workspace.start,
        workspace.monitor,
    )
    energy = energy_balance(system, state, start, monitor.violation, monitor.rate)
    before, take_step = momentum(system, state, start), compiled(newton.take_step)
    for _ in range(10_000):
        residual, _ = take_step(workspace, 0.02, 1.0)
        assert residual < 1e-12
    now = momentum(system, state, start)
    drift = energy_balance(system, state, start, monitor.violation, monitor.rate) - energy
    # Rounding errors of 1e-15 at random add up to 1e-13, those of one sign to 1e-11.
    assert abs(drift) < 1e-10 * energy
    assert np.abs(now.P - before.P).max() < 1e-10 * before.P_size
    assert np.abs(now.L - before.L).max() < 1e-10 * before.L_size
