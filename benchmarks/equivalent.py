"""The formulas of explicit peers in the angles of a planar chain, where a peer takes hours.

A chain that stays in its plane has relative rotations about one axis. MuJoCo's quaternions and
Drake's rolls then advance as those angles do, absolute angles are sums of them, and a Runge-Kutta
formula does not see a linear change of coordinates: the peer's error is that of its formula applied
to ``reference.chain_equation``, but for rounding errors. What a step costs is measured by the peer
itself, over a few steps. ``check`` compares such errors with the peer's own on a shorter chain.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from benchmarks.motion import Motion
from benchmarks.peers import PEERS
from benchmarks.reference import Equation, chain_equation
from msahl.model import Model

FROM = 1000
"""Bodies from which a peer is stood for."""
SECONDS = 2e-3
"""About what a step of the longest chain takes here."""


class Tableau(NamedTuple):
    """Of the peer's ``package``; each row of ``stages`` makes a slope from those before."""

    package: str
    timed: int  # steps
    stages: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]


_KUTTA = Tableau("pydrake", 20, ((), (1 / 2,), (-1.0, 2.0)), (1 / 6, 2 / 3, 1 / 6))
_CLASSIC = Tableau(
    "mujoco", 1, ((), (1 / 2,), (0.0, 1 / 2), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6)
)
_DORMAND_PRINCE = Tableau(
    "pydrake",
    20,
    (
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    ),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
TABLEAUS = {
    "mujoco RK4": _CLASSIC,
    "drake RK3 fixed": _KUTTA,
    "drake RK5 fixed": _DORMAND_PRINCE,
}
"""Source: Hairer, Norsett and Wanner (1993), tables II.1.1, II.1.2 and II.5.2."""


def motion(model: Model, h: float, steps: int, variant: str, every: int = 1) -> Motion:
    """Mass centres by the formula, seconds by the peer; the other columns are empty."""
    x = positions(model, h, steps, variant, every)
    none = np.zeros(0)
    seconds = steps * step_seconds(model, variant)
    return Motion(h * every * np.arange(len(x)), x, none, none, none, seconds, steps)


def positions(model: Model, h: float, steps: int, variant: str, every: int) -> np.ndarray:
    equation, tableau = chain_equation(model, float), TABLEAUS[variant]
    y, rows = equation.start, [equation.start]
    for step in range(1, steps + 1):
        with np.errstate(all="ignore"):
            y = _step(equation, tableau, y, h)
        if not np.isfinite(y).all():
            raise ArithmeticError("the motion grows without bounds")
        if step % every == 0:
            rows.append(y)
    return equation.places(np.array(rows))


def _step(equation: Equation, tableau: Tableau, y: np.ndarray, h: float) -> np.ndarray:
    slopes: list[np.ndarray] = []
    for row in tableau.stages:
        slopes.append(equation.rate(y + h * _sum(row, slopes)))
    return y + h * _sum(tableau.weights, slopes)


def _sum(weights: tuple[float, ...], slopes: list[np.ndarray]) -> np.ndarray | float:
    return sum(w * slope for w, slope in zip(weights, slopes, strict=True))


@lru_cache(maxsize=8)
def step_seconds(model: Model, variant: str) -> float:
    """The peer's own seconds a step."""
    tableau, h = TABLEAUS[variant], 0.005
    module, n = PEERS[tableau.package], tableau.timed
    seconds: float = module.motion(model, h, n, variant, every=n).seconds
    return seconds / n


def check(model: Model, h: float, steps: int, variant: str, exact: np.ndarray) -> tuple[float, ...]:
    """Largest position errors [m] at the end of ``steps`` by the peer and by its formula."""
    peer = PEERS[TABLEAUS[variant].package].motion(model, h, steps, variant, every=steps)
    formula = positions(model, h, steps, variant, steps)
    return tuple(float(np.linalg.norm(x[-1] - exact, axis=-1).max()) for x in (peer.x, formula))
