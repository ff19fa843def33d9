"""Compute reference solutions of a model from equations that share no code with the engine.

The model's records are read here a second time. Every constraint and every load is written in
scalar *signals* of time: a signal holds its value q, its rate q', and how its second derivative
depends on the accelerations a = (v', W') of all bodies (inertial axes),

    q'' = G a + b

with G a row of 6 n numbers, which is also the gradient of q' by (v, W). Products and functions of
signals follow by the product and the chain rule, so a joint is a list of vector products. With M a
= f + G^T lam and the constraints' q'' + 2 k q' + k^2 q = 0 (Baumgarte; k damps violations by
rounding errors) the accelerations follow by least squares, for redundant joints as well. They are
integrated with the orientations as quaternions by scipy's DOP853 between the breakpoints of the
laws: breakpoints in time end an integration, breakpoints in a displacement (tables of springs,
cams) are events.

Of the engine only the records of ``msahl.model``, the values of expressions' trees, and the zero of
a joint's angle are used.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from msahl.algebra.functions import Law
from msahl.expressions.evaluate import evaluate
from msahl.expressions.syntax import Name, Tree, postorder
from msahl.joints.coordinates import angle_offset
from msahl.joints.registry import KINDS
from msahl.model import Marker, Model, SignalState, SignalTable
from msahl.model import Signal as NamedExpression
from msahl.model.couplings import Coupling
from msahl.model.joints import Joint
from msahl.model.loads import (
    Bushing,
    ConcentratedLoad,
    JointActuator,
    JointLoad,
    JointSpring,
    MarkerActuator,
    PointLoad,
    SpringDamper,
)
from msahl.model.motions import JointMotion

FINEST = 1e-13
"""Relative tolerance of a step: scipy goes no lower than 100 machine epsilons, 2.2e-14."""
APART = 10.0
"""Factor between the tolerances of the two solutions."""
ROUNDED = 8.0 * float(np.finfo(float).eps)
"""Relative change of the start between the two: the round-off of a few operations."""
SIZE = 13
"""Numbers of a body in the state vector: x_G (3), quaternion (4), v_G (3), w in body axes (3)."""
STABILISATION = 5.0
"""k of Baumgarte's method [1/s]: slower than what is integrated, so it does not limit the steps."""
POINT_FORCES: dict[str, Callable[..., np.ndarray]] = {
    "drag": lambda V, coefficient: -coefficient * np.sqrt(V @ V) * V,
}
"""Force at a point with the velocity V, by each law."""
JOINT_LOADS: dict[str, Callable[..., float]] = {
    "friction": lambda q, rate, N, coefficient, radius, width: (
        -coefficient * radius * N * np.tanh(rate / width)
    ),
}
"""Load along a coordinate q of a joint with the reaction force N, by each law."""
FRICTION_ROUNDS = 60
"""Most iterations for the normal force of friction, each a contraction by about its coefficient."""

Array = np.ndarray


@dataclass(slots=True)
class Signal:
    """A scalar or a vector (3,): its value, rate, gradient (..., 6 n) and bias."""

    value: Array
    rate: Array
    G: Array
    bias: Array

    def __add__(self, other: "Signal") -> "Signal":
        return Signal(
            self.value + other.value,
            self.rate + other.rate,
            self.G + other.G,
            self.bias + other.bias,
        )

    def __sub__(self, other: "Signal") -> "Signal":
        return self + (-1.0) * other

    def __rmul__(self, factor: float) -> "Signal":
        return Signal(factor * self.value, factor * self.rate, factor * self.G, factor * self.bias)

    def through(self, f: float, f1: float, f2: float) -> "Signal":
        """f(q) of a scalar, by the value of the function and its first two derivatives."""
        return Signal(
            np.asarray(f), f1 * self.rate, f1 * self.G, f1 * self.bias + f2 * self.rate**2
        )

    def __getitem__(self, i: int) -> "Signal":
        return Signal(self.value[i], self.rate[i], self.G[i], self.bias[i])


def times(a: Signal, b: Signal) -> Signal:
    """Product of two scalars, or scalar product of two vectors."""
    if np.ndim(a.value):
        return Signal(
            a.value @ b.value,
            a.rate @ b.value + a.value @ b.rate,
            a.value @ b.G + b.value @ a.G,
            a.value @ b.bias + b.value @ a.bias + 2.0 * (a.rate @ b.rate),
        )
    return Signal(
        a.value * b.value,
        a.rate * b.value + a.value * b.rate,
        a.value * b.G + b.value * a.G,
        a.value * b.bias + b.value * a.bias + 2.0 * a.rate * b.rate,
    )


def root(a: Signal) -> Signal:
    """Square root of a scalar."""
    r = np.sqrt(a.value)
    return a.through(r, 0.5 / r, -0.25 / r**3)


def angle_between(sine: Signal, cosine: Signal, counted: float) -> Signal:
    """The angle of sine and cosine, with the value ``counted`` over all revolutions."""
    s, c = sine.value, cosine.value
    n = s * s + c * c
    rate = (c * sine.rate - s * cosine.rate) / n
    n_rate = 2.0 * (s * sine.rate + c * cosine.rate)
    return Signal(
        np.asarray(counted),
        rate,
        (c * sine.G - s * cosine.G) / n,
        (c * sine.bias - s * cosine.bias - rate * n_rate) / n,
    )


def cross_matrix(a: Array) -> Array:
    """[a], the matrix of a x (.)."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def rotation_of(e: Array) -> Array:
    """Rotation matrix of a quaternion, body to inertial axes."""
    w, u = e[0], e[1:]
    square = e @ e
    return (np.eye(3) * (w * w - u @ u) + 2.0 * np.outer(u, u) + 2.0 * w * cross_matrix(u)) / square


def quaternion_of(p: Array) -> Array:
    """Quaternion of Wiener-Milenkovic parameters 4 tan(phi/4) u."""
    square = p @ p / 16.0
    return np.concatenate([[1.0 - square], 0.5 * p]) / (1.0 + square)


def parameters_of(e: Array) -> Array:
    """Wiener-Milenkovic parameters of a quaternion, of length 4 at most."""
    e = e / np.sqrt(e @ e)
    return (1.0 if e[0] >= 0.0 else -1.0) * 4.0 * e[1:] / (1.0 + abs(e[0]))


def interpolated(kind: str, x: Array, y: Array, u: float) -> Array:
    """Values at ``u`` between the entries ``y`` (m, ...) over ``x``, constant outside."""
    if kind == "periodic":
        return np.asarray(CubicSpline(x, y, bc_type="periodic")(u))
    u = min(max(u, float(x[0])), float(x[-1]))
    if kind == "cubic":
        return np.asarray(CubicSpline(x, y)(u))
    i = min(int(np.searchsorted(x, u, side="right")) - 1, len(x) - 2)
    share = (u - x[i]) / (x[i + 1] - x[i])
    return np.asarray((1.0 - share) * y[i] + share * y[i + 1])


class Function:
    """A law as value and two derivatives. The piece of a table or a ramp does not change until
    ``enter`` chooses another, so that an integrator never passes a breakpoint.
    """

    def __init__(self, law: Law) -> None:
        self.law, self.piece, self.shift, self.period = law, 0, 0.0, 0.0
        self.breaks = np.zeros(0)
        numbers = np.array(law.numbers)
        half = len(numbers) // 2
        if law.kind == "ramp":
            start_value, end_value, start, end = numbers
            rise, span = end_value - start_value, end - start
            c = [6.0 * rise / span**5, -15.0 * rise / span**4, 10.0 * rise / span**3, 0, 0]
            self._table(np.array([[*c, start_value]]).T, np.array([start, end]))
        elif law.kind == "linear":
            x, y = numbers[:half], numbers[half:]
            self._table(np.array([np.diff(y) / np.diff(x), y[:-1]]), x)
        elif law.kind in ("cubic", "periodic"):
            x, y = numbers[:half], numbers[half:]
            ends = "periodic" if law.kind == "periodic" else "not-a-knot"
            self._table(CubicSpline(x, y, bc_type=ends).c, x)
            self.period = float(x[-1] - x[0]) if law.kind == "periodic" else 0.0

    def _table(self, c: Array, x: Array) -> None:
        """Polynomials (k, pieces), with a constant before the first and after the last."""
        constants = np.zeros((len(c), 2))
        constants[-1] = c[-1, 0], np.polyval(c[:, -1], x[-1] - x[-2])
        pieces = np.concatenate([constants[:, :1], c, constants[:, 1:]], axis=1)
        self.pieces = [
            tuple(np.poly1d(p).deriv(k) if k else np.poly1d(p) for k in range(3)) for p in pieces.T
        ]
        self.breaks, self.origins = x, np.concatenate([x[:1], x])

    def enter(self, t: float) -> None:
        """Hold the piece that ``t`` is in."""
        if not self.breaks.size:
            return
        if self.period:
            self.shift = float(np.floor((t - self.breaks[0]) / self.period)) * self.period
        self.piece = int(np.searchsorted(self.breaks, t - self.shift, side="right"))
        if self.period:
            self.piece = min(max(self.piece, 1), len(self.breaks) - 1)

    def held(self) -> tuple[float, float]:
        """Ends of the piece that is held."""
        low = self.breaks[self.piece - 1] if self.piece > 0 else -np.inf
        high = self.breaks[self.piece] if self.piece < len(self.breaks) else np.inf
        return low + self.shift, high + self.shift

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Value and first two derivatives."""
        law = self.law
        if law.kind in ("constant", "polynomial"):
            p = np.poly1d(law.numbers[::-1])
            return float(p(t)), float(p.deriv()(t)), float(p.deriv(2)(t))
        if law.kind == "sine":
            amplitude, omega, phase, offset = law.numbers
            s, c = np.sin(omega * t + phase), np.cos(omega * t + phase)
            return offset + amplitude * s, amplitude * omega * c, -amplitude * omega**2 * s
        x = t - self.shift - self.origins[self.piece]
        value, rate, second = (float(p(x)) for p in self.pieces[self.piece])
        return value, rate, second


@dataclass(slots=True)
class Body:
    """Where a body is in one evaluation: ``place`` is its first column in gradients."""

    place: int
    x: Array
    R: Array
    v: Array
    W: Array


class Equations:
    """The accelerations of a model's bodies, and the signals that they are made of."""

    def __init__(self, model: Model) -> None:
        self.model, self.n = model, len(model.bodies)
        self.index = {b.name: i for i, b in enumerate(model.bodies)}
        self.index |= {ground.name: self.n for ground in model.grounds}
        self.joints = {joint.name: joint for joint in model.joints}
        self.r_BG = [np.array(b.r_BG) for b in model.bodies] + [np.zeros(3)]
        self.inertia = [np.array(b.inertia) for b in model.bodies]
        self.laws = {id(law): Function(law) for law in self._all_laws()}
        self.counted = sorted(self._counted())
        self.states = [s for s in model.signals if isinstance(s, SignalState)]
        self.signals = {s.name: s for s in model.signals if isinstance(s, NamedExpression)}
        self.markers = {marker.name: marker for marker in model.markers}
        self.auxiliary: dict[str, float] = {}
        self.offsets: list[float] = []
        self.origins: dict[str, float] = {}
        self.bodies: list[Body] = []
        self.angles: dict[str, float] = {}
        self.t = 0.0

    def _all_laws(self) -> list[Law]:
        lifts = [c.lift for c in self.model.couplings if c.lift]
        loads = self.model.loads
        springs = (load for load in loads if isinstance(load, JointSpring | SpringDamper))
        tables = [spring.table for spring in springs if spring.table]
        return self._laws_of_time() + lifts + tables

    def _counted(self) -> set[str]:
        """Return the joints whose angle is counted over revolutions, a component of the state."""
        names = {j.name for j in self.model.joints if j.kind == "screw"}
        for coupling in self.model.couplings:
            names.add(coupling.first)
            if coupling.kind == "gear":
                names.add(coupling.second)
        for element in (*self.model.loads, *self.model.motions):
            if (
                isinstance(element, JointSpring | JointLoad | JointMotion)
                and element.coordinate == "angle"
            ):
                names.add(element.joint)
        if any(isinstance(load, JointActuator | MarkerActuator) for load in self.model.loads):
            names |= {j.name for j in self.model.joints if "angle" in (KINDS[j.kind].pose or ())}
        return names

    # The state.

    def first(self, row: Array) -> Array:
        """The state vector of the published states ``row`` (12 n,)."""
        y = np.zeros(SIZE * self.n + len(self.counted) + len(self.states))
        y[SIZE * self.n + len(self.counted) :] = [state.initial for state in self.states]
        for b, part in enumerate(row.reshape(self.n, 12)):
            x, p, v, w = part.reshape(4, 3)
            e = quaternion_of(p)
            R, arm = rotation_of(e), self.r_BG[b]
            own = y[SIZE * b : SIZE * (b + 1)]
            own[:3], own[3:7], own[10:] = x + R @ arm, e, w
            own[7:10] = R @ (v + np.cross(w, arm))
        self._read(0.0, y)
        for k, name in enumerate(self.counted):
            joint = self.joints[name]
            sine, cosine = self._sine_and_cosine(joint)
            y[SIZE * self.n + k] = np.arctan2(sine.value, cosine.value)
        self.hold(0.0, y)
        self.offsets = []
        self.offsets = [float(q.value - target[0]) for q, target, _ in self._relative()]
        self.origins = {}
        self.origins = {key: float(q.value) for key, q in self._counted_from_start()}
        return y

    def publish(self, ys: Array) -> Array:
        """(m, 12 n) the columns of ``states.csv`` of states (m, k)."""
        table = np.zeros((len(ys), self.n, 4, 3))
        for row, y in enumerate(ys):
            for b in range(self.n):
                own = y[SIZE * b : SIZE * (b + 1)]
                R, arm, w = rotation_of(own[3:7]), self.r_BG[b], own[10:]
                table[row, b] = (
                    own[:3] - R @ arm,
                    parameters_of(own[3:7]),
                    R.T @ own[7:10] - np.cross(w, arm),
                    w,
                )
        return table.reshape(len(ys), -1)

    def _read(self, t: float, y: Array) -> None:
        self.t, self.bodies = t, []
        for b in range(self.n):
            own = y[SIZE * b : SIZE * (b + 1)]
            R = rotation_of(own[3:7])
            self.bodies.append(Body(6 * b, own[:3], R, own[7:10], R @ own[10:]))
        rest = np.zeros(3)
        self.bodies.append(Body(-1, rest, np.eye(3), rest, rest))
        rest = y[SIZE * self.n :]
        self.angles = dict(zip(self.counted, rest, strict=False))
        own = rest[len(self.counted) :]
        self.auxiliary = {s.name: float(v) for s, v in zip(self.states, own, strict=True)}

    # Signals of geometry.

    def direction(self, name: str, d: tuple[float, ...]) -> Signal:
        """A direction that is fixed in a body."""
        body = self.bodies[self.index[name]]
        a = body.R @ np.array(d)
        G = np.zeros((3, 6 * self.n))
        if body.place >= 0:
            G[:, body.place + 3 : body.place + 6] = -cross_matrix(a)
        return Signal(a, np.cross(body.W, a), G, np.cross(body.W, np.cross(body.W, a)))

    def point(self, name: str, s: tuple[float, ...]) -> Signal:
        """A point of a body, ``s`` from its B."""
        k = self.index[name]
        body = self.bodies[k]
        arm = self.direction(name, np.array(s) - self.r_BG[k])
        if body.place >= 0:
            arm.G[:, body.place : body.place + 3] = np.eye(3)
        return Signal(body.x + arm.value, body.v + arm.rate, arm.G, arm.bias)

    def across(self, e: Joint | SpringDamper | Bushing) -> Signal:
        """From the parent's point to the child's."""
        return self.point(e.child, e.child_point) - self.point(e.parent, e.parent_point)

    def slide(self, joint: Joint) -> Signal:
        """Displacement of the child's point along the parent's axis."""
        return times(self.direction(joint.parent, joint.parent_axes[2]), self.across(joint))

    def _sine_and_cosine(self, joint: Joint) -> tuple[Signal, Signal]:
        child = self.direction(joint.child, joint.child_axes[0])
        x, y = (self.direction(joint.parent, joint.parent_axes[i]) for i in (0, 1))
        return times(y, child), times(x, child)

    def coordinate(self, name: str, coordinate: str) -> Signal:
        """Return the joint coordinate: the angle or the displacement of a joint."""
        joint = self.joints[name]
        if coordinate == "slide":
            return self.slide(joint)
        return angle_between(*self._sine_and_cosine(joint), self.angles[name])

    # Constraints: signals that stay zero, those of each joint, then the relative ones.

    def of_joint(self, joint: Joint) -> list[tuple[Signal, bool]]:
        """Return the signals that a joint constrains to zero, and whether it constrains the value
        or the rate only.
        """
        x, y, z = (self.direction(joint.parent, axis) for axis in joint.parent_axes)
        a, c = (self.direction(joint.child, axis) for axis in joint.child_axes[1:])
        D = self.across(joint)
        parallel, no_rotation = [times(x, c), times(y, c)], [times(x, a)]
        on_axis, coincide = [times(x, D), times(y, D)], [D[0], D[1], D[2]]
        p = dict(joint.parameters)
        kind = joint.kind
        if kind == "distance":
            return [(self._less(root(times(D, D)), p["length"]), True)]
        if kind == "parallelCylinders":
            apart = root(times(on_axis[0], on_axis[0]) + times(on_axis[1], on_axis[1]))
            radius = abs(p["parentRadius"] + p["childRadius"])
            return [(q, True) for q in (*parallel, self._less(apart, radius))]
        if kind == "crossedCylinders":
            return [(self._skew(z, c, D, p["parentRadius"] + p["childRadius"]), True)]
        if kind == "knifeEdge":
            return [(self._slip(c, self.point(joint.child, joint.child_point)), False)]
        if kind == "rollingDisk":
            return self._disk(joint, p["radius"])
        radius = p.get("radius", 0.0)
        lists = {
            "rigid": [*coincide, *parallel, *no_rotation],
            "revolute": [*coincide, *parallel],
            "prismatic": [*on_axis, *parallel, *no_rotation],
            "cylindrical": [*on_axis, *parallel],
            "screw": [*on_axis, *parallel],
            "universal": [*coincide, times(z, c)],
            "spherical": coincide,
            "planar": [times(z, D), *parallel],
            "pointOnLine": on_axis,
            "edgeSlider": [times(z, D), times(z, c)],
            "cylindricalSlider": [self._less(times(z, D), radius), times(z, c)],
            "pointSlider": [times(z, D)],
            "sphericalSlider": [self._less(times(z, D), radius)],
        }
        return [(q, True) for q in lists[kind]]

    def _less(self, q: Signal, value: float) -> Signal:
        return Signal(q.value - value, q.rate, q.G, q.bias)

    def _skew(self, d: Signal, e: Signal, D: Signal, distance: float) -> Signal:
        """(D . d x e)^2 less the distance squared times (d x e)^2: crossed axes at a distance."""
        a, b, s = times(D, d), times(D, e), times(d, e)
        square = times(s, s)
        sine = Signal(1.0 - square.value, -square.rate, -square.G, -square.bias)
        # (D . d x e)^2 is Gram's determinant of D, d, e.
        gram = times(times(D, D), sine) - times(a, a) - times(b, b) + 2.0 * times(times(s, a), b)
        return (0.5 / distance) * (gram - distance**2 * sine)

    def _slip(self, n: Signal, point: Signal) -> Signal:
        """Rate of a point along a direction, as the rate of a signal that has no value."""
        return Signal(
            np.asarray(0.0),
            n.value @ point.rate,
            n.value @ point.G,
            n.value @ point.bias + n.rate @ point.rate,
        )

    def _disk(self, joint: Joint, r: float) -> list[tuple[Signal, bool]]:
        """The rim's lowest point is in the plane, and has no velocity."""
        e = self.direction(joint.child, joint.child_axes[2])
        x, y, n = (self.direction(joint.parent, axis) for axis in joint.parent_axes)
        lean = times(n, e)
        square = times(lean, lean)
        upright = root(Signal(1.0 - square.value, -square.rate, -square.G, -square.bias))
        height = times(n, self.across(joint)) - r * upright
        # To the lowest point: rho = -r (n - (n.e) e)/upright, as the ground's n is at rest.
        flat, k = n.value - lean.value * e.value, upright.value
        rho = -r * flat / k
        flat_rate = -lean.rate * e.value - lean.value * e.rate
        rho_rate = -r * flat_rate / k + r * flat * upright.rate / k**2
        body, centre = (
            self.bodies[self.index[joint.child]],
            self.point(joint.child, joint.child_point),
        )
        G = centre.G.copy()
        G[:, body.place + 3 : body.place + 6] -= cross_matrix(rho)
        low = Signal(
            rho, centre.rate + np.cross(body.W, rho), G, centre.bias + np.cross(body.W, rho_rate)
        )
        return [(height, True), (self._slip(x, low), False), (self._slip(y, low), False)]

    def _relative(self) -> list[tuple[Signal, tuple[float, float, float], float]]:
        """Signals that follow a law, (value, rate, second derivative) of it, from what they differ
        by at t = 0.
        """
        found = []
        none = (0.0, 0.0, 0.0)
        for joint in self.model.joints:
            if joint.kind == "screw":
                lead = joint.parameter("pitch") / (2.0 * np.pi)
                found.append(
                    (self.slide(joint) - lead * self.coordinate(joint.name, "angle"), none)
                )
        for coupling in self.model.couplings:
            found.append((self._coupled(coupling), none))
        for motion in self.model.motions:
            if isinstance(motion, JointMotion):
                q = self.coordinate(motion.joint, motion.coordinate)
            else:
                ground = self.model.grounds[0].name
                q = times(
                    self.direction(ground, motion.direction), self.point(motion.body, motion.point)
                )
            found.append((q, self.laws[id(motion.law)](self.t)))
        offsets = self.offsets or [0.0] * len(found)
        return [(q, law, offset) for (q, law), offset in zip(found, offsets, strict=True)]

    def _coupled(self, coupling: Coupling) -> Signal:
        leader = self.coordinate(coupling.first, "angle")
        kind = "angle" if coupling.kind == "gear" else "slide"
        follower = self.coordinate(coupling.second, kind)
        if coupling.lift is None:
            return follower - coupling.ratio * leader
        return follower - leader.through(*self.laws[id(coupling.lift)](float(leader.value)))

    def violation(self) -> tuple[float, float]:
        """Largest violation of the joints' constraints in the state read last, and its rate."""
        found = [pair for joint in self.model.joints for pair in self.of_joint(joint)]
        values = [abs(float(q.value)) for q, closed in found if closed]
        return max(values, default=0.0), max((abs(float(q.rate)) for q, _ in found), default=0.0)

    # Loads.

    def _counted_from_start(self) -> list[tuple[str, Signal]]:
        """Signals of springs, by a key, that count from t = 0."""
        found = []
        for load in self.model.loads:
            if isinstance(load, JointSpring):
                found.append((load.name, self.coordinate(load.joint, load.coordinate)))
            elif isinstance(load, SpringDamper) and load.free_length is None:
                D = self.across(load)
                found.append((load.name, root(times(D, D))))
            elif isinstance(load, Bushing):
                found += [(f"{load.name}.{i}", q) for i, q in enumerate(self._bushing(load))]
        return found

    def _bushing(self, load: Bushing) -> list[Signal]:
        frame = [self.direction(load.parent, axis) for axis in load.parent_axes]
        child = [self.direction(load.child, axis) for axis in load.child_axes]
        D = self.across(load)
        pairs = ((2, 1), (0, 2), (1, 0))
        return [times(axis, D) for axis in frame] + [times(frame[i], child[j]) for i, j in pairs]

    def _springs(self) -> list[tuple[Signal, float, float, float, Law | None]]:
        """Signal of each spring from its free value, stiffness, damping, preload and table."""
        from_start = {
            key: self._less(q, self.origins.get(key, 0.0)) for key, q in self._counted_from_start()
        }
        found = []
        for load in self.model.loads:
            if isinstance(load, JointSpring):
                q = from_start[load.name]
                # A table is over what is counted from t = 0, a stiffness over what is from free.
                q = q if load.table else self._less(q, load.free)
                found.append((q, load.stiffness, load.damping, load.preload, load.table))
            elif isinstance(load, SpringDamper):
                D = self.across(load)
                q = root(times(D, D))
                if load.free_length is None and not load.table:
                    q = from_start[load.name]
                elif not load.table:
                    assert load.free_length is not None
                    q = self._less(q, load.free_length)
                found.append((q, load.stiffness, load.damping, load.preload, load.table))
            elif isinstance(load, Bushing):
                for i in range(6):
                    q = from_start[f"{load.name}.{i}"]
                    found.append((q, load.stiffness[i], load.damping[i], 0.0, None))
        return found

    def loads(self) -> Array:
        """(6 n,) generalised force of gravity, gyroscopic moments, loads and springs."""
        f = np.zeros(6 * self.n)
        for b, (body, record) in enumerate(zip(self.bodies, self.model.bodies, strict=False)):
            f[6 * b : 6 * b + 3] = record.mass * np.array(self.model.gravity)
            J = body.R @ self.inertia[b] @ body.R.T
            f[6 * b + 3 : 6 * b + 6] = -np.cross(body.W, J @ body.W)
        for q, k, c, preload, table in self._springs():
            tension = self.laws[id(table)](float(q.value))[0] if table else preload + k * q.value
            f -= (tension + c * q.rate) * q.G
        for load in self.model.loads:
            if isinstance(load, ConcentratedLoad):
                f += self._concentrated(load)
            elif isinstance(load, PointLoad):
                P = self.point(load.body, load.point)
                f += POINT_FORCES[load.law](P.rate, **dict(load.parameters)) @ P.G
            elif isinstance(load, JointActuator):
                f += self.value(load.expression) * self.coordinate(load.joint, load.coordinate).G
            elif isinstance(load, MarkerActuator):
                here, there = (self.markers[name] for name in (load.start, load.end))
                D = self.point(there.body, there.point) - self.point(here.body, here.point)
                f += self.value(load.expression) * root(times(D, D)).G
        return f

    # Expressions of the motion.

    def value(self, tree: Tree) -> float:
        """Return the value of an expression in the present state."""
        names = {n.text: self._named(n.text) for n in postorder(tree) if isinstance(n, Name)}
        return evaluate(tree, names, {s.name: self._table(s) for s in self._tables()})

    def _tables(self) -> list[SignalTable]:
        return [signal for signal in self.model.signals if isinstance(signal, SignalTable)]

    def _table(self, signal: SignalTable) -> Callable[..., float]:
        table = signal.table
        if isinstance(table, Law):
            x, y = np.array(table.numbers).reshape(2, -1)
            return lambda u: float(interpolated(table.kind, x, y, u))
        grid, values = (np.array(table.x), np.array(table.y)), np.array(table.values)

        def surface(u: float, v: float) -> float:
            return float(
                interpolated(table.kind, grid[1], interpolated(table.kind, grid[0], values, u), v)
            )

        return surface

    def _named(self, name: str) -> float:
        if name == "t":
            return self.t
        if name in self.auxiliary:
            return self.auxiliary[name]
        if name in self.signals:
            return self.value(self.signals[name].expression)
        element, value = name.rsplit(".", 1)
        if element in self.markers:
            return float(self._marker(self.markers[element])[value])
        q = self.coordinate(element, value.removesuffix("Rate"))
        if value.endswith("Rate"):
            return float(q.rate)
        return float(q.value) + (angle_offset(self.joints[element]) if value == "angle" else 0.0)

    def _marker(self, marker: Marker) -> dict[str, float]:
        P = self.point(marker.body, marker.point)
        body, axes = self.bodies[self.index[marker.body]], np.array(marker.axes)
        q = Rotation.from_matrix(body.R @ axes.T).as_quat(canonical=True)
        names = ("x", "y", "z", "vx", "vy", "vz", "wx", "wy", "wz", "q1", "q2", "q3", "q0")
        numbers = np.concatenate([P.value, P.rate, axes @ (body.R.T @ body.W), q])
        return dict(zip(names, numbers.tolist(), strict=True))

    def _concentrated(self, load: ConcentratedLoad) -> Array:
        size = self.laws[id(load.law)](self.t)[0] if load.law else 1.0
        if load.expression is not None:
            size = self.value(load.expression)
        force = self.bodies[self.index[load.force_basis]].R @ np.array(load.force)
        moment = self.bodies[self.index[load.moment_basis]].R @ np.array(load.moment)
        f = force @ self.point(load.body, load.point).G
        place = self.bodies[self.index[load.body]].place
        f[place + 3 : place + 6] += moment
        return size * f

    # Accelerations.

    def accelerations(self) -> tuple[Array, Array, Array]:
        """a (6 n,), the multipliers, and the first row of each joint."""
        G: list[Array] = []
        right: list[Array] = []
        starts: list[int] = []
        k = STABILISATION
        for joint in self.model.joints:
            starts.append(len(G))
            for q, closed in self.of_joint(joint):
                G.append(q.G)
                right.append(-q.bias - 2.0 * k * q.rate - (k * k * q.value if closed else 0.0))
        starts.append(len(G))
        for q, (value, rate, second), offset in self._relative():
            G.append(q.G)
            off = q.value - value - offset
            right.append(second - q.bias - 2.0 * k * (q.rate - rate) - k * k * off)
        rows = np.array(G).reshape(len(G), 6 * self.n)
        solve = self._solver(rows, np.array(right))
        f = self.loads()
        a, multipliers = solve(f)
        along = [load for load in self.model.loads if isinstance(load, JointLoad)]
        if along:
            a, multipliers = self._with_joint_loads(along, f, rows, starts, solve, multipliers)
        return a, multipliers, np.array(starts)

    def _solver(self, G: Array, right: Array) -> Callable[[Array], tuple[Array, Array]]:
        inverse = np.zeros((6 * self.n, 6 * self.n))
        for b, body in enumerate(self.bodies[:-1]):
            i = 6 * b
            inverse[i : i + 3, i : i + 3] = np.eye(3) / self.model.bodies[b].mass
            J = np.linalg.inv(self.inertia[b])
            inverse[i + 3 : i + 6, i + 3 : i + 6] = body.R @ J @ body.R.T
        if not len(G):
            return lambda f: (inverse @ f, np.zeros(0))
        A = G @ inverse @ G.T
        # Rows in radians and in metres, light and heavy: the cut in rank is of the scaled matrix.
        size = 1.0 / np.sqrt(np.diag(A))
        pseudo = np.linalg.pinv(size[:, None] * A * size, rcond=1e-11, hermitian=True)

        def solve(f: Array) -> tuple[Array, Array]:
            free = inverse @ f
            lam = size * (pseudo @ (size * (right - G @ free)))
            # Once more with what is left over: the matrix has the squared condition of its factors.
            lam += size * (pseudo @ (size * (right - G @ (free + inverse @ (G.T @ lam)))))
            return free + inverse @ (G.T @ lam), lam

        return solve

    def _with_joint_loads(
        self,
        along: list[JointLoad],
        f: Array,
        G: Array,
        starts: list[int],
        solve: Callable[[Array], tuple[Array, Array]],
        lam: Array,
    ) -> tuple[Array, Array]:
        """The accelerations with normal forces that agree with them."""
        names = list(self.joints)
        for _ in range(FRICTION_ROUNDS):
            total = f.copy()
            for of in along:
                q = self.coordinate(of.joint, of.coordinate)
                j = names.index(of.joint)
                place = self.bodies[self.index[self.joints[of.joint].child]].place
                rows = slice(starts[j], starts[j + 1])
                N = np.linalg.norm(lam[rows] @ G[rows, place : place + 3])
                law = JOINT_LOADS[of.law]
                angular = of.coordinate == "angle"
                value = q.value + (angle_offset(self.joints[of.joint]) if angular else 0.0)
                total += law(value, q.rate, N, **dict(of.parameters)) * q.G
            a, new = solve(total)
            done = np.abs(new - lam).max() <= 1e-15 * np.abs(new).max()
            lam = new
            if done:
                break
        return a, lam

    def rates(self, t: float, y: Array) -> Array:
        """dy/dt."""
        self._read(t, y)
        a, _, _ = self.accelerations()
        dy = np.empty_like(y)
        for b, body in enumerate(self.bodies[:-1]):
            i, w = SIZE * b, y[SIZE * b + 10 : SIZE * b + 13]
            e = y[i + 3 : i + 7]
            dy[i : i + 3] = body.v
            dy[i + 3] = -0.5 * (e[1:] @ w)
            dy[i + 4 : i + 7] = 0.5 * (e[0] * w + np.cross(e[1:], w))
            # The length of the quaternion is drawn to one, as the constraints are to zero.
            dy[i + 3 : i + 7] += STABILISATION * (1.0 - e @ e) * e
            dy[i + 7 : i + 10] = a[6 * b : 6 * b + 3]
            dy[i + 10 : i + 13] = body.R.T @ a[6 * b + 3 : 6 * b + 6]
        for k, name in enumerate(self.counted):
            dy[SIZE * self.n + k] = self.coordinate(name, "angle").rate
        for k, state in enumerate(self.states, start=SIZE * self.n + len(self.counted)):
            dy[k] = self.value(state.rate)
        return dy

    def hold(self, t: float, y: Array) -> None:
        """Hold the pieces of all laws that the time and the displacements are in or enter."""
        self._read(t, y)
        of_time = [(t, 1.0, law) for law in self._laws_of_time()]
        for argument, rate, law in of_time + self._displacements():
            # At a breakpoint, to the side towards which the argument moves.
            ahead = np.copysign(1e-12 * max(1.0, abs(argument)), rate)
            self.laws[id(law)].enter(argument + ahead)

    def events(self) -> list[Callable[[float, Array], float]]:
        """Functions that rise through zero where a table of a displacement is left."""
        found = []
        for i, (_, _, law) in enumerate(self._displacements()):
            low, high = self.laws[id(law)].held()
            found += [self._leaving(i, end, sign) for end, sign in ((low, -1.0), (high, 1.0))]
        return found

    def _leaving(self, number: int, end: float, sign: float) -> Callable[[float, Array], float]:
        def event(t: float, y: Array) -> float:
            self._read(t, y)
            return sign * (self._displacements()[number][0] - end)

        event.terminal, event.direction = True, 1  # type: ignore[attr-defined]
        return event

    def _displacements(self) -> list[tuple[float, float, Law]]:
        """Every law of a displacement with its argument and the rate of that."""
        found = [(float(q.value), float(q.rate), law) for q, *_, law in self._springs() if law]
        for coupling in self.model.couplings:
            if coupling.lift:
                q = self.coordinate(coupling.first, "angle")
                found.append((float(q.value), float(q.rate), coupling.lift))
        return found

    def _laws_of_time(self) -> list[Law]:
        laws = [motion.law for motion in self.model.motions]
        loads = (load for load in self.model.loads if isinstance(load, ConcentratedLoad))
        return laws + [load.law for load in loads if load.law]

    def breaks(self, t_final: float) -> list[float]:
        """Return the breakpoints of the laws of time up to the end."""
        found = {t_final}
        for law in self._laws_of_time():
            function = self.laws[id(law)]
            repeats = int(t_final / function.period) + 2 if function.period else 1
            for k in range(repeats):
                found |= {float(x + k * function.period) for x in function.breaks}
        return sorted(t for t in found if 0.0 < t <= t_final)


@dataclass(frozen=True)
class Truth:
    """Published states (m, 12 n) at ``times``. ``other`` is a second solution with ``APART`` times
    the tolerance, from an initial state that is rounded differently: the difference of the two is
    larger than the error of the first, and includes the effect of rounding the initial state.
    ``opened`` and ``opened_rate`` are the initial constraint violation at position and velocity
    level. ``columns`` are signals by name. ``exact`` are positions (m, p, 3) of the bodies
    ``where`` (p,), if they are known apart from the mesh of beams.
    """

    times: Array
    states: Array
    other: Array
    opened: float = 0.0
    opened_rate: float = 0.0
    columns: dict[str, Array] = field(default_factory=dict)
    other_columns: dict[str, Array] = field(default_factory=dict)
    where: Array | None = None
    exact: Array | None = None
    exact_other: Array | None = None


def truth(model: Model, start: Array, times: Array) -> Truth:
    """The solution from the published states ``start`` (12 n,) at increasing ``times`` from 0."""
    equations = Equations(model)
    signs = np.where(np.random.default_rng(0).random(start.size) < 0.5, -1.0, 1.0)
    cases = (start, FINEST), (start * (1.0 + ROUNDED * signs), APART * FINEST)
    tables = [
        equations.publish(solve(equations, equations.first(row), times, rtol))
        for row, rtol in cases
    ]
    equations.first(start)
    states, other = tables
    opened, opened_rate = equations.violation()
    return Truth(times, states, other, opened, opened_rate)


def solve(equations: Equations, first: Array, times: Array, rtol: float) -> Array:
    """(m, k) the state vector at the increasing ``times``, the first of which is 0."""
    ys = np.empty((len(times), len(first)))
    ys[0], y, t, done = first, first, 0.0, 1
    for end in equations.breaks(float(times[-1])):
        while t < end:
            equations.hold(t, y)
            found = solve_ivp(
                equations.rates,
                (t, end),
                y,
                "DOP853",
                t_eval=np.append(times[(times > t) & (times < end)], end),
                events=equations.events(),
                rtol=rtol,
                atol=1e-2 * rtol * np.maximum(1.0, np.abs(first)),
            )
            if found.status < 0:
                raise ArithmeticError(f"t = {t:g} s: {found.message}")
            inside = np.reshape(found.y, (len(y), -1)).T
            if found.status == 1:  # a breakpoint: the event holds the state
                hits = zip(found.t_events, found.y_events, strict=True)
                t, y = min(
                    ((float(at[0]), ys[0]) for at, ys in hits if len(at)), key=lambda h: h[0]
                )
            else:
                t, y = end, inside[-1]
                inside = inside if end in times else inside[:-1]
            ys[done : done + len(inside)] = inside
            done += len(inside)
    return ys
