"""Derivatives of measures against differences of the measures themselves."""

import numpy as np
import pytest

from msahl.post.measure_gradients import Series, derivative, is_tied, rows_needed
from msahl.post.measures import _of_series, parse_measure

TIMES = np.concatenate([np.linspace(0.0, 2.0, 81), [2.013]])
SLOPES = np.array([np.cos(3.0 * TIMES), TIMES**2])
END = np.array([0.3, -0.2])  # derivatives of the last of the times


def column(times):
    return np.sin(2.5 * times) + 0.3 * times


def moved(measure, e):
    """The measure of the column with parameters ``e`` (2,), which move the end of the run."""
    times = TIMES.copy()
    times[-1] += END @ e
    return _of_series(measure, times, column(TIMES) + e @ SLOPES)[0]


@pytest.mark.parametrize(
    "text",
    ["final", "initial", "max", "min", "absmax", "range", "mean", "rms", "at 0.5", "at 0.5012"],
)
def test_derivatives_of_statistics(text):
    measure, e = parse_measure(f"Tip.z {text}"), 1e-5
    value, _ = _of_series(measure, TIMES, column(TIMES))
    rows = rows_needed(measure, TIMES, value)
    series = Series(TIMES[rows], column(TIMES)[rows], SLOPES[:, rows], END)
    # By central differences, good to about 1e-10.
    exact = [(moved(measure, e * i) - moved(measure, -e * i)) / (2 * e) for i in np.eye(2)]
    assert derivative(measure, series, value) == pytest.approx(exact, rel=1e-7, abs=1e-10)


def test_the_derivative_of_a_crossing():
    measure, e = parse_measure("time of Tip.z = 0.5"), 1e-4
    found = [_of_series(measure, TIMES, column(TIMES) + s * e * SLOPES[0])[0] for s in (-1, 0, 1)]
    rows = rows_needed(measure, TIMES, found[1])
    series = Series(TIMES[rows], column(TIMES)[rows], SLOPES[:, rows], END)
    # Crossings are found by polynomials through fewer or more rows, which differ by 1e-9.
    slope = (found[2] - found[0]) / (2 * e)
    assert derivative(measure, series, found[1])[0] == pytest.approx(slope, rel=1e-4)


def test_no_derivative_of_the_largest_value_of_two():
    measure = parse_measure("Tip.z max")
    both = np.sin(np.pi * TIMES[:81])  # 1 at 0.5 s; a second maximum is added
    both[-1] = both.max()
    assert is_tied(measure, Series(TIMES[:81], both, SLOPES[:, :81], END))
    assert not is_tied(measure, Series(TIMES[:81], both**3 + TIMES[:81], SLOPES[:, :81], END))
