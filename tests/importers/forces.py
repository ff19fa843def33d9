"""Small models of MJCF, each with one kind of force, and what MuJoCo says of their accelerations.

    python -m tests.importers.forces            writes expected_forces.json, which the tests read

The state is drawn at random, and its accelerations are those of every body with a name: of its
origin and angular, both in its own axes. Constraints, all of them soft in MuJoCo, are switched off.
"""

import json
import re
from pathlib import Path

import numpy as np

EXPECTED = Path(__file__).with_name("expected_forces.json")
SEED, AMPLITUDE = 37, 0.6
"""Largest change of a coordinate [rad, m] and rate [rad/s, m/s]."""
ROD = '<geom type="capsule" fromto="0 0 0 0.3 0 0.1" size="0.05"/>'
BRICK = '<geom type="box" pos="0.1 0 0.2" size="0.05 0.1 0.15"/>'
CHAIN = f"""
<body name="a" pos="0 0 1" euler="10 20 30">
  <joint name="j1" axis="0 1 0" ref="10" springref="5" stiffness="0.3" armature="0.02"/>{ROD}
  <body name="b" pos="0.3 0 0.1" euler="40 0 10">
    <joint name="j2" type="slide" axis="1 0 1" ref="0.1" springref="0.2" armature="0.1"/>{BRICK}
    <body name="c" pos="0.3 0 0.1" euler="40 0 10"><joint name="j3" axis="1 0 0.2"/>{ROD}</body>
  </body>
</body>"""
BALLS = f"""
<body name="a" pos="0 0 1" euler="10 20 30"><joint name="j1" type="ball" {{first}}/>{ROD}
  <body name="b" pos="0.3 0 0.1" euler="40 0 10"><joint name="j2" type="ball" {{second}}/>{BRICK}
  </body>
</body>"""
FREE = f"""
<body name="a" pos="1 2 3" euler="10 20 30"><joint type="free" {{free}}/>{ROD}
  <site name="s" pos="0.1 0.2 0.3" euler="40 50 60"/>
  <body pos="0.3 0 0.1" euler="3 4 5">{BRICK}<site name="t" pos="0.1 0 0.3" euler="40 0 60"/></body>
  <body name="b" pos="0.3 0 0.1"><joint type="ball" damping="0.2" pos="0.05 0 0"/>{BRICK}</body>
</body>"""
TENDONS = """
<tendon>
  <fixed name="T" stiffness="10" damping="2">
    <joint joint="j1" coef="2"/><joint joint="j2" coef="-3"/>
  </fixed>
  <fixed name="U" springlength="0.01 0.02" stiffness="30" damping="0.1">
    <joint joint="j3" coef="1.5"/>
  </fixed>
</tendon>"""


def model(world, others=""):
    return f"<mujoco>{others}<worldbody>{world}</worldbody></mujoco>"


MODELS = {
    "dampers of ball joints": model(BALLS.format(first='damping="0.3"', second='damping="0.1"')),
    "springs of ball joints": model(BALLS.format(first='stiffness="2"', second='stiffness="1.5"')),
    "damper of a free joint": model(FREE.format(free='damping="0.7"')),
    "actuators at ball joints": model(
        BALLS.format(first="", second=""),
        '<actuator><motor joint="j2" gear="0 1 0.3"/><position joint="j2" gear="1 2 -0.5" kp="3" '
        'dampratio="0.5"/><velocity joint="j1" gear="1 2 -0.5" kv="3"/>'
        '<damper joint="j2" kv="2" gear="0 0 1" ctrlrange="0 1"/></actuator>',
    ),
    "thrusts at sites": model(
        FREE.format(free=""),
        '<actuator><motor site="s" gear="1 2 3 0.1 0.2 0.3"/>'
        '<motor site="t" gear="0 0 3" ctrlrange="0 0.1"/></actuator>',
    ),
    "fixed tendons": model(
        CHAIN,
        f'{TENDONS}<actuator><motor tendon="T" gear="3"/><position tendon="U" kp="4" kv="0.3" '
        'ctrlrange="-0.1 0.1"/><general tendon="T" gainprm="3 1 2" gaintype="affine" '
        'biastype="affine" biasprm="1 2 -3" gear="-2"/></actuator>',
    ),
    "damping ratios": model(
        CHAIN,
        f'{TENDONS}<actuator><position joint="j1" kp="20" dampratio="0.7"/>'
        '<position joint="j2" kp="20" dampratio="1.2" gear="-3"/>'
        '<position tendon="T" kp="3" dampratio="0.6" gear="2"/>'
        '<general joint="j3" gainprm="5" biastype="affine" biasprm="0 -5 0.4"/></actuator>',
    ),
    "ranges that are inherited": model(
        CHAIN.replace('"j1"', '"j1" range="-2 3"').replace('"j2"', '"j2" range="-0.2 0.1"'),
        '<actuator><position joint="j1" kp="20" inheritrange="0.5"/>'
        '<position jointinparent="j3" kp="2" kv="0.1"/>'
        '<position joint="j2" kp="20" inheritrange="1"/></actuator>',
    ),
    "springs and dampers by time constants": model(
        CHAIN.replace('"j2"', '"j2" springdamper="0.3 0.8"').replace(
            '"j3"', '"j3" springdamper="0.3 0.8" springref="12"'
        )
        + re.sub('name="(.*?)"', r'name="\1 2"', BALLS).format(
            first='springdamper="0.5 0.4"', second='springdamper="0.2 1"'
        )
    ),
    "actuators with states": model(
        CHAIN,
        f'{TENDONS}<actuator><position joint="j1" kp="20" kv="2" timeconst="0.2"/>'
        '<cylinder joint="j2" timeconst="0.3" diameter="2" bias="1 2 -3" ctrlrange="-1 0.5"/>'
        '<general tendon="T" dyntype="filter" dynprm="0.1" gaintype="affine" gainprm="3 1 2"/>'
        '<general joint="j3" dyntype="integrator" gainprm="4"/></actuator>',
    ),
    "weights taken off": model(
        CHAIN.replace('"b"', '"b" gravcomp="0.7"')
        .replace('"c"', '"c" gravcomp="1"')
        .replace(BRICK, f'{BRICK}<body pos="0.1 0.2 0.3" gravcomp="1.5">{BRICK}</body>'),
        '<option gravity="1 2 -5"/>',
    ),
    "shells": model(
        CHAIN.replace("<geom ", '<geom shellinertia="true" ').replace(
            BRICK.replace("<geom ", '<geom shellinertia="true" '),
            "".join(
                f'<geom type="{kind}" size="{size}" pos="0.{k} 0.1 0" shellinertia="true"/>'
                for k, (kind, size) in enumerate(
                    [("sphere", "0.1"), ("box", "0.1 0.2 0.3"), ("cylinder", "0.1 0.3"),
                     ("ellipsoid", "0.1 0.2 0.3")]
                )
            ),
        )
    ),
    "replicates": model(
        '<replicate count="3" offset="0 1 0" euler="20 0 10"><body name="A" pos="0.1 0 0">'
        f'<joint name="j"/>{ROD}<replicate count="2" sep="-" offset="0.4 0 0" euler="0 70 0">'
        f'<body name="B" pos="0.1 0 0"><joint name="k"/>{BRICK}</body></replicate>'
        "</body></replicate>",
        '<actuator><motor name="m" joint="j"/><position name="p" joint="k" kp="3"/></actuator>',
    ),
}  # fmt: skip


def reference(text):
    """A state at random, and the accelerations of all bodies with names."""
    import mujoco

    found = mujoco.MjModel.from_xml_string(text)
    found.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data, random = mujoco.MjData(found), np.random.default_rng(SEED)
    data.qvel[:] = random.uniform(-AMPLITUDE, AMPLITUDE, found.nv)
    mujoco.mj_integratePos(found, data.qpos, random.uniform(-AMPLITUDE, AMPLITUDE, found.nv), 1.0)
    data.ctrl[:] = random.uniform(-1.0, 1.0, found.nu)
    data.act[:] = random.uniform(-1.0, 1.0, found.na)
    mujoco.mj_forward(found, data)
    mujoco.mj_rnePostConstraint(found, data)
    accelerations = {}
    for i in range(1, found.nbody):
        both, R = np.zeros(6), data.xmat[i].reshape(3, 3)
        mujoco.mj_objectAcceleration(found, data, mujoco.mjtObj.mjOBJ_XBODY, i, both, 0)
        a = R.T @ (both[3:] + found.opt.gravity)  # MuJoCo's are relative to free fall
        if found.body(i).name:
            accelerations[found.body(i).name] = [*a.tolist(), *(R.T @ both[:3]).tolist()]
    state = {"qpos": data.qpos, "qvel": data.qvel, "ctrl": data.ctrl, "act": data.act}
    return {"accelerations": accelerations, **{k: v.tolist() for k, v in state.items()}}


def write():
    EXPECTED.write_text(json.dumps({n: reference(text) for n, text in MODELS.items()}) + "\n")


if __name__ == "__main__":
    write()
