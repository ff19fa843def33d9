"""The effect of the first moments of forces over a step of the midpoint element.

The law is in ``ports.concentrated``.
"""

from msahl.algebra.vector import ZERO, at, put, scale
from msahl.formulations.absolute.frames import (
    displacement_node,
    moving_count,
    offset,
    rotation_node,
)
from msahl.jit.kernel import apart, kernel, unit
from msahl.linalg import dense, sparse_lu
from msahl.ports import forces
from msahl.schemes.common.accelerations import NO_STEP
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.midpoint import equations
from msahl.system import evaluate


@unit
def set_loads(workspace: Workspace, h: float) -> None:
    """Set the loads over a step ``h`` from the prepared state, before the step is predicted."""
    if equations.set_loads(workspace.system, workspace.state, workspace.start, h):
        _solve(workspace)
        _enter(workspace, h)
    else:
        for b in range(moving_count(workspace.system.frames)):
            offset(workspace.start.frames, b, ZERO, ZERO)


@apart
def _solve(workspace: Workspace) -> None:
    """Set ``Z`` to the accelerations by the first moments of the loads, with the constraints."""
    system, start, Z, F = workspace.system, workspace.start, workspace.Z, workspace.F
    order = workspace.unknowns.elimination.order
    for node in range(Z.shape[0]):
        put(Z, node, ZERO)
    equations.residual(system, workspace.state, start, NO_STEP, Z, F)
    evaluate.joint_jacobian(system, start, NO_STEP, Z, workspace.values)
    sparse_lu.factor(workspace.unknowns.elimination, workspace.values, workspace.factor)
    for node in range(F.shape[0]):
        put(F, node, ZERO)
    forces.add_first(system.forces, start.forces, system.frames, F)
    dense.gather(order, F, workspace.y)
    sparse_lu.solve(workspace.unknowns.elimination, workspace.factor, workspace.y)
    dense.scatter(order, workspace.y, Z)


@kernel
def _enter(workspace: Workspace, h: float) -> None:
    """Set the velocity offsets of the frames from the accelerations in ``Z``."""
    frames = workspace.system.frames
    for b in range(moving_count(frames)):
        dv = scale(h, at(workspace.Z, displacement_node(frames, b)))
        dW = scale(h / frames.length[b], at(workspace.Z, rotation_node(frames, b)))
        offset(workspace.start.frames, b, dv, dW)
