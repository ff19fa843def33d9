"""Time elements: how one step follows from the last.

Those of order 2 make one family (``schemes.preserving``), from the one that keeps the energy to the
one that takes it from all that is quicker than the step. Those of higher order are one time element
(``schemes.element``) by two rules (``schemes.rule``), of which again one keeps and one takes.
"""

from collections.abc import Callable
from typing import NamedTuple


class Decay(NamedTuple):
    """How a scheme decays: u = h ((v0 + v1)/2 + chi/2 (v1 - v0 - s)), s the smoothed change of v.

    ``share`` is (1 + chi)/2, what an acceleration over the step moves, in parts of h^2; ``pole`` is
    how much of s one step hands to the next.
    """

    share: float
    chi: float
    pole: float


def decaying(damping: float) -> Decay:
    """The scheme whose factor for the quickest motions is -(1 - ``damping``) a step.

    For a linear oscillator it is the two-step method of order 2 with sigma(z) ~ (z + rho)^2, rho =
    1 - damping: the trapezoidal rule for 0, Gear's BDF2 for 1. See ``docs/theory.md``.
    """
    rho = 1.0 - damping
    chi = (1.0 - rho) ** 2 / ((3.0 - rho) * (1.0 + rho))
    return Decay(share=0.5 * (1.0 + chi), chi=chi, pole=(1.0 - 3.0 * rho) / (3.0 - rho))


SCHEMES: dict[str, Callable[[float], Decay]] = {
    "preserving": lambda damping: decaying(0.0),
    "decaying": decaying,
}
"""Schemes of the lowest order, by name, as functions of the damping; the first is the default."""
DEFAULT = next(iter(SCHEMES))
DAMPING = 0.5
"""Damping of a decaying scheme where none is given: 0 none, 1 all, of the quickest in one step."""

CAYLEY, EXPONENTIAL = "cayley", "exponential"
"""What of a step's turn h times the mean angular velocity is, by schemes of the lowest order."""


class Higher(NamedTuple):
    """A scheme of higher order: its largest degree s, and whether it decays."""

    highest: int
    decays: bool

    def order(self, degree: int) -> int:
        """Of states, by its ``degree``."""
        return 2 * degree - self.decays


HIGHER = {"gauss": Higher(5, decays=False), "radau": Higher(3, decays=True)}
"""Schemes of higher order (``schemes.rule``), by name: of order 2s and of order 2s - 1."""
DEGREE = 3
"""Their degree where none is given."""
AUTO, CHOSEN = "auto", "gauss"
"""The scheme whose steps and degree a tolerance asks for, and what it chooses from."""
TOLERANCE = 1e-6
"""Tolerance [m] of ``AUTO`` where none is given."""
WORKER = "scheme"
"""Name that the work of a decaying scheme goes by; loads and motions cannot have it."""


def choices() -> tuple[str, ...]:
    """All schemes a run can choose, by one word each: gauss3 is that of degree 3."""
    higher = (f"{name}{s}" for name, of in HIGHER.items() for s in range(1, of.highest + 1))
    return (*SCHEMES, *higher, AUTO)


def split(word: str) -> tuple[str, int | None]:
    """Name and degree of a scheme given by one of the ``choices``; None if it has none."""
    name = word.rstrip("0123456789")
    return name, int(word.removeprefix(name)) if name in HIGHER else None
