"""Criteria by which the iterations of all schemes end, and lengths that residuals are judged by."""

import numpy as np

from msahl.algebra.vector import at
from msahl.formulations.absolute.frames import moving_count
from msahl.jit.kernel import kernel
from msahl.system.arrays import System, SystemWorkspace
from msahl.system.evaluate import dt2

MAX_ITERATIONS = 25
STUCK = 0.5
"""Ratio of successive residuals above which a solved step is not improved further."""
DIVERGED = 1e3
"""Residual relative to the smallest so far at which the iteration is given up."""
FAR = 1e3
"""Ratio of a step's length to that of its prediction plus the longest body beyond which the
solution is not a motion."""
AT_REST = 1e-100
"""Smallest length [m] of a step: products of smaller ones would underflow."""


@kernel
def step_length(system: System, start: SystemWorkspace, h: float, Z: np.ndarray) -> float:
    """Length of the step [m], relative to which a residual is judged: its largest term."""
    h2, gravity = dt2(system, h), system.bodies.gravity
    # A maximum for each component: one for all would have every comparison wait for the last one.
    x, y, z = h2 * abs(gravity[0]), h2 * abs(gravity[1]), h2 * abs(gravity[2])
    for b in range(moving_count(system.frames)):
        v, W, length = at(start.frames.v, b), at(start.frames.W, b), system.frames.length[b]
        x = max(x, h * abs(v[0]), h * abs(W[0]) * length)
        y = max(y, h * abs(v[1]), h * abs(W[1]) * length)
        z = max(z, h * abs(v[2]), h * abs(W[2]) * length)
    for node in range(Z.shape[0]):
        u = at(Z, node)
        x, y, z = max(x, abs(u[0])), max(y, abs(u[1])), max(z, abs(u[2]))
    return max(x, y, z)


@kernel
def is_implausible(system: System, predicted: float, length: float) -> bool:
    """Whether the ``length`` of a solved step [m] is far beyond that of its prediction.

    The equations of rotations have infinitely many roots; the distant ones are not motions.
    """
    if length <= FAR * predicted:
        return False
    longest = 0.0
    for b in range(system.frames.length.size):
        longest = max(longest, system.frames.length[b])
    return not length <= FAR * (predicted + longest)
