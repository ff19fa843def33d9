"""What MuJoCo says of the machines in examples/.

    python -m tests.importers.oracle            writes expected.json, which the tests read

MuJoCo integrates by RK4 with a small step; limits, contacts, equalities and its dry friction, all
of them soft, are switched off. Its own repair of inertias is off as well.
"""

import json
from pathlib import Path

import numpy as np
from lxml import etree

from tests.support.models import ROOT

EXPECTED = Path(__file__).with_name("expected.json")
POSES, SEED, STEP, TIMES = 20, 20, 2.5e-4, (0.5, 1.0, 2.0)
AMPLITUDE = 0.4
"""Largest coordinate [rad, m] and rate [rad/s, m/s] at the start of a fall."""
FILES = [ROOT / "examples" / name for name in ("arm.urdf", "leg.xml")]
KEPT_BY_MUJOCO = ("link", "joint")


def machines():
    """The files whose numbers are stored, by name."""
    return {path.name: path for path in FILES}


def as_tree(path):
    """A file as MuJoCo shall read it: without shapes of URDF, couplings and loops."""
    root = etree.parse(path).getroot()
    if root.tag == "robot":
        for element in list(root.iter("visual", "collision", "mimic", "limit", "transmission")):
            element.getparent().remove(element)
        for element in [e for e in root if e.tag not in KEPT_BY_MUJOCO]:
            root.remove(element)
        compiler = {"fusestatic": "false", "balanceinertia": "false"}
        etree.SubElement(etree.SubElement(root, "mujoco"), "compiler", compiler)
    else:
        for element in root.findall("equality"):
            root.remove(element)
    return etree.tostring(root)


def mujoco_model(path):
    import mujoco

    text = as_tree(path).decode()
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, STEP
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return model


def reference(path):
    """Mass, mass centres and mass matrices at random poses; a state, its accelerations and a fall
    from it."""
    import mujoco

    model = mujoco_model(path)
    moving = model.body_weldid != 0
    mass = model.body_mass * moving
    data, random = mujoco.MjData(model), np.random.default_rng(SEED)
    names = [model.joint(i).name for i in range(model.njnt)]
    assert model.nv == model.njnt, "only hinges and slides"
    poses, centres, matrices = [], [], []
    for _ in range(POSES):
        data.qpos[:] = random.uniform(-1.0, 1.0, model.nq)
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        centre = mass @ data.xipos / mass.sum()
        for found, value in zip((poses, centres, matrices), (data.qpos, centre, M), strict=True):
            found.append(value.tolist())
    q, v = model.qpos0, 0.0 * model.qpos0
    q, v = (a + random.uniform(-AMPLITUDE, AMPLITUDE, model.nv) for a in (q, v))
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:] = q, v
    mujoco.mj_forward(model, data)
    accelerations, fall = data.qacc.tolist(), []
    for k in range(1, round(TIMES[-1] / STEP) + 1):
        mujoco.mj_step(model, data)
        if any(abs(k * STEP - t) < 0.5 * STEP for t in TIMES):
            fall.append(data.qpos.tolist())
    return {
        "names": names,
        "mass": float(mass.sum()),
        "poses": poses,
        "centres": centres,
        "matrices": matrices,
        "q": q.tolist(),
        "v": v.tolist(),
        "accelerations": accelerations,
        "fall": fall,
    }


def write():
    EXPECTED.write_text(json.dumps({n: reference(p) for n, p in machines().items()}) + "\n")


if __name__ == "__main__":
    write()
