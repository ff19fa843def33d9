"""Rigid displacements of nodes, and displacement fields that rotate with the body.

    R_a     = e_a at every node                                        a = x, y, z
    R_3+i   = e_i x (x_k - o), with the rotation e_i of the node       i = x, y, z
    E_i u   = e_i x u_k, with the rotation e_i x theta_k of the node

x_k places of the nodes [m], o the origin, u_k and theta_k displacement and rotation of node k. With
the velocity v and the angular velocity w of the body, both in its axes, a deformation u has nodal
velocities R_a v_a + (R_3+i + E_i u) w_i + u'; the matrix of mass makes the kinetic energy of them.
"""

import numpy as np

from msahl.reduction.elastic_model import ElasticModel

EPSILON = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    EPSILON[_i, _j, _k], EPSILON[_i, _k, _j] = 1.0, -1.0


def rigid_fields(model: ElasticModel, origin: np.ndarray) -> np.ndarray:
    """Return the nodal displacements (m, 6) of three translations and three rotations about the
    ``origin`` (3,)."""
    fields = np.zeros((model.size, 6))
    axis = model.components % 3
    fields[np.arange(model.size), model.components] = 1.0
    moved = model.components < 3
    arms = model.places[model.owners[moved]] - origin
    # (e_i x arm)_c = epsilon_cik arm_k
    fields[moved, 3:] = np.einsum("mik,mk->mi", EPSILON[axis[moved]], arms)
    return fields


def rotated(model: ElasticModel, i: int, shapes: np.ndarray) -> np.ndarray:
    """Return E_i of displacements (m, k)."""
    spread = np.zeros((len(model.labels), 2, 3, shapes.shape[1]))
    axis, kind = model.components % 3, model.components // 3
    spread[model.owners, kind, axis] = shapes
    crossed = np.einsum("ck,nakj->nacj", EPSILON[:, i, :], spread)
    result: np.ndarray = crossed[model.owners, kind, axis]
    return result


def mass_centre(model: ElasticModel) -> tuple[float, np.ndarray]:
    """Return the mass [kg] and the mass centre (3,) [m] by the matrix of mass."""
    fields = rigid_fields(model, np.zeros(3))
    B = fields.T @ (model.mass @ fields)
    mass = float(np.trace(B[:3, :3])) / 3.0
    if not mass > 0.0:
        return 0.0, np.zeros(3)
    # B[a, 3 + i] = m (e_i x c)_a
    centre = 0.5 * np.einsum("aik,ai->k", EPSILON, B[:3, 3:]) / mass
    return mass, centre
