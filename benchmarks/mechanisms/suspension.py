"""The corner of a car: double wishbone, tie rod, spring-damper and tyre, dropped on its spring.

The chassis slides along z. Both wishbones are hinged to it (the upper one about an inclined axis)
and carry the upright by ball joints; the wheel is braked, so it belongs to the upright. The tie rod
has a universal joint at the chassis. The tyre is a spring-damper from the ground to the wheel's
centre. All springs are unloaded at the start, so the corner falls.
"""

import numpy as np

from benchmarks.mechanisms.parts import body, joint, model, rod, spring
from msahl.algebra.vector import Vector
from msahl.model import Model

LOWER: tuple[Vector, Vector] = (0.0, 0.30, 0.25), (0.0, 0.70, 0.20)
UPPER: tuple[Vector, Vector] = (0.0, 0.40, 0.55), (-0.02, 0.68, 0.55)
TIE: tuple[Vector, Vector] = (-0.15, 0.35, 0.30), (-0.15, 0.70, 0.28)
"""Joints at the chassis and at the upright [m]; x points forward, y outward, z up."""
WHEEL: Vector = (0.0, 0.76, 0.32)
STRUT: tuple[Vector, Vector] = (0.0, 0.42, 0.75), (0.0, 0.56, 0.2175)
"""From the chassis to the lower wishbone [m]."""
CONTACT: Vector = (0.0, 0.78, 0.0)
FORWARD: Vector = (1.0, 0.0, 0.0)
INCLINED: Vector = (0.9950041652780258, 0.0, 0.09983341664682815)
"""0.1 rad from the forward axis: the upper wishbone's hinge."""
GRAVITY = (0.0, 0.0, -9.81)


def suspension() -> Model:
    """Return the model."""
    lower, upper, tie = (
        body(name, mass, rod(mass, np.subtract(*ends), 0.02), np.mean(ends, axis=0))
        for name, mass, ends in (
            ("Lower wishbone", 3.5, LOWER),
            ("Upper wishbone", 2.0, UPPER),
            ("Tie rod", 0.8, TIE),
        )
    )
    chassis = body("Chassis", 380.0, np.diag([60.0, 70.0, 80.0]), (0.0, 0.0, 0.5))
    upright = body("Upright", 38.0, np.diag([1.2, 2.0, 1.1]), WHEEL)
    rod_axis = np.subtract(TIE[1], TIE[0])
    across = np.cross(rod_axis, FORWARD)
    joints = [
        joint("prismatic", "Guide", (None, chassis), chassis.position),
        joint("revolute", "Lower hinge", (chassis, lower), LOWER[0], FORWARD),
        joint("revolute", "Upper hinge", (chassis, upper), UPPER[0], INCLINED),
        joint("universal", "Tie cross", (chassis, tie), TIE[0], FORWARD, tuple(across.tolist())),
        joint("spherical", "Lower ball", (lower, upright), LOWER[1]),
        joint("spherical", "Upper ball", (upper, upright), UPPER[1]),
        joint("spherical", "Tie ball", (tie, upright), TIE[1]),
    ]
    loads = [
        spring("Strut", (chassis, lower), STRUT, 6e4, 4e3),
        spring("Tyre", (None, upright), (CONTACT, WHEEL), 2e5, 150.0),
    ]
    bodies = [chassis, lower, upper, tie, upright]
    return model("Suspension of a car's corner", GRAVITY, bodies, joints, loads)
