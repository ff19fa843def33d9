"""Impulses that events give: the jump of velocities by an impulse L along a rate s.

    [ M  -G^T ] [ dv ]   [ s_v^T L ]        s+ = s- + W L,    W = s_v dv/dL
    [ G    0  ] [ mu ] = [    0    ]

by the matrix of the index-1 problem, with joints, couplings and prescribed motions and without
contacts, whose impacts follow. Prescribed motions do work by impulses of their own; the rest of
the change of the energy is the work of the impulse, L (s+ + s-)/2.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import cross, sub
from msahl.elements.constraints import coordinates, scalar
from msahl.formulations.absolute.equations import push
from msahl.joints.expression_values import RATE
from msahl.model import Model
from msahl.model.events import Impulse
from msahl.start.velocities import add_to_velocities, solve_at_rest
from msahl.system import evaluate
from msahl.system.arrays import State, System, node_count
from msahl.system.collect import collect, frame_index
from msahl.system.unknowns import Unknowns
from msahl.system.work_arrays import WorkArrays, energy, rigid_at_rest

MOVES = 1e-12
"""Change of a rate by a unit impulse, over that without joints, that is none but for round-off."""


class Given(NamedTuple):
    """What an impulse did: the rates along it before and after, its size, and its work [J]."""

    before: float
    after: float
    size: float
    work: float


class Impulses:
    """Impulses on the bodies of a ``system`` of the ``model``, in its ``state``."""

    def __init__(self, model: Model, system: System, state: State, work: WorkArrays) -> None:
        self.system, self.state, self.work_arrays = system, state, work
        self.frame = frame_index(model)
        bodies = {body.name: body for body in model.bodies}
        self.arm = {
            m.name: sub(m.point, bodies[m.body].r_BG) for m in model.markers if m.body in bodies
        }
        self.body = {marker.name: marker.body for marker in model.markers}
        entries = collect(model).signals
        self.inputs = [] if entries is None else [entry.name for entry in entries.inputs]

    def give(self, impulse: Impulse, value: float, unknowns: Unknowns) -> Given | None:
        """Change the velocities by an ``impulse`` of this ``value``; ``unknowns`` are those without
        contacts. Returns None, and changes nothing, where joints and prescribed motions leave no
        change of the velocity along it.
        """
        system, state, frames = self.system, self.state, self.system.frames
        before, load = energy(system, state, self.work_arrays), self._unit_load(impulse)
        R, v, W = (array.copy() for array in self.work_arrays.start.frames[:3])
        values = rigid_at_rest(system, state, self.work_arrays)
        motion = solve_at_rest(system, state, load, unknowns, values)
        self.work_arrays.call(evaluate.prepare, system, state, self.work_arrays.start)
        rate, moved = self._rate(impulse, v, W), self._rate(impulse, *self._motion(motion))
        size = value
        if impulse.changes_velocity:
            if moved <= MOVES * self._rate(impulse, *self._motion(load)):
                return None
            size = value / moved
        add_to_velocities(system, state, size * motion, R)
        done = state.work.sum()
        scalar.motion_work(system.scalar, frames, state.time[0], 1.0, size * motion, state.work)
        work = energy(system, state, self.work_arrays) - before - (state.work.sum() - done)
        return Given(rate, float(rate + size * moved), float(size), float(work))

    def _motion(self, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the velocities (n+1, 3) in a ``change`` (nodes, 3) of the unknowns."""
        frames = self.system.frames
        return change[frames.displacement], change[frames.rotation] / frames.length[:, None]

    def _unit_load(self, impulse: Impulse) -> np.ndarray:
        """(nodes, 3) a unit impulse in the equations of the frames, of the prepared state."""
        system, start, call = self.system, self.work_arrays.start, self.work_arrays.call
        rows, still = np.zeros((2, node_count(system), 3))
        if not impulse.joint:
            f, direction = self.frame[self.body[impulse.marker]], self._direction(impulse)
            moment = cross(self._arm(impulse), direction)
            call(push, system.frames, 1.0, rows, f, direction, moment)
            return rows
        assert system.scalar is not None
        place = start.scalar.coordinates
        call(coordinates.evaluate, system.scalar.coordinates, place, system.frames, still)
        place.load[:] = 0.0
        place.load[self._coordinate(impulse)] = 1.0
        call(coordinates.push, system.scalar.coordinates, place, system.frames, 1.0, rows)
        place.load[:] = 0.0
        return rows

    def _rate(self, impulse: Impulse, v: np.ndarray, W: np.ndarray) -> float:
        """Return the rate along an impulse at these velocities (n+1, 3), in the prepared state."""
        if not impulse.joint:
            f = self.frame[self.body[impulse.marker]]
            V = v[f] + np.cross(W[f], self._arm(impulse))
            return float(V @ np.array(self._direction(impulse)))
        assert self.system.scalar is not None
        group, start = self.system.scalar.coordinates, self.work_arrays.start.scalar
        rates, call = np.zeros(group.kind.size), self.work_arrays.call
        still = np.zeros((node_count(self.system), 3))
        call(coordinates.evaluate, group, start.coordinates, self.system.frames, still)
        call(coordinates.rates, group, start.coordinates, v, W, rates)
        return float(rates[self._coordinate(impulse)])

    def _coordinate(self, impulse: Impulse) -> int:
        """Return the number of the coordinate of a joint along which an impulse acts."""
        signals = self.system.forces.signals
        assert signals is not None
        return int(signals.item[self.inputs.index(f"{impulse.joint}.{impulse.coordinate}{RATE}")])

    def _arm(self, impulse: Impulse) -> tuple[float, float, float]:
        """Return the place of a marker from the mass centre, inertial axes [m]."""
        f = self.frame[self.body[impulse.marker]]
        return self._rotated(f, self.arm[impulse.marker])

    def _direction(self, impulse: Impulse) -> tuple[float, float, float]:
        """Return the unit vector along an impulse at a marker, inertial axes."""
        a = np.array(impulse.direction)
        x, y, z = a / np.linalg.norm(a)
        return self._rotated(self.frame[impulse.basis], (x, y, z))

    def _rotated(self, f: int, a: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = self.work_arrays.start.frames.R[f] @ np.array(a)
        return float(x), float(y), float(z)
