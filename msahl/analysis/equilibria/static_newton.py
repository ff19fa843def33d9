"""Newton's method for an equilibrium, by places and multipliers together.

    [ K  G^T ] [ dq   ]     [ f + G^T lam - M a ]
    [ G   C  ] [ dlam ]  = -[ g + C lam         ]       the equations of ``static_equations``

Since multipliers are unknowns of their own, no reaction has to be right before the places are: far
fewer iterations than by eliminating them, however stiff the directions in which they act, of joints
as of beams. Small numbers on the diagonal of a singular matrix change no result, because the
residual is exact.
"""

from typing import NamedTuple

import numpy as np

from msahl.analysis.equilibria.static_equations import Balance, Statics
from msahl.analysis.equilibria.static_matrix import factorise, solve
from msahl.system.arrays import State, System, node_count

MOST_ITERATIONS = 40
LARGEST_ROTATION = 1.0
"""Of a body in one iteration [rad]; displacements likewise, over the length of the system."""
USEFUL = 0.1
"""Share of a step below which its directions of little stiffness are made stiffer."""
BALANCED = 1e-9
"""Force that is not balanced, over the largest force, of an equilibrium; likewise a violation over
the size of the system."""
CANCELLED = 1e-6
"""Likewise where forces at one body cancel each other, so that none of them is seen; the step must
then be small."""
CONVERGED = 1e-13
"""Step, over the size of the system, after which another one changes nothing."""


class Rest(NamedTuple):
    """Where Newton's method ended."""

    state: State
    balance: Balance
    iterations: int
    converged: bool


def newton(
    statics: Statics, state: State, factor: float = 1.0, most: int = MOST_ITERATIONS
) -> Rest:
    """Return the equilibrium to which Newton's method leads from a ``state``, whose multipliers
    ``state.force`` are the first guess of the reactions, with gravity and loads times ``factor``.
    """
    now, shift, found = statics.balance(state, factor), 0.0, Search()
    for _ in range(most):
        step, multipliers = _step(now, shift)
        share = shortened(now, step)
        if share < USEFUL:
            shift = max(10.0 * shift, now.largest / now.size)
            step, multipliers = _step(now, shift)
            share = shortened(now, step)
        elif share == 1.0:
            shift = 0.1 * shift if shift * now.size > 1e-3 * now.largest else 0.0
        if not np.isfinite(step).all():
            break
        state = stepped(statics.system, state, now, share * step, share * multipliers)
        now = statics.balance(state, factor)
        if found.ends(state, now, step):
            break
    return found.result(state, now)


def _step(now: Balance, shift: float) -> tuple[np.ndarray, np.ndarray]:
    """Newton's step, with all directions stiffer by the ``shift`` [N/m]."""
    return solve(factorise(now, shift), -now.force, -now.violation)


class Search:
    """The best state of an iteration, and whether another one would not improve it."""

    def __init__(self) -> None:
        self.state: State | None = None
        self.balance: Balance | None = None
        self.iterations = self.waited = 0
        self.small = False

    @property
    def converged(self) -> bool:
        """Whether the best state is an equilibrium."""
        if self.balance is None:
            return False
        return self.balance.relative <= (CANCELLED if self.small else BALANCED)

    def ends(self, state: State, now: Balance, step: np.ndarray) -> bool:
        """Take note of a state that a ``step`` led to; return whether to stop."""
        self.iterations += 1
        if not np.isfinite(now.relative):
            return True
        last = np.inf if self.balance is None else self.balance.relative
        self.waited = self.waited + 1 if now.relative > 0.5 * last else 0
        if now.relative < last:
            self.state, self.balance = state, now
        self.small = float(np.abs(step).max(initial=0.0)) <= CONVERGED * now.size
        # At round-off the residual stops falling.
        return self.converged and (self.small or self.waited > 1)

    def result(self, state: State, now: Balance) -> Rest:
        """Return the best state, or the last one given if there is none."""
        return Rest(self.state or state, self.balance or now, self.iterations, self.converged)


def shortened(now: Balance, step: np.ndarray, most: float = LARGEST_ROTATION) -> float:
    """Return the share of a ``step`` (n,) [m] that rotates and displaces no body too far."""
    layout = now.layout
    rotation = np.abs((step / layout.length)[layout.rotational]).max(initial=0.0)
    travel = np.abs(step).max(initial=0.0) / now.size
    return min(1.0, most / max(float(rotation), float(travel), 1e-300))


def stepped(
    system: System, state: State, now: Balance, step: np.ndarray, multipliers: np.ndarray
) -> State:
    """Return the state after a ``step`` (n,) [m] and a change of the ``multipliers`` (c,)."""
    layout = now.layout
    frames, dq = system.frames, np.zeros((node_count(system), 3))
    dq.reshape(-1)[layout.coordinate] = step / layout.length
    x, p, force = state.x.copy(), state.p.copy(), state.force.copy()
    x[:-1] += dq[frames.displacement[:-1]]
    p[:-1] = _rotated(p[:-1], dq[frames.rotation[:-1]])
    force.reshape(-1)[layout.multiplier] += multipliers
    return state._replace(
        x=x, p=p, force=force, angle=state.angle.copy(), strain=state.strain.copy()
    )


def _rotated(p: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Return the parameters ``p`` (f, 3) rotated by the increments ``Q`` (f, 3) in inertial axes,
    as ``compose`` and ``from_increment`` of ``algebra.rotation`` give them.
    """
    c = 2.0 / (1.0 + np.sqrt(1.0 + 0.25 * (Q * Q).sum(axis=1, keepdims=True))) * Q
    c0 = 2.0 - 0.125 * (c * c).sum(axis=1, keepdims=True)
    p0 = 2.0 - 0.125 * (p * p).sum(axis=1, keepdims=True)
    e0 = c0 * p0 - (c * p).sum(axis=1, keepdims=True)
    e = p0 * c + c0 * p + np.cross(c, p)
    norm = (4.0 - c0) * (4.0 - p0)
    rotated: np.ndarray = np.where(e0 >= 0.0, 4.0, -4.0) / (norm + np.abs(e0)) * e
    return rotated
