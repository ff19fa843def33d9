"""Names and coefficients of the schemes: how the state at the end of a step follows from its start.

The schemes of order 2 (``schemes.midpoint``) are one family with a damping: "preserving" conserves
the energy, "decaying" takes energy from motions that are faster than the step. The collocation
schemes (``schemes.collocation``) have the higher orders: gauss nearly conserves the energy, radau
takes energy from fast motions. The explicit schemes (``schemes.explicit``) solve for nothing, and
conserve nothing.
"""

from collections.abc import Callable
from typing import NamedTuple


class Decay(NamedTuple):
    """Coefficients of a scheme of order 2: u = h ((v0 + v1)/2 + chi/2 (v1 - v0 - s)), where s is
    the smoothed change of v.

    ``share`` is (1 + chi)/2, the displacement by a constant acceleration a over the step in units
    of h^2 a; ``pole`` is the factor by which s is carried from one step to the next.
    """

    share: float
    chi: float
    pole: float


def decaying(damping: float) -> Decay:
    """Coefficients of the scheme that multiplies the fastest motions by -(1 - ``damping``) a step.

    For a linear oscillator it is the two-step method of order 2 with sigma(z) ~ (z + rho)^2, rho =
    1 - damping: the trapezoidal rule for 0, Gear's BDF2 for 1. See ``docs/theory.md``.
    """
    rho = 1.0 - damping
    chi = (1.0 - rho) ** 2 / ((3.0 - rho) * (1.0 + rho))
    return Decay(share=0.5 * (1.0 + chi), chi=chi, pole=(1.0 - 3.0 * rho) / (3.0 - rho))


ORDER_TWO: dict[str, Callable[[float], Decay]] = {
    "preserving": lambda damping: decaying(0.0),
    "decaying": decaying,
}
"""Schemes of order 2: name -> coefficients as a function of the damping."""
DEFAULT = next(iter(ORDER_TWO))
"""Scheme of a deck that names none."""
DAMPING = 0.5
"""Default damping of "decaying": 0 damps nothing, 1 removes the fastest motions in one step."""

CAYLEY, EXPONENTIAL = "cayley", "exponential"
"""How schemes of order 2 update a rotation by h times the mean angular velocity of a step: by the
Cayley transform or by the exponential map."""


class Collocation(NamedTuple):
    """A family of collocation schemes: its highest degree s, and whether it takes energy."""

    highest: int
    decays: bool

    def order(self, degree: int) -> int:
        """Order of convergence of the states at this ``degree``."""
        return 2 * degree - self.decays


COLLOCATION = {"gauss": Collocation(5, decays=False), "radau": Collocation(3, decays=True)}
"""Collocation families by name: gauss has the order 2s, radau the order 2s - 1."""
EXPLICIT = {"rk4": 4, "rk8": 8}
"""Explicit Runge-Kutta schemes: name -> order."""
DEGREE = 3
"""Default degree of a collocation scheme."""
AUTO, AUTO_FAMILY = "auto", "gauss"
"""The scheme whose step size and degree follow from a tolerance, and its family."""
TOLERANCE = 1e-6
"""Default tolerance [m] of ``AUTO``."""
WORKER = "scheme"
"""Column of the energy that a dissipative scheme takes; loads and motions cannot have this name."""


def choices() -> tuple[str, ...]:
    """Names of all schemes as the option ``--scheme`` takes them; gauss3 is gauss of degree 3."""
    families = COLLOCATION.items()
    collocation = (f"{name}{s}" for name, family in families for s in range(1, family.highest + 1))
    return (*ORDER_TWO, *collocation, *EXPLICIT, AUTO)


def order_of(word: str) -> int:
    """Order of one of the ``choices`` but ``AUTO``."""
    name, degree = split(word)
    return COLLOCATION[name].order(degree) if degree else EXPLICIT.get(name, 2)


def split(word: str) -> tuple[str, int | None]:
    """Name and degree of one of the ``choices``; the degree is None for schemes without one."""
    name = word.rstrip("0123456789")
    return (name, int(word.removeprefix(name))) if name in COLLOCATION else (word, None)
