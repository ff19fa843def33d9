"""A model made in Python is checked by the run; that of a deck has been checked by its reader."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.algebra.vector import ZERO
from msahl.check import ModelError
from msahl.model import Joint, JointSpring
from tests.support.models import GROUND, body, build_model, simulate, tensor


def hinged(twist, **bob):
    """A bob on a hinge with a coil spring; the child's frame is rotated by ``twist`` [rad]."""
    axes = tensor(np.array(matrix(from_axis_angle((0.0, 0.0, 1.0), twist))).T)
    hinge = Joint("Hinge", "revolute", GROUND.name, "Bob", ZERO, ZERO, child_axes=axes)
    coil = JointSpring("Coil", "Hinge", "angle", 3.0, 0.1)
    return build_model([body(**bob)], [hinge], [coil], t_final=0.1)


def test_a_model_with_faults_is_not_run_and_all_are_named():
    model = hinged(0.4, mass=-1.0)
    with pytest.raises(ModelError) as caught:
        simulate(model, dt=0.01)
    assert str(caught.value).splitlines() == [str(fault) for fault in caught.value.faults]
    mass, frames = caught.value.faults
    assert str(mass) == "body 'Bob', mass: the mass is -1 kg; it must be greater than zero"
    assert "joint 'Hinge', child_axes: its frames are rotated by 22.9" in str(frames)


@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
def test_a_coil_spring_counts_from_the_start_in_every_scheme(scheme):
    """So the bob stays at rest; with frames that do not coincide it would not in all of them."""
    run = simulate(hinged(0.0), dt=0.01, scheme=scheme)
    assert run.report.status == "completed"
    assert np.array_equal(run.matrices()[-1], np.eye(3))


def test_a_model_is_run_as_it_is_if_it_was_checked():
    twisted = hinged(0.4)
    assert simulate(twisted, dt=0.01, checked=True).report.status == "completed"
    with pytest.raises(ModelError):
        simulate(replace(twisted, gravity=(0.0, np.nan, 0.0)), dt=0.01)
