"""What happened to contacts and by events of the deck: the rows of ``events.csv``."""

from typing import NamedTuple

IMPACT, CLOSES, OPENS, STICKS, SLIDES = "impact", "closes", "opens", "sticks", "slides"
RELEASES, ENGAGES, HAPPENS = "releases", "engages", "happens"
SETS, PUSHES = "sets", "pushes"


class ContactEvent(NamedTuple):
    """One contact at the time of an event. Speeds are rates of its gap, impulses those that
    increase it. Of an element that an event of the deck engages the speed is that at which its
    constraint was violated, and the impulse that which closes it; of an impulse that it gives the
    speed is that along the impulse.
    """

    time: float  # [s]
    kind: str  # "impact", "closes" (the gap stays zero from then on), "opens", "sticks", "slides";
    # of events of the deck "releases", "engages", "sets", "pushes", or "happens" without these
    element: str  # contact, joint, coupling, motion, state, number of a load, marker
    speed_before: float  # [m/s or rad/s]
    speed_after: float
    impulse: float  # [N s or N m s]
    energy_lost: float  # [J], that by friction included
    slip_before: float  # [m/s]
    slip_after: float
    friction_impulse: float  # [N s]
    lost_to_friction: float  # [J]
    remaining: float  # time that omitted rebounds, infinitely many, would take [s]
    event: str = ""  # event of the deck, and its message
    message: str = ""


COLUMNS = [
    "time",
    "kind",
    "element",
    "gapSpeedBefore",
    "gapSpeedAfter",
    "impulse",
    "energyLost",
    "slipBefore",
    "slipAfter",
    "frictionImpulse",
    "lostToFriction",
    "remainingTime",
    "event",
    "message",
]
"""Header of ``events.csv``."""
WORDS = ("kind", "element", "event", "message")
"""Columns of words; all others are numbers."""
