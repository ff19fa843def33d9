"""Where the bodies of a mechanism are: msahl's scheme of the highest order, by two routes.

The step of gauss5 is halved until the positions move no more than rounding errors allow, or until
they move more than before; beside it stands the scheme that chooses its steps by a tolerance.
``independent`` compares both with an integration without msahl.
"""

import numpy as np

from benchmarks import ours
from benchmarks.mechanisms.net import swing
from benchmarks.problems import Problem
from benchmarks.reference import Known

SCHEME, BY_TOLERANCE = "msahl gauss5", "msahl by tolerance"
COARSEST, FINEST = 4, 64
"""Steps in an interval of the output times."""
AGREED = 1e-13
"""Change [m] when the step becomes half as long that is called rounding errors."""
TOLERANCE = 1e-12
LOOSER = 1e-12
"""Tolerance of the second integration of the net, whose levels are those of a chain."""


def true_motion(problem: Problem) -> Known:
    """Return the mass centres at the output times, and how far the second route is from them."""
    if problem.name == "net":
        t = problem.grid * np.arange(problem.rows + 1)
        x, looser = swing(t), swing(t, tolerance=LOOSER)
        return Known(x, "DOP853 of its levels to 1e-13; beside it to 1e-12", _distance(x, looser))
    steps, x, moved = COARSEST, _by_steps(problem, COARSEST), np.inf
    while steps < FINEST and moved > AGREED:
        finer = _by_steps(problem, 2 * steps)
        change = _distance(finer, x)
        if change > moved:
            break
        steps, x, moved = 2 * steps, finer, change
    words = f"gauss5 at {problem.grid / steps:g} s, moved {moved:.0e} m by its last change"
    other = ours.motion(problem.model, problem.grid, problem.rows, BY_TOLERANCE, accuracy=TOLERANCE)
    return Known(x, f"{words}; beside it auto to {TOLERANCE:g} m", _distance(x, other.x))


def _by_steps(problem: Problem, k: int) -> np.ndarray:
    return ours.motion(problem.model, problem.grid / k, problem.rows * k, SCHEME, every=k).x


def _distance(x: np.ndarray, y: np.ndarray) -> float:
    return float(np.linalg.norm(x - y, axis=-1).max())
