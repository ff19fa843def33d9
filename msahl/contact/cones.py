"""The cones of Coulomb's friction of several contacts, as arrays."""

from typing import NamedTuple

import numpy as np


class Cones(NamedTuple):
    """What k contacts have; numbers of unknowns count in z."""

    normal: np.ndarray  # (k,)
    tangent: np.ndarray  # (k, 2) or -1 without friction
    friction: np.ndarray  # (k,) mu
    least: np.ndarray  # (k,) of the normal parts
    toward: np.ndarray  # (k, 2) direction of a slip that is given, else nan


def smooth(count: int) -> Cones:
    """Return the cones of so many contacts without friction."""
    none, number = np.zeros(count), np.arange(count)
    tangent, toward = np.full((count, 2), -1), np.full((count, 2), np.nan)
    return Cones(number, tangent, none, none, toward)


def of_contacts(cones: Cones, k: np.ndarray) -> tuple[np.ndarray, Cones]:
    """Return the unknowns (p,) of the contacts ``k``, and their cones, which count among these."""
    t = cones.tangent[k]
    used = np.concatenate([cones.normal[k], t[t >= 0]])
    number = np.full(max(int(used.max(initial=0)), 0) + 2, -1)
    number[used] = np.arange(used.size)
    return used, Cones(number[cones.normal[k]], number[t], *(part[k] for part in cones[2:]))
