"""Every law of force, by the name of its element in the deck."""

from collections.abc import Sequence

import numpy as np

from msahl.laws.contact import CONTACT
from msahl.laws.drag import DRAG
from msahl.laws.friction import FRICTION
from msahl.laws.law import CoordinateLaw, PointLaw
from msahl.laws.spring import SPRING

POINT_LAWS: dict[str, PointLaw] = {law.name: law for law in (DRAG,)}
"""Laws of forces at points of bodies."""

COORDINATE_LAWS: dict[str, CoordinateLaw] = {law.name: law for law in (SPRING, FRICTION, CONTACT)}
"""Laws of forces along coordinates. Springs have elements of their own in the deck, where they act
along more than coordinates of joints, with a damper, a table or an unloaded length beside them; and
so have contacts."""

JOINT_LAWS = {name: law for name, law in COORDINATE_LAWS.items() if law not in (SPRING, CONTACT)}
"""Those whose element in the deck names a joint and its coordinate."""

Parameters = tuple[tuple[str, float], ...]


def constants(
    forces: Sequence[tuple[PointLaw | CoordinateLaw, Parameters]],
) -> np.ndarray:
    """Return the numbers (k, p) that the kernels of laws take, in the order of their fields; rows
    of laws with fewer of them are filled with zeros.
    """
    rows = [[dict(values)[field.name] for field in law.fields] for law, values in forces]
    found = np.zeros((len(rows), max(map(len, rows), default=0)))
    for row, values in zip(found, rows, strict=True):
        row[: len(values)] = values
    return found
