"""A chain of hinged rods that is fixed at one end, falls and lies down on a floor."""

import math
from dataclasses import replace

import numpy as np

from benchmarks.mechanisms.parts import GROUND, body, joint, model, rod
from msahl.model import Model
from msahl.model.contacts import PlaneContact

G = 9.81
MASS, LENGTH, RADIUS = 0.1, 0.1, 0.01
"""Of a rod [kg, m]; the radius is that of the sphere at its outer end, which touches the floor."""
HEIGHT, ANGLE = 0.1, math.radians(4.0)
"""Of the fixed end above the floor [m], and of the straight chain below the horizontal [rad]."""
FRICTION = 0.0


def chain(links: int) -> Model:
    """Return the chain at rest; it falls in the x-z plane."""
    along = np.array([math.cos(ANGLE), 0.0, -math.sin(ANGLE)])
    start = np.array([0.0, 0.0, HEIGHT])
    inertia = rod(MASS, LENGTH * along, RADIUS)
    names = [f"Link{k}" for k in range(1, links + 1)]
    bodies, joints, contacts = [], [], []
    for k, name in enumerate(names):
        bodies.append(body(name, MASS, inertia, start + (k + 0.5) * LENGTH * along))
        parent = bodies[k - 1] if k else None
        joints.append(
            joint(
                "revolute",
                f"Hinge{k + 1}",
                (parent, bodies[k]),
                start + k * LENGTH * along,
                (0.0, 1.0, 0.0),
            )
        )
        end = 0.5 * LENGTH * along
        contacts.append(
            PlaneContact(
                f"Floor{k + 1}",
                GROUND,
                name,
                (0.0, 0.0, 0.0),
                tuple(end.tolist()),
                (0.0, 0.0, 1.0),
                RADIUS,
                0.0,
                None,
                FRICTION,
                None,
            )
        )
    made = model("A chain that lies down", (0.0, 0.0, -G), bodies, joints)
    return replace(made, contacts=tuple(contacts))
