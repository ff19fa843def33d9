"""The table of elastic bodies: the amplitudes of their modes, and their rates.

    a_j = n_i . (P_k - P_0) - x_ki          of the follower k that carries it along the axis i
    da_j/dt = n_i . (v_k - v_0 - w_0 x (P_k - P_0))

with the axes n_i and the angular velocity w_0 of the frame, see ``model.elastic``.
"""

import numpy as np

from msahl.algebra.rotation_arrays import cross, rotated
from msahl.model import Model
from msahl.run.body_rows import TablesOfSteppers, read_motions, select


class AmplitudeTable:
    """Computes ``amplitudes.csv``, one chunk of output times after the other."""

    def __init__(self, model: Model) -> None:
        elastic = model.elastic_bodies
        carriers = [name for body in elastic for name, _ in body.amplitudes]
        frames = [body.name for body in elastic for _ in body.amplitudes]
        self.bodies, places = select(model, [*carriers, *frames])
        self.carrier, self.frame = np.split(places, 2)
        self.axis = np.array([axis for body in elastic for _, axis in body.amplitudes])
        followers = {one.body: one.place for body in elastic for one in body.followers}
        self.place = np.array([followers[name] for name in carriers]).reshape(-1, 3)

    def rows(self, tables: TablesOfSteppers) -> np.ndarray:
        """Return the output times (m, columns) of these tables."""
        motion = read_motions(tables, self.bodies)
        R = np.swapaxes(motion.R[:, self.frame], -1, -2)
        away = motion.x[:, self.carrier] - motion.x[:, self.frame]
        rate = motion.v[:, self.carrier] - motion.v[:, self.frame]
        rate = rotated(R, rate - cross(motion.w[:, self.frame], away))
        both = np.stack([rotated(R, away) - self.place, rate], axis=-1)
        own = both[:, np.arange(self.axis.size), self.axis].reshape(len(both), -1)
        return np.concatenate([tables["states"][:, :1], own], axis=1)
