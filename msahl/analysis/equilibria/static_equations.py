"""The equations of an equilibrium at one configuration, and their derivative.

    f(q) + G^T lam - M a = 0            balance of all forces and moments
    g(q) + C lam         = 0            constraints, C = 0; minus strains of beams

    [ K  G^T ]                          K = d(f + G^T lam - M a)/dq at fixed lam
    [ G   C  ]

Coordinates are displacements and rotations times lengths of the bodies, so all entries of K have
one unit, and those of G have none. At rest a = 0. A model that rotates steadily about an axis
through c, with the angular velocity w, has v = w x (x - c), a = w x v, and W = w; what depends on v
is then part of K.

An evaluation is two calls of compiled kernels with the same arrays every time, and some operations
on the list of all entries of the matrix, whose places are found once. Gravity and concentrated
loads are multiplied by a factor, in arrays of the evaluation's own.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import at
from msahl.analysis.equilibria.static_layout import Layout, layout_of
from msahl.analysis.linearised.coefficients import Work, differentiate, skews
from msahl.analysis.linearised.plain_units import evaluation_size
from msahl.analysis.linearised.steady import SMALL_TRAVEL
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.formulations.absolute.frames import first_multiplier
from msahl.jit.by_size import by_size
from msahl.system import evaluate
from msahl.system.arrays import State, System, new_system_workspace, node_count
from msahl.system.reductions import in_plane, plane_normal


class Spin(NamedTuple):
    """A steady rotation of the complete model."""

    rate: np.ndarray  # (3,) angular velocity w, inertial axes [rad/s]
    center: np.ndarray  # (3,) a point of its axis [m]


REST = Spin(np.zeros(3), np.zeros(3))


class Balance(NamedTuple):
    """The equations at one configuration."""

    layout: Layout
    force: np.ndarray  # (n,) f + G^T lam - M a [N]
    violation: np.ndarray  # (c,) g + C lam
    values: np.ndarray  # (e,) entries of K [N/m] and G
    relative: float  # largest of either, over the largest force and over the size of the system
    largest: float  # force that takes part in the balance [N]
    size: float  # of the model [m]


def with_rates(state: State, spin: Spin = REST) -> State:
    """Return the ``state`` with the velocities and accelerations of a ``spin``, and multipliers of
    its own.
    """
    v, w, a = (np.zeros_like(state.v) for _ in range(3))
    if spin.rate.any():
        v = np.cross(spin.rate, state.x - spin.center)
        v[-1] = 0.0
        for f in range(len(v) - 1):
            w[f] = np.array(matrix(at(state.p, f))).T @ spin.rate
        a = np.cross(spin.rate, v)
    return state._replace(force=state.force.copy(), v=v, w=w, a=a, alpha=np.zeros_like(state.alpha))


class Statics:
    """Evaluates the equations of a system at rest, or in a steady rotation.

    With ``reduced``, those of a planar system are the ones in its plane (``system.reductions``).
    Its stability is not that of these: it may buckle out of the plane.
    """

    def __init__(
        self, system: System, state: State, spin: Spin = REST, reduced: bool = False
    ) -> None:
        self.spin = spin
        self.system, self._scaled = _own_loads(system)
        self._first = first_multiplier(system.frames)
        self._state = State(*(np.array(part) for part in state))
        self._start = new_system_workspace(self.system, self._state)
        at_rest, rows, unused, still = np.zeros((4, node_count(system), 3))
        by_place, by_rate, scratch, both = (np.zeros_like(system.constant) for _ in range(4))
        self._work = Work(at_rest, rows, unused, both)
        self._out = Derivatives(by_place, by_rate, scratch, still)
        self._violation, self._rate = np.zeros_like(state.violation), np.zeros_like(state.violation)
        is_equation = system.blocks[:, 0] >= self._first
        is_force = ~is_equation & (system.blocks[:, 1] >= self._first)
        sign = np.select([is_equation, is_force], [1.0, -1.0], 0.0)
        self._constant = np.repeat(sign, 9) * system.constant
        self._weight = float(
            (1.0 / system.bodies.inverse_mass).max(initial=0.0)
            * np.linalg.norm(system.bodies.gravity)
        )
        self.layout = layout_of(system, self._in_plane(state) if reduced else None)
        # The state, factor and forces of the last evaluation.
        self._last: tuple[State, float, np.ndarray] | None = None
        self._heaviest = max(self._weight, float(np.abs(self.loads(state)).max(initial=0.0)))

    def _in_plane(self, state: State) -> np.ndarray | None:
        """(nodes, 3) the unknowns in the plane of a planar system, else None."""
        self._evaluate(state, 1.0)
        axis = plane_normal(self.system, self._start)
        return None if axis is None else in_plane(self.system, self._start, axis)

    def loads(self, state: State) -> np.ndarray:
        """(n,) gravity and concentrated loads of the deck in the configuration of ``state`` [N]."""
        if self._last is None or self._last[0] is not state:
            self._forces(state, 1.0)
        assert self._last is not None
        _, factor, forces = self._last
        other = 0.0 if factor > 0.5 else 1.0
        return (forces - self._forces(state, other)) / (factor - other)

    def _forces(self, state: State, factor: float) -> np.ndarray:
        """(n,) f - M a, after an evaluation at a ``state`` with loads times ``factor``."""
        self._evaluate(state, factor)
        rows, layout = self._work.rows, self.layout
        if self.spin.rate.any():
            rows[self.system.frames.displacement[:-1]] -= self._state.a[:-1]
        forces: np.ndarray = rows.reshape(-1)[layout.coordinate] * layout.force
        self._last = (state, factor, forces)
        return forces

    def reactions(self, state: State) -> np.ndarray:
        """(j, 6) reactions of the joints by the multipliers of a ``state`` under all loads, along
        inertial axes [N, N m].
        """
        self._evaluate(state, 1.0)
        self._state.force[:] = state.force
        Z = np.zeros_like(self._work.rows)
        call = by_size(evaluate.set_reactions, self._state.reaction.shape[0])
        call(self.system, self._state, self._start, Z)
        return self._state.reaction.copy()

    def is_damped(self) -> bool:
        """Return whether forces depended on rates at the last evaluation."""
        layout, group = self.layout, self.system.beams
        damped = self._out.by_rate[layout.taken[: layout.stiff]].any()
        return bool(damped) or (group is not None and bool(group.damping.any()))

    def balance(self, state: State, factor: float = 1.0) -> Balance:
        """Return the equations at a ``state``, whose multipliers are ``state.force``, with gravity
        and concentrated loads times ``factor``. Counts angles in ``state.angle``, and sets
        ``state.strain``.
        """
        layout = self.layout
        f = self._forces(state, factor)
        observe = by_size(evaluate.observe, evaluation_size(self.system))
        observe(self.system, self._state, self._start, self._violation, self._rate)
        state.angle[:], state.strain[:] = self._state.angle, self._state.strain
        violation = self._violations(state)
        if self.spin.rate.any():
            self._add_rotation(self._out.by_place)
        # In the rows of constraints, ``by_place`` has derivatives of their rates.
        values, k = self._work.constraint[layout.taken], layout.stiff
        values[:k] += self._out.by_place[layout.taken[:k]]
        values *= layout.scale
        return self._weighed(state, f, violation, values, factor)

    def _evaluate(self, state: State, factor: float) -> None:
        """Call the kernel of all forces and derivatives, with loads times ``factor``."""
        for array, full in self._scaled:
            array[:] = factor * full
        moving = with_rates(state, self.spin)
        for name in _COPIED:
            getattr(self._state, name)[:] = getattr(moving, name)
        unit, work, out = self.system.unit, self._work, self._out
        work.at_rest[self._first :] = np.divide(
            state.force, unit, out=np.zeros_like(unit), where=unit != 0.0
        )
        work.constraint[:] = self._constant
        for array in (out.by_place, out.by_rate, out.scratch, out.still, work.rows):
            array[:] = 0.0
        size = evaluation_size(self.system)
        by_size(differentiate, size)(self.system, self._state, self._start, work, out)

    def _violations(self, state: State) -> np.ndarray:
        """(c,) violations of constraints, and C lam minus the strains of beams."""
        group = self.system.beams
        if group is not None:
            lam = np.concatenate([state.force[group.place], state.force[group.place + 1]], axis=1)
            both = np.einsum("gij,gj->gi", group.compliance, lam) - self._state.strain
            both *= group.weight[:, None]
            self._violation[group.place] = both[:, :3]
            self._violation[group.place + 1] = both[:, 3:]
        violation: np.ndarray = self._violation.reshape(-1)[self.layout.multiplier]
        return violation

    def _add_rotation(self, blocks: np.ndarray) -> None:
        """Add to the blocks of derivatives by places what velocities and accelerations change of
        the forces, as they follow the places in a rotation.
        """
        matrices, system = blocks.reshape(-1, 3, 3), self.system
        W = skews(self.spin.rate[None])[0]
        row, column = system.blocks.T
        rotates = system.frames.rotates[np.minimum(column, self._first - 1)]
        moves = (row < self._first) & (column < self._first) & (rotates == 0)
        moves[0] = False
        matrices[moves] += self._out.by_rate.reshape(-1, 3, 3)[moves] @ W
        diagonal = moves & (row == column)
        matrices[diagonal] -= W @ W

    def _weighed(
        self,
        state: State,
        f: np.ndarray,
        violation: np.ndarray,
        values: np.ndarray,
        factor: float,
    ) -> Balance:
        """Return the residual of the forces ``f`` (n,) and the ``violation`` (c,)."""
        layout = self.layout
        lam, G = state.force.reshape(-1)[layout.multiplier], values[layout.stiff :]
        by_entry = lam[layout.row[layout.stiff :]] * G
        force = f + np.bincount(layout.column[layout.stiff :], by_entry, f.size)
        largest = max(
            float(np.abs(f).max(initial=0.0)),
            float(np.abs(by_entry).max(initial=0.0)),
            abs(factor) * self._heaviest,
            self._stiffest(values),
        )
        extent = float(np.linalg.norm(state.x.max(axis=0) - state.x.min(axis=0)))
        size = max(extent, float(layout.length.max(initial=0.0)))
        relative = float(np.abs(force).max(initial=0.0)) / max(largest, 1e-300)
        relative = max(relative, float(np.abs(violation).max(initial=0.0)) / size)
        return Balance(layout, force, violation, values, relative, largest, size)

    def _stiffest(self, values: np.ndarray) -> float:
        """Largest force [N] by which the model, or an elastic strain, resists a small motion."""
        layout, k = self.layout, self.layout.stiff
        if not values.size:
            return 0.0
        typical = float(np.mean(layout.length[layout.rotational]))
        travel = layout.length * np.where(layout.rotational, 1.0, typical)
        K = np.abs(values[:k]) * travel[layout.column[:k]]
        resisting = np.bincount(layout.row[:k], K, travel.size).max(initial=0.0)
        elastic = layout.own > 0.0
        if elastic.any():
            squares = np.bincount(layout.row[k:], values[k:] ** 2, layout.own.size)
            stiffest = (squares[elastic] / layout.own[elastic]).max()
            resisting = max(resisting, float(np.mean(layout.length)) * stiffest)
        return SMALL_TRAVEL * float(resisting)


_COPIED = ("time", "x", "p", "v", "w", "a", "angle", "force", "auxiliary", "reaction")


def _own_loads(system: System) -> tuple[System, list[tuple[np.ndarray, np.ndarray]]]:
    """Return the ``system`` with arrays of its own of gravity and concentrated loads, and each of
    these with the numbers of the deck.
    """
    forces, scaled = system.forces, []

    def own(full: np.ndarray) -> np.ndarray:
        scaled.append((full.copy(), full))
        return scaled[-1][0]

    bodies = system.bodies._replace(gravity=own(system.bodies.gravity))
    for name in ("concentrated", "controlled"):
        loads = getattr(forces, name)
        if loads is not None:
            loads = loads._replace(f=own(loads.f), m=own(loads.m))
            forces = forces._replace(**{name: loads})
    return system._replace(bodies=bodies, forces=forces), scaled
