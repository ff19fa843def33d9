"""Define the scenes with contacts of docs/validation/error.md.

The truth is a closed form where there is one, in pieces between impacts and the ends of slips, else
a solution by two other schemes at small steps.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from msahl.algebra.functions import Law
from msahl.algebra.vector import ZERO
from msahl.model import (
    DistanceLimit,
    Model,
    PlaneContact,
    SpringDamper,
)
from tools.validation.error_beams import solve_at
from tools.validation.error_models import EARTH, Case, body, deck, model_of, push
from tools.validation.reference import Truth

G = 9.81
DOWN = (0.0, 0.0, -G)
ABOVE = (0.0, 0.0, 1.0)
TWO_WAYS = (("gauss", 5, 40), ("gauss", 4, 50))
"""Schemes, degrees and steps per output time of solutions that are references."""
FEW_ULPS = 1e-15
"""Error of closed forms, relative to the largest number."""


def at_small_steps(case: Case) -> Truth:
    """Return the solution by two other schemes."""
    (states, _), (other, _) = (solve_at(case, case.model, way) for way in TWO_WAYS)
    return Truth(case.times, states, other)


def closed_form(states: Callable[[float], list[float]]) -> Callable[[Case], Truth]:
    """Return the truth by the ``states`` (12,) of one body at a time [s]."""

    def truth(case: Case) -> Truth:
        rows = np.array([states(float(t)) for t in case.times])
        return Truth(case.times, rows, rows + FEW_ULPS * np.abs(rows).max())

    return truth


def floor(
    child: str, friction: float = 0.0, radius: float = 0.0, restitution: float = 0.0
) -> PlaneContact:
    """Return a contact of a point, or a sphere, with the plane z = 0."""
    given = ZERO, ZERO, ABOVE, radius, restitution
    return PlaneContact("Floor", EARTH, child, *given, friction=friction)


def rubbing_oscillator() -> Model:
    """A block on a spring, .2 m from its middle, whose friction brings it to rest."""
    spring = SpringDamper("Spring", EARTH, "Block", (-1.0, 0.0, 0.0), ZERO, 100.0, 0.0, 1.0)
    block = body("Block", 1.0, (0.01,) * 3, (0.2, 0.0, 0.0))
    model = model_of([block], loads=[spring], gravity=DOWN)
    return replace(model, contacts=(floor("Block", friction=0.25),))


def rubbing_states(t: float) -> list[float]:
    """Half periods about +-mu g/100, then rest."""
    half, middle = min(int(10.0 * t / np.pi), 4), 0.25 * G / 100.0
    sign, angle = (-1.0) ** half, 10.0 * t - np.pi * half
    width = 0.2 - 2.0 * middle * half - middle
    x, v = sign * (width * np.cos(angle) + middle), -10.0 * sign * width * np.sin(angle)
    if half == 4:
        x, v = 0.2 - 8.0 * middle, 0.0
    return [float(x), *[0.0] * 5, float(v), *[0.0] * 5]


def rolling_sphere() -> Model:
    """A sphere that is thrown along a plane, slides, and rolls from 2/7 v/(mu g) on."""
    sphere = body("Sphere", 1.0, (0.004,) * 3, (0.0, 0.0, 0.1), velocity=(1.0, 0.0, 0.0))
    model = model_of([sphere], gravity=DOWN)
    return replace(model, contacts=(floor("Sphere", radius=0.1, friction=0.1),))


def rolling_states(t: float) -> list[float]:
    """Uniform deceleration, then uniform rolling."""
    a, rolls = 0.1 * G, 2.0 / (7.0 * 0.1 * G)
    slides, after = min(t, rolls), max(t - rolls, 0.0)
    v, w = 1.0 - a * slides, 2.5 * a * slides / 0.1
    x = slides - 0.5 * a * slides * slides + v * after
    angle = 0.5 * w * slides + w * after
    along = 4.0 * np.tan(0.25 * angle), v * np.cos(angle), v * np.sin(angle)  # in its own axes
    place, spin = [x, 0.0, 0.1, 0.0, along[0], 0.0], [0.0, w, 0.0]
    return [*place, along[1], 0.0, along[2], *spin]


def stick_slip() -> Model:
    """A block on a spring with a static coefficient twice the other, that a force shakes."""
    spring = SpringDamper("Spring", EARTH, "Block", (-1.0, 0.0, 0.0), ZERO, 100.0, 0.0, 1.0)
    force = push("Force", "Block", (12.0, 0.0, 0.0), Law("sine", (1.0, 5.0, 0.0, 0.0)))
    model = model_of([body("Block", 1.0, (0.01,) * 3)], loads=[spring, force], gravity=DOWN)
    return replace(model, contacts=(replace(floor("Block", 0.2), static_friction=0.4),))


def thrown_across() -> Model:
    """A block that is thrown across a slope of 20 degrees, and stops on a curved way."""
    angle = float(np.radians(20.0))
    gravity = (-G * float(np.sin(angle)), 0.0, -G * float(np.cos(angle)))
    block = body("Block", 1.0, (0.01,) * 3, velocity=(0.5, 1.5, 0.0))
    return replace(model_of([block], gravity=gravity), contacts=(floor("Block", friction=0.5),))


def slack_rope() -> Model:
    """A stone on a rope of 1 m that is slack at first."""
    stone = body("Stone", 1.0, (0.01,) * 3, (0.5, 0.0, 0.0), velocity=(0.0, 0.5, 1.0))
    rope = DistanceLimit("Rope", EARTH, "Stone", ZERO, ZERO, upper=1.0, restitution=0.3)
    return replace(model_of([stone], gravity=DOWN), contacts=(rope,))


def tumbling_rod() -> Model:
    """A rod that falls on one end, with friction."""
    rod = body("Rod", 1.0, (1.0 / 12.0, 1.0 / 12.0, 1e-3), (0.0, 0.0, 0.8), (0.7, 0.2, 0.0))
    ends = [(-1, "A"), (1, "B")]
    contacts = tuple(
        replace(floor("Rod", 0.3, 0.0, 0.4), name=name, child_point=(0.0, 0.0, 0.5 * sign))
        for sign, name in ends
    )
    return replace(model_of([rod], gravity=DOWN), contacts=contacts)


WALL = deck("contact/pendulum_at_a_wall")
CONTACTS = (
    Case(
        "rubbing oscillator",
        "contact",
        rubbing_oscillator,
        1.5,
        30,
        own_truth=closed_form(rubbing_states),
    ),
    Case(
        "rolling sphere", "contact", rolling_sphere, 0.6, 8, own_truth=closed_form(rolling_states)
    ),
    Case("stick and slip", "contact", stick_slip, 2.0, 50, own_truth=at_small_steps),
    Case("thrown across a slope", "contact", thrown_across, 0.8, 20, own_truth=at_small_steps),
    Case("pendulum at a wall", "contact", WALL, 2.0, 40, own_truth=at_small_steps),
    Case("slack rope", "contact", slack_rope, 1.5, 30, own_truth=at_small_steps),
    Case("tumbling rod", "contact", tumbling_rod, 0.6, 24, own_truth=at_small_steps),
)
