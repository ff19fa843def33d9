"""The table of groups of bodies: mass centre, momentum, angular momentum and energy.

    x = sum m_i x_i / m          v = p / m                  p = sum m_i v_i
    L = sum (J_i w_i + m_i (x_i - x) x v_i)                 about the group's mass centre
    kinetic = sum (m_i v_i.v_i + w_i.J_i w_i)/2             potential = - sum m_i g.x_i

x_i and v_i belong to the mass centres; all vectors are in inertial axes. The potential energy of
the group of all bodies includes the elastic energy of springs and bushings.
"""

import numpy as np

from msahl.algebra.rotation_arrays import cross, dot, rotated
from msahl.joints.coordinates import point_motion
from msahl.model import Model
from msahl.run.body_rows import TablesOfSteppers, read_motions, select, without_ground
from msahl.system.names import ENERGY, GROUP_COLUMNS, group_columns, work_columns


class SystemTable:
    """Computes ``system.csv``, one chunk of output times after the other."""

    def __init__(self, model: Model) -> None:
        everything = tuple(body.name for body in model.bodies)
        members = [group.bodies or everything for group in model.groups]
        names = list(dict.fromkeys(name for group in members for name in group))
        self.bodies, _ = select(model, names)
        chosen = [model.bodies[number] for number in self.bodies.tolist()]
        self.width = len(group_columns(model))
        self.s = np.array([body.r_BG for body in chosen])
        self.inertia = np.array([body.inertia for body in chosen])
        self.gravity = np.array(model.gravity)
        mass = np.array([body.mass for body in chosen])
        # (g, n) masses of the bodies in each group, and who is in it
        self.member = np.array([[body.name in group for body in chosen] for group in members])
        self.mass = self.member * mass
        self.is_complete = np.array([not group.bodies for group in model.groups])
        heads = work_columns(model)
        self.springs = [k for k, head in enumerate(heads) if head.endswith(f".{ENERGY}")]

    def rows(self, tables: TablesOfSteppers) -> np.ndarray:
        """Return the output times (m, columns) of these tables."""
        bodies = without_ground(read_motions(tables, self.bodies))
        motion, R = point_motion(bodies, self.s), bodies.R
        w = rotated(np.swapaxes(R, -1, -2), bodies.w)
        spin = rotated(R, rotated(self.inertia, w))
        total = self.mass.sum(axis=1)[:, None]
        x, p = (_summed(self.mass, part[:, None]) for part in (motion.x, motion.v))
        x, v = x / total, p / total
        arms = motion.x[:, None] - x[:, :, None]  # (m, g, n, 3)
        moments = cross(arms, np.broadcast_to(motion.v[:, None], arms.shape))
        L = _summed(self.mass, moments) + _summed(self.member, spin[:, None])
        rotation = _summed(self.member, dot(bodies.w, spin)[:, None, :, None])
        translation = _summed(self.mass, dot(motion.v, motion.v)[:, None, :, None])
        kinetic = 0.5 * (translation + rotation)
        potential = -_summed(self.mass, dot(motion.x, self.gravity)[:, None, :, None])
        if self.springs:
            elastic = tables["work"][:, self.springs].sum(axis=1)
            potential += self.is_complete[:, None] * elastic[:, None, None]
        found = np.concatenate([x, v, p, L, kinetic, potential], axis=-1)
        assert found.shape[-1] == len(GROUP_COLUMNS)
        return np.concatenate([tables["states"][:, :1], found.reshape(len(x), -1)], axis=1)


def _summed(weights: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the sums (m, g, k) of ``values`` (m, g or 1, n, k) over bodies, by ``weights`` (g, n).

    They are added in one order whatever the number m of rows, so that the digits do not depend on
    where a run was interrupted; those of ``einsum`` and ``@`` do.
    """
    total = np.zeros((len(values), len(weights), values.shape[-1]))
    for n in range(weights.shape[1]):
        total += weights[:, n, None] * values[:, :, n]
    return total
