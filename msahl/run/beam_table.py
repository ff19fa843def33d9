"""The table of beams: strains and stress resultants at the Gauss points of their elements.

    (n, m) = K (eps + tau d(eps)/dt)          eps from the strains of the unstressed beam

in the section's axes d_1, d_2, d_3, at the output time. Where a strain cannot change (shears of
Euler and Bernoulli, the stretch of an inextensible beam) its resultant does not follow from the
motion: it is the multiplier that keeps it, of order 2 schemes the mean over the last step.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import cross
from msahl.elements.beams.shape import strains
from msahl.joints.coordinates import Motion
from msahl.model import Beam, Model
from msahl.run.body_rows import TablesOfSteppers, of_bodies, read_motions, select
from msahl.run.tables import RESULTANTS

TINY = 1e-30
"""Imaginary part of the increment of a complex difference, which is exact at any size."""


class _Law(NamedTuple):
    """A beam's law: K and tau at its Gauss points, strains of the unstressed beam, its nodes."""

    beam: Beam
    nodes: np.ndarray  # (k,) among the bodies that are read
    stiffness: np.ndarray  # (g, 6, 6)
    damping: np.ndarray  # (6,)
    strain: np.ndarray  # (g, 6)


class BeamTable:
    """Computes ``beams.csv``, one chunk of output times after the other."""

    def __init__(self, model: Model) -> None:
        self.bodies, places = select(model, [name for beam in model.beams for name in beam.nodes])
        self.laws, first = [], 0
        for beam in model.beams:
            nodes = places[first : first + len(beam.nodes)]
            stiffness = np.array([stiffness_of(np.array(C)) for C in beam.compliance])
            damping, strain = np.array(beam.damping), np.array(beam.strain)
            self.laws.append(_Law(beam, nodes, stiffness, damping, strain))
            first += len(beam.nodes)

    def rows(self, tables: TablesOfSteppers) -> np.ndarray:
        """Return the output times (m, columns) of these tables."""
        states = tables["states"]
        motion = read_motions({"states": states}, self.bodies)
        found = [states[:, :1]]
        given, first = tables.get(RESULTANTS), 0
        if given is None:  # they do not follow from the motion alone
            given = np.full(
                (len(states), 1 + 6 * sum(len(law.strain) for law in self.laws)), np.nan
            )
        mean = given[:, 1:].reshape(len(states), -1, 6)
        for law in self.laws:
            both, points = _of_beam(law, of_bodies(motion, law.nodes)), len(law.strain)
            kept = np.diagonal(law.stiffness, axis1=1, axis2=2) == 0.0
            resultants = both[..., 6:]
            np.copyto(resultants, mean[:, first : first + points], where=kept)
            found.append(both.reshape(len(states), -1))
            first += points
        return np.concatenate(found, axis=1)


def stiffness_of(compliance: np.ndarray) -> np.ndarray:
    """Return K (6, 6): the inverse of C over the strains that can change, else zero."""
    free = np.flatnonzero(np.diag(compliance))
    K = np.zeros((6, 6))
    K[np.ix_(free, free)] = np.linalg.inv(compliance[np.ix_(free, free)])
    return K


def _of_beam(law: _Law, motion: Motion) -> np.ndarray:
    """Return strains and resultants (m, g, 12) of a beam at output times."""
    lengths = np.array(law.beam.lengths)
    eps = strains(law.beam.degree, lengths, motion.x, motion.R) - law.strain
    stressed = eps
    if law.damping.any():
        # d_i' = w x d_i by columns
        rate = cross(motion.w[..., None, :], np.swapaxes(motion.R, -1, -2))
        x, R = motion.x + 1j * TINY * motion.v, motion.R + 1j * TINY * np.swapaxes(rate, -1, -2)
        eps_rate = strains(law.beam.degree, lengths, x, R).imag / TINY
        stressed = eps + law.damping * eps_rate
    return np.concatenate([eps, np.einsum("gij,mgj->mgi", law.stiffness, stressed)], axis=-1)
