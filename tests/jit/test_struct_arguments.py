"""Groups of arrays are passed to compiled kernels by reference, also groups within groups."""

import os

import numpy as np
import pytest

from msahl.algebra.vector import at, dot
from msahl.jit.compiled import Compiled
from msahl.ports.point import load_of
from msahl.system.build import build_system
from tests.support.element_samples import ELEMENTS

pytestmark = pytest.mark.skipif(
    bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="nothing is compiled"
)


def power(forces, velocity):
    """Power [W] of all drags at the velocities (d, 3) of their points: a kernel of the package is
    called for each.
    """
    total = 0.0
    for k in range(forces.point.frame.size):
        V = at(velocity, k)
        total += dot(load_of(forces.point, k, V), V)
    return total


def test_a_kernel_reads_groups_and_calls_others_as_in_plain_python():
    """Compiled anew, whatever the cache holds."""
    rng = np.random.default_rng(2)
    forces = build_system(ELEMENTS["drag"](rng)).forces
    velocity = rng.normal(size=(forces.point.frame.size, 3))
    entered = Compiled(power)
    # The compiler may join a multiplication and an addition, which rounds once less.
    assert entered(forces, velocity) == pytest.approx(power(forces, velocity), rel=1e-15)
    assert power(forces, velocity) < 0.0
    doubled = forces._replace(point=forces.point._replace(constants=2.0 * forces.point.constants))
    assert entered(doubled, velocity) == pytest.approx(2.0 * power(forces, velocity), rel=1e-15)
    # Other numbers are no other type.
    assert entered.unit((doubled, velocity)) == entered.unit((forces, velocity))
