"""The step's equations as a dense system in the free unknowns, for ``scipy`` and ``numpy``."""

import numpy as np

from msahl.kernel import kernel
from msahl.schemes import preserving
from msahl.system.arrays import Start, State, System
from msahl.system.unknowns import Unknowns


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
    start: Start,
    h: float,
    Z: np.ndarray,
    z: np.ndarray,
) -> None:
    """First guess of the free unknowns; leaves the others' values in ``Z``."""
    preserving.predict(system, state, start, h, Z)
    gather(unknowns.free, Z, z)


@kernel
def residual(
    system: System,
    unknowns: Unknowns,
    state: State,
    start: Start,
    h: float,
    z: np.ndarray,
    Z: np.ndarray,
    f: np.ndarray,
    F: np.ndarray,
) -> tuple[float, int]:
    """Set the free rows ``f`` at ``z``, and ``Z`` and ``F``; the worst row as ``judge`` has it."""
    spread(unknowns.free, z, Z)
    preserving.residual(system, state, start, h, Z, F)
    gather(unknowns.free, F, f)
    return judge(system, unknowns, start, h, Z, F)


@kernel
def jacobian(
    system: System,
    unknowns: Unknowns,
    state: State,
    start: Start,
    h: float,
    z: np.ndarray,
    Z: np.ndarray,
    F: np.ndarray,
    values: np.ndarray,
    A: np.ndarray,
) -> None:
    """Set ``A`` (f * f,) to the dense derivative of the free rows by the free unknowns at ``z``."""
    spread(unknowns.free, z, Z)
    preserving.residual(system, state, start, h, Z, F)
    preserving.jacobian(system, start, h, Z, values)
    for i in range(A.size):
        A[i] = 0.0
    for i in range(unknowns.dense_from.size):
        A[unknowns.dense_to[i]] = values[unknowns.dense_from[i]]


@kernel
def judge(
    system: System, unknowns: Unknowns, start: Start, h: float, Z: np.ndarray, F: np.ndarray
) -> tuple[float, int]:
    """Largest free row relative to the step's length, and its index among the flat rows."""
    worst, largest = -1, 0.0
    for i in range(unknowns.free.size):
        unknown = unknowns.free[i]
        row = abs(F[unknown // 3, unknown % 3])
        # Written so that a nan is the worst of all.
        if not row <= largest:
            worst, largest = unknown, row
    if largest == 0.0:
        return 0.0, worst
    return largest / preserving.step_size(system, start, h, Z), worst
