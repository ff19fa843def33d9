"""Integrate equations of motion that are smooth between known times and switches of the motion.

A ``Motion`` is what a person derives from a scene by hand: y' = rates(t, y, side, piece), where
``side`` has the sign of each switch and ``piece`` counts the known times that have passed. Both are
held while scipy's DOP853 integrates, so that it never sees a kink or a jump. A piece ends where a
switch passes zero; it is integrated again up to there, without the error of interpolation.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

Array = np.ndarray
Sides = tuple[float, ...]
CLEAR = 1e-9
"""Value of a switch, at a known time, below which its side is the one before."""


@dataclass(frozen=True)
class Motion:
    """Equations of motion from the state ``first`` at t = 0; ``motion`` returns, of solutions
    (m, k), position, angle about z, velocity and angular velocity of all bodies in inertial axes
    (m, n, 4, 3), ``columns`` the values of signals by name.
    """

    first: Sequence[float]
    rates: Callable[[float, Array, Sides, int], Sequence[float]]
    motion: Callable[[Array], Array]
    columns: Callable[[Array, Array], dict[str, Array]] = lambda t, ys: {}
    switches: Callable[[float, Array], Sequence[float]] = lambda t, y: ()
    breaks: Sequence[float] = ()


def published(motion: Motion, ys: Array) -> Array:
    """(m, 12 n) the states as runs publish them: rotations as four times the tangent of a quarter
    of the angle, velocities in the axes of the bodies."""
    states = motion.motion(ys)
    angle = states[:, :, 1, 2].copy()
    states[:, :, 1, 2] = 4.0 * np.tan(0.25 * np.remainder(angle + np.pi, 2.0 * np.pi) - np.pi / 4)
    x, y = states[:, :, 2, 0].copy(), states[:, :, 2, 1].copy()
    states[:, :, 2, 0] = np.cos(angle) * x + np.sin(angle) * y
    states[:, :, 2, 1] = np.cos(angle) * y - np.sin(angle) * x
    return states.reshape(len(ys), -1)


def solve(motion: Motion, times: Array, rtol: float, change: float = 0.0) -> Array:
    """(m, k) the solution at the increasing ``times`` from 0, from a start that is changed by a
    share ``change`` with alternating signs."""
    first = np.array(motion.first, dtype=float)
    y = first * (1.0 + change * (-1.0) ** np.arange(len(first)))
    t, rows = 0.0, [y]
    side = tuple(1.0 if g >= 0.0 else -1.0 for g in motion.switches(t, y))
    ends = sorted({*(b for b in motion.breaks if 0.0 < b < times[-1]), float(times[-1])})
    for piece, end in enumerate(ends):
        while t < end:
            found, hit = _to_switch(motion, (t, end), y, side, piece, rtol)
            asked = times[(times > t) & (times <= found.t[-1])]
            rows += list(found.sol(asked).T) if len(asked) else []
            t, y = float(found.t[-1]), found.y[:, -1]
            side = tuple(-s if k == hit else s for k, s in enumerate(side))
        now = motion.switches(end, y)
        side = tuple(
            s if abs(g) < CLEAR else np.copysign(1.0, g) for s, g in zip(side, now, strict=True)
        )
    return np.array(rows)


def _to_switch(
    motion: Motion, span: tuple[float, float], y: Array, side: Sides, piece: int, rtol: float
) -> tuple[Any, int | None]:
    """The solution up to the first switch that changes its side, or the end; and that switch."""

    def rates(t: float, y: Array) -> Sequence[float]:
        return motion.rates(t, y, side, piece)

    def leaves(k: int) -> Callable[[float, Array], float]:
        def event(t: float, y: Array) -> float:
            return side[k] * motion.switches(t, y)[k]

        event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        return event

    given = {"method": "DOP853", "rtol": rtol, "atol": rtol * 1e-2 * np.maximum(1.0, np.abs(y))}
    events = [leaves(k) for k in range(len(side))]
    found = solve_ivp(rates, span, y, events=events, dense_output=True, **given)
    if found.status != 1:
        return found, None
    hit = next(k for k, at in enumerate(found.t_events) if len(at))
    again = solve_ivp(rates, (span[0], found.t[-1]), y, dense_output=True, **given)
    return again, hit
