"""Reader and writer of elastic bodies: elements <-> records of the frame and its followers."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import IDENTITY
from msahl.check.bodies import body_findings
from msahl.check.context import INERTIAL
from msahl.check.elastic import elastic_findings
from msahl.check.faults import LARGEST, number_findings
from msahl.deck.elastic_files import write_part, write_squares
from msahl.deck.elements import child, numbers
from msahl.deck.faults import Element, attribute, is_true, text
from msahl.deck.states import with_states
from msahl.deck.values import Reader
from msahl.model.bodies import RigidBody
from msahl.model.elastic import ElasticBody, Square, least_followers
from msahl.records import record
from msahl.reduction.followers import Part, Parts, Start, build_elastic_body

FRAME = 5
"""Numbers of a frame: mass, inertia, place."""
MOST_SQUARED = 100_000
"""Largest number of what is squared, before it is compared with the followers."""


@record
class BuiltElasticBody:
    """An elastic body and its rigid bodies; nothing of one that has a fault."""

    body: ElasticBody | None
    bodies: tuple[RigidBody, ...]


NOTHING = BuiltElasticBody(None, ())


def read_elastic_body(element: Element, reader: Reader) -> BuiltElasticBody:
    """Return the records of an ``<elasticBody>``, and make its bodies known by axes and place."""
    name, modes = text(element.find("name")), element.find("modes")
    if modes is None:
        if not attribute(element, "file"):
            reader.faults.add(element, "its file is missing; give the one of msahl reduce: file=")
        return NOTHING
    _know_names(element, modes, name, reader)
    parts = _parts(modes, name, reader)
    if parts is None or not reader.faults.sound(element):
        return NOTHING
    parts = parts._replace(damping=_damping(element, parts, reader))
    start = _start(element, name, parts.stiffness.size, reader)
    if not reader.faults.sound(element):
        return NOTHING
    with np.errstate(all="ignore"):
        body, bodies = build_elastic_body(parts, start)
    shows_all, file = is_true(element, "allBodies"), attribute(element, "file")
    body = replace(body, shows_all=shows_all, file=file)
    bodies = _moved(element, bodies, reader)
    reader.add(element, elastic_findings(body, {one.name for one in bodies}))
    for one in bodies:
        _add(element, one, reader)
    return BuiltElasticBody(body, bodies) if reader.faults.sound(element) else NOTHING


def _know_names(element: Element, modes: Element, name: str, reader: Reader) -> None:
    """Make the bodies known by name before anything refers to them."""
    for follower in modes.iterfind("follower"):
        own = f"{name}.{attribute(follower, 'name')}"
        if own in reader.context.axes:
            reader.faults.add(element, f"'{own}' is the name of another body; rename that")
        reader.context.axes[own] = IDENTITY


def _add(element: Element, body: RigidBody, reader: Reader) -> None:
    """Make the axes and the place of a body known, if it is possible."""
    found = [*number_findings(body), *body_findings(body)]
    if found:
        reader.faults.add(element, f"body '{body.name}': {found[0].message}")
        return
    reader.context.axes[body.name] = matrix(body.orientation)
    reader.context.place(body.name, body.position)
    reader.bodies[body.name] = body


def _parts(modes: Element, name: str, reader: Reader) -> Parts | None:
    """Return the bodies by the numbers of ``<modes>``; None with a fault."""
    stiffness, damping, given, *rows = (
        _values(modes, tag) for tag in ("stiffness", "damping", "squares", "frame", "follower")
    )
    k, c, pairs = (one[0] if one else np.zeros(0) for one in (stiffness, damping, given))
    q, n = k.size, k.size + pairs.size // 2
    sizes = {"frame": (FRAME,), "follower": (FRAME + 3 * n, FRAME + 6 * n)}
    for found, (tag, allowed) in zip(rows, sizes.items(), strict=True):
        if any(row.size not in allowed for row in found):
            reader.faults.add(modes, f"a <{tag}> does not have {allowed[-1]} numbers; correct it")
            return None
    if c.size != q or q == 0 or len(rows[1]) < -(-q // 3):
        reader.faults.add(modes, "stiffness, damping and followers do not fit together; correct")
        return None
    if not max(np.abs(row).max() for found in (stiffness, damping, *rows) for row in found) <= (
        LARGEST
    ):
        reader.faults.add(modes, f"a number is too large; numbers go up to {LARGEST:g}")
        return None
    names = [f"{name}.{attribute(e, 'name')}" for e in modes.iterfind("follower")]
    nodes = [is_true(e, "interface") for e in modes.iterfind("follower")]
    parts = [_part(name, rows[0][0], n)]
    parts += map(_part, names, rows[1], [n] * len(names), nodes)
    squares = _squares(pairs)
    if squares is None or least_followers(q, squares) > len(names):
        reader.faults.add(modes, "squares and followers do not fit together; correct them")
        return None
    return Parts(tuple(parts), k, c, squares)


def _squares(pairs: np.ndarray) -> tuple[Square, ...] | None:
    """Return the squares of numbers, from 1, and factors; None if there are no such."""
    numbers = pairs[::2]
    if pairs.size % 2 or any(not 1 <= number <= MOST_SQUARED for number in numbers):
        return None
    return tuple(Square(int(n) - 1, float(c)) for n, c in zip(numbers, pairs[1::2], strict=True))


def _values(modes: Element, tag: str) -> list[np.ndarray]:
    return [np.array(text(e).split(), dtype=float) for e in modes.iterfind(tag)]


def _part(name: str, row: np.ndarray, q: int, is_node: bool = False) -> Part:
    shapes = np.zeros(6 * q)
    shapes[: row.size - FRAME] = row[FRAME:]
    shape, rotation = shapes.reshape(2, 3, q)
    return Part(name, float(row[0]), float(row[1]), row[2:FRAME], shape, rotation, is_node)


def _damping(element: Element, parts: Parts, reader: Reader) -> np.ndarray:
    """Return the damping with that of the ``<dampingRatio>`` zeta, 2 zeta sqrt(k m) of each mode,
    and that of the ``<dampingTime>`` tau, tau k."""
    given = [element.find(tag) for tag in ("dampingRatio", "dampingTime")]
    ratio, tau = (reader.number(e, q) for e, q in zip(given, ("", "time"), strict=True))
    for one, value in zip(given, (ratio, tau), strict=True):
        if one is not None and value < 0.0:
            reader.faults.add(one, "it is less than zero; give zero or more")
    k = parts.stiffness
    damping = parts.damping + tau * k
    if ratio > 0.0:
        modal = np.array([_modal_mass(parts, j) for j in range(k.size)])
        damping = damping + 2.0 * ratio * np.sqrt(k * modal)
    return damping


def _modal_mass(parts: Parts, j: int) -> float:
    """Return the modal mass of an amplitude [kg], which is what all bodies have of it."""
    squares = (
        p.mass * p.shape[:, j] @ p.shape[:, j] + p.inertia * p.rotation[:, j] @ p.rotation[:, j]
        for p in parts.bodies
    )
    return float(sum(squares))


def _start(element: Element, name: str, q: int, reader: Reader) -> Start:
    """Return the start of the frame and of the amplitudes."""
    start = element.find("initialConditions")
    start = element if start is None else start  # then none of its children is found either
    amplitude, rate = np.zeros((2, q))
    for mode in element.iterfind("mode"):
        number = float(attribute(mode, "number"))
        if not (number.is_integer() and 1 <= number <= q):
            reader.faults.add(mode, f"there is no mode {number:g}; number them from 1 to {q}")
            continue
        amplitude[int(number) - 1] = reader.number(mode.find("amplitude"), "length")
        rate[int(number) - 1] = reader.number(mode.find("rate"), "velocity")
    return Start(
        reader.vector(start.find("position"), own=name, wanted=INERTIAL),
        reader.orientation(element),
        reader.vector(start.find("velocity"), own=name, wanted=name),
        reader.vector(start.find("angularVelocity"), own=name, wanted=name),
        amplitude,
        rate,
    )


def _moved(
    element: Element, bodies: tuple[RigidBody, ...], reader: Reader
) -> tuple[RigidBody, ...]:
    """Return the bodies where ``<states>`` has them, which programs write."""
    given = element.find("states")
    if given is None:
        return bodies
    return with_states(bodies, given, "bodies", reader)


def write_elastic_body(element: Element, body: ElasticBody, bodies: Sequence[RigidBody]) -> None:
    """Write an ``<elasticBody>`` with all its numbers; ``bodies`` are the frame and followers."""
    child(element, "name", body.name)
    if body.file:
        element.set("file", body.file)
    if body.shows_all:
        element.set("allBodies", "true")
    modes = child(element, "modes")
    numbers(modes, "stiffness", body.stiffness)
    numbers(modes, "damping", body.damping)
    write_squares(modes, body.squares)
    for part in _parts_of(body, bodies):
        write_part(modes, part)
    states = [
        number
        for one in bodies
        for a in (one.position, one.orientation, one.velocity, one.angular_velocity)
        for number in a
    ]
    numbers(element, "states", states)


def _parts_of(body: ElasticBody, bodies: Sequence[RigidBody]) -> Iterator[Part]:
    frame, *others = bodies
    nothing = np.zeros((3, 0))
    yield Part("", frame.mass, frame.inertia[0][0], np.array(frame.r_BG), nothing, nothing)
    for one, follower in zip(others, body.followers, strict=True):
        name = follower.body.removeprefix(f"{body.name}.")
        place, shape, rotation = map(np.array, (follower.place, follower.shape, follower.rotation))
        inertia, is_node = one.inertia[0][0], follower.is_node
        yield Part(name, one.mass, inertia, place, shape, rotation, is_node)
