"""Topology of a system: which elements connect what, apart from all numbers.

It has the node map, the places of the multipliers, the pattern of the Jacobian's 3 x 3 blocks and
the index arrays of every group of elements. It is built once for a model; all models with equal
``connections`` share it (``build.rebuild_parameters``).
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from msahl.elements.beams.shape import elements_of
from msahl.elements.constraints.coordinate_kinds import ANGLE
from msahl.elements.constraints.products import DOT, PARTS
from msahl.elements.reactions import Shown
from msahl.formulations.absolute.frames import NODES
from msahl.formulations.absolute.rigid_body import STATE_SIZE
from msahl.joints.joint import CHILD, GROUND, PARENT, Coordinate, Product
from msahl.joints.registry import KINDS
from msahl.laws.registry import COORDINATE_LAWS, POINT_LAWS
from msahl.linalg.pattern import Blocks
from msahl.model.beams import Beam
from msahl.system.arrays import Multipliers
from msahl.system.collect import BeamEntry, ConcentratedEntry, Elements, Pair
from msahl.system.signal_inputs import ResultEntry, input_parts

Indices = dict[str, np.ndarray]
"""The index arrays of a group of elements, by the names of its fields."""


class Topology(NamedTuple):
    """All that does not depend on numbers; groups as in ``System``."""

    connections: tuple[Any, ...]  # what connects what: equal tuples, equal topologies
    relaxed: bool  # whether the multipliers' diagonal is relaxed, as joints are redundant
    frames: Indices
    bodies: Indices
    coincide: Indices
    products: Indices
    coordinates: Indices
    equations: Indices
    sums: Indices | None
    equation_column: np.ndarray  # (r,)
    concentrated: Indices
    controlled: Indices | None
    point: Indices | None
    along: Indices
    compliance: Indices | None
    signals: Indices | None
    actuator: Indices | None
    beams: Indices | None
    reactions: Indices
    shown: Shown
    multipliers: Multipliers
    blocks: np.ndarray  # (m, 2) row and column node of each block
    pattern: np.ndarray  # (9 m,) which entries of the blocks are not always zero, contacts open
    unit_blocks: np.ndarray  # (n,) starts of the blocks that are always the unit matrix
    coincide_blocks: np.ndarray  # (k, 2, 2) by side: force by multiplier, violation by displacement
    relaxed_blocks: np.ndarray  # (k,) by multiplier, of a relaxed system; else empty


class _Nodes(NamedTuple):
    """Where the multipliers stand."""

    element: list[int]
    rotational: list[bool]
    frames: list[set[int]]
    place: list[tuple[int, int]]  # node and slot of each scalar equation
    of_spring: list[tuple[int, int]]  # likewise of each spring in the compliance form
    points: list[int]  # first of the two nodes of each Gauss point of beams
    of_beam: list[bool]


def build_topology(elements: Elements, relaxed: bool) -> Topology:
    """Return the topology of ``elements``; ``relaxed`` if their constraints are redundant."""
    count = len(elements.model.bodies) + 1
    frames = _frames(count)
    blocks, first = Blocks(frames["displacement"], frames["rotation"]), NODES * count
    nodes = _place_multipliers(elements)
    bodies, unit_blocks = _bodies(frames, blocks)
    coincide, coincide_blocks = _coincide(elements, frames, blocks, first)
    concentrated = _concentrated(elements, elements.concentrated, frames, blocks)
    point = _at_points(elements, frames, blocks)
    parts = _parts(elements, frames)
    coordinates = _coordinates(elements, parts, blocks)
    equations = _equations(elements, nodes, parts, blocks, first)
    sums = _sums(elements, nodes, parts, blocks, first)
    signals, actuator = _signals(elements, parts, frames, blocks)
    beams = _beams(elements, nodes, frames, blocks, first)
    controlled = signals and _concentrated(elements, elements.controlled, frames, blocks)
    multiplier = first + np.arange(len(nodes.element), dtype=np.int64)
    relaxed_blocks = blocks.constant(multiplier, multiplier) if relaxed else indices([])
    return Topology(
        connections=connections(elements),
        relaxed=relaxed,
        frames=frames,
        bodies=bodies,
        coincide=coincide,
        products=_products(elements),
        coordinates=coordinates,
        equations=equations,
        sums=sums,
        equation_column=indices([entry.column for entry in elements.equations]),
        concentrated=concentrated,
        controlled=controlled,
        point=point,
        along=_along(elements),
        compliance=_compliances(elements, nodes, parts, blocks, first),
        signals=signals,
        actuator=actuator,
        beams=beams,
        reactions=_reactions(elements),
        shown=_shown(elements),
        multipliers=_multipliers(nodes, multiplier, elements.ground),
        blocks=blocks.nodes(),
        pattern=blocks.pattern(),
        unit_blocks=unit_blocks,
        coincide_blocks=coincide_blocks,
        relaxed_blocks=relaxed_blocks,
    )


def connections(elements: Elements) -> tuple[Any, ...]:
    """Return what connects what in ``elements``, without numbers."""
    pairs = [(c.kind, _kinds(c), c.angular, p.a, p.b) for c, p in elements.coordinates]
    equations = [
        (e.element, e.first, e.second, e.function, e.law, e.column, not e.equation.rate)
        for e in elements.equations
    ]
    sums = tuple((r, q) for r, e in enumerate(elements.equations) for q, _ in e.more)
    loads = [
        (e.load.body, e.load.force_basis, e.load.moment_basis, e.law, e.column)
        for e in elements.concentrated
    ]
    return (
        tuple(elements.frame.items()),
        tuple(bool(arms) for arms in elements.arms),
        tuple((element, pair.a, pair.b) for element, pair in elements.points),
        tuple(pairs),
        (tuple(equations), sums),
        (tuple(elements.first_equation), tuple(elements.load_equation)),
        tuple(
            (e.law.name, e.coordinate, e.table, e.joint, e.column, e.element)
            for e in elements.along
        ),
        tuple(loads),
        tuple((column, load.law, load.body) for column, load in elements.at_points),
        tuple((joint.kind, joint.child) for joint in elements.model.joints),
        tuple(
            (e.beam.degree, e.frames, e.column, _rigid(e.beam).tobytes()) for e in elements.beams
        ),
        _signal_connections(elements),
    )


def _signal_connections(elements: Elements) -> tuple[Any, ...] | None:
    entries = elements.signals
    if entries is None:
        return None
    return (
        tuple(entry[:4] for entry in entries.inputs),
        tuple(marker.body for marker in entries.markers),
        tuple((r.coordinate, r.body, r.column, r.inputs) for r in entries.results),
        tuple((e.load.force_basis, e.load.moment_basis) for e in elements.controlled),
        (len(entries.states), len(entries.shown), len(entries.stops)),
    )


def _kinds(coordinate: Coordinate) -> tuple[Any, ...]:
    return tuple((p.kind, p.owner, p.up is None) for p in coordinate.products)


def _frames(count: int) -> Indices:
    """One frame for each rigid body, and the ground: two nodes each, one after the other."""
    index = np.arange(count, dtype=np.int64)
    return {
        "displacement": NODES * index,
        "rotation": NODES * index + 1,
        "of_node": np.repeat(index, NODES),
        "rotates": np.tile([False, True], count),
        "owner": np.where(index < count - 1, index, -1),
    }


def _bodies(frames: Indices, blocks: Blocks) -> tuple[Indices, np.ndarray]:
    count = frames["displacement"].size - 1
    rotation, displacement = frames["rotation"][:count], frames["displacement"][:count]
    block, unit = blocks.place(rotation, rotation), blocks.constant(displacement, displacement)
    index = np.arange(count, dtype=np.int64)
    return {"frame": index, "block": block, "column": STATE_SIZE * index}, unit


def _place_multipliers(elements: Elements) -> _Nodes:
    """Give every constraint equation a node and a slot.

    The points that coincide come first; then the scalar equations of an element, three to a node,
    those that see displacements apart from those that see rotations only; then those of beams, and
    last those of springs in the compliance form, likewise three to a node.
    """
    nodes = _Nodes([], [], [], [], [], [], [])

    def add(element: int, rotational: bool, frames: set[int], of_beam: bool = False) -> int:
        nodes.element.append(element)
        nodes.rotational.append(rotational)
        nodes.frames.append(frames)
        nodes.of_beam.append(of_beam)
        return len(nodes.element) - 1

    for element, pair in elements.points:
        add(element, False, {pair.a, pair.b})
    open_nodes: dict[tuple[int, bool], tuple[int, int]] = {}

    def place(element: int, along: list[int]) -> tuple[int, int]:
        sides = [elements.coordinates[q] for q in along if q >= 0]
        key = (element, all(coordinate.angular for coordinate, _ in sides))
        if key not in open_nodes:
            open_nodes[key] = (add(*key, set()), 0)
        node, slot = open_nodes.pop(key)
        nodes.frames[node].update(frame for _, pair in sides for frame in (pair.a, pair.b))
        if slot < 2:
            open_nodes[key] = (node, slot + 1)
        return node, slot

    for entry in elements.equations:
        along = [entry.first, entry.second, *(q for q, _ in entry.more)]
        nodes.place.append(place(entry.element, along))
    for of_beam, k, own in _beam_elements(elements):
        for _ in range(of_beam.beam.degree):
            nodes.points.append(add(of_beam.element + k, False, set(own), True))
            add(of_beam.element + k, True, set(own), True)
    for spring in elements.along:
        if spring.element >= 0:
            nodes.of_spring.append(place(spring.element, [spring.coordinate]))
    return nodes


def _beam_elements(elements: Elements) -> Iterator[tuple[BeamEntry, int, list[int]]]:
    """Yield the elements of all beams: the beam, the number in it, the frames of its nodes."""
    for entry in elements.beams:
        for k, nodes in enumerate(elements_of(entry.beam.degree, len(entry.frames))):
            yield entry, k, [entry.frames[m] for m in nodes]


def _rigid(beam: Beam) -> np.ndarray:
    """(g, 6) strains that cannot change, by Gauss point."""
    return ~np.any(np.array(beam.compliance), axis=2)


def _beams(
    elements: Elements, nodes: _Nodes, frames: Indices, blocks: Blocks, first: int
) -> Indices | None:
    """Return the indices of beams; arrays by nodes of elements have as many as the largest one."""
    if not elements.beams:
        return None
    own = [beam for _, _, beam in _beam_elements(elements)]
    used = sorted({frame for beam in own for frame in beam})
    number = {frame: m for m, frame in enumerate(used)}
    most = max(len(beam) for beam in own)
    frame = indices([[*beam, *[elements.ground] * (most - len(beam))] for beam in own])
    u, theta = frames["displacement"][frame], frames["rotation"][frame]
    places = [
        blocks.place(rows[:, :, None], columns[:, None, :])
        for rows, columns in ((u, theta), (theta, u), (theta, theta))
    ]
    counts = [e.beam.degree for e, _, _ in _beam_elements(elements)]
    of_point = np.repeat(np.arange(len(own), dtype=np.int64), counts)
    place = indices(nodes.points)
    stretch, bend = first + place[:, None], first + place[:, None] + 1
    u, theta = u[of_point], theta[of_point]
    pairs = ((u, stretch), (theta, stretch), (theta, bend))
    load = [blocks.place(*pair) for pair in (*pairs, *(pair[::-1] for pair in pairs))]
    both = np.stack([stretch[:, 0], bend[:, 0]], axis=1)
    return {
        "frame": indices(used),
        "first": np.concatenate([[0], np.cumsum([len(beam) for beam in own])]).astype(np.int64),
        "node": indices([number[frame] for beam in own for frame in beam]),
        "element": of_point,
        "rigid": np.concatenate([_rigid(entry.beam) for entry in elements.beams]),
        "place": place,
        "load_block": np.ascontiguousarray(np.stack(load, axis=2)),
        "pair_block": np.ascontiguousarray(np.stack(places, axis=3)),
        "compliance_block": blocks.place(both[:, :, None], both[:, None, :]),
        "beam": np.repeat(
            np.arange(len(elements.beams)), [len(e.beam.strain) for e in elements.beams]
        ),
        "column": indices([entry.column for entry in elements.beams]),
    }


def _coincide(
    elements: Elements, frames: Indices, blocks: Blocks, first: int
) -> tuple[Indices, np.ndarray]:
    pairs = _frames_of([pair for _, pair in elements.points])
    node = first + np.arange(len(pairs), dtype=np.int64)[:, None]
    u, theta = frames["displacement"][pairs], frames["rotation"][pairs]
    rows = np.stack(np.broadcast_arrays(u, node, theta, theta, node), axis=-1)
    columns = np.stack(np.broadcast_arrays(node, u, theta, node, theta), axis=-1)
    starts = blocks.mixed(rows, columns, np.array([False, False, True, True, True]))
    constant, *by = (np.ascontiguousarray(starts[:, :, i]) for i in (slice(0, 2), 2, 3, 4))
    names = ("moment_by_rotation", "moment_by_force", "constraint_by_rotation")
    a, b = np.ascontiguousarray(pairs.T)
    sides = {"a": a, "b": b, "row": node.reshape(-1)}
    return sides | dict(zip(names, by, strict=True)), constant


def _frames_of(pairs: list[Pair]) -> np.ndarray:
    """(k, 2) frames of pairs."""
    return np.array([(pair.a, pair.b) for pair in pairs], dtype=np.int64).reshape(-1, 2)


def _products(elements: Elements) -> Indices:
    owners = {GROUND: elements.ground}
    entries = [
        (p.kind, pair.a, pair.b, (owners | {PARENT: pair.a, CHILD: pair.b})[p.owner])
        for p, pair in all_products(elements)
    ]
    columns = indices(entries).reshape(-1, 4).T
    return dict(zip(("kind", "a", "b", "owner"), np.ascontiguousarray(columns), strict=True))


def all_products(elements: Elements) -> list[tuple[Product, Pair]]:
    """Return the products of all coordinates, those of one coordinate together."""
    return [(p, pair) for c, pair in elements.coordinates for p in c.products]


def _parts(elements: Elements, frames: Indices) -> np.ndarray:
    """(q, 4) nodes of the four parts; -1 of displacements that a coordinate does not depend on."""
    depends = [any(p.kind != DOT for p in c.products) for c, _ in elements.coordinates]
    pairs = _frames_of([pair for _, pair in elements.coordinates])
    u = np.where(np.array(depends, dtype=bool)[:, None], frames["displacement"][pairs], -1)
    theta = frames["rotation"][pairs]
    return np.stack([u[:, 0], theta[:, 0], u[:, 1], theta[:, 1]], axis=1)


def _coordinates(elements: Elements, parts: np.ndarray, blocks: Blocks) -> Indices:
    sizes = [len(coordinate.products) for coordinate, _ in elements.coordinates]
    kept = ~_of_open_contacts(elements)[:, None, None]
    block = blocks.place_some(parts[:, :, None], parts[:, None, :], kept)
    return {
        "kind": indices([coordinate.kind for coordinate, _ in elements.coordinates]),
        "first": np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        "coordinate": np.repeat(np.arange(len(sizes)), sizes),
        "block": block.reshape(-1, PARTS * PARTS),
        "of_contacts": _of_contacts(elements),
    }


def _of_contacts(elements: Elements) -> np.ndarray:
    """(q,) coordinates along which nothing but contacts acts, and whose angles are not counted."""
    angles = [coordinate.kind == ANGLE for coordinate, _ in elements.coordinates]
    found: np.ndarray = _of_open_contacts(elements) & ~np.array(angles, dtype=bool)
    return found


def _of_open_contacts(elements: Elements) -> np.ndarray:
    """(q,) coordinates along which nothing but contacts acts, which are open in a new system."""
    found = np.zeros(len(elements.coordinates), dtype=bool)
    found[[e.first for e in elements.equations if e.is_open]] = True
    others = [q for e in elements.equations if not e.is_open for q in (e.first, e.second)]
    others += [entry.coordinate for entry in elements.along]
    others += [q for entry in elements.rubbing for q in entry.along]
    if elements.signals is not None:
        others += [result.coordinate for result in elements.signals.results]
    found[[q for q in others if q >= 0]] = False
    return found


def _equations(
    elements: Elements, nodes: _Nodes, parts: np.ndarray, blocks: Blocks, first: int
) -> Indices:
    entries = elements.equations
    place = indices(nodes.place).reshape(-1, 2)
    coordinate = indices([(e.first, e.second) for e in entries]).reshape(-1, 2)
    # The last row of the parts serves the coordinate -1.
    part = np.vstack([parts, np.full((1, PARTS), -1)])[coordinate]
    node = np.broadcast_to(first + place[:, :1, None], part.shape)
    rows, columns = np.stack([part, node], axis=2), np.stack([node, part], axis=2)
    kept = np.array([not e.is_open for e in entries], dtype=bool)
    starts = blocks.place_some(rows, columns, kept[:, None, None, None])
    return {
        "place": place,
        "coordinate": coordinate,
        "function": indices([e.function for e in entries]),
        "law": indices([e.law for e in entries]),
        "holonomic": np.array([not e.equation.rate for e in entries], dtype=bool),
        "force_block": np.ascontiguousarray(starts[:, :, 0]),
        "constraint_block": np.ascontiguousarray(starts[:, :, 1]),
    }


def _sums(
    elements: Elements, nodes: _Nodes, parts: np.ndarray, blocks: Blocks, first: int
) -> Indices | None:
    """Return the indices of further terms of equations."""
    terms = [(r, q) for r, e in enumerate(elements.equations) for q, _ in e.more]
    if not terms:
        return None
    row, coordinate = indices(terms).T
    part, node = parts[coordinate], first + indices(nodes.place)[row, :1]
    return {
        "row": np.ascontiguousarray(row),
        "coordinate": np.ascontiguousarray(coordinate),
        "force_block": blocks.place(part, node),
        "constraint_block": blocks.place(node, part),
    }


def _concentrated(
    elements: Elements, entries: list[ConcentratedEntry], frames: Indices, blocks: Blocks
) -> Indices:
    u, theta = frames["displacement"], frames["rotation"]
    frame, loads = elements.frame, [load for load, _, _ in entries]
    axes = [(frame[a.body], frame[a.force_basis], frame[a.moment_basis]) for a in loads]
    body, f_axes, m_axes = np.ascontiguousarray(indices(axes).reshape(-1, 3).T)
    across = np.stack([body, f_axes, m_axes], axis=1)
    moment_by_rotation = blocks.place(theta[body][:, None], theta[across])
    force_by_rotation = blocks.place(u[body], theta[f_axes])
    return {
        "frame": body,
        "f_axes": f_axes,
        "m_axes": m_axes,
        "law": indices([entry.law for entry in entries]),
        "force_by_rotation": force_by_rotation,
        "moment_by_rotation": moment_by_rotation,
        "column": indices([entry.column for entry in entries]),
    }


def _at_points(elements: Elements, frames: Indices, blocks: Blocks) -> Indices | None:
    if not elements.at_points:
        return None
    numbers, loads = list(POINT_LAWS), elements.at_points
    body = indices([elements.frame[load.body] for _, load in loads])
    nodes = np.stack([frames["displacement"][body], frames["rotation"][body]], axis=1)
    places = blocks.place(nodes[:, :, None], nodes[:, None, :])
    return {
        "law": indices([numbers.index(load.law) for _, load in loads]),
        "frame": body,
        "block": places.reshape(-1, 4),
        "column": indices([column for column, _ in loads]),
    }


def _along(elements: Elements) -> Indices:
    entries, laws = elements.along, [*COORDINATE_LAWS]
    columns = sorted({entry.column for entry in entries if entry.law.is_elastic})
    number = {column: i for i, column in enumerate(columns)}
    energy = [number[e.column] if e.law.is_elastic else -1 for e in entries]
    closed = [e.law.mean_tension is not None or not e.law.is_elastic for e in entries]
    return _columns(entries, "coordinate", "table", "joint", "column") | {
        "law": indices([laws.index(entry.law.name) for entry in entries]),
        "energy_column": indices(energy),
        "closed": np.array(closed, dtype=bool),
        "unknown": np.array([entry.element >= 0 for entry in entries], dtype=bool),
    }


def _compliances(
    elements: Elements, nodes: _Nodes, parts: np.ndarray, blocks: Blocks, first: int
) -> Indices | None:
    """Return the indices of springs in the compliance form."""
    if not nodes.of_spring:
        return None
    springs = [s for s, entry in enumerate(elements.along) if entry.element >= 0]
    place = indices(nodes.of_spring)
    part = parts[[elements.along[s].coordinate for s in springs]]
    node = first + place[:, :1]
    return {
        "spring": indices(springs),
        "place": place,
        "force_block": blocks.place(part, node),
        "equation_block": blocks.place(node, part),
        "own_block": blocks.constant(node[:, 0], node[:, 0]),  # only its diagonal is not zero
    }


def _signals(
    elements: Elements, parts: np.ndarray, frames: Indices, blocks: Blocks
) -> tuple[Indices | None, Indices | None]:
    """Return the indices of the signals and of the actuators.

    A result depends on the frames of all its inputs, so its blocks are those of the frames that it
    acts on by these.
    """
    entries = elements.signals
    if entries is None:
        return None, None
    frame = indices([elements.frame[marker.body] for marker in entries.markers])
    of_inputs = input_parts(entries, parts, frame, frames)
    columns: list[np.ndarray] = []
    entry_column: list[np.ndarray] = [np.zeros((0, PARTS), dtype=np.int64)]
    places: list[np.ndarray] = [np.zeros((0, PARTS), dtype=np.int64)]
    acting: list[list[int]] = []
    for result in entries.results:
        wanted = of_inputs[list(result.inputs)].reshape(-1, PARTS)
        own = np.flatnonzero(np.bincount(wanted[wanted >= 0]))
        columns.append(own)
        entry_column.append(np.where(wanted >= 0, np.searchsorted(own, wanted), -1))
        rows, on = _acting(elements, result, parts, frames)
        acting.append(on)
        places.append(blocks.place(rows[None, :], own[:, None]))
    sizes = [len(result.inputs) for result in entries.results]
    signals = {
        "kind": indices([entry.kind for entry in entries.inputs]),
        "item": indices([entry.item for entry in entries.inputs]),
        "component": indices([entry.component for entry in entries.inputs]),
        "counted": indices(entries.counted),
        "frame": frame,
        "first_entry": indices(np.cumsum([0, *sizes])),
        "entry_input": indices([j for result in entries.results for j in result.inputs]),
        "entry_column": np.concatenate(entry_column),
        "first_column": indices(np.cumsum([0, *map(len, columns)])),
        "block": np.concatenate(places),
        "acting": indices(acting).reshape(-1, PARTS),
    }
    if not elements.coordinates:
        return signals, None
    actuators = [result for result in entries.results if result.coordinate >= 0]
    return signals, {
        "coordinate": indices([result.coordinate for result in actuators]),
        "column": indices([result.column for result in actuators]),
    }


def _acting(
    elements: Elements, result: ResultEntry, parts: np.ndarray, frames: Indices
) -> tuple[np.ndarray, list[int]]:
    """Return the nodes (4,) of the parts that a result acts on, -1 for none, and their frames."""
    if result.coordinate >= 0:
        pair = elements.coordinates[result.coordinate][1]
        return parts[result.coordinate], [pair.a, pair.a, pair.b, pair.b]
    b = elements.frame[result.body]
    nodes = [frames["displacement"][b], frames["rotation"][b], -1, -1]
    return indices(nodes), [b, b, b, b]


def _reactions(elements: Elements) -> Indices:
    joints = elements.model.joints
    point = {element: k for k, (element, _) in enumerate(elements.points)}
    return {
        "child": indices([elements.frame[joint.child] for joint in joints]),
        "coincide": indices([point.get(e, -1) for e in range(len(joints))]),
        "first_equation": indices(elements.first_equation),
    }


def _shown(elements: Elements) -> Shown:
    joints = elements.model.joints
    return Shown(
        moment=np.array([KINDS[joint.kind].moment for joint in joints], dtype=bool),
        load_equation=indices(elements.load_equation),
    )


def _multipliers(nodes: _Nodes, multiplier: np.ndarray, ground: int) -> Multipliers:
    most = max(4, *(len(frames) for frames in nodes.frames), 4)
    touched = [[*sorted(frames), *[ground] * most][:most] for frames in nodes.frames]
    return Multipliers(
        node=multiplier,
        element=indices(nodes.element),
        rotational=np.array(nodes.rotational, dtype=bool),
        bodies=indices(touched).reshape(-1, most),
        of_beam=np.array(nodes.of_beam, dtype=bool),
    )


def _columns(entries: list[Any], *fields: str) -> Indices:
    return {field: indices([getattr(entry, field) for entry in entries]) for field in fields}


def indices(numbers: Any) -> np.ndarray:
    """Return an array of indices, also of none."""
    return np.array(list(numbers), dtype=np.int64)
