"""Numbers of loads that events may set: those that change a law and not what it acts on."""

import math
from dataclasses import replace
from typing import Any

from msahl.laws.registry import JOINT_LAWS, POINT_LAWS
from msahl.laws.spring import SPRING
from msahl.model.loads import JointLoad, JointSpring, Load, PointLoad, SpringDamper

FIELDS = {"freeLength": "free_length", "freeAngle": "free", "freeSlide": "free"}
"""Fields of records whose elements in the deck have another name."""


def settable(load: Load) -> dict[str, str]:
    """Return the names of the numbers of a ``load`` that an event may set, as in the deck, and
    their physical quantities ("" of pure numbers).
    """
    if isinstance(load, SpringDamper | JointSpring):
        coordinate = load.coordinate if isinstance(load, JointSpring) else "slide"
        angle = coordinate == "angle"
        damping = {"damping": "angularDamping" if angle else "damping"}
        if load.table is not None:
            return damping
        free = f"free{coordinate.capitalize()}" if isinstance(load, JointSpring) else "freeLength"
        own = {field.name: field.quantity_along(coordinate) or "" for field in SPRING.fields}
        return own | damping | {free: "angle" if angle else "length"}
    if isinstance(load, PointLoad):
        return {field.name: field.quantity_along("") or "" for field in POINT_LAWS[load.law].fields}
    if isinstance(load, JointLoad):
        fields = JOINT_LAWS[load.law].fields
        quantities = {field.name: field.quantity_along(load.coordinate) for field in fields}
        return {name: quantity for name, quantity in quantities.items() if quantity is not None}
    return {}


def parameter_of(load: Load, parameter: str) -> float:
    """Return the value [SI] of a parameter of a ``load`` that is ``settable``, nan if a deck leaves
    it to the configuration at t = 0.
    """
    if isinstance(load, PointLoad | JointLoad):
        return dict(load.parameters)[parameter]
    value = getattr(load, FIELDS.get(parameter, parameter))
    return math.nan if value is None else float(value)


def with_parameter(load: Load, parameter: str, value: float) -> Load:
    """Return the ``load`` with another ``value`` [SI] of a parameter that is ``settable``."""
    if isinstance(load, PointLoad | JointLoad):
        values = tuple((name, value if name == parameter else v) for name, v in load.parameters)
        return replace(load, parameters=values)
    changes: dict[str, Any] = {FIELDS.get(parameter, parameter): value}
    return replace(load, **changes)
