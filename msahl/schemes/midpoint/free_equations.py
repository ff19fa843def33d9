"""Evaluates the step equations of order 2 in the free unknowns, and judges their residual.

scipy works with these unknowns z (f,) and rows f(z) (f,); all others keep their predicted values.
The relative residual is

    max |F| / L ,    L = largest term of the step's own motion [m]

or relative to the loads in a row, where they are larger than L. It decides whether a step is solved
(``outcome.TOLERANCE``), for every solver.
"""

import math

import numpy as np

from msahl.elements.constraints import scalar
from msahl.jit.kernel import apart, kernel
from msahl.linalg import dense
from msahl.schemes.common.criteria import AT_REST, step_length
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.midpoint import equations


@kernel
def predict(workspace: Workspace, h: float, z: np.ndarray) -> None:
    """Set ``z`` to the predicted free unknowns; ``workspace.Z`` receives those of all unknowns."""
    equations.predict(workspace.system, workspace.state, workspace.start, h, workspace.Z)
    dense.gather(workspace.unknowns.free, workspace.Z, z)


@kernel
def residual(
    workspace: Workspace, h: float, z: np.ndarray, f: np.ndarray
) -> tuple[float, int, float]:
    """Set the free rows ``f`` at ``z``; return what ``relative_residual`` does."""
    dense.scatter(workspace.unknowns.free, z, workspace.Z)
    equations.residual(
        workspace.system, workspace.state, workspace.start, h, workspace.Z, workspace.F
    )
    dense.gather(workspace.unknowns.free, workspace.F, f)
    return relative_residual(workspace, h)


@kernel
def jacobian(workspace: Workspace, h: float, z: np.ndarray, A: np.ndarray) -> None:
    """Set ``A`` (f * f,) to the dense derivative of the free rows by the free unknowns at ``z``."""
    system, state, start, Z = workspace.system, workspace.state, workspace.start, workspace.Z
    unknowns = workspace.unknowns
    dense.scatter(unknowns.free, z, Z)
    equations.residual(system, state, start, h, Z, workspace.F)
    equations.jacobian(system, start, h, Z, workspace.values)
    dense.scatter_matrix(unknowns.dense_to, unknowns.dense_from, workspace.values, A)


@apart
def relative_residual(workspace: Workspace, h: float) -> tuple[float, int, float]:
    """Largest free residual relative to the step's length, or to the loads in it if they are
    larger; its index among the flat rows; and the step's length [m].
    """
    system, start, free, F = (
        workspace.system,
        workspace.start,
        workspace.unknowns.free,
        workspace.F,
    )
    worst, largest = -1, 0.0
    length = max(AT_REST, step_length(system, start, h, workspace.Z))
    for i in range(free.size):
        unknown = free[i]
        node = unknown // 3
        row = abs(F[node, unknown % 3]) * scalar.tolerance_factor(
            system.scalar, start.scalar, node, length
        )
        # Written so that a nan counts as the largest of all.
        if not row <= largest:
            worst, largest = unknown, row
            if math.isnan(row):
                break
    return largest / length, worst, length
