"""Model -> system: one group of arrays per kind of element, the Jacobian's blocks, the state."""

from collections.abc import Iterable, Sequence

import numpy as np

from msahl.bodies.rigid import Bodies, RigidBody
from msahl.forces.concentrated import ConcentratedLoads
from msahl.joints.coincide import Coincide
from msahl.model import Model
from msahl.rotation import matrix
from msahl.system.arrays import State, System
from msahl.vector import Vector, add, cross, sub, times


class _Blocks:
    """The Jacobian's pattern while it grows: a block's place by its row and column node."""

    def __init__(self, ground: int) -> None:
        self.ground = ground
        self.starts: dict[tuple[int, int], int] = {(-1, -1): 0}
        self.constants: list[tuple[int, float]] = []

    def place(self, row: int, column: int) -> int:
        """Start of the block in the value array; 0 if it belongs to the ground."""
        if {row, column} & {2 * self.ground, 2 * self.ground + 1}:
            return 0
        return self.starts.setdefault((row, column), 9 * len(self.starts))

    def constant(self, row: int, column: int, value: float) -> None:
        """A block ``value`` times the unit matrix."""
        self.constants.append((self.place(row, column), value))

    def nodes(self) -> np.ndarray:
        """(m, 2) row and column node of each block."""
        nodes = np.array(list(self.starts), dtype=np.int64)
        nodes[0] = 0
        return nodes

    def constant_values(self) -> np.ndarray:
        """The value array with nothing but the constant blocks."""
        values = np.zeros(9 * len(self.starts))
        for start, value in self.constants:
            if start:
                values[start : start + 9 : 4] = value
        return values


def build_system(model: Model) -> System:
    """The flat arrays of ``model`` (see ``System``)."""
    index = body_index(model)
    blocks = _Blocks(ground=len(model.bodies))
    bodies = _bodies(model, blocks)
    coincide = _coincide(model, index, bodies, blocks)
    loads = _loads(model, index, blocks)
    return System(bodies, coincide, loads, blocks.nodes(), blocks.constant_values())


def body_index(model: Model) -> dict[str, int]:
    """Index of each body by name; every ground has the last one."""
    index = {body.name: i for i, body in enumerate(model.bodies)}
    return index | {ground.name: len(model.bodies) for ground in model.grounds}


def build_state(model: Model, system: System) -> State:
    """The state at t = 0 as the deck gives it, accelerations and forces still zero."""
    n = len(model.bodies)
    x, p, v, w = (np.zeros((n + 1, 3)) for _ in range(4))
    for i, body in enumerate(model.bodies):
        R = matrix(body.orientation)
        x[i] = add(body.position, times(R, body.r_BG))
        p[i] = body.orientation
        v[i] = times(R, add(body.velocity, cross(body.angular_velocity, body.r_BG)))
        w[i] = body.angular_velocity
    k = system.coincide.a.size
    return State(
        x=x,
        x_low=np.zeros_like(x),
        p=p,
        v=v,
        w=w,
        a=np.zeros_like(x),
        alpha=np.zeros_like(x),
        force=np.zeros((k, 3)),
        a_trend=np.zeros_like(x),
        alpha_trend=np.zeros_like(x),
        force_trend=np.zeros((k, 3)),
        gap=np.zeros((k, 3)),
        work=np.zeros(system.loads.body.size),
    )


def _bodies(model: Model, blocks: _Blocks) -> Bodies:
    n = len(model.bodies)
    inertia = np.zeros((n + 1, 3, 3))
    inertia[:n] = [body.inertia for body in model.bodies]
    places = [blocks.place(2 * b + 1, 2 * b + 1) for b in range(n + 1)]
    for b in range(n):
        blocks.constant(2 * b, 2 * b, 1.0)
    return Bodies(
        inverse_mass=np.array([1.0 / body.mass for body in model.bodies] + [0.0]),
        inertia=inertia,
        r_BG=np.array([body.r_BG for body in model.bodies] + [(0.0, 0.0, 0.0)]),
        length=np.array([_length(model, body) for body in model.bodies] + [1.0]),
        ballistic=_ballistic(model),
        gravity=np.array(model.gravity, dtype=float),
        block=np.array(places, dtype=np.int64),
    )


def _ballistic(model: Model) -> np.ndarray:
    touched = {joint.parent for joint in model.joints} | {joint.child for joint in model.joints}
    touched |= {load.body for load in model.loads}
    return np.array([*(body.name not in touched for body in model.bodies), True])


def _length(model: Model, body: RigidBody) -> float:
    """The length of a body: its radius of gyration or its longest arm, whichever is larger."""
    points = [joint.parent_point for joint in model.joints if joint.parent == body.name]
    points += [joint.child_point for joint in model.joints if joint.child == body.name]
    points += [load.point for load in model.loads if load.body == body.name]
    arms = [float(np.linalg.norm(sub(point, body.r_BG))) for point in points]
    gyration = float(np.sqrt(np.trace(np.array(body.inertia)) / (2.0 * body.mass)))
    return max([gyration, *arms])


def _arms(model: Model, names: Iterable[str], points: Sequence[Vector]) -> np.ndarray:
    """(k, 3) points of bodies from their mass centres (of the ground: from the origin)."""
    r_BG = {body.name: body.r_BG for body in model.bodies}
    arms = [
        sub(point, r_BG.get(name, (0.0, 0.0, 0.0)))
        for name, point in zip(names, points, strict=True)
    ]
    return np.array(arms, dtype=float).reshape(-1, 3)


def _indices(names: Iterable[str], index: dict[str, int]) -> np.ndarray:
    return np.array([index[name] for name in names], dtype=np.int64)


def _coincide(model: Model, index: dict[str, int], bodies: Bodies, blocks: _Blocks) -> Coincide:
    parents = [joint.parent for joint in model.joints]
    children = [joint.child for joint in model.joints]
    a, b = _indices(parents, index), _indices(children, index)
    mass = 1.0 / (bodies.inverse_mass[a] + bodies.inverse_mass[b])
    first = 2 * bodies.inverse_mass.size
    moment_by_turn, moment_by_force, gap_by_turn = (
        np.zeros((a.size, 2), dtype=np.int64) for _ in "123"
    )
    for k, pair in enumerate(zip(a.tolist(), b.tolist(), strict=True)):
        for side, (sign, body) in enumerate(zip((-1.0, 1.0), pair, strict=True)):
            u, turn, node = 2 * body, 2 * body + 1, first + k
            share = float(bodies.inverse_mass[body] * mass[k])
            blocks.constant(u, node, -sign * share)
            blocks.constant(node, u, sign)
            moment_by_turn[k, side] = blocks.place(turn, turn)
            moment_by_force[k, side] = blocks.place(turn, node)
            gap_by_turn[k, side] = blocks.place(node, turn)
    return Coincide(
        a=a,
        b=b,
        s_a=_arms(model, parents, [joint.parent_point for joint in model.joints]),
        s_b=_arms(model, children, [joint.child_point for joint in model.joints]),
        mass=mass,
        row=first + np.arange(a.size, dtype=np.int64),
        moment_by_turn=moment_by_turn,
        moment_by_force=moment_by_force,
        gap_by_turn=gap_by_turn,
    )


def _loads(model: Model, index: dict[str, int], blocks: _Blocks) -> ConcentratedLoads:
    loads = model.loads
    body = _indices((load.body for load in loads), index)
    f_axes = _indices((load.force_basis for load in loads), index)
    m_axes = _indices((load.moment_basis for load in loads), index)
    turning = np.stack([body, f_axes, m_axes], axis=1).tolist()
    moment_by_turn = [[blocks.place(2 * t[0] + 1, 2 * c + 1) for c in t] for t in turning]
    force_by_turn = [blocks.place(2 * b, 2 * c + 1) for b, c, _ in turning]
    return ConcentratedLoads(
        body=body,
        s=_arms(model, [load.body for load in loads], [load.point for load in loads]),
        f=np.array([load.force for load in loads], dtype=float).reshape(-1, 3),
        f_axes=f_axes,
        m=np.array([load.moment for load in loads], dtype=float).reshape(-1, 3),
        m_axes=m_axes,
        force_by_turn=np.array(force_by_turn, dtype=np.int64),
        moment_by_turn=np.array(moment_by_turn, dtype=np.int64).reshape(-1, 3),
    )
