"""Stronge's impact law of one contact with friction: velocities as functions of the normal impulse.

    dv/dL = W (1, -mu d)     d = s/|s| while it slips                   v = (gap's rate, slip s)
                             d = the one in the disk |d| <= 1 by which ds/dL = 0, where it sticks
    A(L) = integral of v_n dL;    at the end A = (1 - e^2) A_c      A_c at the end of compression

Where s keeps its line, v is linear in L by pieces and all is exact; where it rotates, the piece is
integrated to ``RELATIVE``. Source: W. J. Stronge, Rigid body collisions with friction, Proc. R.
Soc. Lond. A 431 (1990).
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.contact.complementarity import NoSolution
from msahl.contact.cone import directions_from_rest

STRAIGHT = 1e-13
"""Rotation of the slip, relative, that is none."""
ENDED = 1e-12
"""Slip, over the largest rate before the impact, that is zero."""
RELATIVE = 1e-13
"""Accuracy of the integration of a slip that rotates."""
MOST_PIECES = 20


class _Piece(NamedTuple):
    """The state after a piece: rates, impulse so far, work of its normal part, and what ended."""

    v: np.ndarray
    total: np.ndarray
    work: float
    slip_ended: bool
    phase_ended: bool


def impulse(W: np.ndarray, v: np.ndarray, e: float, mu: float) -> np.ndarray:
    """Return the impulse (3,) of a contact with the matrix ``W`` (3, 3) at the rates ``v`` (3,).
    Raises ``NoSolution``.
    """
    now, wanted = _Piece(v.copy(), np.zeros(3), 0.0, False, False), math.nan
    still = ENDED * float(np.abs(v).max())
    for _ in range(MOST_PIECES):
        slip = math.hypot(*now.v[1:])
        d = now.v[1:] / slip if slip > still else _from_rest(W, mu)
        rate = W @ np.array([1.0, *(-mu * d)])
        across = abs(d[0] * rate[2] - d[1] * rate[1])
        if slip > still and across > STRAIGHT * float(np.abs(rate).max()):
            now = _rotating(W, mu, now, wanted, still)
        else:
            now = _straight(rate, mu * d, now, wanted, slip > still)
        if now.slip_ended:
            now.v[1:] = 0.0
        if now.phase_ended:
            if not math.isnan(wanted) or e == 0.0:
                return now.total
            now.v[0], wanted = 0.0, (1.0 - e * e) * now.work
    raise NoSolution


def _from_rest(W: np.ndarray, mu: float) -> np.ndarray:
    """Return d (2,) of a contact whose slip is zero: it sticks, or begins to slip."""
    if mu == 0.0:
        return np.zeros(2)
    T = np.linalg.lstsq(W[1:, 1:], W[1:, 0], rcond=1e-13)[0]
    if math.hypot(*T) <= mu:
        return T / mu
    return next(directions_from_rest(W, mu))


def _straight(
    rate: np.ndarray, friction: np.ndarray, now: _Piece, wanted: float, slips: bool
) -> _Piece:
    """Return what follows a piece with v linear in the impulse."""
    v, closing = now.v, -float(now.v[1:] @ rate[1:])
    ends = float(v[1:] @ v[1:]) / closing if slips and closing > 0.0 else math.inf
    until = math.inf
    if math.isnan(wanted):
        until = -v[0] / rate[0] if rate[0] > 0.0 else math.inf
    elif rate[0] > 0.0:
        until = (math.sqrt(v[0] ** 2 + 2.0 * rate[0] * (wanted - now.work)) - v[0]) / rate[0]
    L = min(ends, until)
    if not math.isfinite(L):
        raise NoSolution
    work = now.work + L * (v[0] + 0.5 * L * rate[0])
    total = now.total + L * np.array([1.0, *-friction])
    return _Piece(v + L * rate, total, work, ends == L, until == L)


def _rotating(W: np.ndarray, mu: float, now: _Piece, wanted: float, still: float) -> _Piece:
    """Return what follows a piece in which the slip rotates, by integration."""
    from scipy.integrate import solve_ivp  # which few impacts need

    def push(y: np.ndarray) -> np.ndarray:
        return np.array([1.0, *(-mu * y[1:3] / math.hypot(y[1], y[2]))])

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        p = push(y)
        return np.concatenate([W @ p, p, y[:1]])

    def phase(_: float, y: np.ndarray) -> float:
        return float(y[0] if math.isnan(wanted) else y[6] - wanted)

    def slip(_: float, y: np.ndarray) -> float:
        return math.hypot(y[1], y[2]) - 0.5 * still

    for event in (phase, slip):
        event.terminal = True  # type: ignore[attr-defined]
    phase.direction = 1.0  # type: ignore[attr-defined]
    begin = np.concatenate([now.v, now.total, [now.work]])
    size = float(np.abs(now.v).max())
    most = 1e3 * size / min(W[0, 0], W[1, 1], W[2, 2])
    done = solve_ivp(
        rates,
        *((0.0, most), begin, "DOP853"),
        events=(phase, slip),
        rtol=RELATIVE,
        atol=RELATIVE * size,
    )
    if done.status != 1:
        raise NoSolution
    y, ended = done.y[:, -1], [bool(times.size) for times in done.t_events]
    return _Piece(y[:3].copy(), y[3:6].copy(), float(y[6]), ended[1], ended[0])
