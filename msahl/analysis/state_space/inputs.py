"""Inputs of a linearised model by their names in the deck: what they act on.

    NAME of a load               added to an actuator's load [N or N m], to a load's factor [-]
    NAME of a motion             second derivative of its law; the law and its rate become states
    NAME of a signal             added to its value wherever it is used
    NAME of an auxiliary state   added to its rate
    JOINT.COORDINATE             a load along the coordinate, on both bodies [N or N m]
    MARKER.Fx ... .Mz            a force or moment at a marker, along inertial axes [N, N m]
    BODY.Fx ... .Mz              likewise at a body's reference point

An input that is added to a signal is an auxiliary state that never changes: ``with_signals`` adds
it to the expression, and the derivatives by it are those by states.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import evaluate as law
from msahl.algebra.rotation import matrix
from msahl.algebra.rotation_arrays import cross, rotated
from msahl.algebra.vector import at
from msahl.analysis.linearised.coefficients import Evaluated, evaluated, result_row
from msahl.analysis.linearised.point import Point, complete
from msahl.expressions.syntax import Call, Name, Number, nearest
from msahl.joints.coordinates import (
    Motion,
    coordinates,
    geometry,
    is_angle,
    relative,
    values_and_rates,
)
from msahl.model import ConcentratedLoad, JointMotion, Model, Signal, SignalState
from msahl.model.loads import Actuator, JointActuator, MarkerActuator
from msahl.ports.concentrated import ConcentratedLoads
from msahl.run.body_rows import numbers_of_bodies
from msahl.system.arrays import node_count
from msahl.system.build import build_system
from msahl.system.names import FACTOR_COLUMN, LOAD_COLUMN
from msahl.system.state import build_state

INPUT = "{} (input)"
"""Name of the auxiliary state that is added to a signal."""
COMPONENTS = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")


class Input(NamedTuple):
    """An input: n coordinates, s auxiliary states."""

    name: str
    unit: str
    value: float  # of what it is added to, at the configuration
    force: np.ndarray  # (n,) by a unit of it [N, N m]
    state_rate: np.ndarray  # (s,)
    motion: int = -1  # number of the constraint equation whose law it is
    shown: str = ""  # column of signals.csv that it is added to
    signal: bool = False  # whether it is an auxiliary state, added to a signal


def with_signals(point: Point, names: Sequence[str]) -> Point:
    """Return the ``point`` of a model in which the signals among ``names`` have inputs."""
    model = point.model
    wanted = [s.name for s in model.signals if isinstance(s, Signal) and s.name in names]
    wanted = [name for name in wanted if not _is_element(model, name)]
    if not wanted:
        return point
    changed = [
        replace(s, expression=Call("+", (s.expression, Name(INPUT.format(s.name)))))
        if isinstance(s, Signal) and s.name in wanted
        else s
        for s in model.signals
    ]
    added = [SignalState(INPUT.format(name), Number(0.0)) for name in wanted]
    model = replace(model, signals=(*changed, *added))
    system = build_system(model)
    state = build_state(model, system)
    zeros = np.zeros(len(added))
    state = point.state._replace(
        auxiliary=np.concatenate([point.state.auxiliary, zeros]),
        reaction=point.state.reaction.copy(),
        **{name: getattr(point.state, name).copy() for name in ("a", "alpha", "force")},
        work=state.work,
    )
    return complete(model, system, state)


def _is_element(model: Model, name: str) -> bool:
    """Return whether a load or motion has this name, which then is meant."""
    return any(element.name == name for element in (*_input_loads(model), *model.motions))


def _input_loads(model: Model) -> list[Actuator | ConcentratedLoad]:
    return [load for load in model.loads if isinstance(load, Actuator | ConcentratedLoad)]


def resolve_inputs(point: Point, found: Evaluated, names: Sequence[str]) -> list[Input]:
    """Return the inputs of these names, which exist (``input_faults``)."""
    known = _known(point, found)
    return [known[name]() for name in names]


def input_faults(point: Point, names: Sequence[str]) -> list[str]:
    """Return what is wrong with the ``names`` of inputs."""
    known = _known(point, evaluated(point.system, point.state)) if names else {}
    faults = [
        f"'{name}' is no input: name an actuator, a load, a motion, a signal, an auxiliary state, "
        f"JOINT.COORDINATE, or MARKER.Fx{nearest(name, list(known))}"
        for name in names
        if name not in known
    ]
    twice = sorted({name for name in names if names.count(name) > 1})
    return faults + [f"'{name}' is an input twice; name it once" for name in twice]


def _known(point: Point, found: Evaluated) -> dict[str, Callable[[], Input]]:
    """Return what makes each input, by its name."""
    model, make = point.model, _Maker(point, found)
    states = [s.name for s in model.states]
    known: dict[str, Callable[[], Input]] = {}

    def add(name: str, function: Callable[..., Input], *given: object) -> None:
        known.setdefault(name, lambda: function(name, *given))

    for load in model.loads:
        if isinstance(load, Actuator):
            add(load.name, make.actuator, load)
        elif isinstance(load, ConcentratedLoad):
            add(load.name, make.load, load)
    for k, motion in enumerate(model.motions):
        add(motion.name, make.motion, k)
    for k, name in enumerate(states):
        if INPUT.format(name) not in states and name not in map(INPUT.format, _signals(model)):
            add(name, make.auxiliary_state, k)
    for name in _signals(model):
        add(name, make.signal, states)
    for joint in model.joints:
        for c in coordinates(joint):
            if c != "orientation":
                add(f"{joint.name}.{c}", make.coordinate, joint, c)
    for marker in model.markers:
        for component in COMPONENTS:
            add(f"{marker.name}.{component}", make.force, marker.body, marker.point, component)
    for body in model.bodies:
        for component in COMPONENTS:
            add(f"{body.name}.{component}", make.force, body.name, (0.0, 0.0, 0.0), component)
    return known


def _signals(model: Model) -> list[str]:
    return [s.name for s in model.signals if isinstance(s, Signal)]


class _Maker:
    """Makes the inputs of a model at one configuration."""

    def __init__(self, point: Point, found: Evaluated) -> None:
        self.point, self.system, self.state = point, point.system, point.state
        self.found, self.n = found, found.coordinate.size
        self.s = point.state.auxiliary.size
        self.number = np.full(3 * node_count(self.system), -1)
        self.number[found.coordinate] = np.arange(self.n)
        self.bodies = numbers_of_bodies(point.model)

    def actuator(self, name: str, load: Actuator) -> Input:
        """An input that is added to the load of an actuator."""
        r = self.point.model.actuators.index(load)
        at_coordinates = self.found.coordinate
        row = result_row(self.system, self.found.start, r)
        force = (row * self.found.force_scale)[at_coordinates]
        group = self.system.forces.signals
        assert group is not None
        value = float(self.found.start.forces.signals.values.value[group.result[r]])
        rotates = isinstance(load, JointActuator) and is_angle(load.coordinate)
        unit = "N m" if rotates else "N"
        shown = f"{name}.{LOAD_COLUMN}"
        assert isinstance(load, JointActuator | MarkerActuator)
        return Input(name, unit, value, force, np.zeros(self.s), shown=shown)

    def load(self, name: str, load: ConcentratedLoad) -> Input:
        """An input that is added to the factor of a concentrated load."""
        forces, model = self.system.forces, self.point.model
        by_expression = load.expression is not None
        alike = model.controlled if by_expression else model.concentrated
        k, value = alike.index(load), 1.0
        group = forces.concentrated
        if by_expression and forces.controlled and forces.signals:
            group = forces.controlled
            place = forces.signals.result[len(model.actuators) + k]
            value = float(self.found.start.forces.signals.values.value[place])
        elif group.law[k] >= 0:
            value = law(self.system.laws, int(group.law[k]), self.point.time)[0]
        shown = f"{name}.{FACTOR_COLUMN}" if by_expression else ""
        return Input(name, "-", value, self._unit_load(group, k), np.zeros(self.s), shown=shown)

    def _unit_load(self, group: ConcentratedLoads, k: int) -> np.ndarray:
        """(n,) load ``k`` of a group with the factor 1."""
        R = self.found.start.frames.R
        f, m = R[group.f_axes[k]] @ group.f[k], R[group.m_axes[k]] @ group.m[k]
        r = R[group.frame[k]] @ group.s[k]
        return self._at_frame(int(group.frame[k]), f, np.cross(r, f) + m)

    def _at_frame(self, f: int, force: np.ndarray, moment: np.ndarray) -> np.ndarray:
        """(n,) a force at a frame's origin and a moment."""
        row = np.zeros(self.n)
        frames = self.system.frames
        if f < len(self.state.x) - 1:
            row[self.number[3 * frames.displacement[f] + np.arange(3)]] = force
            row[self.number[3 * frames.rotation[f] + np.arange(3)]] = moment
        return row

    def motion(self, name: str, k: int) -> Input:
        """The second derivative of the law of prescribed motion ``k``."""
        scalar = self.system.scalar
        assert scalar is not None
        r = int(np.flatnonzero(scalar.equations.law >= 0)[k])
        motion = self.point.model.motions[k]
        rotates = isinstance(motion, JointMotion) and is_angle(motion.coordinate)
        value = law(self.system.laws, int(scalar.equations.law[r]), self.point.time)[2]
        rows = 3 * self.system.coincide.a.size + r
        unit = "rad/s^2" if rotates else "m/s^2"
        return Input(name, unit, value, np.zeros(self.n), np.zeros(self.s), motion=rows)

    def auxiliary_state(self, name: str, k: int) -> Input:
        """An input that is added to the rate of auxiliary state ``k``."""
        group = self.system.forces.signals
        assert group is not None
        rate = np.zeros(self.s)
        rate[k] = 1.0
        value = float(self.found.start.forces.signals.values.value[group.rate[k]])
        return Input(name, "SI/s", value, np.zeros(self.n), rate)

    def signal(self, name: str, states: list[str]) -> Input:
        """An input that is added to a signal: the column of its auxiliary state."""
        group = self.system.forces.signals
        assert group is not None
        shown = [s.name for s in self.point.model.signals if hasattr(s, "initial") or _is(s)]
        place = group.shown[shown.index(name)]
        value = float(self.found.start.forces.signals.values.value[place])
        return Input(name, "SI", value, np.zeros(self.n), np.zeros(self.s), signal=True)

    def coordinate(self, name: str, joint: object, coordinate: str) -> Input:
        """A load along a coordinate of a joint: what does work where the coordinate increases."""
        from msahl.model import Joint

        assert isinstance(joint, Joint)
        shape, force = geometry(joint), np.zeros(self.n)
        which = shape.names.index(coordinate)
        bodies = [self.bodies[joint.parent], self.bodies[joint.child]]
        for side, b in enumerate(bodies):
            if b < 0:
                continue
            both = [self._moved(other, 6, own_axes=i == side) for i, other in enumerate(bodies)]
            rates = values_and_rates(shape, relative(shape, both[0], both[1]))[1][:, which]
            force += self._at_frame(int(self.system.bodies.frame[b]), rates[:3], rates[3:])
        unit = "N m" if is_angle(coordinate) else "N"
        return Input(name, unit, 0.0, force, np.zeros(self.s))

    def _moved(self, b: int, m: int, own_axes: bool) -> Motion:
        """Body ``b`` with, in m = 6 rows, a unit of each velocity and angular velocity of its mass
        centre if they are its ``own_axes``, else at rest; -1 is the ground.
        """
        v, w = np.zeros((2, m, 3))
        if b < 0:
            still = np.zeros((m, 3))
            return Motion(still, np.broadcast_to(np.eye(3), (m, 3, 3)), v, w)
        f = int(self.system.bodies.frame[b])
        R = np.array(matrix(at(self.state.p, f)))
        arm = -R @ self.system.bodies.r_BG[b]
        if own_axes:
            v[:3] = w[3:] = np.eye(3)
        v = v + cross(w, np.broadcast_to(arm, w.shape))
        x = np.broadcast_to(self.state.x[f] + arm, (m, 3))
        return Motion(x, np.broadcast_to(R, (m, 3, 3)), v, w)

    def force(self, name: str, body: str, point: tuple[float, ...], component: str) -> Input:
        """A force or moment at a point of a body, along an inertial axis."""
        axis = np.zeros(3)
        axis[COMPONENTS.index(component) % 3] = 1.0
        b, row = self.bodies[body], np.zeros(self.n)
        unit = "N" if component[0] == "F" else "N m"
        if b >= 0:
            f = int(self.system.bodies.frame[b])
            R = np.array(matrix(at(self.state.p, f)))
            arm = rotated(R, np.array(point) - self.system.bodies.r_BG[b])
            if component[0] == "F":
                row = self._at_frame(f, axis, np.cross(arm, axis))
            else:
                row = self._at_frame(f, np.zeros(3), axis)
        return Input(name, unit, 0.0, row, np.zeros(self.s))


def _is(signal: object) -> bool:
    return isinstance(signal, Signal)
