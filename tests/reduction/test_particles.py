"""Particles of reduced bodies: their sums against the inertia invariants."""

import numpy as np
import pytest

from msahl.reduction.interfaces import interface_of
from msahl.reduction.normal_modes import Wanted
from msahl.reduction.particles import SHARE, particles
from msahl.reduction.reduce import Wishes, reduce_model
from tests.reduction.bodies import beam
from tests.support.elastic import invariants_of_particles, reduced_box


def reduced_beam():
    interfaces = (interface_of("Root=1"), interface_of("Tip=21"))
    return reduce_model(beam(), Wishes(interfaces, Wanted(4))).body


@pytest.mark.parametrize("body", [reduced_box, reduced_beam])
def test_masses_and_couplings_of_rates_are_exact(body):
    """What frequencies, statics and the momentum of a body without deformation depend on."""
    body = body()
    found, modal = invariants_of_particles(body)
    given = body.invariants
    # Sums of some hundred terms of the size of these units have errors of some machine epsilons.
    size = np.sqrt(np.trace(given.inertia))
    assert found.mass == pytest.approx(given.mass, rel=1e-12)
    assert np.abs(found.inertia - given.inertia).max() < 1e-12 * size**2
    assert np.abs(modal - np.eye(len(modal))).max() < 1e-12
    assert np.abs(found.translation).max() < 1e-12 * np.sqrt(given.mass)
    assert np.abs(found.rotation - given.rotation).max() < 1e-12 * size


def test_other_invariants_of_solids_differ_by_the_share_of_carriers():
    body = reduced_box()
    found, _ = invariants_of_particles(body)
    size = np.sqrt(np.trace(body.invariants.inertia))
    units = {"moment": np.sqrt(found.mass), "gyration": 1.0, "inertia_slope": size,
             "inertia_curve": 1.0}  # fmt: skip
    for name, unit in units.items():
        error = np.abs(getattr(found, name) - getattr(body.invariants, name)).max()
        # Each entry is a sum of at most three entries of the moments, as the deviation has them.
        assert error < 3.0 * particles(body).deviation * unit, name
    assert particles(body).deviation < 3.0 * SHARE


def test_beams_have_rotations_that_no_particles_have():
    """Torsion: the deviation says so, and the number of particles is that of the moments' rank."""
    found = particles(reduced_beam())
    assert 0.01 < found.deviation < 1.0
    assert found.points.mass.min() > 0.0
    assert len(found.points.mass) <= 4 + 3 * 10
