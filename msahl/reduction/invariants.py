"""Inertia invariants of the modes of a floating frame: what the motion needs of all nodes.

Velocity v and angular velocity w of the frame, both in its axes, and amplitudes q:

    2 T = m v^2 + w . J(q) w + q' . q' + 2 v . (S1 q' + G(q) w)
          + 2 w . S2 q' + 2 sum_i w_i q . C_i q'

    mass m, inertia  J(q) = J0 + sum_j J1_j q_j + sum_jk J2_jk q_j q_k     (3, 3)     [kg-m^2]
    translation      S1[a, j] = R_a . M phi_j                              (3, q)
    rotation         S2[i, j] = R_3+i . M phi_j                            (3, q)
    moment           G[a, i, j] = R_a . M E_i phi_j, times q_j             (3, 3, q)
    gyration         C[i, j, k] = E_i phi_j . M phi_k                      (3, q, q)
    inertia_slope    J1[i, l, j] = R_3+i . M E_l phi_j + R_3+l . M E_i phi_j
    inertia_curve    J2[i, l, j, k] = E_i phi_j . M E_l phi_k

R and E are those of ``msahl.reduction.rigid``, M is the matrix of mass, consistent or lumped. For
solids, whose mass is alike in all directions, these are the integrals of the displacement fields;
rotations of nodes are interpolated as the elements do it. Amplitudes have the unit
sqrt(kg) m. The origin is the undeformed mass centre. Source: Shabana, Dynamics of Multibody
Systems, section 5.
"""

from dataclasses import dataclass

import numpy as np

from msahl.reduction.floating import FloatingModes
from msahl.reduction.rigid import rotated


@dataclass(frozen=True, eq=False, slots=True)
class Invariants:
    """The arrays of the module's docstring."""

    mass: float
    inertia: np.ndarray
    translation: np.ndarray
    rotation: np.ndarray
    moment: np.ndarray
    gyration: np.ndarray
    inertia_slope: np.ndarray
    inertia_curve: np.ndarray

    def inertia_at(self, q: np.ndarray) -> np.ndarray:
        """Return the inertia (3, 3) of the deformed body about the frame's origin."""
        slope, curve = self.inertia_slope @ q, np.einsum("iljk,j,k", self.inertia_curve, q, q)
        result: np.ndarray = self.inertia + slope + curve
        return result


def invariants(modes: FloatingModes) -> Invariants:
    """Return the invariants of these modes."""
    model, R, Phi = modes.model, modes.rigid, modes.shapes
    M = model.mass
    MR, MPhi = M @ R, M @ Phi
    W = [rotated(model, i, Phi) for i in range(3)]
    MW = [M @ one for one in W]
    couplings = np.array([[R[:, 3 + i] @ MW[j] for j in range(3)] for i in range(3)])
    return Invariants(
        mass=float(np.trace(modes.inertia[:3, :3])) / 3.0,
        inertia=modes.inertia[3:, 3:],
        translation=MR[:, :3].T @ Phi,
        rotation=MR[:, 3:].T @ Phi,
        moment=np.stack([MR[:, :3].T @ one for one in W], axis=1),
        gyration=np.array([one.T @ MPhi for one in W]),
        inertia_slope=couplings + couplings.transpose(1, 0, 2),
        inertia_curve=np.array([[a.T @ b for b in MW] for a in W]),
    )
