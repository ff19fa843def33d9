"""Numbers of coordinates and equations among the flat unknowns, and their plain units.

Coordinates are those of the nodes of the frames (``Frames``): a displacement [m] and a rotation
vector [rad] of each frame, both along inertial axes. Equations are those of the joints, then the
strains of beams, six for each Gauss point: rigid ones are constraints, elastic ones determine
stress resultants.
"""

import numpy as np

from msahl.elements.beams.group import COMPONENTS
from msahl.elements.constraints.equations import is_active
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.system.arrays import System, node_count, product_count


def evaluation_size(system: System) -> int:
    """Number of bodies, or as much work, that one evaluation takes (``by_size``).

    A pair of nodes at a Gauss point of a beam takes as much as a body, a scalar product a third of
    it. Searches for equilibria of beams and elastic bodies evaluate some ten times as often, so
    compiled kernels pay for small ones.
    """
    pairs = 0 if system.beams is None else system.beams.value.size * system.beams.value.shape[1]
    return moving_count(system.frames) + 10 * pairs + 3 * product_count(system)


def coordinate_numbers(system: System) -> np.ndarray:
    """(n,) flat numbers of the coordinates of all frames that can move."""
    moving = slice(moving_count(system.frames))
    nodes = np.sort([*system.frames.displacement[moving], *system.frames.rotation[moving]])
    flat: np.ndarray = (3 * nodes[:, None] + np.arange(3)).reshape(-1)
    return flat


def joint_equation_numbers(system: System) -> np.ndarray:
    """(c,) flat numbers of the constraint equations of all joints and closed contacts."""
    first, points = first_multiplier(system.frames), system.coincide.a.size
    flat = list(range(3 * first, 3 * (first + points)))
    if system.scalar:
        place = system.scalar.equations.place[acting_rows(system)]
        flat += [3 * (first + node) + slot for node, slot in place.tolist()]
    return np.array(flat, dtype=np.int64)


def acting_rows(system: System) -> np.ndarray:
    """(r,) numbers of the scalar equations that constrain anything: those of open contacts and of
    released joints do not.
    """
    none = np.zeros(0, dtype=np.int64)
    return np.flatnonzero(is_active(system.scalar.equations)) if system.scalar else none


def multiplier_numbers(system: System) -> np.ndarray:
    """(c,) flat numbers of all multipliers and their equations, those of strains last."""
    if system.beams is None:
        return joint_equation_numbers(system)
    i = np.arange(COMPONENTS)
    node = first_multiplier(system.frames) + system.beams.place[:, None] + i // 3
    return np.concatenate([joint_equation_numbers(system), (3 * node + i % 3).reshape(-1)])


def elastic_equations(system: System) -> np.ndarray:
    """(c,) whether the equation of a multiplier is that of an elastic strain."""
    none = np.zeros(joint_equation_numbers(system).size, dtype=bool)
    if system.beams is None:
        return none
    return np.concatenate([none, ~system.beams.rigid.reshape(-1).astype(bool)])


def equation_numbers(system: System) -> np.ndarray:
    """Flat numbers of the equations that are constraints."""
    return multiplier_numbers(system)[~elastic_equations(system)]


def scales(system: System) -> tuple[np.ndarray, np.ndarray]:
    """(3 nodes,) force over acceleration in an equation, and unknown over coordinate."""
    frames = system.frames
    moving = slice(moving_count(frames))
    force, place = np.ones((2, node_count(system), 3))
    force[frames.displacement[moving]] = 1.0 / frames.inverse_mass[moving, None]
    force[frames.rotation[moving]] = (frames.length[moving] / frames.inverse_mass[moving])[:, None]
    place[frames.rotation] = frames.length[:, None]
    return force.reshape(-1), place.reshape(-1)


def equation_scale(system: System) -> np.ndarray:
    """(k, 3) factor by which equations in radians are multiplied [m], 1 for others; negative for
    strains, whose multipliers in ``State.force`` are stress resultants, which resist them.
    """
    scale = np.ones((system.multipliers.node.size, 3))
    if system.scalar:
        rows = system.scalar.equations
        scale[rows.place[:, 0], rows.place[:, 1]] = rows.scale
    if system.beams is not None:
        scale[system.beams.place] = -1.0
        scale[system.beams.place + 1] = -system.beams.length[:, None]
    return scale
