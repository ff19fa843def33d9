"""A double pendulum by MuJoCo as a user writes it: 10 s, 1000 steps, every state as CSV.

    python benchmarks/mujoco_script.py states.csv

The model of ``decks/thesis/double_pendulum_89.xml``: the same columns but the rotation parameters,
for which the quaternion stands.
"""

import csv
import sys
from pathlib import Path

import mujoco
import numpy as np

MODEL = """
<mujoco>
  <option integrator="RK4" timestep="0.01" gravity="0 0 9.80665">
    <flag constraint="disable"/>
  </option>
  <worldbody>
    <body name="PendulumBob" pos="4.999238475781956 0 0.08726203218641756" euler="0 89 0">
      <inertial pos="0 0 0" mass="2" diaginertia="0.008 0.008 0.008"/>
      <joint type="ball" pos="0 0 -5"/>
      <body name="2ndBall" pos="0 0 5">
        <inertial pos="0 0 0" mass="2" diaginertia="0.008 0.008 0.008"/>
        <joint type="ball" pos="0 0 -5"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
STEPS = 1000


def main() -> None:
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    bodies = range(1, model.nbody)
    names = ["x", "y", "z", "q0", "q1", "q2", "q3", "wx", "wy", "wz", "vx", "vy", "vz"]
    rows = [row(model, data, bodies)]
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
        rows.append(row(model, data, bodies))
    with Path(sys.argv[1]).open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(
            ["time"] + [f"{model.body(b).name}.{name}" for b in bodies for name in names]
        )
        writer.writerows(rows)


def row(model: mujoco.MjModel, data: mujoco.MjData, bodies: range) -> list[float]:
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comVel(model, data)
    values, velocity = [data.time], np.zeros(6)
    for b in bodies:
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, b, velocity, 0)
        values += [*data.xpos[b].tolist(), *data.xquat[b].tolist(), *velocity.tolist()]
    return values


if __name__ == "__main__":
    main()
