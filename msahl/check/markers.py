"""Rules about markers, the distances and angles between them, and groups of bodies."""

from collections.abc import Iterator

from msahl.check.context import INERTIAL, Context
from msahl.check.ends import frame_findings
from msahl.check.faults import Finding
from msahl.check.names import unresolved
from msahl.expressions.syntax import nearest
from msahl.model.markers import Group, Marker, MarkerAngle, MarkerDistance, Sensor


def marker_findings(marker: Marker, context: Context) -> Iterator[Finding]:
    """Find axes that are no frame, and an unknown basis."""
    yield from frame_findings(marker.axes, "axes")
    if marker.basis != INERTIAL and marker.basis not in context.axes:
        yield Finding("basis", unresolved("basis", marker.basis, "body", context.bodies()))


def sensor_findings(sensor: Sensor, context: Context) -> Iterator[Finding]:
    """Find markers that do not exist or are named twice."""
    names = {"from": sensor.start, "to": sensor.end}
    if isinstance(sensor, MarkerAngle):
        names["vertex"] = sensor.vertex
    unknown = [(tag, name) for tag, name in names.items() if name not in context.markers]
    for tag, name in unknown:
        message = f"'{name}' is not a marker of this model{nearest(name, context.markers)}"
        yield Finding(tag, message)
    if not unknown and len(set(names.values())) < len(names):
        kind = "distance" if isinstance(sensor, MarkerDistance) else "angle"
        yield Finding("to", f"a marker is named twice; the {kind} needs {len(names)} markers")


def group_findings(group: Group, context: Context) -> Iterator[Finding]:
    """Find bodies that do not exist, do not move, or are named twice."""
    seen: set[str] = set()
    for name in group.bodies:
        if name == INERTIAL or name not in context.axes:
            yield Finding("body", unresolved("body", name, "body", context.bodies()))
        elif name in context.grounds:
            yield Finding("body", f"'{name}' is a ground, which has no mass; name rigid bodies")
        elif name in seen:
            yield Finding("body", f"'{name}' is named twice; name each body once")
        seen.add(name)
