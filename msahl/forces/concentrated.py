"""Concentrated load: a constant force at a point of a body, and a constant moment."""

from dataclasses import dataclass

from msahl.vector import Vector


@dataclass(frozen=True, slots=True)
class ConcentratedLoad:
    """``point`` [m] from B in the body's axes; ``force`` [N] and ``moment`` [N m] have constant
    components in the axes of the bodies (or grounds) named by ``force_basis`` and
    ``moment_basis``, and turn with them."""

    name: str
    body: str
    point: Vector
    force: Vector
    force_basis: str
    moment: Vector
    moment_basis: str
