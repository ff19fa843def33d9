"""A planetary gear train that lifts an eccentric load: sun, carrier, three planets, fixed ring.

The sun (20 teeth), under a constant moment, is in mesh with three planets (20 teeth) on the
carrier; the first of these is in mesh with the fixed ring (60 teeth), so that no equation is
redundant. Angles relative to the carrier: planet = -sun, and planet = -3 carrier at the ring. The
carrier rotates at a quarter of the sun's speed and carries a load off its axis, under gravity.
"""

import numpy as np

from benchmarks.mechanisms.parts import GROUND, ORIGIN, body, disk, joint, model, rod
from msahl.algebra.vector import Vector
from msahl.model import ConcentratedLoad, Coupling, Model

UP: Vector = (0.0, 0.0, 1.0)
RADIUS, WIDTH = 0.05, 0.03
"""Of the sun and of the planets [m]."""
MOMENT = 20.0
"""On the sun, about the axis [N m]."""
LOAD, ARM = 20.0, 0.3
"""Mass [kg] and distance of its centre from the axis [m]."""
GRAVITY = (0.0, -9.81, 0.0)


def gear_train() -> Model:
    """Return the model."""
    carrier = body("Carrier", LOAD, rod(LOAD, (0.2, 0.0, 0.0), 0.05), (ARM, 0.0, 0.0))
    sun = body("Sun", 2.0, disk(2.0, UP, RADIUS, WIDTH), ORIGIN)
    places = [
        (2.0 * RADIUS * np.cos(phi), 2.0 * RADIUS * np.sin(phi), 0.0)
        for phi in 2.0 * np.pi / 3.0 * np.arange(3)
    ]
    planets = [
        body(f"Planet {i}", 1.0, disk(1.0, UP, RADIUS, WIDTH), place)
        for i, place in enumerate(places, start=1)
    ]
    joints = [
        joint("revolute", "Carrier bearing", (None, carrier), ORIGIN, UP),
        joint("revolute", "Sun bearing", (carrier, sun), ORIGIN, UP),
        *(joint("revolute", f"{planet.name} pin", (carrier, planet), planet.position, UP)
          for planet in planets),
    ]  # fmt: skip
    gears = [Coupling("Ring", "gear", "Carrier bearing", "Planet 1 pin", -3.0)]
    gears += [
        Coupling(f"Mesh {i}", "gear", "Sun bearing", f"Planet {i} pin", -1.0) for i in (1, 2, 3)
    ]
    motor = ConcentratedLoad("Motor", "Sun", ORIGIN, ORIGIN, GROUND, (0.0, 0.0, MOMENT), GROUND)
    bodies = [carrier, sun, *planets]
    return model("Planetary gear train", GRAVITY, bodies, joints, [motor], gears)
