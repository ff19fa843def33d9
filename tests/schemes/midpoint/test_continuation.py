"""The path of solutions from short steps to the complete one."""

import numpy as np
import pytest

from msahl.schemes.midpoint.continuation import follow

COMPLETE = 8.0


class Cubic:
    """z^3 - 6 z^2 + 9.5 z = 8 s: its curve turns back at s = 0.57 and forth at s = 0.18."""

    def __init__(self, end=np.inf):
        self.end, self.f, self.evaluations = end, np.ones(1), 0

    def residual_of(self, z, s):
        self.evaluations += 1
        self.f = z**3 - 6.0 * z**2 + 9.5 * z - COMPLETE * s
        if s > self.end:
            self.f = np.full(1, np.nan)
        return self.f

    def jacobian_of(self, z, s):
        return np.array([3.0 * z**2 - 12.0 * z + 9.5])

    def predicted(self, s):
        return np.zeros(1)

    def relative(self):
        return float(np.abs(self.f).max()) / COMPLETE


def test_a_path_is_followed_where_it_turns_back():
    equations = Cubic()
    z = follow(equations)
    (real,) = [root.real for root in np.roots([1.0, -6.0, 9.5, -COMPLETE]) if abs(root.imag) < 1e-9]
    assert z == pytest.approx([real], rel=1e-12)
    assert equations.relative() < 1e-12
    # Measured: 51.
    assert equations.evaluations < 100


def test_a_path_that_ends_gives_no_solution():
    assert follow(Cubic(end=0.4)) is None
