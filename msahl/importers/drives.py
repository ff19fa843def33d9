"""Actuators and tendons of a robot: forces along lengths of joints, and thrusts at links.

A force f along a length l = sum c q loads each coordinate q by c f, so its power is f l_dot.
"""

import numpy as np

from msahl.algebra.rotation_arrays import plain_vector
from msahl.expressions.syntax import Name, Number, parse, quoted
from msahl.expressions.text import text_of
from msahl.importers.bodies import Parts
from msahl.importers.loads import add_actuator
from msahl.importers.made import Made
from msahl.importers.reading import Log
from msahl.importers.robot import Control, Drive, Thrust
from msahl.importers.spatial_loads import add_moment, rates_of, rotation_of
from msahl.model import ConcentratedLoad, Signal, SignalState


def add_drive(drive: Drive, made: Made, log: Log) -> None:
    """Add a force along a length: a load at each of its joints."""
    if not all(name in made.along or name in made.balls for name, _ in drive.terms):
        log.lost(drive.element, "its joint has no coordinate of its own in the deck")
        return
    expression = drive.expression
    values = _control(drive.name, drive.control, made)
    for key, is_rate in (("l", False), ("v", True)):
        if f"{{{key}}}" in expression:
            values[key] = _sum(drive, made, is_rate)
    force = expression.format(**values)
    if len(drive.terms) > 1:
        name = made.names.unique(f"{drive.name} force")
        made.signals.append(Signal(name, parse(force)))
        force = text_of(Name(name))
    for joint, coefficients in drive.terms:
        name = drive.name if drive.name != joint else f"{drive.name} actuator"
        if len(drive.terms) > 1:
            name = f"{drive.name} at {joint}"
        if joint in made.balls:
            add_moment(made.balls[joint], name, np.array(coefficients), force, made)
        else:
            (c,) = coefficients
            add_actuator(name, made.along[joint], force if c == 1.0 else f"{c!r}*({force})", made)


def _control(name: str, control: Control | None, made: Made) -> dict[str, str]:
    """Add the signal of a control and its state, if it has one, and return the texts of both."""
    if control is None:
        return {}
    label = made.names.unique(f"{name} control")
    made.signals.append(Signal(label, Number(control.value)))
    values = {"u": text_of(Name(label))}
    if control.rate:
        label = made.names.unique(f"{name} activation")
        values["a"] = text_of(Name(label))
        rate = parse(control.rate.format(**values))
        made.signals.append(SignalState(label, rate, control.activation))
    return values


def _sum(drive: Drive, made: Made, is_rate: bool) -> str:
    """Return the text of the length of a drive or of its rate: a signal if it has several terms."""
    pairs: list[tuple[float, str]] = []
    for joint, coefficients in drive.terms:
        if joint in made.balls:
            of = rates_of if is_rate else rotation_of
            names = of(made.balls[joint], made)
        else:
            place = made.along[joint]
            names = [quoted(f"{place.joint}.{place.coordinate}{'Rate' if is_rate else ''}")]
        pairs += zip(coefficients, names, strict=True)
    texts = [name if c == 1.0 else f"{c!r}*{name}" for c, name in pairs if c]
    if len(texts) < 2:
        return texts[0] if texts else "0"
    name = made.names.unique(f"{drive.name} {'rate' if is_rate else 'length'}")
    made.signals.append(Signal(name, parse(" + ".join(texts))))
    return text_of(Name(name))


def add_thrust(thrust: Thrust, parts: Parts, made: Made, log: Log) -> None:
    """Add a force and a moment that a control gives, fixed in a link."""
    body, pose = parts.places[thrust.link]
    if body == made.ground:
        log.lost(thrust.element, "it acts on the ground")
        return
    place = pose.after(thrust.place)
    force, moment = (plain_vector(place.R @ a) for a in (thrust.force, thrust.moment))
    tree = parse(thrust.expression.format(**_control(thrust.name, thrust.control, made)))
    load = (made.names.unique(thrust.name), body, plain_vector(place.p), force, body, moment, body)
    made.loads.append(ConcentratedLoad(*load, expression=tree))
