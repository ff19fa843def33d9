"""Forces, moments and their derivatives enter the equations of the frames.

A force F and a moment M about the origin of a frame f add to its rows

    force equations     factor F / m
    moment equations    factor M / (m l)

with m and l of ``frames``. At one configuration ``factor`` is 1, and rows are accelerations
[m/s^2]; over a step of the midpoint element it is -dt2, dt2 = h^2/2 (see ``schemes``), and rows are
lengths [m]. Derivatives are by unknowns, which are lengths, too: u, and l times a rotation.
``frames.tangent`` and ``frames.end_tangent`` give those of a vector fixed in a frame.
"""

import numpy as np

from msahl.algebra.vector import Matrix, Vector, accumulate, scale
from msahl.formulations.absolute.frames import Frames, displacement_node, rotation_node
from msahl.jit.kernel import kernel


@kernel
def force_factor(frames: Frames, factor: float, f: int) -> float:
    """What a unit force at frame ``f`` adds to its force equations."""
    c: float = factor * frames.inverse_mass[f]
    return c


@kernel
def moment_factor(frames: Frames, factor: float, f: int) -> float:
    """What a unit moment at frame ``f`` adds to its moment equations."""
    c: float = factor * frames.inverse_mass[f] / frames.length[f]
    return c


@kernel
def push(
    frames: Frames, factor: float, F: np.ndarray, f: int, force: Vector, moment: Vector
) -> None:
    """Add a ``force`` [N] and a ``moment`` about the origin [N m], inertial axes, to the equations
    of frame ``f``.
    """
    c = force_factor(frames, factor, f)
    accumulate(F, displacement_node(frames, f), scale(c, force))
    accumulate(F, rotation_node(frames, f), scale(c / frames.length[f], moment))


@kernel
def add_block(values: np.ndarray, start: int, c: float, M: Matrix) -> None:
    """Add ``c M`` to the block at ``start``; block 0 belongs to no node."""
    if start > 0:
        for i in range(3):
            for j in range(3):
                values[start + 3 * i + j] += c * M[i][j]


@kernel
def add_slope(
    frames: Frames,
    factor: float,
    values: np.ndarray,
    f: int,
    places: tuple[int, int],
    of_force: Matrix,
    of_moment: Matrix,
) -> None:
    """Add the derivatives of a force and of a moment at frame ``f`` by the unknowns of one node,
    whose blocks in the force and in the moment equations start at ``places``.
    """
    c = force_factor(frames, factor, f)
    add_block(values, places[0], c, of_force)
    add_block(values, places[1], c / frames.length[f], of_moment)
