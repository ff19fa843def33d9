"""MuJoCo: a tree of ball joints in minimal coordinates, explicit Runge-Kutta of order 4.

Settings of MuJoCo's own "energy conserving pendulum": RK4, constraint solver off. Its chains are
dense in the mass matrix, so the cost of a step grows like the square to the cube of their length.
"""

import time
from functools import lru_cache

import mujoco
import numpy as np

from benchmarks.motion import Motion, observe_outputs
from msahl.algebra.rotation import matrix
from msahl.model import Model

VERSION = mujoco.__version__
VARIANTS = ("mujoco RK4",)
ORDERS = {"mujoco RK4": 4}
SETTINGS = {
    "mujoco RK4": "integrator RK4, constraint solver disabled, no geoms, energy not computed, ball "
    "joints; as in its example of an energy conserving pendulum; steps by mj_step(nstep=N)"
}


def loop_seconds(model: Model, h: float, steps: int, variant: str) -> float:
    compiled, data = _fresh(model, h)
    began = time.perf_counter()
    mujoco.mj_step(compiled, data, nstep=steps)
    return time.perf_counter() - began


def motion(model: Model, h: float, steps: int, variant: str, every: int = 1) -> Motion:
    compiled, data = _fresh(model, h)
    rows, seconds = observe_outputs(
        lambda k: mujoco.mj_step(compiled, data, nstep=every),
        lambda: _look(compiled, data),
        steps // every,
    )
    x, R, v, w = (np.array(column) for column in zip(*rows, strict=True))
    return Motion(h * every * np.arange(len(rows)), x, R, v, w, seconds, steps)


def _fresh(model: Model, h: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    compiled = _compile(model)
    compiled.opt.timestep = h
    data = mujoco.MjData(compiled)
    R = {body.name: np.array(matrix(body.orientation)) for body in model.bodies}
    w = {body.name: R[body.name] @ body.angular_velocity for body in model.bodies}
    for k, joint in enumerate(model.joints):
        relative = w[joint.child] - w.get(joint.parent, np.zeros(3))
        data.qvel[3 * k : 3 * k + 3] = R[joint.child].T @ relative
    return compiled, data


@lru_cache(maxsize=1)
def _compile(model: Model) -> mujoco.MjModel:
    """Kept for the problem at hand: a chain of 1000 takes half a minute."""
    spec = mujoco.MjSpec()
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.gravity = model.gravity
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    bodies = {body.name: body for body in model.bodies}
    nodes = {ground.name: spec.worldbody for ground in model.grounds}
    for joint in model.joints:
        child, parent = bodies[joint.child], bodies.get(joint.parent)
        R, place = np.array(matrix(child.orientation)), np.array(child.position)
        if parent:
            R_p = np.array(matrix(parent.orientation))
            R, place = R_p.T @ R, R_p.T @ (place - parent.position)
        quaternion = np.zeros(4)
        mujoco.mju_mat2Quat(quaternion, R.ravel())
        nodes[child.name] = nodes[joint.parent].add_body(
            name=child.name,
            pos=place,
            quat=quaternion,
            mass=child.mass,
            inertia=np.diag(child.inertia),
            ipos=[0.0, 0.0, 0.0],
            explicitinertial=True,
        )
        nodes[child.name].add_joint(type=mujoco.mjtJoint.mjJNT_BALL, pos=joint.child_point)
    return spec.compile()


def _look(compiled: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, ...]:
    """Positions and velocities of the present coordinates (a step leaves older ones)."""
    mujoco.mj_kinematics(compiled, data)
    mujoco.mj_comPos(compiled, data)
    mujoco.mj_comVel(compiled, data)
    x, R = data.xipos[1:].copy(), data.xmat[1:].reshape(-1, 3, 3).copy()
    W, v = data.cvel[1:, :3], data.cvel[1:, 3:]
    root = data.subtree_com[compiled.body_rootid[1:]]
    return x, R, v + np.cross(W, x - root), np.einsum("bji,bj->bi", R, W)
