"""Parameters of a system: the numbers of all elements, put beside the indices of a topology."""

from collections.abc import Iterable, Sequence

import numpy as np

from msahl.algebra.functions import Laws, build_laws, continue_past
from msahl.algebra.rotation_arrays import parameters
from msahl.algebra.vector import ZERO, Vector, sub
from msahl.elements.beams.group import Beams
from msahl.elements.beams.shape import shape
from msahl.elements.constraints.coincide import Coincide
from msahl.elements.constraints.contact_points import BOX
from msahl.elements.constraints.coordinate_kinds import Coordinates
from msahl.elements.constraints.equations import ConstraintEquations
from msahl.elements.constraints.outlines import curves_of
from msahl.elements.constraints.products import Products, Surfaces
from msahl.elements.constraints.scalar import ScalarConstraints
from msahl.elements.constraints.sums import Sums
from msahl.elements.reactions import Reactions
from msahl.elements.signals.coupling import coupling
from msahl.elements.signals.group import Signals
from msahl.expressions.tape import Tape, build_tape
from msahl.formulations.absolute.frames import Frames
from msahl.formulations.absolute.rigid_body import RigidBodies
from msahl.joints.joint import Surface
from msahl.laws.registry import POINT_LAWS, constants
from msahl.model import resolve
from msahl.model.beams import Beam
from msahl.model.bodies import RigidBody
from msahl.ports.actuator import Actuators
from msahl.ports.compliance import Compliances
from msahl.ports.concentrated import ConcentratedLoads
from msahl.ports.coordinate import AlongForces
from msahl.ports.forces import Forces
from msahl.ports.point import PointForces
from msahl.ports.rubbing import Rubbing
from msahl.ports.sliding import Sliding
from msahl.system.arrays import System
from msahl.system.collect import ConcentratedEntry, Elements
from msahl.system.signal_inputs import SignalEntries
from msahl.system.topology import Indices, Topology, all_products

RELAXATION = 1e-9
"""Put on the multipliers' diagonal where joints are redundant: large against round-off, and so
small against the dimensionless compliances of joints that Newton's method hardly notices."""


def build_parameters(elements: Elements, topology: Topology) -> System:
    """Return the system of ``elements``. What an element takes from the configuration at t = 0 is
    still nan.
    """
    model, laws = elements.model, build_laws(elements.laws)
    for law in {entry.law for entry in elements.equations} - {-1}:
        continue_past(laws, law, model.simulation.t_final)
    frames = _frames(elements, topology)
    coincide = _coincide(elements, topology, frames)
    scalar = _scalar(elements, topology, frames, laws) if elements.coordinates else None
    beams = _beams(elements, topology.beams, frames) if topology.beams else None
    forces = _forces(elements, topology, frames, laws)
    return System(
        frames=frames,
        bodies=_bodies(elements, topology),
        coincide=coincide,
        scalar=scalar,
        beams=beams,
        reactions=_reactions(elements, topology),
        laws=laws,
        forces=forces,
        shown=topology.shown,
        unit=_units(coincide, scalar, beams, forces.compliance, topology),
        decay=resolve(model.simulation).decay,
        relaxation=RELAXATION if topology.relaxed else 0.0,
        multipliers=topology.multipliers,
        blocks=topology.blocks,
        pattern=topology.pattern,
        constant=_constant(topology, frames, coincide),
    )


def _frames(elements: Elements, topology: Topology) -> Frames:
    bodies = elements.model.bodies
    return Frames(
        **topology.frames,
        inverse_mass=np.array([1.0 / body.mass for body in bodies] + [0.0]),
        length=np.array([*_lengths(bodies, elements.arms), 1.0]),
        exponential=resolve(elements.model.simulation).exponential,
        ballistic=np.array([*(not arms for arms in elements.arms[: len(bodies)]), True]),
        moves=np.ones((2, 3)),
    )


def _lengths(bodies: Sequence[RigidBody], arms: Sequence[Sequence[float]]) -> list[float]:
    """The length of each body: its radius of gyration or its longest arm, whichever is larger."""
    mass = np.array([body.mass for body in bodies])
    gyration = np.sqrt(np.trace(_tensors(bodies), axis1=1, axis2=2) / (2.0 * mass))
    return [max((size, *lengths)) for size, lengths in zip(gyration.tolist(), arms, strict=False)]


def _tensors(bodies: Sequence[RigidBody]) -> np.ndarray:
    """(n, 3, 3) inertia of bodies."""
    return np.array([body.inertia for body in bodies], dtype=float).reshape(-1, 3, 3)


def _bodies(elements: Elements, topology: Topology) -> RigidBodies:
    bodies = elements.model.bodies
    return RigidBodies(
        **topology.bodies,
        inverse_mass=np.array([1.0 / body.mass for body in bodies]),
        inertia=_tensors(bodies),
        r_BG=_vectors(body.r_BG for body in bodies),
        gravity=np.array(elements.model.gravity, dtype=float),
    )


def _coincide(elements: Elements, topology: Topology, frames: Frames) -> Coincide:
    a, b = topology.coincide["a"], topology.coincide["b"]
    return Coincide(
        **topology.coincide,
        s_a=_vectors(pair.s_a for _, pair in elements.points),
        s_b=_vectors(pair.s_b for _, pair in elements.points),
        mass=1.0 / (frames.inverse_mass[a] + frames.inverse_mass[b]),
    )


def _constant(topology: Topology, frames: Frames, coincide: Coincide) -> np.ndarray:
    """The block values that never change."""
    values = np.zeros(topology.pattern.size)

    def put(starts: np.ndarray, numbers: np.ndarray | float) -> None:
        places = starts[:, None] + np.array([0, 4, 8])
        values[places] = np.broadcast_to(np.reshape(numbers, (-1, 1)), places.shape)

    put(topology.unit_blocks, 1.0)
    for side, (sign, frame) in enumerate(((-1.0, coincide.a), (1.0, coincide.b))):
        put(
            topology.coincide_blocks[:, side, 0],
            -sign * (frames.inverse_mass[frame] * coincide.mass),
        )
        put(topology.coincide_blocks[:, side, 1], sign)
    put(topology.relaxed_blocks, -RELAXATION)
    values[:9] = 0.0  # what belongs to the ground
    return values


def _scalar(
    elements: Elements, topology: Topology, frames: Frames, laws: Laws
) -> ScalarConstraints:
    products = all_products(elements)
    return ScalarConstraints(
        coordinates=Coordinates(
            **topology.coordinates,
            products=Products(
                **topology.products,
                n=_vectors(product.n for product, _ in products),
                s_a=_vectors(pair.s_a if p.up is None else p.up for p, pair in products),
                s_b=_vectors(pair.s_b for _, pair in products),
                e=_vectors(product.e for product, _ in products),
                surfaces=_surfaces([product.surface for product, _ in products]),
            ),
            radius=_numbers(coordinate.radius for coordinate, _ in elements.coordinates),
            curves=curves_of([coordinate.curve for coordinate, _ in elements.coordinates]),
            ends=_ends([coordinate.ends for coordinate, _ in elements.coordinates]),
            idle=topology.coordinates["of_contacts"].copy(),
        ),
        equations=_equations(elements, topology, frames),
        laws=laws,
        equation_column=topology.equation_column,
        sums=None if topology.sums is None else Sums(**topology.sums, weight=_weights(elements)),
    )


def _weights(elements: Elements) -> np.ndarray:
    """(s,) weights of the further terms of equations."""
    return _numbers(weight for entry in elements.equations for _, weight in entry.more)


def _ends(found: Sequence[tuple[float, float]]) -> np.ndarray | None:
    """Return the half lengths (q, 2) of segments [m], None if there are none."""
    return _numbers(found).reshape(-1, 2) if any(map(any, found)) else None


def _surfaces(found: Sequence[Surface | None]) -> Surfaces | None:
    """Return what products between surfaces have, None if there are none."""
    if not any(found):
        return None
    entries = [(0, 0.0, False) if s is None else (s.shape, s.radius, s.second) for s in found]
    shape, radius, second = zip(*entries, strict=True)
    has_points = any(shape >= BOX for shape, _, _ in entries)
    half = _vectors(ZERO if s is None or s.half is None else s.half for s in found)
    return Surfaces(
        shape=np.array(shape),
        radius=_numbers(radius),
        second=np.array(second),
        axis=np.zeros(len(entries), dtype=np.int64),
        half=half if has_points else None,
    )


def _equations(elements: Elements, topology: Topology, frames: Frames) -> ConstraintEquations:
    entries = elements.equations
    mass, scale = np.zeros(len(entries)), np.ones(len(entries))
    for r, entry in enumerate(entries):
        mass[r], scale[r] = _mass_and_scale(elements, frames, entry.first)
    values = (entry.equation.value for entry in entries)
    return ConstraintEquations(
        **topology.equations,
        coefficient=_numbers(
            (entry.first_coefficient, entry.coefficient) for entry in entries
        ).reshape(-1, 2),
        offset=_numbers(np.nan if value is None else value for value in values),
        mass=mass,
        scale=scale,
    )


def _mass_and_scale(elements: Elements, frames: Frames, q: int) -> tuple[float, float]:
    """Return the mass [kg] of a multiplier along coordinate ``q``, and by what its equation is
    multiplied: a length [m] along an angle, or 1.
    """
    coordinate, pair = elements.coordinates[q]
    moving = [frame for frame in (pair.a, pair.b) if frame != elements.ground]
    mass = 1.0 / sum(frames.inverse_mass[frame] for frame in moving)
    return mass, max(frames.length[frame] for frame in moving) if coordinate.angular else 1.0


def _compliances(elements: Elements, topology: Topology, frames: Frames) -> Compliances | None:
    if topology.compliance is None:
        return None
    entries = [entry for entry in elements.along if entry.element >= 0]
    scales = [_mass_and_scale(elements, frames, entry.coordinate) for entry in entries]
    return Compliances(
        **topology.compliance,
        compliance=_numbers(1.0 / dict(entry.parameters)["stiffness"] for entry in entries),
        mass=_numbers(mass for mass, _ in scales),
        scale=_numbers(scale for _, scale in scales),
    )


def _forces(elements: Elements, topology: Topology, frames: Frames, laws: Laws) -> Forces:
    return Forces(
        concentrated=_concentrated(elements, elements.concentrated, topology.concentrated),
        point=_at_points(elements, topology),
        along=_along(elements, topology),
        compliance=_compliances(elements, topology, frames),
        actuator=None if topology.actuator is None else Actuators(**topology.actuator),
        controlled=None
        if topology.controlled is None
        else _concentrated(elements, elements.controlled, topology.controlled),
        signals=_signals(elements, topology),
        sliding=_sliding(elements) if elements.sliding else None,
        rubbing=_rubbing(elements) if elements.rubbing else None,
        laws=laws,
    )


def _sliding(elements: Elements) -> Sliding:
    """Return the contacts with friction, all of them open."""
    entries = elements.sliding
    row = np.array([entry.row for entry in entries])
    return Sliding(
        row=row,
        tangent=row[:, None] + [1, 2],
        along=np.array([entry.along for entry in entries]),
        reaction=len(elements.model.joints) + np.arange(row.size),
        friction=np.zeros(row.size),
        grip=_numbers(entry.grip for entry in entries),
        toward=np.tile([1.0, 0.0], (row.size, 1)),
        still=np.zeros(row.size),
        width=np.zeros(1),
        column=np.array([entry.column for entry in entries]),
    )


def _rubbing(elements: Elements) -> Rubbing:
    """Return the compliant contacts with friction."""
    entries = elements.rubbing
    number = {id(entry): s for s, entry in enumerate(elements.along)}
    return Rubbing(
        normal=np.array([number[id(entry.normal)] for entry in entries]),
        along=np.array([entry.along for entry in entries]),
        friction=_numbers(entry.friction for entry in entries),
        width=_numbers(entry.width for entry in entries),
        column=np.array([entry.normal.column for entry in entries]),
    )


def _along(elements: Elements, topology: Topology) -> AlongForces:
    entries = elements.along
    return AlongForces(
        **topology.along,
        constants=constants([(entry.law, entry.parameters) for entry in entries]),
        damping=_numbers(entry.damping for entry in entries),
        origin=_numbers(entry.origin for entry in entries),
        free=_numbers(entry.free for entry in entries),
        decay=_numbers(entry.decay for entry in entries),
        width=_numbers(dict(e.parameters).get(e.law.width or "", 0.0) for e in entries),
    )


def _at_points(elements: Elements, topology: Topology) -> PointForces | None:
    if topology.point is None:
        return None
    loads = [load for _, load in elements.at_points]
    return PointForces(
        **topology.point,
        s=_arms(elements, ((load.body, load.point) for load in loads)),
        constants=constants([(POINT_LAWS[load.law], load.parameters) for load in loads]),
    )


def _concentrated(
    elements: Elements, entries: Sequence[ConcentratedEntry], places: Indices
) -> ConcentratedLoads:
    """Return a group of concentrated loads."""
    loads = [entry.load for entry in entries]
    return ConcentratedLoads(
        **places,
        s=_arms(elements, ((load.body, load.point) for load in loads)),
        f=_vectors(load.force for load in loads),
        m=_vectors(load.moment for load in loads),
    )


def _signals(elements: Elements, topology: Topology) -> Signals | None:
    entries = elements.signals
    if entries is None or topology.signals is None:
        return None
    tape, (rate, result, shown, stop, *_) = tape_of(entries)
    axes = [marker.axes for marker in entries.markers]
    return Signals(
        **topology.signals,
        tape=tape,
        origin=_numbers(entry.origin for entry in entries.inputs),
        s=_arms(elements, ((marker.body, marker.point) for marker in entries.markers)),
        axes=np.array(axes, dtype=float).reshape(-1, 3, 3),
        quaternion=np.array([_quaternion(np.array(rows).T) for rows in axes]).reshape(-1, 4),
        rate=rate,
        result=result,
        shown=shown,
        stop=stop,
        coupling=coupling(tape, rate, result),
    )


def tape_of(entries: SignalEntries) -> tuple[Tape, list[np.ndarray]]:
    """Return the tape of all expressions, and the places on it of: rates of auxiliary states,
    results, published values, margins of the conditions that end the run, those of events, values
    that events need.
    """
    names = [entry.name for entry in entries.inputs] + [state.name for state in entries.states]
    rates = [state.rate for state in entries.states]
    results = [entry.expression for entry in entries.results]
    events = entries.conditions, entries.values
    trees = rates, results, entries.shown, entries.stops, *events
    tape, places = build_tape(
        [tree for each in trees for tree in each], names, entries.named, entries.tables
    )
    return tape, np.split(places, np.cumsum([len(each) for each in trees[:-1]]))


def _quaternion(R: np.ndarray) -> np.ndarray:
    """Return the Euler parameters (4,) of a matrix of rotation, the first not negative."""
    p = parameters(R[None])[0]
    square = p @ p / 16.0
    return np.array([1.0 - square, *(0.5 * p)]) / (1.0 + square)


def _reactions(elements: Elements, topology: Topology) -> Reactions:
    points = ((joint.child, joint.child_point) for joint in elements.model.joints)
    return Reactions(**topology.reactions, s=_arms(elements, points))


def _beams(elements: Elements, places: Indices, frames: Frames) -> Beams:
    entries, most = [entry.beam for entry in elements.beams], places["load_block"].shape[1]
    values, slopes, weights = (
        np.concatenate(parts)
        for parts in zip(*(_interpolation(beam, most) for beam in entries), strict=True)
    )
    frame, node, first = places["frame"], places["node"], places["first"]
    of_point = [node[first[e] : first[e + 1]] for e in places["element"]]
    compliance = np.concatenate([np.array(beam.compliance) for beam in entries])
    bodies = [elements.model.bodies[f] for f in frame]
    return Beams(
        **places,
        arm=-_vectors(body.r_BG for body in bodies),
        value=values,
        slope=slopes,
        weight=weights,
        reference=np.concatenate([np.array(beam.strain) for beam in entries]),
        compliance=compliance,
        stiffness=np.array([_inverse(C) for C in compliance]),
        damping=np.concatenate([np.tile(beam.damping, (len(beam.strain), 1)) for beam in entries]),
        mass=_numbers(1.0 / frames.inverse_mass[frame[own]].sum() for own in of_point),
        length=_numbers(frames.length[frame[own]].max() for own in of_point),
        plane=None,
    )


def _interpolation(beam: Beam, most: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return shape functions (g, most), their derivatives by arc length and weights w J (g,) at the
    Gauss points of a beam; of a node that its elements do not have they are 0.
    """
    element, half = shape(beam.degree), 0.5 * np.array(beam.lengths)
    missing = ((0, 0), (0, most - beam.degree - 1))
    values = np.pad(np.tile(element.values, (half.size, 1)), missing)
    slopes = np.pad((element.slopes / half[:, None, None]).reshape(-1, beam.degree + 1), missing)
    return values, slopes, (half[:, None] * element.weights).reshape(-1)


def _inverse(compliance: np.ndarray) -> np.ndarray:
    """Return the stiffness (6, 6) of the components that are not rigid; zero for these."""
    elastic = np.flatnonzero(compliance.any(axis=1))
    stiffness = np.zeros_like(compliance)
    stiffness[np.ix_(elastic, elastic)] = np.linalg.inv(compliance[np.ix_(elastic, elastic)])
    return stiffness


def _units(
    coincide: Coincide,
    scalar: ScalarConstraints | None,
    beams: Beams | None,
    springs: Compliances | None,
    topology: Topology,
) -> np.ndarray:
    unit = np.ones((topology.multipliers.node.size, 3))
    unit[: coincide.a.size] = coincide.mass[:, None]
    if scalar is not None:
        place = scalar.equations.place
        unit[place[:, 0], place[:, 1]] = scalar.equations.mass * scalar.equations.scale
    if springs is not None:
        unit[springs.place[:, 0], springs.place[:, 1]] = springs.mass * springs.scale
    if beams is not None:
        # Multipliers are minus the stress resultants, and published as these.
        unit[beams.place] = -beams.mass[:, None]
        unit[beams.place + 1] = -(beams.mass * beams.length)[:, None]
    return unit


def _arms(elements: Elements, points: Iterable[tuple[str, Vector]]) -> np.ndarray:
    """(k, 3) points of bodies, given by name from their reference points, from the mass centres."""
    return _vectors(sub(point, elements.r_BG(elements.frame[body])) for body, point in points)


def _vectors(vectors: Iterable[Vector]) -> np.ndarray:
    """(k, 3) array of vectors, also of none."""
    return np.array(list(vectors), dtype=float).reshape(-1, 3)


def _numbers(numbers: Iterable[object]) -> np.ndarray:
    """Array of numbers, also of none."""
    return np.array(list(numbers), dtype=float)
