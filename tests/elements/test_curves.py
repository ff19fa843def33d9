"""Distances from planar curves and slips along them: laws that they keep for two random bodies."""

import math

import numpy as np
import pytest

from msahl.check.directions import frame
from msahl.elements.constraints import coordinates, curves
from msahl.elements.constraints.coordinate_jacobians import stiffness
from msahl.elements.constraints.coordinates import part_node
from msahl.elements.constraints.curves import ARC, LINE, PIECE, Curves
from msahl.elements.constraints.outlines import NoCurve, corners, curves_of, segments_of
from msahl.model import Curve, CurvePart, PinContact
from tests.elements.test_surfaces import A_POINT, B_POINT, SLANTED, E, Slips


def line(*end):
    return CurvePart("line", (end,))


def arc(through, end):
    return CurvePart("arc", (through, end))


def circle(radius, centre=(0.0, 0.0), sign=1.0):
    """Counter-clockwise for the sign 1: solid inside."""
    x, y = centre
    halves = (
        arc((x, y + sign * radius), (x - radius, y)),
        arc((x, y - sign * radius), (x + radius, y)),
    )
    return Curve((x + radius, y), halves, closed=True)


def ellipse(a, b, count=40):
    angle = 2.0 * math.pi * np.arange(count) / count
    points = tuple(zip((a * np.cos(angle)).tolist(), (b * np.sin(angle)).tolist(), strict=True))
    return Curve(points[0], (CurvePart("spline", points[1:]),), closed=True)


SQUARE = Curve((1.0, -1.0), (line(1.0, 1.0), line(-1.0, 1.0), line(-1.0, -1.0)), closed=True)
ROUNDED = Curve(
    (0.0, 0.0),
    (
        line(-1.0, 0.0),
        arc((-2.0, -1.0), (-1.0, -2.0)),
        CurvePart("spline", ((1.0, -2.5), (2.0, -2.0))),
    ),
)
CURVES = {"circle": circle(0.8), "square": SQUARE, "ellipse": ellipse(1.5, 0.7), "mixed": ROUNDED}
every_curve = pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)


def feet(curve, points):
    """d, n_1, n_2 and k (n, 4) at ``points`` (n, 2)."""
    group = curves_of([curve])
    return np.array([curves.foot(group, 0, *map(float, point)) for point in points])


def pin(curve, radius=0.7):
    """Between two bodies, with friction."""
    axes = frame(SLANTED)
    ends = ("C", "B0", "B1", A_POINT, B_POINT)
    return PinContact(*ends, curve, radius, friction=0.3, axes=axes, reference=(0.0, 0.8, 0.6))


class Along(Slips):
    """Gap and both slips of a pin."""

    def __init__(self, curve, seed=0, radius=0.7):
        super().__init__(pin(curve, radius), seed)
        assert self.system.scalar is not None
        self.own = np.arange(self.group.kind.size)


def test_segments_are_what_the_parts_say():
    kinds = [segment.kind for segment in segments_of(ROUNDED)]
    assert kinds[:3] == [LINE, LINE, ARC]
    assert kinds[-1] == LINE
    assert set(kinds[3:-1]) == {PIECE}
    assert corners(segments_of(ROUNDED), False) == []
    assert [angle for _, angle in corners(segments_of(SQUARE), True)] == pytest.approx(
        [math.pi / 2] * 4
    )
    assert [s.kind for s in segments_of(circle(1.0))] == [ARC, ARC]


def test_distances_are_those_of_plane_geometry():
    """Of a circle and a square from outside, on sides and corners; of a hole and behind a wall."""
    rng = np.random.default_rng(1)
    points = rng.uniform(-3.0, 3.0, size=(200, 2))
    found = feet(circle(0.8), points)
    length = np.hypot(*points.T)
    assert found[:, 0] == pytest.approx(length - 0.8, abs=1e-14)
    assert found[:, 1:3] == pytest.approx(points / length[:, None], abs=1e-14)
    assert found[:, 3] == pytest.approx(1.0 / length, rel=1e-13)
    assert feet(circle(0.8, sign=-1.0), points)[:, 0] == pytest.approx(0.8 - length, abs=1e-14)
    outside = points[np.abs(points).max(1) > 1.0]
    away = np.maximum(np.abs(outside) - 1.0, 0.0)
    found = feet(SQUARE, outside)
    assert found[:, 0] == pytest.approx(np.hypot(*away.T), abs=1e-15)
    at_corner = (away > 0.0).all(1)
    assert found[at_corner, 3] == pytest.approx(1.0 / found[at_corner, 0])
    assert not found[~at_corner, 3].any()
    assert feet(SQUARE, [(0.9, 0.2), (-0.5, -0.7)])[:, 0] == pytest.approx([-0.1, -0.3])
    wall = Curve((0.0, 0.0), (line(-1.0, 0.0),))
    assert feet(wall, [(0.5, 2.0), (7.0, 3.0), (-9.0, -4.0)])[:, 0] == pytest.approx(
        [2.0, 3.0, -4.0]
    )


@pytest.mark.slow
def test_a_spline_is_as_near_as_its_points_are_dense():
    """Distances outside of an ellipse against those by its parameter; the spline is of order 4."""
    errors = []
    for count in (40, 160):
        worst = 0.0
        for u in np.linspace(0.1, 6.2, 101):
            n = np.array([0.7 * math.cos(u), 1.5 * math.sin(u)])
            n /= np.hypot(*n)
            point = (1.5 * math.cos(u), 0.7 * math.sin(u)) + 0.4 * n
            worst = max(worst, abs(feet(ellipse(1.5, 0.7, count), [point])[0, 0] - 0.4))
        errors.append(worst)
    assert errors[0] < 1e-4
    assert 3.7 < math.log(errors[0] / errors[1], 4.0) < 4.6


@every_curve
def test_normal_and_curvature_are_derivatives_of_the_distance(curve):
    rng = np.random.default_rng(2)
    points = rng.uniform(-3.0, 3.0, size=(60, 2))
    found = feet(curve, points)
    points, found = points[found[:, 0] > 0.2], found[found[:, 0] > 0.2]
    h = 1e-5
    for i in range(2):
        there, back = (feet(curve, points + s * h * np.eye(2)[i]) for s in (1.0, -1.0))
        slope = (there[:, :3] - back[:, :3]) / (2.0 * h)
        assert slope[:, 0] == pytest.approx(found[:, 1 + i], abs=1e-9)
        t = np.stack([-found[:, 2], found[:, 1]], axis=1)
        by_hand = (found[:, 3] * t[:, i])[:, None] * t
        # Where the foot passes from one segment to the next within h the curvature jumps.
        assert (np.abs(slope[:, 1:] - by_hand).max(1) < 1e-7).mean() > 0.95


@every_curve
def test_change_is_the_work_of_the_unit_force(curve):
    for seed in range(5):
        along = Along(curve, seed)
        Z = along.random()
        start = along.evaluated(Z)
        length = along.system.frames.length
        parts = np.array([Z[0], Z[1] / length[0], Z[2], Z[3] / length[1]])
        for q in along.own:
            work = (start.force[q] * parts).sum()
            assert start.change[q] == pytest.approx(work, rel=1e-12, abs=1e-14)


@every_curve
def test_the_change_of_a_distance_is_that_of_its_values(curve):
    """For steps of all sizes, within a segment and from one to another."""
    rng = np.random.default_rng(4)
    group = curves_of([curve])
    for size in (0.0, 1e-9, 1e-6, 1e-3, 0.1, 2.0):
        for _ in range(20):
            begin, step = rng.uniform(-3.0, 3.0, size=2), size * rng.normal(size=2)
            ends = [curves.value(group, 0, *map(float, p)) for p in (begin, begin + step)]
            out = np.zeros((1, 6)), np.zeros((1, 6)), np.zeros((1, 6, 6))
            pair = (tuple(map(float, begin)), tuple(map(float, step)))
            change = curves.weigh(group, 0, *pair, ends[0], out)
            if min(ends) < 0.0:
                continue  # within what is solid the distance has kinks
            assert change == pytest.approx(ends[1] - ends[0], abs=1e-14)
            assert out[0][0, :2] @ step == pytest.approx(change, abs=1e-14)


@every_curve
def test_derivatives_are_those_of_differences(curve):
    """Of the changes and of the unit forces by the unknowns of a large step."""
    along = Along(curve, 3)
    Z, frames = along.random(), along.system.frames
    start = along.evaluated(Z)
    coordinates.differentiate(along.group, start, frames, Z)
    for q in along.own:
        along.evaluated(Z, start)
        start.load[q] = 1.0
        values = np.zeros_like(along.system.constant)
        stiffness(along.group, start, frames, 1.0, Z, values)
        blocks = values.reshape(-1, 3, 3)
        for part in range(4):
            node = part_node(along.group, frames, q, part)
            for i in range(3):
                ends = []
                for sign in (1.0, -1.0):
                    there = Z.copy()
                    there[node, i] += sign * E
                    F, other = np.zeros(along.shape), along.evaluated(there)
                    other.load[q] = 1.0
                    coordinates.push(along.group, other, frames, 1.0, F)
                    ends.append((other.change[q], F))
                slope = (ends[0][0] - ends[1][0]) / (2.0 * E)
                assert slope == pytest.approx(start.slope[q, part, i], abs=2e-8)
                by_difference = (ends[0][1] - ends[1][1]) / (2.0 * E)
                for row in range(4):
                    block = along.group.block[q, 4 * row + part]
                    at_node = part_node(along.group, frames, q, row)
                    expected = by_difference[at_node]
                    assert expected == pytest.approx(blocks[block // 9][:, i], abs=2e-8)


@every_curve
def test_second_derivative_is_that_along_a_motion_without_accelerations(curve):
    along = Along(curve, 4)
    ends = [along.rates(*along.moved(sign * E)) for sign in (1.0, -1.0)]
    start = along.evaluated(np.zeros(along.shape))
    for i, q in enumerate(along.own):
        given = (along.group, start, along.v, along.W, int(q))
        second = coordinates.coordinate_acceleration(*given)
        # Near a corner the third derivatives are large, by which the difference is in error.
        by_difference = (ends[0][i] - ends[1][i]) / (2.0 * E)
        assert second == pytest.approx(by_difference, abs=1e-8, rel=1e-7)


DROP = Curve((2.0, 0.0), (arc((-1.0, 1.0), (-1.0, -1.0)),), closed=True)
AROUND = {
    "circle": (circle(0.8), 2, 0),
    "square": (SQUARE, 8, 0),
    "odd spline": (ellipse(1.5, 0.7, 41), 41, 1),
    "even spline": (ellipse(1.5, 0.7, 40), 40, 0),
    "corners": (DROP, 4, 0),
}


@pytest.mark.parametrize("case", AROUND)
def test_kinks_are_where_stretches_end_and_nowhere_else(case):
    """All around a curve, at some distance from it."""
    curve, stretches, more = AROUND[case]
    group, count = curves_of([curve]), 4000
    angle = 2.0 * math.pi * np.arange(count + 1) / count
    path = np.stack([4.0 * np.cos(angle), 3.0 * np.sin(angle)], axis=1)
    value = np.array([curves.kink(group, 0, *map(float, point)) for point in path])
    assert np.abs(np.diff(value)).max() < 0.05
    signs = np.sign(value[value != 0.0])
    assert (signs[1:] != signs[:-1]).sum() + (signs[0] != signs[-1]) in (
        stretches + more,
        stretches + more + 1,  # the path begins at one
    )


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_which_side_of_a_corner_a_point_is_on_does_not_depend_on_round_off(angle):
    """Beside a line's end, where line and corner are equally far to the last digit, the foot is on
    the line: else the curvature there, and a force by it, would be the corner's here and there.
    """
    c, s = math.cos(angle), math.sin(angle)
    x, y = SQUARE.start
    corners = [(x, y), *(part.points[0] for part in SQUARE.parts)]
    places = [(c * x - s * y, s * x + c * y) for x, y in corners]
    group = curves_of([Curve(places[0], tuple(line(*end) for end in places[1:]), closed=True)])
    along, out = np.array([-s, c]), np.array([c, s])  # of the side to the second corner
    # From three times what rounding a place of 1 m moves it by.
    for away in np.geomspace(1e-15, 1e-9, 61):
        before = curves.foot(group, 0, *(places[1] + 0.002 * out - away * along).tolist())
        after = curves.foot(group, 0, *(places[1] + 0.002 * out + away * along).tolist())
        assert before[3] == 0.0
        assert after[3] == pytest.approx(1.0 / 0.002) or away < 3e-15
        kinks = [
            curves.kink(group, 0, *(places[1] + 0.002 * out + side * away * along).tolist())
            for side in (-1.0, 1.0)
        ]
        assert kinks[0] * kinks[1] < 0.0 or away < 3e-15


def test_a_slip_is_that_of_the_material_points():
    """In a plane: the velocity of the pin's point of contact less that of the curve's, along it."""
    group = curves_of([circle(2.0)])
    centre, speed, spin, r = np.array([1.5, 2.0]), np.array([0.3, -0.4]), 1.7, 0.5
    out = np.zeros((1, 6)), np.zeros((1, 6)), np.zeros((1, 6, 6))
    angle, h = 0.4, 1e-6
    m = np.array([*centre, math.sin(angle), math.cos(angle)])
    dm = h * np.array([*speed, spin * math.cos(angle), -spin * math.sin(angle)])
    slip = curves.weigh_slip(group, 0, r, m, dm, out) / h
    n = centre / np.hypot(*centre)
    velocity = speed + spin * -r * np.array([-n[1], n[0]])
    assert slip == pytest.approx(velocity @ np.array([-n[1], n[0]]), rel=1e-5)


FAULTS = {
    "one point": (Curve((0.0, 0.0), ()), "two or more"),
    "twice": (Curve((0.0, 0.0), (line(0.0, 0.0),)), "twice in a row"),
    "flat arc": (Curve((0.0, 0.0), (arc((1.0, 0.0), (2.0, 0.0)),)), "on a line"),
    "few": (ellipse(1.0, 1.0, 3), "four points"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_what_is_no_curve_says_so(case):
    curve, words = FAULTS[case]
    with pytest.raises(NoCurve, match=words):
        segments_of(curve)


def test_coordinates_without_curves_have_none():
    assert curves_of([None, None]) is None
    group = curves_of([None, SQUARE, circle(1.0)])
    assert isinstance(group, Curves)
    assert group.first.tolist() == [0, 0, 4, 6]
    assert curves.subset(group, np.array([0])) is None
    fewer = curves.subset(group, np.array([2, 0]))
    assert fewer.first.tolist() == [0, 2, 2]
    assert fewer.kind.tolist() == [ARC, ARC]
