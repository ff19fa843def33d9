"""A serial robot of six revolutes that falls under gravity, with viscous friction in each joint.

Column about z, upper arm and forearm about y, then a wrist about the forearm, across it and about
its own axis, with a payload that is off this axis. Slender cylinders; the arm starts at rest, but
the column rotates at 1 rad/s with all that it carries.
"""

import numpy as np

from benchmarks.mechanisms.parts import body, damper, disk, joint, model, rod
from msahl.model import Model

SPIN = (0.0, 0.0, 1.0)
"""Angular velocity of all bodies at the start [rad/s]."""
FRICTION = (4.0, 6.0, 4.0, 0.4, 0.3, 0.1)
"""Of the joints, viscous [N m s/rad]."""
MASSES = (20.0, 12.0, 8.0, 3.0, 2.0, 3.5)  # [kg]
RADII = (0.1, 0.06, 0.05, 0.04, 0.03, 0.05)  # [m]
LINKS = ((0.0, 0.0, 0.5), (0.27, 0.0, 0.36), (0.32, 0.0, -0.24), (0.08, 0.0, -0.06),
         (0.064, 0.0, -0.048), (0.08, 0.03, -0.06))  # fmt: skip
"""From each joint to the next, the last to twice the payload's mass centre [m]."""
FOREARM, ACROSS, UP = (0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
AXES = (UP, ACROSS, ACROSS, FOREARM, ACROSS, FOREARM)
GRAVITY = (0.0, 0.0, -9.81)


def robot() -> Model:
    """Return the model."""
    points = np.concatenate([np.zeros((1, 3)), np.cumsum(LINKS, axis=0)])
    inertias = [rod(m, link, r) for m, link, r in zip(MASSES, LINKS, RADII, strict=True)]
    inertias[5] += disk(1.0, UP, 0.05, 0.02)
    bodies = [
        body(f"Link {i + 1}", MASSES[i], inertias[i], 0.5 * (points[i] + points[i + 1]), SPIN)
        for i in range(6)
    ]
    pairs = zip([None, *bodies[:-1]], bodies, strict=True)
    joints = [
        joint("revolute", f"Joint {i + 1}", pair, points[i], AXES[i])
        for i, pair in enumerate(pairs)
    ]
    friction = [damper(j.name, c) for j, c in zip(joints, FRICTION, strict=True)]
    return model("Robot of six revolutes", GRAVITY, bodies, joints, friction)
