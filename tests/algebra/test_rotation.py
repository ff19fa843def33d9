"""Wiener-Milenkovic parameters and rotation increments, against axis and angle and matrix
exponentials.
"""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from msahl.algebra.rotation import (
    HALF_REVOLUTION,
    compose,
    from_axis_angle,
    from_increment,
    inverse,
    matrix,
    rescaled,
    rotation_change,
    rotation_tangent,
    to_axis_angle,
    to_increment,
)
from msahl.algebra.vector import skew

# A product of a dozen roundings of numbers up to one.
ROUND_OFF = 4e-15

numbers = st.floats(-1.0, 1.0)
axes = st.tuples(numbers, numbers, numbers).filter(lambda a: math.hypot(*a) > 0.1)
angles = st.floats(-20.0, 20.0)
small = st.floats(-12.0, -1.0).map(lambda e: 10.0**e)
near_half = small.map(lambda e: math.pi - e)
rotations = st.one_of(angles, small, near_half, st.sampled_from([0.0, math.pi, -math.pi, 1e-300]))


def exponential(axis, phi):
    return expm(phi * np.array(skew(axis)) / math.hypot(*axis))


@given(axes, rotations)
def test_the_matrix_is_the_exponential_and_orthogonal(axis, phi):
    p = from_axis_angle(axis, phi)
    R = np.array(matrix(p))
    assert math.hypot(*p) <= HALF_REVOLUTION * (1 + ROUND_OFF)
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-14
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)
    # expm itself squares a few times: its own error grows with the angle.
    assert np.abs(R - exponential(axis, phi)).max() < 1e-14 * max(1.0, abs(phi)) * 4


@given(axes, rotations, axes, rotations)
def test_composition_is_the_product_of_the_matrices(a, phi, b, psi):
    p, q = from_axis_angle(a, phi), from_axis_angle(b, psi)
    both = compose(p, q)
    assert math.hypot(*both) <= HALF_REVOLUTION * (1 + ROUND_OFF)
    product = np.array(matrix(p)) @ np.array(matrix(q))
    assert np.abs(np.array(matrix(both)) - product).max() < ROUND_OFF


@given(axes, rotations)
def test_a_rotation_and_its_inverse_are_no_rotation(axis, phi):
    p = from_axis_angle(axis, phi)
    assert math.hypot(*compose(p, inverse(p))) < ROUND_OFF


def test_forty_thousand_compositions_stay_orthogonal():
    p = (0.3, -0.2, 0.9)
    for _ in range(20000):
        p = compose(from_axis_angle((1.0, 2.0, -1.0), 0.7), p)
        p = compose(p, from_axis_angle((0.1, -1.0, 0.4), 0.011))
    R = np.array(matrix(p))
    assert np.abs(R @ R.T - np.eye(3)).max() < 1e-14


@given(axes, st.one_of(st.floats(0.0, math.pi), small, near_half))
def test_axis_and_angle_come_back(axis, phi):
    unit, angle = to_axis_angle(from_axis_angle(axis, phi))
    assert angle == pytest.approx(phi, rel=ROUND_OFF, abs=1e-300)
    if phi > 0.0:
        assert unit == pytest.approx(np.array(axis) / math.hypot(*axis), abs=ROUND_OFF)


def test_no_rotation_has_an_axis_all_the_same():
    assert to_axis_angle((0.0, 0.0, 0.0)) == ((0.0, 0.0, 1.0), 0.0)


@given(axes, st.floats(1e-3, 1e3))
def test_rescaling_keeps_the_orientation(axis, length):
    p = tuple(length * x / math.hypot(*axis) for x in axis)
    q = rescaled(p)
    assert math.hypot(*q) <= HALF_REVOLUTION * (1 + ROUND_OFF)
    assert np.abs(np.array(matrix(p)) - np.array(matrix(q))).max() < ROUND_OFF
    assert (q == p) == (math.hypot(*p) <= HALF_REVOLUTION)


@given(axes, st.one_of(st.floats(0.0, 3.1), small))
def test_rotation_increment_and_parameters_say_the_same(axis, phi):
    unit = np.array(axis) / math.hypot(*axis)
    Q = tuple(2.0 * math.tan(phi / 2) * unit)
    c = from_increment(Q)
    assert c == pytest.approx(4.0 * math.tan(phi / 4) * unit, rel=1e-14, abs=1e-300)
    # Near half a revolution 1 - c.c/16 cancels: its relative error is eps over itself.
    loss = 1.0 / (1.0 - np.dot(c, c) / 16.0)
    assert to_increment(c) == pytest.approx(Q, rel=ROUND_OFF * loss, abs=1e-300)


@given(axes, st.one_of(st.floats(0.0, 3.1), small), axes)
def test_the_change_of_a_rotated_vector_does_not_cancel(axis, phi, a):
    unit = np.array(axis) / math.hypot(*axis)
    Q = tuple(2.0 * math.tan(phi / 2) * unit)
    # Rodrigues' formula, 1 - cos by the half angle.
    Ka = np.cross(unit, a)
    change = math.sin(phi) * Ka + 2.0 * math.sin(phi / 2) ** 2 * np.cross(unit, Ka)
    bound = ROUND_OFF * min(1.0, phi) * 4 + 1e-300  # half of a subnormal angle may be zero
    assert np.abs(np.array(rotation_change(Q, a)) - change).max() <= bound


@pytest.mark.parametrize("size", [0.0, 1e-8, 1e-3, 0.5, 2.0, 30.0])
def test_the_tangent_of_a_rotation_is_its_derivative_on_the_manifold(size):
    rng = np.random.default_rng(3)
    Q = size * rng.normal(size=3)
    D = np.array(rotation_tangent(tuple(Q)))
    e = 1e-5 * max(1.0, size)
    for j in range(3):
        step = np.zeros(3)
        step[j] = e
        ends = [np.array(matrix(from_increment(tuple(Q + s * step)))) for s in (1.0, -1.0)]
        # R(Q + e) R(Q - e)^T = exp([2 e D_j] + O(e^3)); its skew part is that angle to O(e^3).
        W = ends[0] @ ends[1].T
        angle = 0.5 * np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]])
        # Round-off of W over e, and e^2 of the central difference.
        assert np.abs(angle / (2 * e) - D[:, j]).max() < 1e-9
