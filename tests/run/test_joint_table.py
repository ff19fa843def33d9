"""The table of joints' coordinates: revolutions, accelerations, when it is written."""

import math
from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.functions import Law
from msahl.algebra.rotation_arrays import rotations
from msahl.algebra.vector import ZERO
from msahl.check.directions import frame, unit
from msahl.model import Joint, JointMotion
from msahl.run.explain import explain
from msahl.run.joint_table import count_revolutions
from msahl.run.tables import ACCELERATIONS, JOINTS, tables_of_model
from msahl.system.names import acceleration_columns, coordinate_columns
from tests.support.models import body, build_model, deck, pendulum, simulate


def spinning(rng, rate=2.0, **simulation):
    """A motor about a random axis of the ground, and on its body a free hinge about another."""
    first, second = (unit(tuple(rng.normal(size=3))) for _ in range(2))
    start = frame(first)
    joints = (
        Joint("Motor", "revolute", "Earth", "A", ZERO, ZERO, start, start),
        Joint("Hinge", "revolute", "A", "B", (0.1, 0.2, 0.3), ZERO, frame(second), frame(second)),
    )
    law = Law("polynomial", (0.0, 2.0 * math.pi * rate))
    a = body("A", angular_velocity=tuple(2.0 * math.pi * rate * c for c in first))
    pairs = zip(first, second, strict=True)
    spin = tuple(2.0 * math.pi * (rate * c - 1.5 * rate * d) for c, d in pairs)
    v = tuple(np.cross([2.0 * math.pi * rate * c for c in first], (0.1, 0.2, 0.3)))
    b = body("B", position=(0.1, 0.2, 0.3), angular_velocity=spin, velocity=v)
    model = build_model((a, b), joints, motions=(JointMotion("M", "Motor", "angle", law),))
    return replace(model, simulation=replace(model.simulation, **simulation))


def column(run, name, levels=2):
    return run.others[JOINTS][:, coordinate_columns(run.model, levels).index(name)]


def by_orientations(run, joint, child, parent=None):
    """(rows,) the angle within one revolution, from the tables of states alone."""
    R = rotations(run.of("orientation", child))
    R_a = np.broadcast_to(np.eye(3), R.shape)
    if parent is not None:
        R_a = rotations(run.of("orientation", parent))
    x, y, _ = (R_a @ np.array(axis) for axis in joint.parent_axes)
    e = R @ np.array(joint.child_axes[0])
    return np.arctan2((y * e).sum(axis=1), (x * e).sum(axis=1))


@pytest.mark.parametrize("seed", range(2))
def test_angles_of_random_motions_agree_with_the_states_over_100_revolutions(seed):
    model = spinning(np.random.default_rng(seed))
    run = simulate(model, dt=0.01, t_final=51.0)
    for joint, child, parent in ((model.joints[0], 0, None), (model.joints[1], 1, 0)):
        angle = column(run, f"{joint.name}.angle")
        expected = np.unwrap(by_orientations(run, joint, child, parent))
        assert abs(angle[-1] - angle[0]) > 100 * 2.0 * math.pi
        assert angle == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())
    assert column(run, "Motor.angle")[-1] == pytest.approx(4.0 * math.pi * 51.0, rel=1e-12)


def test_revolutions_are_counted_between_thinned_output_times():
    """50 steps, one revolution of the motor and 1.5 of the hinge, between two rows."""
    model = spinning(np.random.default_rng(3))
    fine, thin = (simulate(model, dt=0.01, t_final=20.0, every=n) for n in (1, 50))
    for name in ("Motor.angle", "Hinge.angle"):
        assert column(thin, name).tolist() == column(fine, name)[::50].tolist()


def test_revolutions_are_counted_in_steps_of_more_than_half_a_revolution():
    """Gauss steps of 0.6 s: 1.2 revolutions of the motor."""
    model = spinning(np.random.default_rng(4), output_interval=0.6)
    run = simulate(model, dt=0.02, t_final=30.0, scheme="gauss3")
    assert column(run, "Motor.angle") == pytest.approx(4.0 * math.pi * run.time, abs=1e-9)


def test_revolutions_between_two_rows_follow_from_the_mean_of_the_rates():
    times = np.array([0.0, 1.0, 2.0])
    angles, rates = np.array([[0.5], [0.6]]), np.array([[4.0 * math.pi], [-6.0 * math.pi]])
    before = (np.array([0.1]), np.array([8.0 * math.pi]), np.array([7.0]))
    # The means are 6 pi and -pi: three revolutions on; then 0.1 - 2 pi is nearer to -pi than 0.1.
    assert count_revolutions(times, angles, rates, before)[:, 0].tolist() == [10.0, 9.0]


def slope(name, model, steps):
    """Observed order of a column against central differences of one of a finer run."""
    known = simulate(model, dt=steps[0] / 16, t_final=1.0, scheme="gauss3")
    errors = []
    for h in steps:
        run = simulate(model, dt=h, t_final=1.0)
        stride = round(h / (steps[0] / 16))
        errors.append(np.abs(column(run, name, 3) - column(known, name, 3)[::stride]).max())
    return np.diff(np.log(errors)) / np.diff(np.log(steps))


def test_accelerations_are_of_the_order_of_the_scheme():
    model = deck("four_bar_by_angle")
    free = replace(model, motions=())
    free = replace(free, simulation=replace(free.simulation, accelerations="yes"))
    orders = slope("Rocker pivot.angleAcceleration", free, [0.02, 0.01, 0.005])
    assert orders == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("scheme", ["preserving", "gauss3"])
def test_accelerations_are_the_derivatives_of_velocities(scheme):
    """Central differences over output times of 1 ms; their error is of order two in the interval,
    as is that of the scheme of order 2."""
    model = spinning(np.random.default_rng(5), 0.3, accelerations="yes")
    run = simulate(model, dt=0.001, t_final=0.5, scheme=scheme)
    h, table = 0.001, run.others[ACCELERATIONS]
    names = acceleration_columns(model)
    for number in range(2):
        first = names.index(f"{model.bodies[number].name}.ax")
        a, alpha = table[:, first : first + 3], table[:, first + 3 : first + 6]
        v, w = run.of("velocity", number), run.of("spin", number)
        # In the body's axes, which rotate: dv/dt + w x v is the acceleration.
        v_dot, w_dot = ((of[2:] - of[:-2]) / (2.0 * h) for of in (v, w))
        assert a[1:-1] == pytest.approx(v_dot + np.cross(w, v)[1:-1], abs=1e-3)
        assert alpha[1:-1] == pytest.approx(w_dot, abs=1e-3)
    rates = column(run, "Hinge.angleRate", 3)
    found = column(run, "Hinge.angleAcceleration", 3)
    assert found[1:-1] == pytest.approx((rates[2:] - rates[:-2]) / (2.0 * h), abs=1e-3)


@pytest.mark.parametrize("scheme", ["preserving", "decaying", "gauss2"])
@pytest.mark.parametrize("name", ["friction_hinge", "actuator_motor"])
def test_accelerations_change_nothing_else(name, scheme):
    model = deck(name)
    with_them = replace(model, simulation=replace(model.simulation, accelerations="yes"))
    plain, other = (simulate(m, t_final=0.5, scheme=scheme) for m in (model, with_them))
    for name in ("states", "reactions", "work", "signals"):
        assert getattr(plain, name).tobytes() == getattr(other, name).tobytes()


def test_explain_lists_the_coordinates_at_the_start():
    lines = explain(deck("four_bar_by_angle"))
    assert "Crank pivot at t = 0: angle -60 deg, rate -360 deg/s" in lines
    lines = explain(deck("universal"))
    # The axes of the shafts are at 30 degrees; the cross rotates at sin 30 deg of the first shaft.
    assert "Hooke at t = 0: angle1 -30 deg, rate 0 deg/s, angle2 0 deg, rate 180 deg/s" in lines
    lines = explain(deck("cylindrical"))
    assert "Rod at t = 0: slide 0 m, rate 8 m/s, angle 0 deg, rate 687.5494 deg/s" in lines


def test_the_table_is_written_where_a_joint_has_an_angle_or_a_slide():
    assert JOINTS not in tables_of_model(pendulum())  # a spherical joint
    model = deck("four_bar")
    assert JOINTS in tables_of_model(model)
    for word, written in (("no", False), ("yes", True)):
        asked = replace(model, simulation=replace(model.simulation, joint_table=word))
        assert (JOINTS in tables_of_model(asked)) is written
    many = replace(model, joints=model.joints * 13)
    assert JOINTS not in tables_of_model(many)
    spherical = pendulum()
    asked = replace(spherical, simulation=replace(spherical.simulation, joint_table="yes"))
    assert tables_of_model(asked)[JOINTS][1:] == [
        f"{asked.joints[0].name}.{c}" for c in ("P1", "P2", "P3", "wx", "wy", "wz")
    ]


def test_the_table_of_a_spherical_joint_has_the_orientation_of_the_child():
    model = pendulum(30.0)
    model = replace(model, simulation=replace(model.simulation, joint_table="yes"))
    run = simulate(model, dt=0.01, t_final=0.2)
    table = run.others[JOINTS][:, 1:]
    assert table[:, :3] == pytest.approx(run.of("orientation"), abs=1e-15)
    assert table[:, 3:] == pytest.approx(run.of("spin"), abs=1e-15)


def test_rows_too_far_apart_for_counting_are_mentioned():
    model = spinning(np.random.default_rng(5), rate=2.0)
    near, far = (simulate(model, dt=0.01, solver="newton", every=n) for n in (1, 20))
    assert not [text for text in near.report.warnings if "revolutions" in text]
    assert [text for text in far.report.warnings if "revolutions" in text]
