"""Reader of the states that programs write of the bodies of an element: beams, elastic bodies."""

from dataclasses import replace

import numpy as np

from msahl.algebra.rotation_arrays import plain_vector
from msahl.check.faults import LARGEST
from msahl.deck.faults import Element, text
from msahl.deck.values import Reader
from msahl.model.bodies import RigidBody

NUMBERS = 12
"""Position, rotation parameters, velocity and angular velocity."""


def with_states(
    bodies: tuple[RigidBody, ...], given: Element, called: str, reader: Reader
) -> tuple[RigidBody, ...]:
    """Return the bodies, which messages call ``called``, where the element has them, moving as that
    says; as they are with a fault.
    """
    numbers = np.array([float(word) for word in text(given).split()])
    if numbers.size != NUMBERS * len(bodies):
        message = f"it has {numbers.size} numbers, but {len(bodies)} {called} need {NUMBERS} each"
        reader.faults.add(given, f"{message}; correct the number of elements or of numbers")
        return bodies
    if not np.abs(numbers).max() <= LARGEST:
        reader.faults.add(given, f"a number is too large; numbers go up to {LARGEST:g}")
        return bodies
    return tuple(
        replace(
            body,
            position=plain_vector(x),
            orientation=plain_vector(P),
            velocity=plain_vector(v),
            angular_velocity=plain_vector(w),
        )
        for body, (x, P, v, w) in zip(bodies, numbers.reshape(-1, 4, 3), strict=True)
    )
