"""Where the bodies of a scene are: in closed form, or by two schemes of msahl."""

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks import ours
from benchmarks.contact.scenes import SLOPE, STICKY, THROWN, G
from benchmarks.problems import Problem
from benchmarks.reference import Known

HEIGHT, RADIUS, RESTITUTION = 1.0, 0.1, 0.8
"""Of the bouncing ball: its fall [m], and what rebounds of its speed."""
SPEED, FRICTION = 2.0, 0.2
"""Of the sphere that slides before it rolls."""
HALF = (0.1, 0.4)
"""Half width and half height of the rocking block [m]."""
TOLERANCE = 1e-13
"""Of the rocking block's angle [rad]."""
FINE, BESIDE = ("msahl gauss3", 40), ("msahl gauss2", 40)
"""Two schemes, and steps in an interval of output times, where there is no closed form."""


def true_motion(problem: Problem) -> Known:
    """Return the mass centres at the output times, and how far msahl's finest run is from them, or
    two of its schemes from each other.
    """
    t = problem.grid * np.arange(problem.rows + 1)
    finest = _by_msahl(problem, *FINE)
    if problem.name in CLOSED:
        words, motion = CLOSED[problem.name]
        x = motion(t)[:, None]
        return Known(x, f"{words}; beside it {_named(problem, *FINE)}", _distance(x, finest))
    other = _by_msahl(problem, *BESIDE)
    words = f"{_named(problem, *FINE)}; beside it {_named(problem, *BESIDE)}"
    return Known(finest, words, _distance(finest, other))


def _named(problem: Problem, scheme: str, k: int) -> str:
    return f"{scheme} at {problem.grid / k:g} s"


def _by_msahl(problem: Problem, scheme: str, k: int) -> np.ndarray:
    return ours.motion(problem.model, problem.grid / k, problem.rows * k, scheme, every=k).x


def _distance(x: np.ndarray, y: np.ndarray) -> float:
    return float(np.linalg.norm(x - y, axis=-1).max())


def slides_then_rolls(t: np.ndarray) -> np.ndarray:
    """Mass centre (n, 3) of the sphere at times ``t`` (n,) [s]."""
    rolls = 2.0 * SPEED / (7.0 * FRICTION * G)
    slid = np.minimum(t, rolls)
    x = SPEED * slid - 0.5 * FRICTION * G * slid**2 + 5.0 / 7.0 * SPEED * np.maximum(t - rolls, 0.0)
    return np.stack([x, np.zeros_like(x), np.full_like(x, RADIUS)], axis=-1)


def bounces(t: np.ndarray) -> np.ndarray:
    """Mass centre (n, 3) of the ball at times ``t`` (n,) [s]."""
    z = np.array([_height(float(time)) for time in t])
    return np.stack([np.zeros_like(z), np.zeros_like(z), RADIUS + z], axis=-1)


def _height(t: float) -> float:
    """Height of the ball's lowest point; the k-th impact is at t_1 (1 + 2 (e + ... + e^(k-1)))."""
    first = math.sqrt(2.0 * HEIGHT / G)
    e = RESTITUTION
    if t <= first:
        return HEIGHT - 0.5 * G * t * t
    share = 1.0 - (t / first - 1.0) * (1.0 - e) / (2.0 * e)
    if share <= 0.0:
        return 0.0
    k = math.floor(math.log(share) / math.log(e))
    began = first * (1.0 + 2.0 * e * (1.0 - e**k) / (1.0 - e))
    since = t - began
    return max(0.0, e ** (k + 1) * G * first * since - 0.5 * G * since * since)


def stops_on_the_slope(t: np.ndarray) -> np.ndarray:
    """Mass centre (n, 3) of the box at times ``t`` (n,) [s], axes of the slope."""
    slowing = G * (math.sin(SLOPE) + STICKY * math.cos(SLOPE))
    slid = np.minimum(t, THROWN / slowing)
    x = THROWN * slid - 0.5 * slowing * slid**2
    return np.stack([x, np.zeros_like(x), np.full_like(x, HALF[0])], axis=-1)


def rocks(t: np.ndarray) -> np.ndarray:
    """Mass centre (n, 3) of the block at times ``t`` (n,) [s]: its one angle by DOP853, which ends
    where it stands upright, and goes on about the other edge with 0.91 of the rate.
    """
    b, h = HALF
    radius, critical = math.hypot(b, h), math.atan2(b, h)
    # Moment of inertia over mass about the edge, (b^2 + h^2)/3 of it about the mass centre.
    p2 = G * radius / (4.0 / 3.0 * radius**2)
    ratio = 1.0 - 1.5 * math.sin(critical) ** 2
    tilt, edge = np.zeros_like(t), np.zeros_like(t)
    side, pivot, now, state = 1.0, 0.0, 0.0, (0.5 * critical, 0.0)
    while now < t[-1]:
        found = solve_ivp(
            lambda _, y: (y[1], -p2 * math.sin(critical - y[0])),
            (now, t[-1]),
            state,
            method="DOP853",
            rtol=TOLERANCE,
            atol=TOLERANCE,
            dense_output=True,
            events=_upright,
        )
        end = found.t[-1]
        inside = (t >= now) & (t <= end)
        tilt[inside], edge[inside] = side * found.sol(t[inside])[0], pivot
        # It rises about the other edge: the sign of the tilt changes, not that of the rotation.
        state = (0.0, -ratio * found.y[1, -1])
        side, pivot, now = -side, pivot - 2.0 * b * side, end
    return _centre(tilt, edge)


def _upright(_: float, y: np.ndarray) -> float:
    return float(y[0])


_upright.terminal = True  # type: ignore[attr-defined]
_upright.direction = -1.0  # type: ignore[attr-defined]


def _centre(tilt: np.ndarray, edge: np.ndarray) -> np.ndarray:
    """Mass centre where the block is tilted about the lower edge at x = ``edge``."""
    b, h = HALF
    x0 = np.where(tilt >= 0.0, -b, b)
    x = edge + x0 * np.cos(tilt) + h * np.sin(tilt)
    z = -x0 * np.sin(tilt) + h * np.cos(tilt)
    return np.stack([x, np.zeros_like(x), z], axis=-1)


CLOSED: dict[str, tuple[str, Callable[[np.ndarray], np.ndarray]]] = {
    "slip to roll": ("closed form", slides_then_rolls),
    "bouncing ball": ("closed form", bounces),
    "rocking block": ("its one angle by DOP853, between impacts in closed form", rocks),
    "box on a slope": ("closed form", stops_on_the_slope),
}
"""Where the true motion is known without msahl: how, and the mass centre at given times."""
