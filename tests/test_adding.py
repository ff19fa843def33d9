"""A joint that the program does not have, added as docs/adding-an-element.md says: one kind."""

import numpy as np
import pytest
from elements import Sample, joint_between, random_frame, slide, turn
from scenes import random_body, random_vector, scene, simulate

from msahl.joints.joint import Equation, Kind, X, Y, Z, in_plane, perpendicular
from msahl.joints.joint import angle as turned
from msahl.joints.registry import KINDS
from msahl.system.build import build_system
from msahl.system.reduce import all_unknowns


def equations(joint):
    """A drawer that swings: it slides along x of the parent and turns about z, and no more."""
    axis = joint.child_axes[Z]
    upright = [perpendicular(joint.parent_axes[i], axis) for i in (X, Y)]
    return [in_plane(joint.parent_axes[Y]), in_plane(joint.parent_axes[Z]), *upright]


DRAWER = Kind("drawer", equations, axes=1, freedoms=("angle",))
LOCKED = Kind("lockedDrawer", lambda j: [*equations(j), Equation(turned(j), None)], axes=1)
FREE = {DRAWER: [slide((1.0, 0.0, 0.0)), turn((0.0, 0.0, 1.0))], LOCKED: [slide((1.0, 0.0, 0.0))]}


@pytest.mark.parametrize("kind", FREE, ids=lambda kind: kind.name)
def test_a_joint_of_ones_own_runs(monkeypatch, kind):
    monkeypatch.setitem(KINDS, kind.name, kind)
    rng = np.random.default_rng(3)
    bodies = [random_body(rng, name) for name in ("A", "B")]
    joint = joint_between(bodies, kind.name, "J", "A", "B", random_frame(rng), Sample(FREE[kind]))
    model = scene(bodies, [joint], gravity=random_vector(rng, 5.0))
    assert all_unknowns(build_system(model)).size == 12 + 6 - len(FREE[kind])
    run = simulate(model, dt=0.01, t_final=1.0)
    assert run.report.status == "completed"
    assert run.report.freedoms["byRank"] == 6 + len(FREE[kind])
    assert run.report.extremes["energyErrorMaxRelative"] < 1e-12
    assert run.report.extremes["gapMax"] < 1e-12
    assert run.moment().shape == (101, 3)
