"""Numbers of coordinates and equations among the flat unknowns, and their plain units.

They are those of ``system.evaluate``, under names of their own, and with the strains of beams, six
for each Gauss point: rigid ones are constraints, elastic ones determine stress resultants.
"""

import numpy as np

from msahl.elements.beams.group import COMPONENTS
from msahl.elements.frames import first_multiplier, moving_count
from msahl.system.arrays import System
from msahl.system.evaluate import _coordinates as coordinate_numbers
from msahl.system.evaluate import _equation_scale, _equations
from msahl.system.evaluate import _scales as scales

__all__ = [
    "coordinate_numbers",
    "elastic_equations",
    "equation_numbers",
    "equation_scale",
    "evaluation_size",
    "multiplier_numbers",
    "scales",
]


def evaluation_size(system: System) -> int:
    """Number of bodies, or as much work, that one evaluation takes (``by_size``).

    A pair of nodes at a Gauss point of a beam takes as much as a body, and searches for equilibria
    of beams evaluate them some ten times as often, so compiled kernels pay for small beams.
    """
    pairs = 0 if system.beams is None else system.beams.value.size * system.beams.value.shape[1]
    return moving_count(system.frames) + 10 * pairs


def multiplier_numbers(system: System) -> np.ndarray:
    """(c,) flat numbers of all multipliers and their equations, those of strains last."""
    if system.beams is None:
        return _equations(system)
    i = np.arange(COMPONENTS)
    node = first_multiplier(system.frames) + system.beams.place[:, None] + i // 3
    return np.concatenate([_equations(system), (3 * node + i % 3).reshape(-1)])


def elastic_equations(system: System) -> np.ndarray:
    """(c,) whether the equation of a multiplier is that of an elastic strain."""
    none = np.zeros(_equations(system).size, dtype=bool)
    if system.beams is None:
        return none
    return np.concatenate([none, ~system.beams.rigid.reshape(-1).astype(bool)])


def equation_numbers(system: System) -> np.ndarray:
    """Flat numbers of the equations that are constraints."""
    return multiplier_numbers(system)[~elastic_equations(system)]


def equation_scale(system: System) -> np.ndarray:
    """(k, 3) factor by which equations in radians are multiplied [m], 1 for others; negative for
    strains, whose multipliers in ``State.force`` are stress resultants, which resist them.
    """
    scale = _equation_scale(system)
    if system.beams is not None:
        scale[system.beams.place] = -1.0
        scale[system.beams.place + 1] = -system.beams.length[:, None]
    return scale
