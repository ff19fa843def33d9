"""A robot with four closed loops, and its motion by MuJoCo's open tree with exact constraints.

    python -m tests.importers.loops             writes expected_loops.json, which the tests read

MuJoCo's own equalities are soft. MuJoCo has the mass matrix M of the open tree, the forces Q, and
the Jacobians J of the points that coincide; the accelerations follow from

    M a - J^T lam = Q ,     J a = -J_dot v - 2 b J v - b^2 g

with the violations g of round-off taken back at the rate b (Baumgarte), and are integrated by RK4.
"""

import json
from pathlib import Path

import numpy as np

FILE = Path(__file__).with_name("four_loops.xml")
EXPECTED = Path(__file__).with_name("expected_loops.json")
SEED, STEP, TIMES, BACK = 37, 1.25e-4, (0.1, 0.2, 0.4), 20.0
RATE = 0.5
"""Largest rate at the start [rad/s, m/s]."""
CONTROLS = (0.6, -0.3, -0.4, 0.5)


class Loops:
    """The tree of a file, and the points that its <connect> elements hold together."""

    def __init__(self, path):
        import mujoco

        self.api, self.model = mujoco, mujoco.MjModel.from_xml_path(str(path))
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        self.data = mujoco.MjData(self.model)
        self.data.ctrl[:] = CONTROLS

    def constraints(self):
        """g (k,), J (k, n) and J_dot v (k,) at the state of the data."""
        api, model, data = self.api, self.model, self.data
        g, J, gamma = [], [], []
        for k in range(model.neq):
            ends = []
            for body, at in ((model.eq_obj1id[k], 0), (model.eq_obj2id[k], 3)):
                arm = model.eq_data[k, at : at + 3]
                point = data.xpos[body] + data.xmat[body].reshape(3, 3) @ arm
                Jp, Jp_dot, rotation = np.zeros((3, 3, model.nv))
                api.mj_jac(model, data, Jp, rotation, point, body)
                api.mj_jacDot(model, data, Jp_dot, rotation, point, body)
                ends.append((point, Jp, Jp_dot @ data.qvel))
            (a, J_a, c_a), (b, J_b, c_b) = ends
            g.append(b - a)
            J.append(J_b - J_a)
            gamma.append(c_b - c_a)
        return np.concatenate(g), np.concatenate(J), np.concatenate(gamma)

    def acceleration(self, q, v):
        api, model, data = self.api, self.model, self.data
        data.qpos[:], data.qvel[:] = q, v
        api.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        api.mj_fullM(model, data, M)
        Q = data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias
        g, J, gamma = self.constraints()
        k = len(g)
        matrix = np.block([[M, -J.T], [J, np.zeros((k, k))]])
        right = np.concatenate([Q, -gamma - 2.0 * BACK * J @ v - BACK**2 * g])
        return np.linalg.solve(matrix, right)[: model.nv]

    def moved(self, q, v, time):
        found = q.copy()
        self.api.mj_integratePos(self.model, found, v, time)
        return found

    def step(self, q, v, h):
        """RK4; mean rates of its stages move quaternions by rotation vectors, as in MuJoCo."""
        rates, accelerations, at = [], [], (q, v)
        for part in (0.0, 0.5, 0.5, 1.0):
            if rates:
                at = self.moved(q, rates[-1], part * h), v + part * h * accelerations[-1]
            rates.append(at[1])
            accelerations.append(self.acceleration(*at))
        weights = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
        return self.moved(q, weights @ rates, h), v + h * weights @ accelerations


def consistent(loops):
    """A state at the pose of the file, with rates at random that keep the loops closed."""
    q, v = loops.model.qpos0.copy(), np.zeros(loops.model.nv)
    loops.acceleration(q, v)
    g, J, _ = loops.constraints()
    assert np.abs(g).max() < 1e-15
    v = np.random.default_rng(SEED).uniform(-RATE, RATE, loops.model.nv)
    return q, v - np.linalg.pinv(J) @ J @ v


def reference(path=FILE, step=STEP):
    """The state at the start, and coordinates of hinges and slides at some times."""
    loops = Loops(path)
    model = loops.model
    chosen = [i for i in range(model.njnt) if model.jnt_type[i] in (2, 3)]
    q, v = consistent(loops)
    numbers = {"qpos": q.tolist(), "qvel": v.tolist(), "motion": []}
    numbers["names"] = [model.joint(i).name for i in chosen]
    for k in range(1, round(TIMES[-1] / step) + 1):
        q, v = loops.step(q, v, step)
        if any(abs(k * step - t) < 0.5 * step for t in TIMES):
            numbers["motion"].append(q[model.jnt_qposadr[chosen]].tolist())
    numbers["violation"] = float(np.abs(loops.constraints()[0]).max())
    return numbers


def write():
    EXPECTED.write_text(json.dumps(reference()) + "\n")


if __name__ == "__main__":
    write()
