"""Contacts of MJCF: which geoms MuJoCo lets collide, and those of them that become contacts here.

Two geoms collide if contype of one and conaffinity of the other have a bit in common, unless their
bodies are one, parent and child, both fixed to the world, or excluded; or if a ``<pair>`` names
them. Here spheres, capsules and boxes collide with planes, which are all on the ground.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.mjcf_settings import Settings, resolved, several
from msahl.importers.reading import Log, number
from msahl.importers.robot import Link, Pose, Touch

SHAPES = ("sphere", "capsule", "box")
FRICTION, DIMENSIONS = 1.0, 3
"""MuJoCo's defaults of the coefficient of sliding friction, and of condim."""
OTHERS = "its contact with shapes other than planes"
UNKNOWN = "its contact with planes: spheres, capsules and boxes have one here"
MARGIN = "the margin of its contact with a plane: it is closed where the shapes touch"
ROLLING = "the torsional and rolling friction of its contact with a plane"


class Bits(NamedTuple):
    """The masks of a geom."""

    contype: int
    conaffinity: int

    def meets(self, other: "Bits") -> bool:
        """Return whether two geoms with these masks collide."""
        return bool(self.contype & other.conaffinity or other.contype & self.conaffinity)


@dataclass
class Geom:
    """A geom of a link with its frame there and its half sizes, () if it is a mesh or a plane."""

    element: Element
    link: str
    kind: str
    place: Pose
    size: tuple[float, ...]
    bits: Bits

    @property
    def name(self) -> str:
        """The name of the geom; that of its link if it has none."""
        return attribute(self.element, "name") or self.link


def read_bits(element: Element, log: Log) -> Bits:
    """Return the masks of a geom with resolved attributes."""
    values = []
    for name in Bits._fields:
        value = number(element, name, log, 1.0)
        if value != int(value) or value < 0.0:
            log.fault(element, f"its {name} is {value:g}; it is a whole number of 32 bits")
            value = 0.0
        values.append(int(value))
    return Bits(*values)


def read_contacts(
    root: Element, geoms: list[Geom], links: Mapping[str, Link], settings: Settings, log: Log
) -> list[Touch]:
    """Return the contacts of shapes with planes; what else collides is noted."""
    flags = list(root.iterfind("option/flag"))
    if any(flag.get(name) == "disable" for flag in flags for name in ("contact", "constraint")):
        return []
    roots = _roots(links)
    excluded = _excluded(root, links, log)
    pairs = _pairs(root, geoms, settings, log)
    for plane, geom in product([geom for geom in geoms if geom.kind == "plane"], geoms):
        apart = frozenset((plane.link, geom.link)) in excluded
        known = (id(plane), id(geom)) in pairs or geom.kind == "plane" or apart
        if not known and roots[geom.link] != roots[plane.link] and plane.bits.meets(geom.bits):
            pairs[id(plane), id(geom)] = Pair(plane, geom, *_mixed(plane, geom, log))
    _note_others(geoms, links, roots, excluded, log)
    return [touch for pair in pairs.values() for touch in _touch(pair, log)]


class Pair(NamedTuple):
    """A plane and a geom that collide, the coefficient of sliding friction and condim."""

    plane: Geom
    geom: Geom
    friction: float
    dimensions: float


def _touch(pair: Pair, log: Log) -> Iterator[Touch]:
    """Yield the contact of a pair; a shape that has none here is noted."""
    plane, geom, friction, dimensions = pair
    if geom.kind not in SHAPES:
        log.lost(geom.element, UNKNOWN)
        return
    if dimensions > DIMENSIONS:
        log.lost(geom.element, ROLLING)
    if any(number(one.element, "margin", log) for one in (plane, geom)):
        log.lost(geom.element, MARGIN)
    mu = friction if dimensions > 1.0 else 0.0
    points, radius = _spheres(geom)
    name = f"{geom.name} on {plane.name}"
    yield Touch(name, geom.link, points, radius, plane.link, plane.place, mu, geom.element)


def _spheres(geom: Geom) -> tuple[list[np.ndarray], float]:
    """Return the centres and the radius [m] of the spheres that a plane meets first: those at the
    ends of a capsule, points at the corners of a box."""
    if geom.kind == "box":
        corners = product(*((-half, half) for half in geom.size))
        return [_at(geom, corner) for corner in corners], 0.0
    radius, *lengths = geom.size
    ends = [(0.0, 0.0, sign * h) for h in lengths for sign in (-1.0, 1.0)]
    return [_at(geom, end) for end in ends or [(0.0, 0.0, 0.0)]], radius


def _at(geom: Geom, point: tuple[float, ...]) -> np.ndarray:
    """Return a point of a geom in the axes of its link."""
    return np.asarray(geom.place.p + geom.place.R @ np.array(point))


def _mixed(plane: Geom, geom: Geom, log: Log) -> tuple[float, float]:
    """Return friction and condim of two geoms: those of the one with the higher priority, or else
    the larger ones."""
    elements = plane.element, geom.element
    priority = [number(element, "priority", log) for element in elements]
    chosen = [e for e, rank in zip(elements, priority, strict=True) if rank == max(priority)]
    return (
        max(_sliding(element, log) for element in chosen),
        max(number(element, "condim", log, DIMENSIONS) for element in chosen),
    )


def _sliding(element: Element, log: Log, given: float = FRICTION) -> float:
    """Return the coefficient of sliding friction, the first one that an element gives."""
    friction = (several(element, "friction", log, 5) or [given])[0]
    if friction < 0.0:
        log.fault(element, f"its friction is {friction:g}; it must not be negative")
    return friction


def _pairs(
    root: Element, geoms: list[Geom], settings: Settings, log: Log
) -> dict[tuple[int, int], Pair]:
    """Return every ``<pair>`` of a plane and another geom, by the identities of both."""
    named = {attribute(geom.element, "name"): geom for geom in geoms}
    found: dict[tuple[int, int], Pair] = {}
    for element in root.iterfind("contact/pair"):
        resolved(element, settings, log)
        names = [attribute(element, f"geom{k}") for k in (1, 2)]
        unknown = [name for name in names if not name or name not in named]
        if unknown:
            log.fault(element, f"'{unknown[0]}' is no geom")
            continue
        plane, geom = sorted((named[name] for name in names), key=lambda g: g.kind != "plane")
        if plane.kind != "plane" or geom.kind == "plane":
            log.lost(element, OTHERS)
            continue
        friction, dimensions = _mixed(plane, geom, log)
        mu = _sliding(element, log, friction)
        pair = Pair(plane, geom, mu, number(element, "condim", log, dimensions))
        found[id(plane), id(geom)] = pair
    return found


def _excluded(root: Element, links: Mapping[str, Link], log: Log) -> set[frozenset[str]]:
    """Return the pairs of links that an ``<exclude>`` keeps from colliding."""
    found = set()
    for element in root.iterfind("contact/exclude"):
        names = [attribute(element, f"body{k}") for k in (1, 2)]
        for name in names:
            if name not in links:
                log.fault(element, f"'{name}' is no body")
        found.add(frozenset(names))
    return found


def _roots(links: Mapping[str, Link]) -> dict[str, str]:
    """Return the link that each is fixed to: itself if it has joints; parents come first."""
    found: dict[str, str] = {}
    for name, link in links.items():
        found[name] = name if link.axes or not link.parent else found[link.parent]
    return found


def _note_others(
    geoms: list[Geom],
    links: Mapping[str, Link],
    roots: dict[str, str],
    excluded: set[frozenset[str]],
    log: Log,
) -> None:
    """Note every geom that collides with another one that is no plane."""
    near = _near(links, roots, excluded)
    present: dict[Bits, set[str]] = defaultdict(set)
    for geom in geoms:
        if geom.kind != "plane":
            present[geom.bits].add(roots[geom.link])
    for geom in geoms:
        meets = (there for bits, there in present.items() if geom.bits.meets(bits))
        if geom.kind != "plane" and any(there - near[roots[geom.link]] for there in meets):
            log.lost(geom.element, OTHERS)


def _near(
    links: Mapping[str, Link], roots: dict[str, str], excluded: set[frozenset[str]]
) -> dict[str, set[str]]:
    """Return the bodies that each one does not collide with, by their first links: itself, its
    parent and its children unless that is the ground, and those excluded."""
    near = {name: {name} for name in roots.values()}
    ground = next(iter(roots.values()), "")
    pairs = [(name, roots[link.parent]) for name, link in links.items() if link.parent]
    pairs = [(a, b) for a, b in pairs if roots[a] == a and b != ground]
    pairs += [(roots[min(both)], roots[max(both)]) for both in excluded if both <= roots.keys()]
    for a, b in pairs:
        near[a].add(b)
        near[b].add(a)
    return near
