"""Compute reactions in the axes of each joint: its frame on the parent, z along the joint's axis.

A published reaction is a mean over the step that ends at its output time. The frame is therefore
taken halfway between the orientations of the parent at both ends of the step; at t = 0 it is that
of the state itself. If only some steps were written, the state before is too far away, and the
frame is that of the output time: its error is of first order in the step size.
"""

import numpy as np

from msahl.algebra.rotation import compose, inverse, matrix
from msahl.algebra.vector import Vector, scale
from msahl.model import Joint
from msahl.results.read import Run
from msahl.system.names import STATE_COLUMNS, joint_columns

P = STATE_COLUMNS.index("P1")


def in_joint_axes(run: Run) -> tuple[list[str], np.ndarray]:
    """Return column names and values (m, columns): time [s], joint forces [N] and moments [N m]."""
    columns, parts = ["time"], [run.time[:, None]]
    for joint in run.model.joints:
        names = [f"{joint.name}.{c}" for c in joint_columns(joint)]
        assert run.reactions is not None
        vectors = run.reactions[names].to_numpy().reshape(len(run.time), -1, 3)
        frames = _frames(run, joint)
        parts.append(np.einsum("mij,mkj->mki", frames, vectors).reshape(len(run.time), -1))
        columns += names
    return columns, np.concatenate(parts, axis=1)


def _frames(run: Run, joint: Joint) -> np.ndarray:
    """Return (m, 3, 3): x, y, z of the joint's frame as matrix rows, in inertial axes."""
    axes = np.array(joint.parent_axes)
    bodies = {body.name for body in run.model.bodies}
    if joint.parent not in bodies:
        return np.broadcast_to(axes, (len(run.time), 3, 3))
    names = [f"{joint.parent}.{c}" for c in STATE_COLUMNS[P : P + 3]]
    parameters = [tuple(values) for values in run.states[names].to_numpy().tolist()]
    before = [parameters[0], *parameters[:-1]] if run.has_means else parameters
    halfway = [_halfway(p, q) for p, q in zip(before, parameters, strict=True)]
    return np.array([axes @ np.array(matrix(p)).T for p in halfway])


def _halfway(p: Vector, q: Vector) -> Vector:
    """Return the orientation halfway between ``p`` and ``q`` (Wiener-Milenkovic parameters)."""
    increment = compose(inverse(p), q)
    if not any(increment):
        return q
    # |increment| = 4 tan(phi/4); half of the rotation has 4 tan(phi/8).
    size = float(np.linalg.norm(increment))
    half = 4.0 * np.tan(0.5 * np.arctan(0.25 * size))
    return compose(p, scale(float(half) / size, increment))
