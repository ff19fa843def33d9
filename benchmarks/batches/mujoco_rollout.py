"""The plan by MuJoCo's ``rollout`` in two threads: one compiled model with other numbers."""

import copy
from collections.abc import Sequence

import mujoco
import numpy as np
from mujoco import rollout

from benchmarks.batches.plan import CORES, GRID, SPAN, Clock, Sample, model_of
from benchmarks.mujoco_peer import _compile

BASE = Sample(2.0, 89.0)


def positions(plan: Sequence[Sample], h: float) -> np.ndarray:
    """(samples, rows, 2, 3) mass centres at the grid."""
    models, states = _run(plan, h)
    every, found = round(GRID / h), list[list[np.ndarray]]()
    for model, rows in zip(models, states, strict=True):
        data = mujoco.MjData(model)
        own = []
        for row in [None, *rows[every - 1 :: every]]:
            state = _start(model, data, plan[len(found)]) if row is None else row
            mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
            mujoco.mj_kinematics(model, data)
            own.append(data.xipos[1:].copy())
        found.append(own)
    return np.array(found)


def seconds(plan: Sequence[Sample], h: float) -> tuple[float, float]:
    """Time of the plan, from numbers to states, as of ``Clock``; the base is compiled before."""
    _run(plan[:2], h)
    clock = Clock()
    _run(plan, h)
    return clock.read()


def _run(plan: Sequence[Sample], h: float) -> tuple[list[mujoco.MjModel], np.ndarray]:
    base = _compile(model_of(BASE))
    base.opt.timestep = h
    data = mujoco.MjData(base)
    second = mujoco.mj_name2id(base, mujoco.mjtObj.mjOBJ_BODY, "2ndBall")
    models = []
    for sample in plan:
        model = copy.copy(base)
        model.body_mass[second] = sample.m
        mujoco.mj_setConst(model, data)
        models.append(model)
    starts = np.array([_start(base, data, sample) for sample in plan])
    threads = [mujoco.MjData(base) for _ in range(CORES)]
    with rollout.Rollout(nthread=CORES) as pool:
        states, _ = pool.rollout(models, threads, starts, nstep=round(SPAN / h))
    return models, states


def _start(model: mujoco.MjModel, data: mujoco.MjData, sample: Sample) -> np.ndarray:
    """Return the state at t = 0: the first ball joint rotates the pendulum as a rigid body."""
    mujoco.mj_resetData(model, data)
    angle = np.radians(sample.phi - BASE.phi)
    mujoco.mju_axisAngle2Quat(data.qpos[:4], np.array([0.0, 1.0, 0.0]), angle)
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return state
