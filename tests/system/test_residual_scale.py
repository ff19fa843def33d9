"""What a residual is judged by where almost nothing moves."""

import numpy as np
import pytest

from msahl.model import JointMotion, Law
from tests.support.element_samples import Frame, joint_between
from tests.support.models import GROUND, body, build_model, simulate

ACROSS = np.column_stack([(0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
STOP = 1.2


def halted(pendulum):
    """An arm that a joint motion rotates by 1 rad until ``STOP``, with a pendulum on its end or
    without.
    """
    bodies = [
        body("Arm", 2.0, (0.05, 0.2, 0.2), position=(0.5, 0.0, 0.0)),
        body("Bob", 1.0, (0.02, 0.02, 0.005), position=(1.0, 0.0, -0.4)),
    ]
    hinge = joint_between(bodies, "revolute", "H", GROUND.name, "Arm", Frame(np.zeros(3), ACROSS))
    tip = Frame(np.array([1.0, 0.0, 0.0]), ACROSS)
    pin = joint_between(bodies, "revolute", "P", "Arm", "Bob", tip)
    n = 2 if pendulum else 1
    joint_motion = JointMotion("D", "H", "angle", Law("ramp", (0.0, 1.0, 0.0, STOP)))
    return build_model(
        bodies[:n], [hinge, pin][:n], gravity=(0.0, 0.0, -9.81), motions=(joint_motion,)
    )


@pytest.mark.parametrize(
    ("pendulum", "scheme", "h"),
    [
        (False, "preserving", 5e-4),
        (False, "decaying", 5e-4),
        (False, "gauss3", 5e-4),
        (False, "radau3", 5e-4),
        (True, "preserving", 1e-4),
        (True, "gauss1", 2e-4),
        (True, "gauss3", 1e-4),
    ],
)
def test_an_arm_that_a_joint_motion_brings_to_a_halt(pendulum, scheme, h):
    """The values of a joint motion's law have the round-off of a radian, however little it
    changes in a step: no residual is smaller, and none need be.
    """
    run = simulate(halted(pendulum), h, 1.3 if pendulum else 1.5, scheme)
    assert run.report.status == "completed"
    assert run.report.subdivisions == 0
    # A guess that is good to round-off takes no more than its check; in joint coordinates the
    # second correction, which says how the first one was, has to be seen as well.
    assert run.report.iterations <= (2.0 + run.report.tree_subsystems) * len(run.time)
    # Thousands of steps each close the arm's angle to a few machine epsilons: at random 1e-14 in
    # all.
    arm = run.of("position", 0)[run.time >= STOP]
    expected = 0.5 * np.array([np.cos(1.0), 0.0, -np.sin(1.0)])
    assert arm == pytest.approx(np.broadcast_to(expected, arm.shape), abs=1e-13)
