"""Reduced meshes of beams with geometric stiffening, for tests."""

from dataclasses import replace

import numpy as np

from msahl.reduction.interfaces import interface_of
from msahl.reduction.mesh.material import Material, section_of
from msahl.reduction.mesh.reduce import mesh_model
from msahl.reduction.mesh.second_order import Beams, beam_stiffening
from msahl.reduction.normal_modes import Wanted
from msahl.reduction.reduce import Reduction, Wishes, reduce_model
from tests.reduction.meshes import line_mesh

SECTION = "A=1, I2=1e-6, I3=20e-6, J=1e-2, d3=0:0:1"
BLADE = Material(E=1e6, nu=0.3, rho=1.0)
"""1 m, 1 kg, EI = 1 and 20 N m^2, a rotary inertia of 1e-6 kg m; stiff in stretch and torsion."""


def stiffened(
    places: np.ndarray,
    text: str = SECTION,
    material: Material = BLADE,
    interfaces: tuple[str, ...] = ("Root=1",),
    number: int = 6,
    pairs: np.ndarray | None = None,
) -> Reduction:
    """The reduction of the mesh through these places, with stiffening."""
    mesh, section = line_mesh(places, pairs), section_of(text, material.nu)
    made = mesh_model(mesh, material, section, "m-kg")
    found = reduce_model(made.model, Wishes(tuple(map(interface_of, interfaces)), Wanted(number)))
    members = [int(np.searchsorted(mesh.labels, labels[0])) for labels in found.members]
    beams = Beams(mesh, material, section, 1.0)
    stiffening = beam_stiffening(beams, found.body, found.rotations, members)
    return replace(found, body=replace(found.body, stiffening=stiffening))


def blade(number: int = 6, count: int = 40) -> Reduction:
    """A blade along x, with the node Root at the origin."""
    return stiffened(np.linspace(0.0, 1.0, count + 1)[:, None] * np.eye(3)[0], number=number)
