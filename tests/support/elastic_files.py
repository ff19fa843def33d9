"""Files of elastic models."""

import numpy as np

from tests.reduction.bodies import beam_parts


def write_beam(path):
    """Write an Euler beam of six elements, nodes 1 to 7."""
    nodes, given = beam_parts(count=6)
    mass, stiffness = given.mass.toarray(), given.stiffness.toarray()
    np.savez(path, nodes=nodes.places, mass=mass, stiffness=stiffness)
