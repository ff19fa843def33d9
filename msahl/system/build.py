"""Model -> system: one group of arrays per kind of element, and the Jacobian's blocks."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.functions import Law, Laws, build_laws
from msahl.algebra.vector import ZERO, Vector, sub
from msahl.elements.constraints.coincide import Coincide
from msahl.elements.constraints.coordinates import Coordinates
from msahl.elements.constraints.equations import ConstraintEquations
from msahl.elements.constraints.products import DOT, PARTS, Products
from msahl.elements.constraints.scalar import ScalarConstraints
from msahl.elements.forces import Forces
from msahl.elements.forces.concentrated import ConcentratedLoads
from msahl.elements.forces.drag import Drags
from msahl.elements.forces.friction import Frictions
from msahl.elements.forces.spring import Springs
from msahl.elements.frames import NODES, Frames, displacement_node, first_multiplier, rotation_node
from msahl.elements.reactions import Reactions, Shown
from msahl.elements.rigid_body import STATE_SIZE, RigidBodies
from msahl.joints.joint import (
    CHILD,
    GROUND,
    PARENT,
    Coordinate,
    Equation,
    Product,
    X,
    Y,
    Z,
    angle,
    distance,
    in_plane,
    perpendicular,
    slide,
)
from msahl.joints.joint import Coincide as Coinciding
from msahl.joints.registry import KINDS
from msahl.model import Model, decay_of, is_exponential
from msahl.model.bodies import RigidBody
from msahl.model.couplings import COORDINATES, Coupling
from msahl.model.joints import Joint
from msahl.model.loads import Bushing, ConcentratedLoad, Drag, Friction, JointSpring, SpringDamper
from msahl.model.motions import JointMotion, PointMotion
from msahl.system.arrays import Multipliers, System
from msahl.system.pattern import Blocks

RELAXATION = 1e-9
"""Put on the multipliers' diagonal where joints are redundant: large against round-off, and so
small against the dimensionless compliances of joints that Newton's method hardly notices."""

FREE_MOTIONS = {"angle": angle, "slide": slide}


def build_system(model: Model, relaxed: bool = False) -> System:
    """The flat arrays of ``model`` (see ``System``); ``relaxed`` if its joints are redundant."""
    return _Builder(model, RELAXATION if relaxed else 0.0).system()


def body_index(model: Model) -> dict[str, int]:
    """Index of each body by name; every ground has the last one."""
    index = {body.name: i for i, body in enumerate(model.bodies)}
    return index | {ground.name: len(model.bodies) for ground in model.grounds}


class _Pair(NamedTuple):
    """Two bodies with the points and frames between which a quantity is measured."""

    a: int
    b: int
    s_a: Vector
    s_b: Vector


class _Builder:
    """The system while it grows: lists by kind of element, one entry each."""

    def __init__(self, model: Model, relaxation: float) -> None:
        self.model, self.relaxation = model, relaxation
        self.index = body_index(model)
        self.ground = len(model.bodies)
        self.r_BG = [*(body.r_BG for body in model.bodies), ZERO]
        self.joints = {joint.name: joint for joint in model.joints}
        self.arms: list[list[float]] = [[] for _ in range(self.ground + 1)]
        self.products: list[tuple[Any, ...]] = []
        self.coordinates: list[tuple[Coordinate, _Pair]] = []
        self.freedoms: dict[tuple[str, str], int] = {}
        self.coincide: list[tuple[int, _Pair]] = []
        self.rows: list[dict[str, Any]] = []
        self.joint_rows = [0]
        self.laws: list[Law] = []
        self.springs: list[tuple[Any, ...]] = []
        self.frictions: list[tuple[Any, ...]] = []
        self.columns: dict[str, list[int]] = {key: [] for key in ("loads", "drags", "rows")}
        for element, joint in enumerate(model.joints):
            self._joint(element, joint)
        self.load_rows: list[int] = []
        for element, coupling in enumerate(model.couplings, start=len(model.joints)):
            self._coupling(element, coupling)
        first = len(model.joints) + len(model.couplings)
        for i, motion in enumerate(model.motions):
            self._motion(first + i, len(model.loads) + i, motion)
        for column, load in enumerate(model.loads):
            self._load(column, load)
        self.frames = self._frames()
        self.blocks = Blocks(self.frames)

    def system(self) -> System:
        """Everything as arrays."""
        frames, bodies = self.frames, self._bodies()
        nodes = self._place_multipliers()
        coincide = self._coincide(frames)
        loads, drags = self._concentrated(), self._drags()
        laws = build_laws(self.laws)
        scalar = self._along(frames, laws) if self.coordinates else None
        return System(
            frames=frames,
            bodies=bodies,
            coincide=coincide,
            scalar=scalar,
            reactions=self._reactions(),
            laws=laws,
            forces=Forces(
                concentrated=loads,
                drag=drags,
                spring=self._springs(),
                friction=_group(Frictions, self.frictions, "qqffq"),
                laws=laws,
            ),
            shown=self._shown(),
            unit=self._units(coincide, scalar, len(nodes)),
            decay=decay_of(self.model),
            relaxation=self.relaxation,
            multipliers=self._multipliers(nodes),
            blocks=self.blocks.nodes(),
            pattern=self.blocks.pattern(),
            constant=self.blocks.constant_values(),
        )

    def _along(self, frames: Frames, laws: Laws) -> ScalarConstraints:
        coords = self._quantities()
        return ScalarConstraints(
            coordinates=coords,
            equations=self._rows(frames),
            laws=laws,
            equation_column=_indices(self.columns["rows"]),
        )

    def _point(self, body: int, point: Vector) -> Vector:
        """A point from B as an arm from the mass centre; counted for the body's length."""
        arm = sub(point, self.r_BG[body])
        self.arms[body].append(float(np.linalg.norm(arm)))
        return arm

    def _pair(self, joint: Joint | SpringDamper | Bushing) -> _Pair:
        a, b = self.index[joint.parent], self.index[joint.child]
        s_a, s_b = self._point(a, joint.parent_point), self._point(b, joint.child_point)
        return _Pair(a, b, s_a, s_b)

    def _quantity(self, coordinate: Coordinate, pair: _Pair) -> int:
        """Add a quantity; its number."""
        self.coordinates.append((coordinate, pair))
        self.products += [_measure(product, pair, self.ground) for product in coordinate.products]
        return len(self.coordinates) - 1

    def _freedom(self, joint_name: str, coordinate: str) -> int:
        """The quantity of a joint's free motion, the same for all that act along it."""
        key = (joint_name, coordinate)
        if key not in self.freedoms:
            joint = self.joints[joint_name]
            self.freedoms[key] = self._quantity(FREE_MOTIONS[coordinate](joint), self._pair(joint))
        return self.freedoms[key]

    def _joint(self, element: int, joint: Joint) -> None:
        pair = self._pair(joint)
        for equation in KINDS[joint.kind].equations(joint):
            if isinstance(equation, Coinciding):
                self.coincide.append((element, pair))
                continue
            first = self._quantity(equation.first, pair)
            second = -1
            if equation.second is not None:
                second = self._quantity(equation.second, pair)
            self._row(element, first, second, equation.coefficient, equation)
        self.joint_rows.append(len(self.rows))

    def _coupling(self, element: int, coupling: Coupling) -> None:
        first_freedom, second_freedom = COORDINATES[coupling.kind]
        follower = self._freedom(coupling.second, second_freedom)
        leader = self._freedom(coupling.first, first_freedom)
        equation = Equation(self.coordinates[follower][0], None)
        factor = -1.0 if coupling.lift is not None else -coupling.ratio
        self.load_rows.append(len(self.rows))
        self._row(element, follower, leader, factor, equation, function=self._law(coupling.lift))

    def _motion(self, element: int, column: int, motion: JointMotion | PointMotion) -> None:
        if isinstance(motion, JointMotion):
            coordinate = self._freedom(motion.joint, motion.coordinate)
        else:
            b = self.index[motion.body]
            pair = _Pair(self.ground, b, ZERO, self._point(b, motion.point))
            equation = in_plane(motion.direction)
            coordinate = self._quantity(equation.first, pair)
        equation = Equation(self.coordinates[coordinate][0], None)
        self.load_rows.append(len(self.rows))
        self._row(element, coordinate, -1, 0.0, equation, self._law(motion.law), column)

    def _row(
        self,
        element: int,
        first: int,
        second: int,
        coefficient: float,
        equation: Equation,
        law: int = -1,
        column: int = -1,
        function: int = -1,
    ) -> None:
        self.columns["rows"].append(column)
        self.rows.append(
            {
                "element": element,
                "quantity": (first, second),
                "coefficient": (1.0, coefficient),
                "function": function,
                "law": law,
                "offset": np.nan if equation.value is None else equation.value,
                "holonomic": not equation.rate,
                "angular": equation.first.angular,
            }
        )

    def _law(self, law: Law | None) -> int:
        if law is None:
            return -1
        self.laws.append(law)
        return len(self.laws) - 1

    def _load(self, column: int, load: Any) -> None:
        if isinstance(load, SpringDamper):
            coordinate = self._quantity(distance(), self._pair(load))
            free = np.nan if load.free_length is None else load.free_length
            self._spring(column, coordinate, load.stiffness, load.damping, free, load)
        elif isinstance(load, JointSpring):
            coordinate = self._freedom(load.joint, load.coordinate)
            self._spring(column, coordinate, load.stiffness, load.damping, load.free, load)
        elif isinstance(load, Bushing):
            pair = self._pair(load)
            for product, k, c in zip(_bushing(load), load.stiffness, load.damping, strict=True):
                if k or c:
                    self._spring(column, self._quantity(product, pair), k, c, np.nan, None)
        elif isinstance(load, Friction):
            coordinate = self._freedom(load.joint, load.coordinate)
            number = [joint.name for joint in self.model.joints].index(load.joint)
            lever = load.coefficient * load.radius
            self.frictions.append((coordinate, number, lever, load.width, column))
        else:
            kind = "drags" if isinstance(load, Drag) else "loads"
            self.columns[kind].append(column)

    def _spring(
        self,
        column: int,
        coordinate: int,
        stiffness: float,
        damping: float,
        free: float,
        load: SpringDamper | JointSpring | None,
    ) -> None:
        preload = load.preload if load else 0.0
        table = self._law(load.table) if load else -1
        origin = np.nan if isinstance(load, JointSpring) else 0.0
        steepest = _steepest(load.table) if load and load.table else stiffness
        lag = 0.5 * decay_of(self.model).chi * steepest
        entry = (coordinate, stiffness, damping, origin, free, preload, table, lag, column)
        self.springs.append(entry)

    def _frames(self) -> Frames:
        """One frame for each rigid body, at its mass centre, and the ground."""
        model, n = self.model, self.ground
        for load in model.loads:
            if isinstance(load, ConcentratedLoad | Drag):
                self._point(self.index[load.body], load.point)
        lengths = [_length(body, arms) for body, arms in zip(model.bodies, self.arms, strict=False)]
        count = n + 1
        return Frames(
            displacement=NODES * np.arange(count, dtype=np.int64),
            rotation=NODES * np.arange(count, dtype=np.int64) + 1,
            of_node=np.repeat(np.arange(count, dtype=np.int64), NODES),
            rotates=np.tile([False, True], count),
            owner=np.array([*range(n), -1], dtype=np.int64),
            inverse_mass=np.array([1.0 / body.mass for body in model.bodies] + [0.0]),
            length=np.array([*lengths, 1.0]),
            exponential=is_exponential(model) or None,
            ballistic=np.array([*(not arms for arms in self.arms[:n]), True]),
            moves=np.ones((2, 3)),
        )

    def _bodies(self) -> RigidBodies:
        model, n, blocks = self.model, self.ground, self.blocks
        nodes = [
            (displacement_node(self.frames, b), rotation_node(self.frames, b)) for b in range(n)
        ]
        places = [blocks.place(rotation, rotation) for _, rotation in nodes]
        for displacement, _ in nodes:
            blocks.constant(displacement, displacement, 1.0)
        return RigidBodies(
            frame=np.arange(n, dtype=np.int64),
            inverse_mass=np.array([1.0 / body.mass for body in model.bodies]),
            inertia=np.array([body.inertia for body in model.bodies], dtype=float).reshape(
                -1, 3, 3
            ),
            r_BG=_vectors(self.r_BG[:n]),
            gravity=np.array(model.gravity, dtype=float),
            block=np.array(places, dtype=np.int64),
            column=STATE_SIZE * np.arange(n, dtype=np.int64),
        )

    def _place_multipliers(self) -> list[tuple[int, bool, set[int]]]:
        """Give every row its node and slot: (element, turning, bodies) of each node.

        The points that coincide come first; then the rows of an element, three to a node, those
        that see displacements apart from those that see nothing but turns.
        """
        nodes: list[tuple[int, bool, set[int]]] = [
            (element, False, {pair.a, pair.b}) for element, pair in self.coincide
        ]
        open_nodes: dict[tuple[int, bool], tuple[int, int]] = {}
        for row in self.rows:
            coords = [self.coordinates[q] for q in row["quantity"] if q >= 0]
            key = (row["element"], all(q.angular for q, _ in coords))
            if key not in open_nodes:
                open_nodes[key] = (len(nodes), 0)
                nodes.append((*key, set()))
            node, slot = open_nodes.pop(key)
            row["place"] = (node, slot)
            nodes[node][2].update(body for _, pair in coords for body in (pair.a, pair.b))
            if slot < 2:
                open_nodes[key] = (node, slot + 1)
        return nodes

    def _coincide(self, frames: Frames) -> Coincide:
        a = np.array([pair.a for _, pair in self.coincide], dtype=np.int64)
        b = np.array([pair.b for _, pair in self.coincide], dtype=np.int64)
        mass = 1.0 / (frames.inverse_mass[a] + frames.inverse_mass[b])
        first = first_multiplier(frames)
        moment_by_rotation, moment_by_force, constraint_by_rotation = np.zeros(
            (3, a.size, 2), dtype=np.int64
        )
        for k, (_, pair) in enumerate(self.coincide):
            for side, (sign, body) in enumerate(zip((-1.0, 1.0), (pair.a, pair.b), strict=True)):
                u, turn = displacement_node(frames, body), rotation_node(frames, body)
                node = first + k
                share = float(frames.inverse_mass[body] * mass[k])
                self.blocks.constant(u, node, -sign * share)
                self.blocks.constant(node, u, sign)
                moment_by_rotation[k, side] = self.blocks.place(turn, turn)
                moment_by_force[k, side] = self.blocks.place(turn, node)
                constraint_by_rotation[k, side] = self.blocks.place(node, turn)
        return Coincide(
            a=a,
            b=b,
            s_a=_vectors(pair.s_a for _, pair in self.coincide),
            s_b=_vectors(pair.s_b for _, pair in self.coincide),
            mass=mass,
            row=first + np.arange(a.size, dtype=np.int64),
            moment_by_rotation=moment_by_rotation,
            moment_by_force=moment_by_force,
            constraint_by_rotation=constraint_by_rotation,
        )

    def _quantities(self) -> Coordinates:
        sizes = [len(coordinate.products) for coordinate, _ in self.coordinates]
        blocks = [
            [self.blocks.place(row, column) for row in parts for column in parts]
            for parts in (
                _parts(self.frames, coordinate, pair) for coordinate, pair in self.coordinates
            )
        ]
        columns = list(zip(*self.products, strict=True)) or [()] * len(Products._fields)
        vectors = dict(zip(Products._fields, columns, strict=True))
        products = Products(
            **{key: np.array(vectors[key], dtype=np.int64) for key in ("kind", "a", "b", "owner")},
            **{key: _vectors(vectors[key]) for key in ("n", "s_a", "s_b", "e")},
        )
        return Coordinates(
            products=products,
            kind=np.array([coordinate.kind for coordinate, _ in self.coordinates], dtype=np.int64),
            first=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
            radius=np.array([coordinate.radius for coordinate, _ in self.coordinates], dtype=float),
            block=np.array(blocks, dtype=np.int64).reshape(-1, PARTS * PARTS),
        )

    def _rows(self, frames: Frames) -> ConstraintEquations:
        count, first = len(self.rows), first_multiplier(frames)
        force_block, constraint_block = np.zeros((2, count, 2, PARTS), dtype=np.int64)
        mass, lengths = np.zeros(count), np.ones(count)
        for r, row in enumerate(self.rows):
            node = first + row["place"][0]
            for side, q in enumerate(row["quantity"]):
                if q >= 0:
                    parts = _parts(frames, *self.coordinates[q])
                    force_block[r, side] = [self.blocks.place(part, node) for part in parts]
                    constraint_block[r, side] = [self.blocks.place(node, part) for part in parts]
            pair = self.coordinates[row["quantity"][0]][1]
            moving = [body for body in (pair.a, pair.b) if body != self.ground]
            mass[r] = 1.0 / sum(frames.inverse_mass[body] for body in moving)
            if row["angular"]:
                lengths[r] = max(frames.length[body] for body in moving)

        def integers(key: str, width: int = 0) -> np.ndarray:
            values = np.array([row[key] for row in self.rows], dtype=np.int64)
            return values.reshape(-1, width) if width else values

        coefficients = [row["coefficient"] for row in self.rows]
        return ConstraintEquations(
            place=integers("place", 2),
            coordinate=integers("quantity", 2),
            coefficient=np.array(coefficients, dtype=float).reshape(-1, 2),
            function=integers("function"),
            law=integers("law"),
            offset=np.array([row["offset"] for row in self.rows], dtype=float),
            holonomic=np.array([row["holonomic"] for row in self.rows], dtype=bool),
            mass=mass,
            scale=lengths,
            force_block=force_block,
            constraint_block=constraint_block,
        )

    def _reactions(self) -> Reactions:
        coincide = {element: k for k, (element, _) in enumerate(self.coincide)}
        joints = self.model.joints
        child = [self.index[joint.child] for joint in joints]
        arms = [sub(j.child_point, self.r_BG[b]) for j, b in zip(joints, child, strict=True)]
        return Reactions(
            child=np.array(child, dtype=np.int64),
            s=_vectors(arms),
            coincide=np.array([coincide.get(e, -1) for e in range(len(joints))], dtype=np.int64),
            first_equation=np.array(self.joint_rows, dtype=np.int64),
        )

    def _concentrated(self) -> ConcentratedLoads:
        loads = [load for load in self.model.loads if isinstance(load, ConcentratedLoad)]
        body, f_axes, m_axes = (
            np.array([self.index[getattr(load, key)] for load in loads], dtype=np.int64)
            for key in ("body", "force_basis", "moment_basis")
        )
        place = self.blocks.place
        rotational = np.stack([body, f_axes, m_axes], axis=1).tolist()
        rotation = self.frames.rotation
        moment_by_rotation = [[place(rotation[t[0]], rotation[c]) for c in t] for t in rotational]
        force_by_rotation = [
            place(self.frames.displacement[b], rotation[c]) for b, c, _ in rotational
        ]
        arms = [sub(load.point, self.r_BG[self.index[load.body]]) for load in loads]
        return ConcentratedLoads(
            frame=body,
            s=_vectors(arms),
            f=_vectors(load.force for load in loads),
            f_axes=f_axes,
            m=_vectors(load.moment for load in loads),
            m_axes=m_axes,
            law=np.array([self._law(load.law) for load in loads], dtype=np.int64),
            force_by_rotation=np.array(force_by_rotation, dtype=np.int64),
            moment_by_rotation=np.array(moment_by_rotation, dtype=np.int64).reshape(-1, 3),
            column=_indices(self.columns["loads"]),
        )

    def _drags(self) -> Drags:
        drags = [load for load in self.model.loads if isinstance(load, Drag)]
        body = [self.index[load.body] for load in drags]
        blocks = [
            [self.blocks.place(row, column) for row in nodes for column in nodes]
            for nodes in zip(
                self.frames.displacement[body], self.frames.rotation[body], strict=True
            )
        ]
        arms = [sub(load.point, self.r_BG[b]) for load, b in zip(drags, body, strict=True)]
        return Drags(
            frame=np.array(body, dtype=np.int64),
            s=_vectors(arms),
            coefficient=np.array([load.coefficient for load in drags], dtype=float),
            block=np.array(blocks, dtype=np.int64).reshape(-1, 4),
            column=_indices(self.columns["drags"]),
        )

    def _springs(self) -> Springs:
        columns = [entry[-1] for entry in self.springs]
        energy_column = {column: i for i, column in enumerate(sorted(set(columns)))}
        entries = [(*entry, energy_column[entry[-1]]) for entry in self.springs]
        return _group(Springs, entries, "qfffffqfqq")

    def _shown(self) -> Shown:
        model = self.model
        return Shown(
            moment=np.array([KINDS[joint.kind].moment for joint in model.joints], dtype=bool),
            load_equation=np.array(self.load_rows, dtype=np.int64),
        )

    def _units(
        self, coincide: Coincide, scalar: ScalarConstraints | None, nodes: int
    ) -> np.ndarray:
        unit = np.ones((nodes, 3))
        unit[: coincide.a.size] = coincide.mass[:, None]
        if scalar is not None:
            place = scalar.equations.place
            unit[place[:, 0], place[:, 1]] = scalar.equations.mass * scalar.equations.scale
        return unit

    def _multipliers(self, nodes: list[tuple[int, bool, set[int]]]) -> Multipliers:
        first = first_multiplier(self.frames)
        if self.relaxation:
            for node in range(first, first + len(nodes)):
                self.blocks.constant(node, node, -self.relaxation)
        touched = [[*sorted(bodies), *[self.ground] * 4][:4] for _, _, bodies in nodes]
        return Multipliers(
            node=first + np.arange(len(nodes), dtype=np.int64),
            element=np.array([element for element, _, _ in nodes], dtype=np.int64),
            rotational=np.array([rotational for _, rotational, _ in nodes], dtype=bool),
            bodies=np.array(touched, dtype=np.int64).reshape(-1, 4),
        )


def _measure(product: Product, pair: _Pair, ground: int) -> tuple[Any, ...]:
    """A row of ``Measures``."""
    owner = {PARENT: pair.a, CHILD: pair.b, GROUND: ground}[product.owner]
    s_a = pair.s_a if product.up is None else product.up
    return product.kind, pair.a, pair.b, owner, product.n, s_a, pair.s_b, product.e


def _parts(frames: Frames, coordinate: Coordinate, pair: _Pair) -> list[int]:
    """Nodes of the four parts; -1 for displacements that the quantity does not see."""
    seen = any(product.kind != DOT for product in coordinate.products)
    u_a, u_b = frames.displacement[[pair.a, pair.b]] if seen else (-1, -1)
    rotation_a, rotation_b = frames.rotation[[pair.a, pair.b]]
    return [int(node) for node in (u_a, rotation_a, u_b, rotation_b)]


def _bushing(bushing: Bushing) -> list[Coordinate]:
    """Three slides along the parent's frame and three turns about it, small ones as products."""
    frame, child = bushing.parent_axes, bushing.child_axes
    slides = [in_plane(axis).first for axis in frame]
    pairs = ((Z, Y), (X, Z), (Y, X))
    return slides + [perpendicular(frame[i], child[j]).first for i, j in pairs]


def _steepest(table: Law) -> float:
    """Largest rise of a table from one entry to the next; zero if it only falls."""
    x, y = np.array(table.numbers).reshape(2, -1)
    return max(0.0, float((np.diff(y) / np.diff(x)).max()))


def _length(body: RigidBody, arms: Sequence[float]) -> float:
    """The length of a body: its radius of gyration or its longest arm, whichever is larger."""
    gyration = float(np.sqrt(np.trace(np.array(body.inertia)) / (2.0 * body.mass)))
    return max([gyration, *arms])


def _vectors(vectors: Iterable[Vector]) -> np.ndarray:
    """(k, 3) array of vectors, also of none."""
    return np.array(list(vectors), dtype=float).reshape(-1, 3)


def _indices(numbers: Iterable[int]) -> np.ndarray:
    """Array of indices, also of none."""
    return np.array(list(numbers), dtype=np.int64)


def _group(kind: Any, entries: Sequence[tuple[Any, ...]], types: str) -> Any:
    """A group of arrays from its rows; ``types`` has q for indices, f for numbers."""
    columns = list(zip(*entries, strict=True)) or [()] * len(types)
    arrays = [
        np.array(column, dtype=np.int64 if letter == "q" else float)
        for column, letter in zip(columns, types, strict=True)
    ]
    return kind(*arrays)
