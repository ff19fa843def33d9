"""Reader of joint coordinates at t = 0, and what follows from them for bodies without their own.

In a deck that gives a coordinate or a rate of any joint, a body without a position and an
orientation of its own is placed by the joints, and one without velocities of its own moves with
them. Bodies that no joint carries stay at the inertial origin.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import build_laws, evaluate, rate_round_off
from msahl.algebra.rotation import matrix
from msahl.algebra.rotation_arrays import plain_vector
from msahl.algebra.vector import IDENTITY, ZERO, Matrix, Vector
from msahl.check.directions import (
    PARALLEL,
    crossed_references,
    frame,
    shared_references,
    sine,
    unit,
)
from msahl.deck.ends import SIDES, explicit_references, given_frames, read_ends
from msahl.deck.faults import Element, text
from msahl.deck.joint_start import (
    ORIENTATION_RATE,
    has_references,
    read_joint_start,
    read_parameters,
)
from msahl.deck.motions import read_joint_motion
from msahl.deck.values import INERTIAL_BASIS, BodyStart, Reader, is_inertial
from msahl.joints import coordinates
from msahl.joints.joint import Kind
from msahl.joints.named_coordinates import coupled_rates
from msahl.joints.placement import (
    ColumnRates,
    Linkage,
    Place,
    Rates,
    Relation,
    orientation_of,
    place_of,
)
from msahl.joints.registry import KINDS
from msahl.joints.tree import JointStart, spanning_tree
from msahl.model.bodies import RigidBody
from msahl.model.joints import Joint

UNCLOSED = "it cannot be closed"
"""How the message begins on a loop that stays open."""
CONSISTENT = 1e-9
"""Violation rate, relative to the largest speed, that counts as round-off."""
ROUNDING = 16.0
"""Of the numbers of a prescribed motion: below as many its rate is that of round-off, which sums
over the numbers, and over the bodies of a loop."""


def place_by_joints(root: Element, reader: Reader) -> None:
    """Place the bodies that have no position of their own, and give those without velocities of
    their own the velocities by the joints, of which the deck gives coordinates or rates.
    """
    released = reader.context.released
    elements = [
        e
        for e in root.iterfind("system/joints/*")
        if e.tag in KINDS
        and not (text(e.find("name")) in released and e.find("initialConditions") is None)
    ]
    with np.errstate(all="ignore"):
        placing = _Placing(root, elements, reader)
        if placing.is_sound:
            placing.set_places()
        if placing.is_sound:
            placing.set_velocities()
        placing.hand_over()


class _Own(NamedTuple):
    """What a body gives of its own start."""

    place: bool
    velocity: bool


@dataclass
class _Placing:
    """The bodies of a deck while they are placed."""

    root: Element
    elements: list[Element]
    reader: Reader
    start_of: dict[str, Element | None] = field(default_factory=dict)
    own: dict[str, _Own] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)
    velocities: dict[str, Rates] = field(default_factory=dict)
    moving: dict[str, Rates] = field(default_factory=dict)
    round_off: float = 0.0  # of the rates of prescribed motions [m/s] or [rad/s]
    is_sound: bool = True

    def __post_init__(self) -> None:
        for nodes in self.reader.beams.values():
            self._add_beam(nodes)
        for body in self.root.iterfind("system/bodies/*"):
            if body.tag == "beamOfBodies":
                continue
            if body.tag in ("beam", "elasticBody"):
                self.is_sound &= self.reader.faults.sound(body)
                continue
            name, start = text(body.find("name")), body.find("initialConditions")
            tags = [] if start is None else [child.tag for child in start]
            self.start_of[name] = start
            ground = body.tag == "ground"
            self.own[name] = _Own(
                ground or "position" in tags or "orientation" in tags,
                ground or "velocity" in tags or "angularVelocity" in tags,
            )
            if not self.reader.faults.sound(body):
                self.is_sound = False
                continue
            P = ZERO if ground else self.reader.orientation(body)
            x = ZERO
            if start is not None and self.own[name].place:
                x = self.reader.vector(start.find("position"), own=name, wanted="")
            self.places[name] = place_of(x, P)
        self.starts = self._read_joints() if self.is_sound else []

    def _add_beam(self, nodes: tuple[RigidBody, ...]) -> None:
        """Add the nodes of a beam, which have places and velocities of their own."""
        for node in nodes:
            self.own[node.name], self.start_of[node.name] = _Own(True, True), None
            place = self.places[node.name] = place_of(node.position, node.orientation)
            v, w = (place.R @ np.array(a) for a in (node.velocity, node.angular_velocity))
            self.moving[node.name] = Rates(v[None], w[None])

    def _read_joints(self) -> list[tuple[JointStart, Element]]:
        """Return every joint with what is given of it; not sound if one has a fault."""
        found = []
        for element in self.elements:
            if self.reader.faults.sound(element):
                joint = self._geometry(element)
                if joint is not None and self.reader.faults.sound(element):
                    start = read_joint_start(element, joint, self.reader)
                    found.append((start, element))
            self.is_sound &= self.reader.faults.sound(element)
        self.is_sound &= len(found) == len(self.elements)
        return found

    def _geometry(self, element: Element) -> Joint | None:
        """Return a joint by what its two bodies hold of it, each in its own axes, wherever they
        are; None if an axis is missing."""
        kind = KINDS[str(element.tag)]
        names = [text(element.find(f"{side}/name")) for side in SIDES]
        points = [self._vector(element, side, "position") or ZERO for side in SIDES]
        axes = self._axes(element, kind)
        if axes is None:
            return None
        frames, references = axes
        return Joint(
            *(text(element.find("name")), kind.name, names[0], names[1], points[0], points[1]),
            *(frames[0], frames[1], read_parameters(element, kind, self.reader)),
            *references,
        )

    def _vector(self, element: Element, side: str, tag: str) -> Vector | None:
        """Return a vector of one end in its body's own axes, None without it."""
        own, given = text(element.find(f"{side}/name")), element.find(f"{side}/{tag}")
        if given is None:
            return None
        inertial = is_inertial(given, self.reader.context)
        basis = INERTIAL_BASIS if inertial else self.reader.basis(given) or own
        placed = self.own[own].place and (inertial or self.own[basis].place)
        if basis != own and not placed:
            message = (
                f"its basis is '{basis}', but where '{own}' and '{basis}' are follows from joints; "
                f"give the components in the axes of '{own}' and delete basis"
            )
            self.reader.faults.add(given, message)
            return None
        return self.reader.vector(given, own=own, wanted=own)

    def _axes(
        self, element: Element, kind: Kind
    ) -> tuple[tuple[Matrix, Matrix], tuple[Vector | None, Vector | None]] | None:
        """Return the frames and the references of both ends, None if an axis is missing."""
        explicit = given_frames(element, self.reader)
        if explicit is not None:
            ends = read_ends(element, self.reader)
            return explicit, explicit_references(element, explicit, ends, self.reader)
        if kind.axes == 0:
            return (IDENTITY, IDENTITY), (None, None)
        axes: Sequence[Vector | None] = [self._direction(element, side, "axis") for side in SIDES]
        if None in axes and kind.axes == 1:
            axes = self._carried(element, axes)
        references = [self._direction(element, side, "reference") for side in SIDES]
        p, c = axes
        if p is None or c is None:
            return None
        for axis, reference in zip(axes, references, strict=True):
            if axis and reference and sine(axis, reference) < PARALLEL:
                return None  # which the reader of joints reports
        here, there = references
        if has_references(kind):
            complete = crossed_references if kind.axes == 2 else shared_references
            here, there = complete(p, c, here, there)
        return (frame(p, here), frame(c, there)), (here, there)

    def _direction(self, element: Element, side: str, tag: str) -> Vector | None:
        a = self._vector(element, side, tag)
        return None if a is None or math.hypot(*a) == 0.0 else unit(a)

    def _carried(self, element: Element, axes: Sequence[Vector | None]) -> Sequence[Vector | None]:
        """Return both axes from the one that is given: its components are the same in both bodies,
        unless both have places of their own."""
        names = [text(element.find(f"{side}/name")) for side in SIDES]
        axis, parent_or_child = (axes[0], 0) if axes[0] is not None else (axes[1], 1)
        if axis is not None and all(self.own[name].place for name in names):
            rotated = self.reader.context.rotated(
                axis, names[parent_or_child], names[1 - parent_or_child]
            )
            return [axis, unit(rotated)][:: 1 if parent_or_child == 0 else -1]
        return [axis, axis]

    def set_places(self) -> None:
        """Place all bodies without a place of their own."""
        starts = []
        for start, element in self.starts:
            joint = start.joint
            if not (self.own[joint.parent].place and self.own[joint.child].place):
                starts.append((start, bool(start.values)))
            elif start.values:
                message = (
                    f"'{joint.parent}' and '{joint.child}' both have places of their own, from "
                    "which the joint's coordinates follow; delete these, or the <position> and "
                    "<orientation> of one of the two"
                )
                self._fail(element, message)
        if not self.is_sound:
            return
        roots = [name for name, own in self.own.items() if own.place]
        branches, loops, _ = spanning_tree(roots, starts)
        linkage = Linkage(self.places, branches, loops, self._length())
        violation, worst = linkage.close()
        if worst is not None and not self.reader.context.project:
            message = (
                f"{UNCLOSED}: a constraint violation of {violation:.3g} m remains with "
                "all given coordinates and places; correct these, or mark coordinates that may "
                'change by approximate="true"'
            )
            known = {end for s, given in starts if given for end in (s.joint.parent, s.joint.child)}
            for name in (worst.joint.parent, worst.joint.child):
                if not self.own[name].place and name not in known:
                    nothing = f"neither a place of '{name}' nor a coordinate of its joints is given"
                    message = f"{message}; {nothing}"
            self._fail(self._element(worst.joint.name), message)
        for branch in branches if self.is_sound else ():
            joint = branch.start.joint
            ends = (self.places[joint.parent], self.places[joint.child])
            if not all(np.isfinite(part).all() for place in ends for part in place):
                message = "where its bodies are is too far away to compute with; check its numbers"
                self._fail(self._element(joint.name), message)
        if not self.is_sound:
            return
        for name, own in self.own.items():
            if not own.place:
                self.reader.context.axes[name] = matrix(orientation_of(self.places[name]))

    def _length(self) -> float:
        """Return the size of the model [m]: its longest arm or distance from the origin."""
        arms = [
            math.hypot(*point)
            for start, _ in self.starts
            for point in (start.joint.parent_point, start.joint.child_point)
        ]
        given = [float(np.linalg.norm(place.x)) for place in self.places.values()]
        return max(*arms, *given, 0.0) or 1.0

    def _element(self, name: str) -> Element:
        return next(element for start, element in self.starts if start.joint.name == name)

    def _fail(self, element: Element, message: str) -> None:
        self.reader.faults.add(element, message)
        self.is_sound = False

    def set_velocities(self) -> None:
        """Set the velocities of all bodies by their own, the rates given, and the joints."""
        fixed = {name: self._own_rates(name) for name, own in self.own.items() if own.velocity}
        self._read_rates()
        if not self.is_sound:
            return
        rates_of = [JointStart(start.joint, rates=start.rates) for start, _ in self.starts]
        starts = [(start, bool(start.rates)) for start in rates_of]
        branches, loops, _ = spanning_tree(fixed, starts)
        linkage = Linkage(self.places, branches, loops, self._length())
        given: ColumnRates = {}
        free = []
        for column in linkage.columns():
            rates = branches[column[0]].start.rates
            if linkage.name(column) in rates:
                given[column] = np.array([rates[linkage.name(column)]])
            else:
                free.append(column)
        known = linkage.velocities(given, fixed, 1)
        relations = [*self._relations(), *_given_rates(loops)]
        if loops or relations:
            found, left, name = linkage.solve_rates(free, known, relations)
            given |= {c: np.array([rate]) for c, rate in zip(free, found.tolist(), strict=True)}
            known = linkage.velocities(given, fixed, 1)
            speed = max((float(np.abs(rates.v).max()) for rates in known.rates.values()), default=0)
            spin = max((float(np.abs(rates.w).max()) for rates in known.rates.values()), default=0)
            if not left <= CONSISTENT * (speed + spin * self._length()) + self.round_off:
                self._fail(
                    self._element(name),
                    f"the given rates and velocities contradict it: {left:.3g} m/s (or rad/s) "
                    "remain; correct them, or give fewer",
                )
        self.velocities = known.rates

    def _own_rates(self, name: str) -> Rates:
        """Return the velocities that a body gives itself, inertial axes (1, 3)."""
        start = self.start_of[name]
        if name in self.moving:
            return self.moving[name]
        if start is None:
            return Rates(*np.zeros((2, 1, 3)))
        R = self.places[name].R
        tags = ("velocity", "angularVelocity")
        v, w = (self.reader.vector(start.find(tag), own=name, wanted=name) for tag in tags)
        return Rates((R @ np.array(v))[None], (R @ np.array(w))[None])

    def _read_rates(self) -> None:
        """Add to the starts the rates of orientations, and those of prescribed motions."""
        for start, element in self.starts:
            spin = element.find(f"initialConditions/{ORIENTATION_RATE}")
            if spin is not None:
                child = start.joint.child
                w = self.reader.vector(spin, own=child, wanted=child)
                start.rates |= dict(zip(coordinates.SPATIAL[1], w, strict=True))
        by_name = {start.joint.name: start for start, _ in self.starts}
        for element in self.root.iterfind("system/motions/jointMotion"):
            released = text(element.find("name")) in self.reader.context.released
            if released or not self.reader.faults.sound(element):
                continue
            motion = read_joint_motion(element, self.reader)
            self.is_sound &= self.reader.faults.sound(element)
            if self.is_sound and motion.joint in by_name:
                laws = build_laws([motion.law])
                rate = evaluate(laws, 0, 0.0)[1]
                self.round_off += ROUNDING * rate_round_off(laws, 0, 0.0)
                self._prescribe(by_name[motion.joint], f"{motion.coordinate}Rate", rate, element)

    def _prescribe(self, start: JointStart, column: str, rate: float, motion: Element) -> None:
        """Give a joint the rate of a prescribed motion at t = 0."""
        given = start.rates.setdefault(column, rate)
        if abs(given - rate) > CONSISTENT * max(abs(given), abs(rate)) + self.round_off:
            message = (
                f"{column} is {given:g}, but motion '{text(motion.find('name'))}' prescribes "
                f"{rate:g} at t = 0 (SI); delete it"
            )
            self._fail(self._element(start.joint.name), message)

    def _relations(self) -> Iterator[Relation]:
        """Yield the relations between rates by joints (threads), gears, racks and pinions."""
        joints = {start.joint.name: start.joint for start, _ in self.starts}
        for joint in joints.values():
            for q, follower, factor in coupled_rates(joint):
                yield Relation(((joint, f"{q}Rate", 1.0), (joint, f"{follower}Rate", factor)))
        for tag, quantity, column in (("gear", "", "angle"), ("rackAndPinion", "length", "slide")):
            for element in self.root.iterfind(f"system/joints/{tag}"):
                first, second = (joints.get(text(element.find(t))) for t in ("first", "second"))
                if first and second and self.reader.faults.sound(element):
                    number = element.find("ratio" if tag == "gear" else "radius")
                    ratio = self.reader.number(number, quantity)
                    yield Relation(((second, f"{column}Rate", 1.0), (first, "angleRate", -ratio)))

    def hand_over(self) -> None:
        """Give the reader of bodies what was found; mark what depends on it if there is a fault."""
        for name, own in self.own.items():
            if not self.is_sound:
                if not own.place:
                    self.reader.unplaced.add(name)
                continue
            place, start = self.places[name], BodyStart()
            if not own.place:
                start.position = plain_vector(place.x)
                start.orientation = orientation_of(place)
            rates = self.velocities.get(name)
            if not own.velocity and rates is not None:
                start.velocity = plain_vector(place.R.T @ rates.v[0])
                start.angular_velocity = plain_vector(place.R.T @ rates.w[0])
            self.reader.starts[name] = start
        for element in self.elements:
            ends = {text(element.find(f"{side}/name")) for side in SIDES}
            if ends & self.reader.unplaced:
                self.reader.faults.doubt(element)


def _given_rates(loops: list[JointStart]) -> Iterator[Relation]:
    """Yield the rates that are given of joints which close loops."""
    for start in loops:
        for column, rate in start.rates.items():
            yield Relation(((start.joint, column, 1.0),), rate)
