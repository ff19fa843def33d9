"""Centre lines: unit tangents by arc length, right-handed axes, references and twist."""

import numpy as np
import pytest

from msahl.beams.lines import Arc, LineError, Spline, Straight, frames

HELIX = [(float(np.cos(a)), float(np.sin(a)), 0.2 * float(a)) for a in np.linspace(0.0, 3.0, 25)]
LINES = {
    "straight": Straight(np.array([1.0, 2.0, 3.0]), np.array([2.0, 0.0, 4.0])),
    "vertical": Straight(np.zeros(3), np.array([0.0, 0.0, 2.0])),
    "arc": Arc(np.zeros(3), np.array([0.0, 5.0, 0.0]), np.array([0.0, 0.0, 2.0]), 1.2),
    "backward": Arc(np.zeros(3), np.array([0.0, -5.0, 0.0]), np.array([0.0, 0.0, 2.0]), -1.2),
    "spline": Spline(HELIX),
    "two points": Spline(HELIX[:2]),
}


@pytest.mark.parametrize("name", LINES)
def test_tangents_are_rates_of_points_by_arc_length(name):
    line = LINES[name]
    s = np.linspace(0.1, 0.9, 9) * line.length
    h = 1e-5 * line.length
    rate = (line.points(s + h) - line.points(s - h)) / (2.0 * h)
    # Central differences: (h/length)^2 r'''/6 and the inversion's 1e-14/1e-5 leave 1e-8.
    assert rate == pytest.approx(line.tangents(s), abs=1e-7)
    R = frames(line, s, None, 0.7)
    assert R.transpose(0, 2, 1) @ R == pytest.approx(np.tile(np.eye(3), (9, 1, 1)), abs=1e-14)
    assert np.linalg.det(R) == pytest.approx(np.ones(9))
    assert np.array_equal(R[:, :, 0], line.tangents(s))


def test_a_spline_through_a_helix_has_its_length():
    # Cubic splines err by the fourth power of their spacing, 0.125, with small factors.
    assert LINES["spline"].length == pytest.approx(3.0 * np.hypot(1.0, 0.2), rel=1e-4)
    ends = LINES["spline"].points(np.array([0.0, LINES["spline"].length]))
    assert ends == pytest.approx(np.array([HELIX[0], HELIX[-1]]), abs=1e-13)


def test_default_axes():
    (R,) = frames(LINES["vertical"], np.zeros(1), None, 0.0)
    assert np.array_equal(R.T, [[0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    (R,) = frames(Straight(np.zeros(3), np.array([2.0, 0.0, 0.0])), np.zeros(1), None, 0.0)
    assert np.array_equal(R, np.eye(3))
    for name in ("arc", "backward"):  # d_2 is towards the centre
        line = LINES[name]
        (R,) = frames(line, np.zeros(1), None, 0.0)
        assert R[:, 1] == pytest.approx(line.centre / 5.0)


def test_a_twist_is_linear():
    line = LINES["straight"]
    plain, twisted = (frames(line, np.array([0.25 * line.length]), None, t)[0] for t in (0.0, 0.4))
    assert (plain.T @ twisted)[1:, 1] == pytest.approx([np.cos(0.1), np.sin(0.1)])


def test_impossible_lines():
    with pytest.raises(LineError, match="one point"):
        Straight(np.zeros(3), np.zeros(3))
    with pytest.raises(LineError, match="not perpendicular"):
        Arc(np.zeros(3), np.array([0.0, 5.0, 0.0]), np.array([0.0, 1.0, 2.0]), 1.2)
    with pytest.raises(LineError, match="zero"):
        Arc(np.zeros(3), np.array([0.0, 5.0, 0.0]), np.array([0.0, 0.0, 2.0]), 0.0)
    with pytest.raises(LineError, match="follow each other"):
        Spline([HELIX[0], HELIX[0], HELIX[1]])
    with pytest.raises(LineError, match="parallel"):
        frames(LINES["straight"], np.zeros(1), np.array([1.0, -2.0, 1.0]), 0.0)
