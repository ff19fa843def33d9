"""Drive loads and constraint forces of a given motion: the balance of forces at one configuration.

    M z'' = f + B u + G^T lam

With N of ``motion`` (G N = 0, N^T M N = 1) the multipliers drop out:

    (N^T B) u = r ,   r = N^T (M z'' - f)                                                  (1)

    u = W^-1 (N^T B W^-1)^+ r        least of all that satisfy (1): the sum of (w_i u_i)^2
    rho = r - N^T B u                 what no load can produce; |rho| least
    lam = (G^+)^T (M z'' - f - B u)

A load is unique if no vector of the null space of N^T B has a part in it. A reaction is unique if
no vector of the null space of (G^T B) has one. f contains all forces of the model but the drives:
gravity, inertia's gyroscopic moments, springs, friction, which depends on lam, and expressions.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.analysis.inverse.motion import Follower, Frame
from msahl.analysis.linearised.coefficients import result_row
from msahl.analysis.linearised.plain_units import equation_scale
from msahl.elements.reactions import MOST_ROUNDS, is_unchanged
from msahl.elements.signals.group import use_reactions
from msahl.formulations.absolute.frames import first_multiplier
from msahl.ports import forces
from msahl.start.redundancy import PART, non_unique_reactions
from msahl.system import evaluate
from msahl.system.arrays import State, node_count

INDEPENDENT = 1e-9
"""Singular value of N^T B W^-1, over the sizes of both, below which loads do not act, or depend on
each other."""


class Loads(NamedTuple):
    """The loads at one configuration; k drives."""

    loads: np.ndarray  # (k,) u [N or N m]
    power: np.ndarray  # (k,) [W]
    rank: int  # of N^T B
    shared: np.ndarray  # (k,) part of each in unit vectors of the null space of N^T B
    missing: np.ndarray  # (n,) force M N rho that no drive produces [N, moments over lengths]
    largest: float  # largest force of the balance, likewise [N]


class Drives:
    """The drives of a system: what a unit load of each adds to the equations."""

    def __init__(self, follower: Follower, results: list[int], weights: np.ndarray) -> None:
        of = follower.equations
        self.follower, self.results, self.weights = follower, results, weights
        self.mass = follower.masses
        scale = np.concatenate([
            np.ones(3 * first_multiplier(of.system.frames)),
            equation_scale(of.system).reshape(-1),
        ])  # fmt: skip
        self.scale = scale[of.equation]
        self.by_reactions = forces.depend_on_reactions(of.system.forces) or use_reactions(
            of.system.forces.signals
        )

    def second_derivatives(self, state: State) -> np.ndarray:
        """(c,) minus the second derivatives of the constraints at zero accelerations."""
        return np.asarray(self._rows(state)[self.follower.equations.equation])

    def _rows(self, state: State) -> np.ndarray:
        """Right-hand side of the index-1 problem, flat; prepares the workspace."""
        of = self.follower.equations
        rows, Z = np.zeros((2, node_count(of.system), 3))
        of.call(evaluate.prepare, of.system, state, of.start)
        of.call(evaluate.free_acceleration, of.system, state, of.start, Z, rows)
        return np.asarray(rows.reshape(-1))

    def unit_forces(self) -> np.ndarray:
        """(n, k) B of the prepared configuration."""
        of = self.follower.equations
        rows = [result_row(of.system, of.start, r)[of.coordinate] for r in self.results]
        return self.mass[:, None] * np.stack(rows, axis=1)

    def solve(
        self, state: State, frame: Frame, velocity: np.ndarray, acceleration: np.ndarray
    ) -> Loads:
        """Return the loads of a ``state`` with its velocities and accelerations (n,), and set its
        multipliers and reactions. Friction depends on these: rounds until they do not change.
        """
        inertia = frame.M @ acceleration
        for _ in range(MOST_ROUNDS if self.by_reactions else 1):
            last = state.reaction.copy()
            force = self.mass * self._rows(state)[self.follower.equations.coordinate]
            B = self.unit_forces()
            found = self._balance(frame, B, inertia - force)
            self._set_reactions(state, frame, inertia - force - B @ found.loads)
            if is_unchanged(state.reaction, last):
                break
        largest = max(float(np.abs(part).max(initial=0.0)) for part in (inertia, force))
        return found._replace(power=found.loads * (B.T @ velocity), largest=largest)

    def _balance(self, frame: Frame, B: np.ndarray, needed: np.ndarray) -> Loads:
        """Solve (1) for the force ``needed`` (n,)."""
        r = frame.N.T @ needed
        A, left, values, right, rank = self._decomposed(frame, B)
        u = right[:rank].T @ ((left[:, :rank].T @ r) / values[:rank])
        shared = np.linalg.norm(right[rank:], axis=0)
        rho = r - A @ u
        zero = np.zeros_like(u)
        return Loads(u / self.weights, zero, rank, shared, frame.M @ frame.N @ rho, 0.0)

    def _decomposed(
        self, frame: Frame, B: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int]:
        """Return N^T B W^-1, its singular vectors and values, and its rank."""
        weighted = B / self.weights
        A = frame.N.T @ weighted
        left, values, right = np.linalg.svd(A)
        largest = (np.linalg.norm(part, axis=0).max(initial=0.0) for part in (frame.N, weighted))
        rank = int(np.count_nonzero(values > INDEPENDENT * math.prod(largest)))
        return A, left, values, right, rank

    def _set_reactions(self, state: State, frame: Frame, carried: np.ndarray) -> None:
        """Set multipliers and reactions by the force (n,) that the constraints carry."""
        of = self.follower.equations
        flat = np.zeros(3 * node_count(of.system))
        flat[of.equation] = self.scale * (frame.inverse.T @ carried)
        state.force[:] = flat.reshape(-1, 3)[first_multiplier(of.system.frames) :]
        Z = np.zeros((node_count(of.system), 3))
        of.call(evaluate.set_reactions, of.system, state, of.start, Z)

    def undriven(self, state: State, frame: Frame) -> np.ndarray:
        """(n, m) motions that no drive can influence in the configuration."""
        self._rows(state)
        _, left, _, _, rank = self._decomposed(frame, self.unit_forces())
        return frame.N @ left[:, rank:]

    def non_unique(self, state: State, frame: Frame) -> dict[int, list[str]]:
        """Return the columns of reactions that are not unique, by number of the joint, coupling or
        motion: those of redundant joints, and those that depend on how drives share their load.
        """
        of = self.follower.equations
        self._rows(state)
        B = self.unit_forces()
        _, _, _, right, rank = self._decomposed(frame, B)
        vectors = []
        for sharing in right[rank:]:
            load = B @ (sharing / self.weights)
            flat = np.zeros(3 * node_count(of.system))
            flat[of.equation] = frame.inverse.T @ load
            size = float(np.linalg.norm(flat))
            if size > PART * float(np.linalg.norm(load)):
                vectors.append(flat.reshape(-1, 3)[first_multiplier(of.system.frames) :] / size)
        return non_unique_reactions(of.system, state, vectors)
