"""Places of a model that have nodes or bodies in any mesh of its beams."""

from msahl.model import Model

SAME = 1e-9
"""Distance of two places, relative to the length of a beam, that counts as zero."""

Place = tuple[str, float]
"""Name of a beam and share of its arc length where an element ends; or name of a body, and -1."""


def common_places(model: Model) -> dict[Place, int]:
    """Return the number of the body at each place: ends of elements, and bodies that are no nodes
    of beams."""
    number = {body.name: index for index, body in enumerate(model.bodies)}
    found: dict[Place, int] = {}
    for beam in model.beams:
        for k in range(0, len(beam.nodes), beam.degree):
            share = round(beam.stations[k] / beam.stations[-1] / SAME) * SAME
            found[beam.name, share] = number[beam.nodes[k]]
        for name in beam.nodes:
            del number[name]
    return found | {(name, -1.0): index for name, index in number.items()}
