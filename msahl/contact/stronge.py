"""Stronge's impact law of one contact with friction: velocities as functions of the normal impulse.

    dv/dL = W (1, -mu d),    d = s/|s| while it slips                   v = (gap's rate, slip s)
    dv/dL = W (1, -mu d*)    where it sticks: the d* in the disk |d*| <= 1 by which ds/dL = 0
    A(L) = integral of v_n dL;    at the end A = (1 - e^2) A_c          A_c at the least v_n = 0

Where s keeps its line, v is linear in L by pieces and all is exact; where it turns, the piece is
integrated. Source: W. J. Stronge, Rigid body collisions with friction, Proc. R. Soc. Lond. A 431
(1990).
"""

import math

import numpy as np

from msahl.contact.complementarity import NoSolution

STRAIGHT = 1e-13
"""Turn of the slip, relative, that is none."""
MOST_PIECES = 20


def impulse(W: np.ndarray, v: np.ndarray, e: float, mu: float) -> np.ndarray:
    """Return the impulse (3,) of a contact with the matrix ``W`` (3, 3) at the rates ``v`` (3,).
    Raises ``NoSolution``.
    """
    total, work, wanted = np.zeros(3), 0.0, math.nan
    v, phase = v.copy(), 0
    speed = float(np.abs(v).max())
    for _ in range(MOST_PIECES):
        slips = math.hypot(v[1], v[2]) > 1e-14 * speed
        d = v[1:] / math.hypot(v[1], v[2]) if slips else _rest(W, mu)
        push = np.array([1.0, -mu * d[0], -mu * d[1]])
        rate = W @ push
        if rate[0] <= 0.0 and phase == 1:
            raise NoSolution
        turning = abs(d[0] * rate[2] - d[1] * rate[1]) > STRAIGHT * float(np.abs(rate).max())
        if slips and turning:
            return _integrated(W, v, e, mu, (total, work, wanted))
        ends = _until_slip_ends(v, rate) if slips else math.inf
        if phase == 0:
            until = -v[0] / rate[0] if rate[0] > 0.0 else math.inf
        else:
            until = (-v[0] + math.sqrt(v[0] ** 2 + 2.0 * rate[0] * (wanted - work))) / rate[0]
        step = min(ends, until)
        if not math.isfinite(step):
            raise NoSolution
        total += step * push
        work += step * (v[0] + 0.5 * step * rate[0])
        v = v + step * rate
        if step == ends:
            v[1:] = 0.0
        if step == until:
            if phase == 1 or e == 0.0:
                return total
            v[0], phase, wanted = 0.0, 1, (1.0 - e * e) * work
    raise NoSolution


def _rest(W: np.ndarray, mu: float) -> np.ndarray:
    """Return d* (2,) of a contact whose slip is zero: it sticks, or begins to slip."""
    T = np.linalg.solve(W[1:, 1:], W[1:, 0])
    if math.hypot(*T) <= mu:
        return T / mu if mu > 0.0 else np.zeros(2)
    d = W[1:, 0] / math.hypot(*W[1:, 0])
    for _ in range(200):  # ds/dL along d
        rate = W[1:, 0] - mu * (W[1:, 1:] @ d)
        new = rate / math.hypot(*rate)
        new = (d + new) / math.hypot(*(d + new))
        if np.abs(new - d).max() <= 1e-15:
            break
        d = new
    return d


def _until_slip_ends(v: np.ndarray, rate: np.ndarray) -> float:
    """Return the normal impulse until a slip on a line ends, infinite if it does not."""
    closing = -float(v[1:] @ rate[1:])
    return float(v[1:] @ v[1:]) / closing if closing > 0.0 else math.inf
