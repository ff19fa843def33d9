"""A hinged net of 10 x 10 meshes, hung from its upper edge, that swings in its plane.

Eleven columns of ten rods hang from fixed hinges side by side; at each of the ten levels ten
rods join neighbouring columns. Each mesh is a closed loop of four hinged rods (the ground is the
first row's upper rod): 100 loops, 210 bodies, 310 hinges about y. Columns stay parallel, so ten
degrees of freedom remain, those of a chain of ten rods.
"""

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.mechanisms.parts import body, joint, model, rod
from msahl.algebra.vector import Vector
from msahl.model import Joint, Model, RigidBody

MESHES = 10
"""Rows, and columns of meshes."""
LENGTH, MASS, RADIUS = 0.2, 0.5, 0.01
"""Of each rod [m], [kg], [m]."""
ANGLE = 0.5
"""Of the columns from the vertical at the start [rad]."""
ACROSS: Vector = (0.0, 1.0, 0.0)
GRAVITY = (0.0, 0.0, -9.81)


def net(meshes: int = MESHES) -> Model:
    """Return the model of ``meshes`` x ``meshes`` loops."""
    down = LENGTH * np.array([np.sin(ANGLE), 0.0, -np.cos(ANGLE)])
    across = np.array([LENGTH, 0.0, 0.0])
    columns, joints = _columns(meshes, down, across)
    bars: list[RigidBody] = []
    closing: list[Joint] = []
    inertia = rod(MASS, across, RADIUS)
    for level in range(1, meshes + 1):
        for i in range(meshes):
            name, start = f"Bar {level}.{i}", level * down + i * across
            bar = body(name, MASS, inertia, start + 0.5 * across)
            left, right = columns[i][level - 1], columns[i + 1][level - 1]
            bars.append(bar)
            joints.append(joint("revolute", f"{name} left", (left, bar), start, ACROSS))
            end = start + across
            closing.append(joint("pointOnLine", f"{name} right", (right, bar), end, ACROSS))
    rods = [rod for column in columns for rod in column]
    return model("Net of loops", GRAVITY, [*rods, *bars], [*joints, *closing])


def _columns(
    meshes: int, down: np.ndarray, across: np.ndarray
) -> tuple[list[list[RigidBody]], list[Joint]]:
    """The rods of each column, from the top, and their upper hinges."""
    inertia = rod(MASS, down, RADIUS)
    columns: list[list[RigidBody]] = []
    joints: list[Joint] = []
    for i in range(meshes + 1):
        column: list[RigidBody] = []
        for level in range(meshes):
            top = level * down + i * across
            hanging = body(f"Rod {level + 1}.{i}", MASS, inertia, top + 0.5 * down)
            above = column[-1] if column else None
            joints.append(joint("revolute", f"{hanging.name} top", (above, hanging), top, ACROSS))
            column.append(hanging)
        columns.append(column)
    return columns, joints


def swing(t: np.ndarray, meshes: int = MESHES, tolerance: float = 1e-13) -> np.ndarray:
    """Return the mass centres (t, bodies, 3) at the times ``t``, the first of which is 0, from the
    angles th of the levels:

        M_ij th_j'' = -C_ij sin(th_i - th_j) th_j'^2 - g w_i sin(th_i),  M = C cos(...) + rods J

    Mass centres of a level are at sums of e_j = (sin th_j, 0, -cos th_j) with the coefficients
    ``rods`` and ``bars``; C and w are their moments over all bodies.
    """
    rods = LENGTH * (np.tri(meshes, k=-1) + 0.5 * np.eye(meshes))
    bars = LENGTH * np.tri(meshes)
    C = MASS * ((meshes + 1) * rods.T @ rods + meshes * bars.T @ bars)
    weight = MASS * ((meshes + 1) * rods.sum(axis=0) + meshes * bars.sum(axis=0))
    J = (meshes + 1) * rod(MASS, (LENGTH, 0.0, 0.0), RADIUS)[1, 1] * np.eye(meshes)

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        th, th_dot = y[:meshes], y[meshes:]
        difference = th[:, None] - th[None, :]
        load = -C * np.sin(difference) @ th_dot**2 + GRAVITY[2] * weight * np.sin(th)
        return np.concatenate([th_dot, np.linalg.solve(C * np.cos(difference) + J, load)])

    start = np.concatenate([np.full(meshes, ANGLE), np.zeros(meshes)])
    found = solve_ivp(
        rate, (0.0, t[-1]), start, method="DOP853", t_eval=t, rtol=tolerance, atol=tolerance
    )
    th = found.y[:meshes]
    e = np.stack([np.sin(th), np.zeros_like(th), -np.cos(th)])  # (3, levels, t)
    aside = LENGTH * np.array([1.0, 0.0, 0.0])
    columns = np.einsum("lj,cjt->tlc", rods, e)
    levels = np.einsum("lj,cjt->tlc", bars, e)
    hanging = [columns[:, k] + i * aside for i in range(meshes + 1) for k in range(meshes)]
    across = [levels[:, k] + (i + 0.5) * aside for k in range(meshes) for i in range(meshes)]
    return np.stack(hanging + across, axis=1)
