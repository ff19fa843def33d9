"""What happened to contacts: the rows of ``events.csv``."""

from typing import NamedTuple

IMPACT, CLOSES, OPENS, STICKS, SLIDES = "impact", "closes", "opens", "sticks", "slides"


class ContactEvent(NamedTuple):
    """One contact at the time of an event. Speeds are rates of its gap, impulses those that
    increase it.
    """

    time: float  # [s]
    kind: str  # "impact", "closes" (the gap stays zero from then on), "opens", "sticks" or "slides"
    contact: str
    speed_before: float  # [m/s or rad/s]
    speed_after: float
    impulse: float  # [N s or N m s]
    energy_lost: float  # [J], that by friction included
    slip_before: float  # [m/s]
    slip_after: float
    friction_impulse: float  # [N s]
    lost_to_friction: float  # [J]
    remaining: float  # time that omitted rebounds, infinitely many, would take [s]


COLUMNS = [
    "time",
    "kind",
    "contact",
    "gapSpeedBefore",
    "gapSpeedAfter",
    "impulse",
    "energyLost",
    "slipBefore",
    "slipAfter",
    "frictionImpulse",
    "lostToFriction",
    "remainingTime",
]
"""Header of ``events.csv``."""
WORDS = ("kind", "contact")
"""Columns of words; all others are numbers."""
