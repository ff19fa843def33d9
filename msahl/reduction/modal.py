"""Elastic models by modes: files that were reduced by other programs."""

from dataclasses import dataclass

from msahl.reduction.craig_bampton import Basis


@dataclass(frozen=True, eq=False, slots=True)
class ModalModel:
    """Shapes at nodes with lumped masses, and the matrices of their amplitudes. The stiffness of
    the nodes is not known; it is zero in the model of the basis."""

    basis: Basis
