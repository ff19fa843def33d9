"""Loads of every body at output times: reactions, applied loads, gravity and inertia loads.

    m g + sum F - m a = 0 ,    sum M_G - J alpha - omega x J omega = 0

The index-1 problem of a row of states gives accelerations and multipliers; a joint, coupling or
motion acts with its columns of the constraints' matrix, an applied load with what it adds to the
forces of the model without loads. All loads are given in the axes of their body.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import rotations
from msahl.formulations.absolute.frames import first_multiplier
from msahl.formulations.absolute.rigid_body import read_states
from msahl.model import Model
from msahl.post.loads.points import Place, places_of
from msahl.post.replay import body_columns, count_to
from msahl.results.info import ResultError
from msahl.results.read import Run
from msahl.start.velocities import solve_accelerations, solve_at_rest
from msahl.system import evaluate
from msahl.system.arrays import State, System, new_system_workspace, node_count
from msahl.system.build import build_system
from msahl.system.evaluate import jacobian_at_rest
from msahl.system.reductions import all_unknowns
from msahl.system.state import build_state
from msahl.system.unknowns import choose
from msahl.system.work_arrays import PlainFirst, WorkArrays

REACTION, LOAD, GRAVITY, INERTIA = "reaction", "load", "gravity", "inertia"
BALANCE = 1e-9
"""What the loads of a body may leave over, as a part of the largest load: a thousand times what the
refined solutions of the equations of motion leave over."""
REFINEMENTS = 2
"""Each leaves a part of 1e-7 or less of what the one before did."""


class Wrench(NamedTuple):
    """A load on a body: a ``force`` (3,) [N] at a ``point`` (3,) [m] from the body's B and a
    ``moment`` (3,) [N m] about that, in the body's axes."""

    body: str
    element: str
    kind: str
    point: np.ndarray
    force: np.ndarray
    moment: np.ndarray


class Motion(NamedTuple):
    """Of a body, in its axes: acceleration of the mass centre [m/s^2], angular velocity [rad/s],
    angular acceleration [rad/s^2] and the gravity vector [m/s^2], each (3,)."""

    acceleration: np.ndarray
    spin: np.ndarray
    spin_rate: np.ndarray
    gravity: np.ndarray


class Instant(NamedTuple):
    """All loads of all bodies at an output time [s], and the bodies' motions by name."""

    time: float
    loads: list[Wrench]
    motions: dict[str, Motion]


class _Part:
    """A model with all or some of its loads, at the output times of a run one after the other."""

    def __init__(self, model: Model, run: Run) -> None:
        self.system: System = build_system(model)
        self.state: State = build_state(model, self.system)
        self.start = new_system_workspace(self.system, self.state)
        self.call = PlainFirst(self.system)
        self._table, self._time = body_columns(run, slice(0, len(run.time))), run.time
        signals = run.others.get("signals")
        names = [state.name for state in model.states]
        self._auxiliary = signals[names].to_numpy() if signals is not None and names else None
        self._mass = [body.mass for body in model.bodies]
        self._row = -1

    def go_to(self, row: int) -> None:
        """Set the state to a later row, counting the revolutions of joints up to it."""
        system, state = self.system, self.state
        places = (state.x, state.p, state.v, state.w)
        for k in range(self._row + 1, row + 1):
            if self._auxiliary is not None:
                state.auxiliary[:] = self._auxiliary[k]
            self.call(read_states, system.bodies, self._table, k, *places)
            count_to(system, state, self.start, self._time[k], self.call)
        self._row = row

    def forces(self) -> np.ndarray:
        """Return the right-hand side of the index-1 problem (nodes, 3) [m/s^2]."""
        rows, Z = np.zeros((2, node_count(self.system), 3))
        self.call(evaluate.prepare, self.system, self.state, self.start)
        self.call(evaluate.free_acceleration, self.system, self.state, self.start, Z, rows)
        return rows

    def on_bodies(self, rows: np.ndarray) -> np.ndarray:
        """Return forces [N] and moments [N m] on the bodies, (2, bodies, 3), of ``rows`` of the
        equations (nodes, 3). The length of a body, by which its rows are scaled, depends on the
        loads that the system has."""
        frames, f = self.system.frames, self.system.bodies.frame
        mass = np.array(self._mass)[:, None]
        moments = mass * frames.length[f, None] * rows[frames.rotation[f]]
        return np.array([mass * rows[frames.displacement[f]], moments])


class BodyLoads:
    """The loads of the bodies of a ``run``; raises ``ResultError`` for a model with elements whose
    loads it does not compute."""

    def __init__(self, run: Run) -> None:
        _require_known(run)
        self.model = model = run.model
        self._all = _Part(model, run)
        # A signal may name any joint and marker, and none names a load.
        self._none = _Part(replace(model, loads=()), run)
        self._each = [_Part(replace(model, loads=(load,)), run) for load in model.loads]
        self._unknowns = choose(self._all.system, all_unknowns(self._all.system))
        self._time = run.time
        self._places = {
            element.name: list(places_of(model, element))
            for element in (*model.constrained, *model.loads)
        }

    def at(self, row: int) -> Instant:
        """Return all loads at a ``row``; rows are asked for in their order."""
        for part in (self._all, self._none, *self._each):
            part.go_to(row)
        system, state = self._all.system, self._all.state
        work_arrays = WorkArrays(self._all.start, _at_rest(state), self._all.call)
        solve_accelerations(system, state, self._unknowns, None, work_arrays)
        for _ in range(REFINEMENTS):
            self._refine()
        R = rotations(state.p)
        loads = [*self._reactions(R), *self._applied(R), *self._own(R)]
        motions = {body.name: self._motion(b, R) for b, body in enumerate(self.model.bodies)}
        _require_balance(loads, self.model, float(self._time[row]))
        return Instant(float(self._time[row]), loads, motions)

    def _refine(self) -> None:
        """Solve for what the accelerations and multipliers leave over in their equations: the
        factors of bodies of very different masses leave more than round-off."""
        system, state = self._all.system, self._all.state
        frames, first = system.frames, first_multiplier(system.frames)
        values = jacobian_at_rest(system, state)
        row, column = system.blocks.T
        x = np.zeros((node_count(system), 3))
        x[frames.displacement] = state.a
        x[frames.rotation] = state.alpha * frames.length[:, None]
        x[first:] = state.force / system.unit
        left = self._all.forces()
        products = np.einsum("kij,kj->ki", values.reshape(-1, 3, 3), x[column])
        np.subtract.at(left, row, products)
        change = solve_at_rest(system, state, left, self._unknowns, values)
        state.a[:] += change[frames.displacement]
        state.alpha[:] += change[frames.rotation] / frames.length[:, None]
        state.force[:] += change[first:] * system.unit

    def _reactions(self, R: np.ndarray) -> Iterator[Wrench]:
        """Yield the loads of joints, couplings and motions: minus the columns of their multipliers
        in the equations of motion."""
        system, state = self._all.system, self._all.state
        first = first_multiplier(system.frames)
        values = jacobian_at_rest(system, state).reshape(-1, 3, 3)
        row, column = system.blocks.T
        of_force = (row < first) & (column >= first)
        multipliers = state.force / system.unit
        for k, element in enumerate(self.model.constrained):
            rows = np.zeros((node_count(system), 3))
            for block in np.flatnonzero(of_force):
                node = column[block] - first
                if system.multipliers.element[node] == k:
                    rows[row[block]] -= values[block] @ multipliers[node]
            yield from self._wrenches(element, REACTION, self._all.on_bodies(rows), R)

    def _applied(self, R: np.ndarray) -> Iterator[Wrench]:
        """Yield the applied loads: by what each adds to the forces without loads."""
        without = self._none.on_bodies(self._none.forces())
        reaction = self._all.state.reaction
        for load, part in zip(self.model.loads, self._each, strict=True):
            part.state.reaction[:] = reaction
            yield from self._wrenches(load, LOAD, part.on_bodies(part.forces()) - without, R)

    def _wrenches(
        self, element: Any, kind: str, forces: np.ndarray, R: np.ndarray
    ) -> Iterator[Wrench]:
        """Yield the loads of an element from forces and moments on the bodies (2, bodies, 3)."""
        system, state = self._all.system, self._all.state
        for b, body in enumerate(self.model.bodies):
            f = system.bodies.frame[b]
            F, M = forces[:, b]
            place = next((p for p in self._places[element.name] if p.body == body.name), None)
            if place is None or not (F.any() or M.any()):
                continue
            arm = self._point(place, R) - state.x[f]
            point = np.array(body.r_BG) + R[f].T @ arm
            M = M - np.cross(arm, F)
            yield Wrench(body.name, element.name, kind, point, R[f].T @ F, R[f].T @ M)

    def _point(self, place: Place, R: np.ndarray) -> np.ndarray:
        """Return a point in inertial axes [m]."""
        names = [body.name for body in self.model.bodies]
        if place.owner not in names:
            return np.array(place.point)
        b = names.index(place.owner)
        f = self._all.system.bodies.frame[b]
        offset = np.array(place.point) - np.array(self.model.bodies[b].r_BG)
        return np.asarray(self._all.state.x[f] + R[f] @ offset)

    def _motion(self, b: int, R: np.ndarray) -> Motion:
        state, f = self._all.state, self._all.system.bodies.frame[b]
        back = R[f].T
        gravity = back @ np.array(self.model.gravity)
        return Motion(back @ state.a[f], state.w[f].copy(), back @ state.alpha[f], gravity)

    def _own(self, R: np.ndarray) -> Iterator[Wrench]:
        """Yield gravity and inertia load of every body, at its mass centre."""
        for b, body in enumerate(self.model.bodies):
            motion, J, G = self._motion(b, R), np.array(body.inertia), np.array(body.r_BG)
            w = motion.spin
            moment = -J @ motion.spin_rate - np.cross(w, J @ w)
            weight = body.mass * motion.gravity
            yield Wrench(body.name, "", GRAVITY, G, weight, np.zeros(3))
            yield Wrench(body.name, "", INERTIA, G, -body.mass * motion.acceleration, moment)


def left_over(loads: Sequence[Wrench], body: str, centre: np.ndarray) -> tuple[float, float]:
    """Return the largest component of the sum of forces [N], and of moments [N m] about the mass
    ``centre`` (3,) [m], of all loads of a body: zero to round-off."""
    own = [load for load in loads if load.body == body]
    force = sum((load.force for load in own), np.zeros(3))
    moment = sum(
        (load.moment + np.cross(load.point - centre, load.force) for load in own), np.zeros(3)
    )
    return float(np.abs(force).max()), float(np.abs(moment).max())


def _require_balance(loads: Sequence[Wrench], model: Model, time: float) -> None:
    """Raise ``ResultError`` if the loads of a body are not in balance."""
    for body in model.bodies:
        own = [load for load in loads if load.body == body.name]
        centre = np.array(body.r_BG)
        force = max(float(np.abs(load.force).max()) for load in own)
        arm = max(float(np.abs(load.point - centre).max()) for load in own)
        moment = max(arm * force, *(float(np.abs(load.moment).max()) for load in own))
        of_force, of_moment = left_over(loads, body.name, centre)
        if of_force > BALANCE * force or of_moment > BALANCE * moment:
            raise ResultError(
                f"body '{body.name}' has loads at {time:g} s that are not in balance: "
                f"{of_force:.3g} N and {of_moment:.3g} N-m are left over"
            )


def _require_known(run: Run) -> None:
    """Raise ``ResultError`` if a model has elements whose loads are not known here."""
    model = run.model
    found = {
        "beams": model.beams,
        "elastic bodies": model.elastic_bodies,
        "contacts": model.contacts,
        "events": (*model.events, *model.released),
        "springs in the compliance form": [
            load for load in model.loads if getattr(load, "compliance", False)
        ],
    }
    words = [name for name, elements in found.items() if elements]
    if words:
        raise ResultError(
            f"loads are exported of models without {' and '.join(words)}; this one has some"
        )


def _at_rest(state: State) -> State:
    return state._replace(v=np.zeros_like(state.v), w=np.zeros_like(state.w))
