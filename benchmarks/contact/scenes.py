"""The scenes, each with the motion that is compared and where this is known in closed form."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from benchmarks.contact.chain import chain
from benchmarks.problems import Problem
from msahl.deck import read_deck
from msahl.model import Model
from msahl.model.contacts import PlaneContact

DECKS = Path(__file__).parents[2] / "decks" / "contact"
G = 9.81
SLOPE = math.radians(10.0)
"""Of the box's slope [rad]; its tangent is a third of the coefficient of friction, 0.5."""
FIRST_IMPACT = math.sqrt(2.0 * G)
"""Speed of the bouncing ball, which falls 1 m, at its first impact [m/s]."""
THROWN, STICKY = 1.5, 0.5
"""Speed at which the box is thrown [m/s], and its coefficient of friction."""
LINKS = 10
"""Of the chain."""


def _deck(name: str) -> Callable[[], Model]:
    return lambda: read_deck(DECKS / f"{name}.xml")


def _box() -> Model:
    """The deck ``box_on_slope.xml`` with one coefficient of friction: MuJoCo has no other."""
    model = read_deck(DECKS / "box_on_slope.xml")
    gravity = -G * math.sin(SLOPE), 0.0, -G * math.cos(SLOPE)
    corners = [contact for contact in model.contacts if isinstance(contact, PlaneContact)]
    contacts = (replace(one, friction=STICKY, static_friction=None) for one in corners)
    return replace(model, gravity=gravity, contacts=tuple(contacts))


SCENES: dict[str, tuple[Callable[[], Model], float, int]] = {
    "slip to roll": (_deck("sliding_sphere"), 0.1, 10),
    "bouncing ball": (_deck("bouncing_ball"), 0.1, 50),
    "rocking block": (_deck("rocking_block"), 0.1, 14),
    "box on a slope": (_box, 0.5, 20),
    "Newton's cradle": (_deck("newtons_cradle"), 0.1, 12),
    "chain on a floor": (lambda: chain(LINKS), 0.05, 8),
}
"""By name: the model, the interval of output times [s] and how many of these are run."""


ABOUT = {
    "slip to roll": "The deck `sliding_sphere.xml`: a solid sphere is thrown along a floor without "
    "spin, slides, and rolls from 0.291248 s on; 1 s.",
    "bouncing ball": "The deck `bouncing_ball.xml`: a ball falls from 1 m, rebounds with 0.8 of "
    "its speed, and is at rest from 4.063713 s on, after infinitely many impacts; 5 s.",
    "rocking block": "The deck `rocking_block.xml`: a block 0.2 x 0.8 m, inclined by half of its "
    "critical angle, rocks from one lower edge to the other; three impacts without rebound and "
    "without slip; 1.4 s.",
    "box on a slope": "The deck `box_on_slope.xml` with a slope of 10 degrees and one coefficient "
    "of friction, 0.5: a box on its four corners is thrown up the slope, stops after 0.23 s, and "
    "is to stay there; 10 s.",
    "Newton's cradle": "The deck `newtons_cradle.xml`: five balls on hinges, a micrometre apart; "
    "the first one strikes the row at 0.3615 s, the last one comes back at 1.0846 s. Impacts "
    "without loss follow each other within microseconds; 1.2 s.",
    "chain on a floor": f"{LINKS} rods of 0.1 m on hinges, the first of which is fixed 0.1 m above "
    "a smooth floor, 4 degrees from the horizontal: they fall and lie down, by some twenty impacts "
    "without rebound and as many lift-offs; 0.4 s.",
}
"""What each one is, for the page."""


def scene(name: str) -> Problem:
    """Return one of the ``SCENES`` as a problem."""
    build, grid, rows = SCENES[name]
    model = build()
    return Problem(name, model, (), grid * rows, grid * rows, grid, rows)
