"""Arrays of a tree of rigid bodies: what is constant, and what a step needs.

Bodies of the tree are numbered from 1, each after its parent; 0 is the ground. Each has a number of
coordinates, hinges and slides along axes in the order in which they act: a ball is three hinges.
They count from the start of the step, where all are zero, so no orientation is singular. The axes
of a ball are fixed in its body, the last one along its spin, by which it may rotate far in a step.

Arrays of lanes have a row for each number, (n, LANES); those of vectors three rows for each.
"""

from typing import NamedTuple

import numpy as np

from msahl.jit.lanes import LANES

NO_ALIGNMENT, ALIGN_AXES, ALIGN_FRAMES = range(3)
"""What of a joint's two frames stays together: nothing, z, everything."""


class Tree(NamedTuple):
    """Constant data of a tree of b bodies with n coordinates."""

    frame: np.ndarray  # (b+1,) of each body; the ground's first
    parent: np.ndarray  # (b+1,) number of the parent; 0 for the ground itself
    first: np.ndarray  # (b+2,) first coordinate of each body
    free: np.ndarray  # (b+1,) whether no joint holds the body
    ball: np.ndarray  # (b+1,) first of the three hinges of its ball, its last ones; -1: none
    parent_point: np.ndarray  # (b+1, 3) of the joint, from the parent's mass centre, its axes [m]
    child_point: np.ndarray  # (b+1, 3) likewise of the body itself
    alignment: np.ndarray  # (b+1,) see ``NO_ALIGNMENT``
    parent_axes: np.ndarray  # (b+1, 3, 3) x, y, z of the joint, parent's axes
    child_axes: np.ndarray  # (b+1, 3, 3) likewise in the axes of the body itself
    mass: np.ndarray  # (b+1,) [kg]
    inertia: np.ndarray  # (b+1, 3, 3) about the mass centre, body axes [kg m^2]
    bare: bool  # whether gravity is the only load
    gravity: np.ndarray  # (3,) inertial axes; zero unless ``bare``: loads contain it [m/s^2]
    body: np.ndarray  # (n,) body of each coordinate
    slides: np.ndarray  # (n,) whether it is a slide; a hinge otherwise
    axis_frame: np.ndarray  # (n,) frame in which its axis is fixed
    axis: np.ndarray  # (n, 3) in that frame's axes
    precedes: np.ndarray  # (n, b+1) whether it is on the path from the ground to a body
    before: np.ndarray  # (n,) coordinate before it on the path from the ground; -1 for none
    row: np.ndarray  # (n+1,) its entries in the mass matrix: its own, then those before it
    length: np.ndarray  # (n,) displacement of a unit of it, that of its body's length [m or 1]
    reach: np.ndarray  # (n,) largest amount of it within a step [rad or m]


class TreeMotion(NamedTuple):
    """Start of a step in inertial axes, and the motion at nodes of it in lanes."""

    origin: np.ndarray  # (3,) from which places count [m]
    parent_arm: np.ndarray  # (b+1, 3) from the parent's mass centre to the joint [m]
    child_arm: np.ndarray  # (b+1, 3) from its own mass centre [m]
    misalignment: np.ndarray  # (b+1, 3) half the rotation that aligns the joint's frames
    inertia: np.ndarray  # (b+1, 3, 3) [kg m^2]
    axis: np.ndarray  # (n, 3)
    rate: np.ndarray  # (n,) of the coordinates [rad/s or m/s]
    momentum: np.ndarray  # (n,) of the coordinates [kg m^2/s or kg m/s]
    end_momentum: np.ndarray  # (n,) those at the end of the step
    place: np.ndarray  # (3 (b+1), LANES) mass centres from the origin [m]
    quaternion: np.ndarray  # (4 (b+1), LANES) rotations from the start of the step
    rotation: np.ndarray  # (9 (b+1), LANES) their matrices
    screw: np.ndarray  # (6 n, LANES) motion by a unit rate: rotation, velocity at the origin
    screw_rate: np.ndarray  # (6 n, LANES) its rate of change
    twist: np.ndarray  # (6 (b+1), LANES) angular velocity, velocity at the origin [rad/s, m/s]
    momenta: np.ndarray  # (6 (b+1), LANES) of the body and those beyond, about the origin
    wrench: np.ndarray  # (6 (b+1), LANES) of the loads on them, about the origin [N m, N]
    load: np.ndarray  # (6 (b+1), LANES) on each body, about its mass centre [N m, N]
    q: np.ndarray  # (n, LANES) coordinates [rad or m]
    u: np.ndarray  # (n, LANES) their rates
    p: np.ndarray  # (n, LANES) their momenta
    force: np.ndarray  # (n, LANES) rates of these
    moment: np.ndarray  # (n, LANES) likewise of a ball, about axes that are fixed in its parent
    composite: np.ndarray  # (10 (b+1), LANES) mass, first and second moments beyond a body
    mass: np.ndarray  # (entries, LANES) of the mass matrix, then its factors
    y: np.ndarray  # (n, LANES) right-hand side


def new_motion(tree: Tree) -> TreeMotion:
    """Return the arrays for steps of a ``tree``."""
    b, n = tree.frame.size, tree.body.size
    lanes = {
        "place": 3 * b,
        "quaternion": 4 * b,
        "rotation": 9 * b,
        "screw": 6 * n,
        "screw_rate": 6 * n,
        **dict.fromkeys(("twist", "momenta", "wrench", "load"), 6 * b),
        **dict.fromkeys(("q", "u", "p", "force", "moment", "y"), n),
        "composite": 10 * b,
        "mass": int(tree.row[-1]),
    }
    arrays = {name: np.zeros((rows, LANES)) for name, rows in lanes.items()}
    arrays["quaternion"][0] = 1.0
    arrays["rotation"][[0, 4, 8]] = 1.0
    return TreeMotion(
        origin=np.zeros(3),
        inertia=np.zeros((b, 3, 3)),
        axis=np.zeros((n, 3)),
        rate=np.zeros(n),
        momentum=np.zeros(n),
        end_momentum=np.zeros(n),
        **{name: np.zeros((b, 3)) for name in ("parent_arm", "child_arm", "misalignment")},
        **arrays,
    )
