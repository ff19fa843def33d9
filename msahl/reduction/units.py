"""Units of finite-element models: matrices and places in any consistent units become SI."""

from dataclasses import replace

import numpy as np
from scipy import sparse

from msahl.reduction.elastic_model import Matrices, Nodes

UNITS = {
    "m-kg": (1.0, 1.0),
    "mm-t": (1e-3, 1e3),
    "mm-kg": (1e-3, 1.0),
    "in-lbf": (0.0254, 4.4482216152605 / 0.0254),
}
"""Units of length [m] and mass [kg] by name; time is in seconds, so forces are mass length/s^2: N,
N, mN, lbf. The mass of in-lbf is lbf s^2/in."""
SI = "m-kg"


def in_si(nodes: Nodes, given: Matrices, units: str) -> tuple[Nodes, Matrices]:
    """Return nodes and matrices in SI units. Displacements of rows of translations are in the
    unit of length, those of rotations in rad."""
    length, mass = UNITS[units]
    if units == SI:
        return nodes, given
    scale = sparse.diags_array(np.where(given.components < 3, 1.0, length))

    def scaled(A: sparse.csr_array) -> sparse.csr_array:
        return sparse.csr_array(mass * (scale @ A @ scale))

    damping = None if given.damping is None else scaled(given.damping)
    return replace(nodes, places=length * nodes.places), replace(
        given, mass=scaled(given.mass), stiffness=scaled(given.stiffness), damping=damping
    )
