"""The motion of bodies in the rows of the tables of states and accelerations, inertial axes."""

from collections.abc import Mapping, Sequence

import numpy as np

from msahl.algebra.rotation_arrays import rotated, rotations
from msahl.formulations.absolute.rigid_body import ACCELERATION_SIZE, STATE_SIZE
from msahl.joints.coordinates import Motion
from msahl.model import Model

TablesOfSteppers = Mapping[str, np.ndarray]
"""Tables (m, columns) that the steppers fill, by name; see ``run.tables``."""
GROUND = -1
"""Number of every ground among the bodies of a motion: the last."""


def numbers_of_bodies(model: Model) -> dict[str, int]:
    """Return the number of each body, and ``GROUND`` of each ground, by name."""
    found = {body.name: number for number, body in enumerate(model.bodies)}
    return found | {ground.name: GROUND for ground in model.grounds}


def body_motions(
    states: np.ndarray, accelerations: np.ndarray | None, chosen: np.ndarray
) -> Motion:
    """Return the motion of the ``chosen`` bodies (k,) and, after them, of the ground, with axes
    (m, k+1, ...), in m rows of the tables, whose first column is the time.
    """
    m = len(states)
    table = states[:, 1:].reshape(m, -1, STATE_SIZE)[:, chosen]
    x, P, v, w = (_with_ground(table[..., 3 * i : 3 * i + 3]) for i in range(4))
    R = rotations(P)
    motion = Motion(x, R, rotated(R, v), rotated(R, w))
    if accelerations is None:
        return motion
    table = accelerations[:, 1:].reshape(m, -1, ACCELERATION_SIZE)[:, chosen]
    a, alpha = (_with_ground(table[..., 3 * i : 3 * i + 3]) for i in range(2))
    return motion._replace(a=rotated(R, a), alpha=rotated(R, alpha))


def select(model: Model, names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers of the bodies named, each once, and where each name stands among them;
    ``GROUND`` for a ground and for "".
    """
    numbers = numbers_of_bodies(model)
    wanted = np.array([numbers.get(name, GROUND) for name in names], dtype=int)
    bodies = np.flatnonzero(np.bincount(wanted[wanted != GROUND]))
    return bodies, np.where(wanted == GROUND, GROUND, np.searchsorted(bodies, wanted))


def read_motions(tables: TablesOfSteppers, chosen: np.ndarray) -> Motion:
    """Return ``body_motions`` of the tables of states and, if there is one, of accelerations."""
    return body_motions(tables["states"], tables.get("accelerations"), chosen)


def without_ground(motion: Motion) -> Motion:
    """Return the motion of all but the last body."""
    return of_bodies(motion, np.arange(motion.x.shape[1] - 1))


def of_bodies(motion: Motion, bodies: np.ndarray) -> Motion:
    """Return the motion of bodies by their numbers (j,) in ``motion``."""
    found = Motion(*(part[:, bodies] for part in motion[:4]))
    if motion.a is None or motion.alpha is None:
        return found
    return found._replace(a=motion.a[:, bodies], alpha=motion.alpha[:, bodies])


def _with_ground(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (m, k, 3) with a row of zeros for the ground after the bodies."""
    return np.concatenate([vectors, np.zeros((len(vectors), 1, 3))], axis=1)
