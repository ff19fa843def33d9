"""Loads: elements -> records."""

from msahl.deck.faults import Element, text
from msahl.deck.values import Reader
from msahl.forces.concentrated import ConcentratedLoad
from msahl.vector import ZERO


def read_concentrated(element: Element, reader: Reader) -> ConcentratedLoad:
    """Record of a ``<concentrated>`` load; force and moment stay in the axes of their basis."""
    label = element.find("body")
    body = text(label)
    force, moment = element.find("force"), element.find("moment")
    if force is None and moment is None:
        reader.faults.add(element, "it has neither <force> nor <moment>; add one")
    usable = reader.known(element, body, "body", at=label)
    if body in reader.grounds:
        reader.faults.add(
            element, f"'{body}' is a ground and never moves; name a rigid body", label
        )
    position = element.find("position")
    return ConcentratedLoad(
        name=text(element.find("name")),
        body=body,
        point=reader.vector(position, own=body, wanted=body) if usable else ZERO,
        force=reader.components(force),
        force_basis=_basis(force, reader),
        moment=reader.components(moment),
        moment_basis=_basis(moment, reader),
    )


def _basis(element: Element | None, reader: Reader) -> str:
    """The basis an element names; else a ground, for the inertial axes are every ground's.

    An absent element is a zero vector, for which any basis will do.
    """
    if element is not None and element.get("basis"):
        return reader.basis(element)
    if reader.grounds:
        return reader.grounds[0]
    if element is not None:
        message = "without basis it is in a ground's axes, but the deck has no ground; add either"
        reader.faults.add(element, message)
    return next((name for name in reader.axes if name), "")
