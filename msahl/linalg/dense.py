"""The step's equations as a dense system in the free unknowns, for ``scipy`` and ``numpy``."""

import math

import numpy as np

from msahl.elements.constraints import scalar
from msahl.jit.kernel import kernel
from msahl.schemes.midpoint import equations
from msahl.system.arrays import State, System, SystemWorkspace
from msahl.system.unknowns import Unknowns

FAR = 1e3
"""Ratio of a step's length to the guess's, and to the longest body, that is no motion."""
AT_REST = 1e-100
"""Length [m] of a step that is none: products of such lengths would lose their digits."""


@kernel
def spread(free: np.ndarray, z: np.ndarray, Z: np.ndarray) -> None:
    """Put the free unknowns ``z`` (f,) into their nodes ``Z``."""
    for i in range(free.size):
        Z[free[i] // 3, free[i] % 3] = z[i]


@kernel
def gather(free: np.ndarray, F: np.ndarray, f: np.ndarray) -> None:
    """Take the free entries ``f`` (f,) from the nodes ``F``."""
    for i in range(free.size):
        f[i] = F[free[i] // 3, free[i] % 3]


@kernel
def guess(
    system: System,
    unknowns: Unknowns,
    state: State,
    start: SystemWorkspace,
    h: float,
    Z: np.ndarray,
    z: np.ndarray,
) -> None:
    """First guess of the free unknowns; leaves the others' values in ``Z``."""
    equations.predict(system, state, start, h, Z)
    gather(unknowns.free, Z, z)


@kernel
def residual(
    system: System,
    unknowns: Unknowns,
    state: State,
    start: SystemWorkspace,
    h: float,
    z: np.ndarray,
    Z: np.ndarray,
    f: np.ndarray,
    F: np.ndarray,
) -> tuple[float, int, float]:
    """Set the free rows ``f`` at ``z``, and ``Z`` and ``F``; what ``judge`` says of them."""
    spread(unknowns.free, z, Z)
    equations.residual(system, state, start, h, Z, F)
    gather(unknowns.free, F, f)
    return judge(system, unknowns, start, h, Z, F)


@kernel
def jacobian(
    system: System,
    unknowns: Unknowns,
    state: State,
    start: SystemWorkspace,
    h: float,
    z: np.ndarray,
    Z: np.ndarray,
    F: np.ndarray,
    values: np.ndarray,
    A: np.ndarray,
) -> None:
    """Set ``A`` (f * f,) to the dense derivative of the free rows by the free unknowns at ``z``."""
    spread(unknowns.free, z, Z)
    equations.residual(system, state, start, h, Z, F)
    equations.jacobian(system, start, h, Z, values)
    for i in range(A.size):
        A[i] = 0.0
    for i in range(unknowns.dense_from.size):
        A[unknowns.dense_to[i]] = values[unknowns.dense_from[i]]


@kernel
def judge(
    system: System,
    unknowns: Unknowns,
    start: SystemWorkspace,
    h: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> tuple[float, int, float]:
    """Largest free row relative to the step's length, or to the loads in it if they are larger; its
    index among the flat rows; and the step's length [m].
    """
    worst, largest = -1, 0.0
    step = max(AT_REST, equations.step_size(system, start, h, Z))
    for i in range(unknowns.free.size):
        unknown = unknowns.free[i]
        node = unknown // 3
        row = abs(F[node, unknown % 3]) * scalar.tolerance_factor(
            system.scalar, start.scalar, node, step
        )
        # Written so that a nan is the worst of all.
        if not row <= largest:
            worst, largest = unknown, row
            if math.isnan(row):
                break
    return largest / step, worst, step


@kernel
def is_astray(system: System, guess: float, step: float) -> bool:
    """Whether the length of a solved ``step`` is beyond all that its ``guess`` lets expect [m].

    Equations of turns have roots without end; those far out are no motion.
    """
    if step <= FAR * guess:
        return False
    longest = 0.0
    for b in range(system.frames.length.size):
        longest = max(longest, system.frames.length[b])
    return not step <= FAR * (guess + longest)
