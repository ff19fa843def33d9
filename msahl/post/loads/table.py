"""Loads of bodies as CSV: one row for each load, with units in the header."""

import csv
from collections.abc import Sequence
from io import StringIO

from msahl.post.loads.wrenches import Instant

LOADS = (
    "time [s]", "body", "element", "kind", "x [m]", "y [m]", "z [m]", "Fx [N]", "Fy [N]", "Fz [N]",
    "Mx [N-m]", "My [N-m]", "Mz [N-m]",
)  # fmt: skip
"""The point from the B of the body, the force there and the moment about it, body axes."""
MOTIONS = (
    "time [s]", "body", "ax [m/s^2]", "ay [m/s^2]", "az [m/s^2]", "wx [rad/s]", "wy [rad/s]",
    "wz [rad/s]", "alphax [rad/s^2]", "alphay [rad/s^2]", "alphaz [rad/s^2]", "gx [m/s^2]",
    "gy [m/s^2]", "gz [m/s^2]",
)  # fmt: skip
"""Acceleration of the mass centre, angular velocity and acceleration, and gravity, body axes."""


def loads_table(instants: Sequence[Instant]) -> str:
    """Return the table of all loads."""
    rows = (
        (instant.time, load.body, load.element, load.kind, *load.point, *load.force, *load.moment)
        for instant in instants
        for load in instant.loads
    )
    return _table(LOADS, rows)


def motions_table(instants: Sequence[Instant]) -> str:
    """Return the table of the motions that inertia loads follow from."""
    rows = (
        (instant.time, body, *(value for vector in motion for value in vector))
        for instant in instants
        for body, motion in instant.motions.items()
    )
    return _table(MOTIONS, rows)


def _table(header: Sequence[str], rows: object) -> str:
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    for row in rows:  # type: ignore[attr-defined]
        writer.writerow(v if isinstance(v, str) else repr(float(v)) for v in row)
    return text.getvalue()
