"""The energy balance of rows that lie between steps, from the numbers that the tables have there.

    balance = kinetic + potential + elastic energy - works                                    [J]

Such rows are interpolated. Their motion comes from polynomials, and their works from powers along
these, so the balance of the steps says nothing of them.
"""

import numpy as np

from msahl.algebra.rotation_arrays import cross, dot, rotated, rotations
from msahl.formulations.absolute.rigid_body import STATE_SIZE, RigidBodies
from msahl.run.subsystem import SubsystemIntegrator


def row_energies(integrator: SubsystemIntegrator, rows: np.ndarray) -> np.ndarray:
    """Return the energy balances and the potential energies, elastic ones included, (2, m) [J] of a
    subsystem in these ``rows`` of the present chunk.
    """
    tables, works = integrator.workspace.tables, integrator.workspace.state.work.size
    kinetic, potential = _of_bodies(integrator.workspace.system.bodies, tables.states[rows])
    potential = potential + tables.work[rows, works:].sum(axis=1)
    balance = kinetic + potential - tables.work[rows, :works].sum(axis=1)
    return np.stack([balance, potential])


def _of_bodies(bodies: RigidBodies, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the kinetic and potential energies (m,) of bodies with these ``states`` (m, 12 n)."""
    parts = states[:, bodies.column[:, None] + np.arange(STATE_SIZE)]  # (m, n, 12)
    x, p, v, w = (parts[..., 3 * i : 3 * i + 3] for i in range(4))
    mass, to_centre = 1.0 / bodies.inverse_mass, bodies.r_BG
    v = v + cross(w, to_centre)  # in axes of the body, which do not matter here
    kinetic = 0.5 * (mass * dot(v, v) + dot(w, rotated(bodies.inertia, w)))
    potential = -mass * ((x + rotated(rotations(p), to_centre)) @ bodies.gravity)
    return kinetic.sum(axis=1), potential.sum(axis=1)
