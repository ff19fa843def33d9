"""Ground: a body that never moves. Its axes are the inertial axes, its B the inertial origin."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Ground:
    """A name for the inertial frame; a deck may have several."""

    name: str
