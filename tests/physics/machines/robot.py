"""Six-axis robot on computed-torque control: recursive Newton-Euler algorithm in inertial axes.

The joints' axes are z, y, y, x, y, x; at q = 0 the axes of all links are parallel to the inertial
ones. Forward: angular velocity, angular acceleration and acceleration of the joint's point of each
link from those of the link before; backward: force and moment at each joint; the torque is the
moment along the axis. It is linear in the joints' accelerations, tau = M(q) qdd + h(q, qd), so a
batch of accelerations gives M and h.
"""

from dataclasses import dataclass, replace

import numpy as np

from tests.physics.machines.integration import integrate, rotation

X, Y, Z = np.eye(3)
AXES = (Z, Y, Y, X, Y, X)
GRAVITY = np.array([0.0, 0.0, -9.81])
TOOL = np.array([0.072, 0.0, 0.0])
"""Flange from the point of joint 6 [m]."""


@dataclass(frozen=True)
class Link:
    """A link: its joint's point from that of the link before, and its inertia, in link axes."""

    offset: tuple[float, float, float]
    mass: float
    centre: tuple[float, float, float]
    """Mass centre from the joint's point [m]."""
    inertia: tuple[float, float, float]
    """Principal moments about the mass centre, along the link's axes [kg m^2]."""


LINKS = (
    Link((0.0, 0.0, 0.0), 3.1, (0.0, 0.0, 0.24), (0.014, 0.014, 0.010)),
    Link((0.0, 0.0, 0.29), 3.9, (0.001, 0.0, 0.10), (0.026, 0.024, 0.006)),
    Link((0.0, 0.0, 0.27), 2.9, (0.023, -0.001, 0.058), (0.006, 0.014, 0.013)),
    Link((0.134, 0.0, 0.07), 1.3, (0.092, -0.001, 0.0), (0.003, 0.004, 0.005)),
    Link((0.168, 0.0, 0.0), 0.55, (0.0, 0.0, 0.0), (0.0004, 0.0008, 0.0009)),
    Link((0.0, 0.0, 0.0), 0.64, (0.095, 0.0, 0.002), (0.0004, 0.0005, 0.0005)),
)
NAMES = ("Column", "Arm", "Elbow", "Forearm", "Wrist", "Tool")
KP, KD = 100.0, 20.0
"""Gains [1/s^2, 1/s]: errors decay with (a + b t) exp(-10 t)."""
MIDDLE = np.radians([0.0, 20.0, 10.0, 0.0, 40.0, 0.0])
SWING = np.radians([50.0, 25.0, 20.0, 60.0, 30.0, 90.0])
FREQUENCY = np.array([2.0, 3.0, 2.0, 3.0, 4.0, 3.0])
PHASE = np.radians([0.0, 90.0, 45.0, 0.0, 30.0, 0.0])
START = np.radians([10.0, 40.0, 30.0, -10.0, 50.0, 15.0])
"""Angles at the start, at rest: all joints are off the path."""


def cross(a, b):
    """Vector products of the last axes; numpy's own spends most of its time on finding axes."""
    a1, a2, a3 = a.T
    b1, b2, b3 = b.T
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1]).T


def path(t):
    """Angles, rates and accelerations of the path."""
    phase = FREQUENCY * t + PHASE
    return (
        MIDDLE + SWING * np.sin(phase),
        SWING * FREQUENCY * np.cos(phase),
        -SWING * FREQUENCY**2 * np.sin(phase),
    )


def kinematics(q, links=LINKS):
    """Rotations R (6, 3, 3), axes (6, 3) and joints' points (6, 3), in inertial axes."""
    R, point, rotations, axes, points = np.eye(3), np.zeros(3), [], [], []
    for link, axis, angle in zip(links, AXES, q, strict=True):
        point = point + R @ np.array(link.offset)
        axes.append(R @ axis)
        R = R @ rotation(axis, angle)
        rotations.append(R)
        points.append(point)
    return np.array(rotations), np.array(axes), np.array(points)


def torques(q, qd, qdd, links=LINKS):
    """(k, 6) torques for a batch of accelerations ``qdd`` (k, 6), by recursive Newton-Euler."""
    rotations, axes, points = kinematics(q, links)
    k = len(qdd)
    w, dw, a = np.zeros(3), np.zeros((k, 3)), np.broadcast_to(-GRAVITY, (k, 3))
    before = np.zeros(3)
    forces, moments, arms = [], [], []
    for i, link in enumerate(links):
        r = points[i] - before
        a = a + cross(dw, r) + cross(w, cross(w, r))
        dw = dw + qdd[:, i, None] * axes[i] + cross(w, axes[i] * qd[i])
        w = w + axes[i] * qd[i]
        R = rotations[i]
        c, J = R @ np.array(link.centre), R @ np.diag(link.inertia) @ R.T
        forces.append(link.mass * (a + cross(dw, c) + cross(w, cross(w, c))))
        moments.append(dw @ J + cross(w, J @ w))
        arms.append(c)
        before = points[i]
    tau, f, n = np.zeros((k, 6)), np.zeros((k, 3)), np.zeros((k, 3))
    after = points[-1]
    for i in reversed(range(6)):
        n = n + moments[i] + cross(arms[i], forces[i]) + cross(after - points[i], f)
        f = f + forces[i]
        tau[:, i] = n @ axes[i]
        after = points[i]
    return tau


def accelerations(q, qd, tau, links=LINKS):
    """(6,) accelerations under the torques ``tau``."""
    every = torques(q, qd, np.vstack([np.zeros(6), np.eye(6)]), links)
    h = every[0]
    return np.linalg.solve((every[1:] - h).T, tau - h)


def control(t, q, qd, links=LINKS):
    """(6,) torques of the controller, which takes the robot's links to be ``links``."""
    q_ref, v_ref, a_ref = path(t)
    wanted = a_ref + KD * (v_ref - qd) + KP * (q_ref - q)
    return torques(q, qd, wanted[None], links)[0]


def motion(times, links=LINKS, rtol=1e-12):
    """(times, 12) angles and rates of the robot with these links; the controller takes LINKS."""

    def rates(t, y):
        q, qd = y[:6], y[6:]
        return np.concatenate([qd, accelerations(q, qd, control(t, q, qd), links)])

    return integrate(rates, np.concatenate([START, np.zeros(6)]), times, rtol)


def exact(times):
    """(times, 6) angles if the controller's model is the robot: errors of each joint decay."""
    q_ref, v_ref, _ = path(0.0)
    e, de = START - q_ref, -v_ref
    t = np.asarray(times)[:, None]
    decay = (e + (de + KD / 2 * e) * t) * np.exp(-KD / 2 * t)
    return np.array([path(each)[0] for each in times]) + decay


def heavier(extra=0.5):
    """The links with ``extra`` kg more at the tool's mass centre, unknown to the controller."""
    return (*LINKS[:-1], replace(LINKS[-1], mass=LINKS[-1].mass + extra))


def tool(q):
    """(3,) position of the flange."""
    rotations, _, points = kinematics(q)
    return points[-1] + rotations[-1] @ TOOL


def places(y):
    """Position and axes of each link by its name, from one of the times of ``motion``."""
    rotations, _, points = kinematics(y[:6])
    return dict(zip(NAMES, zip(points, rotations, strict=True), strict=True))
