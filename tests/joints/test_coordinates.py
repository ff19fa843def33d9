"""Coordinates of joints: inverse of the pose, rates and accelerations, where zero is."""

import math

import numpy as np
import pytest

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.algebra.rotation_arrays import parameters, rotations
from msahl.algebra.vector import IDENTITY, ZERO, times, transpose
from msahl.check.directions import (
    crossed_references,
    frame,
    shared_references,
    smallest_rotation,
    unit,
)
from msahl.joints import coordinates
from msahl.joints.coordinates import Motion
from msahl.joints.registry import KINDS
from msahl.model import Joint

POSED = [name for name, kind in KINDS.items() if kind.pose]
STEP = 1e-2
"""Step of differences [s]: their error is below 1e-9 for first and 1e-8 for second derivatives."""


def directions(rng):
    return unit(tuple(rng.normal(size=3)))


def joint_of(kind, rng):
    axes = [frame(directions(rng)) for _ in range(2)]
    points = [tuple(rng.normal(size=3)) for _ in range(2)]
    names = [(name, 0.1) for name, *_ in KINDS[kind].parameters]
    references = [frame(axis[2], directions(rng))[0] for axis in axes]
    return Joint("J", kind, "A", "B", *points, *axes, tuple(names), *references)


def rotated(p0, axes, t):
    """(m, 3, 3) of a body that rotates about a fixed axis while the axis itself rotates."""
    first = np.array([matrix(from_axis_angle(axes[0], math.sin(s) + 0.3 * s)) for s in t])
    second = np.array([matrix(from_axis_angle(axes[1], 0.7 * s)) for s in t])
    return np.array(matrix(p0)) @ first @ second


def derivatives(f, dt):
    """First and second derivative at the middle of nine equidistant samples (9, ...)."""
    first = np.array([3.0, -32.0, 168.0, -672.0, 0.0, 672.0, -168.0, 32.0, -3.0]) / 840.0
    second = np.array([-9.0, 128.0, -1008.0, 8064.0, -14350.0, 8064.0, -1008.0, 128.0, -9.0])
    return np.tensordot(first, f, 1) / dt, np.tensordot(second / 5040.0, f, 1) / dt**2


def motion_of(x, R, dt):
    """Motion of a body at the middle of nine samples of its place."""
    v, a = derivatives(x, dt)
    R_dot, R_ddot = derivatives(R, dt)
    W, A = R_dot @ R[4].T, R_ddot @ R[4].T
    w = np.array([W[2, 1], W[0, 2], W[1, 0]])
    A = A - W @ W
    alpha = np.array([A[2, 1], A[0, 2], A[1, 0]])
    return Motion(x[4][None], R[4][None], v[None], w[None], a[None], alpha[None])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", POSED)
def test_rates_and_accelerations_are_derivatives_of_the_coordinates(kind, seed):
    rng = np.random.default_rng(seed)
    joint = joint_of(kind, rng)
    t = np.arange(-4, 5) * STEP
    x_a = rng.normal(size=3) + np.outer(t, rng.normal(size=3)) + np.outer(t**2, rng.normal(size=3))
    R_a = rotated(tuple(rng.normal(size=3)), [directions(rng), directions(rng)], t)
    c0, c1, c2 = rng.normal(size=(3, 3))
    histories = [dict(zip(coordinates.coordinates(joint), c0 + c1 * s + c2 * s * s, strict=False))
                 for s in t]  # fmt: skip
    rotating = rotated(tuple(rng.normal(size=3)), [directions(rng), directions(rng)], t)
    P = parameters(rotating)
    poses = [coordinates.pose(joint, q, tuple(p)) for q, p in zip(histories, P, strict=True)]
    D, R = (np.array(part) for part in zip(*poses, strict=True))
    R_b = R_a @ R
    s_a, s_b = np.array(joint.parent_point), np.array(joint.child_point)
    x_b = x_a + (R_a @ (s_a + D)[..., None])[..., 0] - R_b @ s_b
    motions = motion_of(x_a, R_a, STEP), motion_of(x_b, R_b, STEP)
    values, rates, accelerations = coordinates.values_and_rates(
        joint, coordinates.relative(joint, *motions)
    )
    names = coordinates.columns(joint, 0)
    expected = np.array([[q.get(n, 0.0) for n in names] for q in histories])
    spatial = [i for i, name in enumerate(names) if name in ("P1", "P2", "P3")]
    expected[:, spatial] = P[:, : len(spatial)]
    first, second = derivatives(expected, STEP)
    plain = [i for i in range(len(names)) if i not in spatial]
    assert values[0] == pytest.approx(expected[4], abs=1e-12)
    assert rates[0, plain] == pytest.approx(first[plain], abs=1e-8)
    # Second differences divide the round-off 1e-16 of products of size 10 by STEP^2.
    assert accelerations[0, plain] == pytest.approx(second[plain], abs=1e-7)
    if spatial:
        w = motion_of(np.zeros((9, 3)), rotating, STEP)
        assert rates[0, spatial] == pytest.approx(rotating[4].T @ w.w[0], abs=1e-8)
        assert accelerations[0, spatial] == pytest.approx(rotating[4].T @ w.alpha[0], abs=1e-7)


@pytest.mark.parametrize("kind", POSED)
def test_directions_are_those_of_the_rates(kind):
    rng = np.random.default_rng(5)
    joint = joint_of(kind, rng)
    q = dict(zip(coordinates.coordinates(joint), rng.normal(size=3), strict=False))
    D, R = coordinates.pose(joint, q, tuple(rng.normal(size=3)))
    found = coordinates.directions(joint, R)
    for i, (v, w) in enumerate(found):
        _, rates = coordinates.values_and_rates(
            joint, coordinates.Relative(D[None], R[None], v[None], w[None])
        )
        assert rates[0] == pytest.approx(np.eye(len(found))[i], abs=1e-13)


def test_zero_is_where_own_axes_are_parallel_if_the_axis_has_the_same_components():
    rng = np.random.default_rng(1)
    axis = directions(rng)
    here, there = shared_references(axis, axis, None, None)
    assert here == there
    x = directions(rng)
    assert shared_references(axis, axis, x, None) == shared_references(axis, axis, None, x)


def test_zero_is_at_the_smallest_rotation_of_different_axes():
    rng = np.random.default_rng(2)
    for _ in range(20):  # some of them nearly opposite, which enlarges round-off
        a, b, x = (directions(rng) for _ in range(3))
        assert smallest_rotation(a, b, a) == pytest.approx(b, abs=1e-14)
        perpendicular = tuple(np.cross(a, b))
        assert smallest_rotation(a, b, perpendicular) == pytest.approx(perpendicular, abs=1e-14)
        assert smallest_rotation(b, a, smallest_rotation(a, b, x)) == pytest.approx(x, abs=1e-13)
    opposite = tuple(-c for c in a)
    assert smallest_rotation(a, opposite, a) == pytest.approx(opposite, abs=1e-14)


def test_universal_is_zero_where_own_axes_are_parallel_if_its_axes_are_perpendicular():
    here, there = crossed_references((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), None, None)
    joint = Joint(
        *("U", "universal", "A", "B", ZERO, ZERO),
        frame((1.0, 0.0, 0.0)),
        frame((0.0, 1.0, 0.0)),
        (),
        here,
        there,
    )
    _, R = coordinates.pose(joint, {}, ZERO)
    assert np.eye(3) == pytest.approx(R, abs=1e-15)


def test_the_zero_does_not_depend_on_the_pose_at_which_the_axis_is_carried():
    """An axis of the parent, carried to a child that stands anywhere about it."""
    rng = np.random.default_rng(3)
    axis, P = directions(rng), tuple(rng.normal(size=3))
    found = []
    for angle in (0.0, 1.0, 2.5):
        R = np.array(matrix(from_axis_angle(axis, angle))) @ np.array(matrix(P))
        child = times(transpose(tuple(map(tuple, R))), axis)
        found.append(shared_references(axis, child, None, None)[1])
    assert found[1] == pytest.approx(found[0], abs=1e-14)
    assert found[2] == pytest.approx(found[0], abs=1e-14)


def test_the_offset_leads_from_the_counted_angle_to_the_absolute_one():
    rng = np.random.default_rng(4)
    joint = joint_of("revolute", rng)
    _, R = coordinates.pose(joint, {"angle": 0.4}, ZERO)
    x = R @ np.array(joint.child_axes[0])
    counted = math.atan2(np.dot(joint.parent_axes[1], x), np.dot(joint.parent_axes[0], x))
    difference = counted + coordinates.angle_offset(joint) - 0.4
    assert math.remainder(difference, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-14)


def test_the_offset_is_within_half_a_revolution():
    """So an expression reads the angle at the start, not one a revolution off."""
    rng = np.random.default_rng(5)
    offsets = [coordinates.angle_offset(joint_of("revolute", rng)) for _ in range(50)]
    assert np.abs(offsets).max() <= math.pi


def test_parameters_are_the_inverse_of_rotations():
    rng = np.random.default_rng(6)
    P = rng.normal(size=(200, 3))
    P *= (4.0 * rng.random(200) / np.linalg.norm(P, axis=1))[:, None]
    assert parameters(rotations(P)) == pytest.approx(P, abs=1e-13)
    assert parameters(np.array(IDENTITY)).tolist() == [0.0, 0.0, 0.0]
