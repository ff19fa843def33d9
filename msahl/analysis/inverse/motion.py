"""Positions, velocities and accelerations of all bodies that follow a given motion.

    g(q, t) = 0              exactly                  G z = -g ,   with the null space N of G
    |y - h(q)|^2 -> min      among these              z = -G^+ g + N zeta ,   (H N) zeta = ...

and the same, linear, for velocities and accelerations. Equations between rates (rolling) constrain
velocities and accelerations only. N and G^+ are weighted by mass, so that they serve the balance of
forces as well: N^T M N = 1.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import at
from msahl.analysis.inverse.drives import InverseError
from msahl.analysis.inverse.given import Bodies, Measures
from msahl.analysis.kinematics.configuration import Equations, displace, jacobian, violations
from msahl.analysis.kinematics.configuration import _by_frames as by_frames
from msahl.analysis.linearised.reduced import null_space
from msahl.formulations.absolute.frames import moving_count
from msahl.system import evaluate
from msahl.system.arrays import State, node_count

MOST_ITERATIONS = 40
SMALL = 1e-13
"""Correction, over the size of the model, that is round-off."""
SLOW = 1e-11
"""Likewise of one that does not become smaller any more."""
NEAR = 0.1
"""First correction, over the size of the model, that is too large for matrices of another time."""
CLOSED = 1e-10
"""Constraint violation, over the size of the model, that may remain."""
DETERMINED = 1e-8
"""Singular value of H N, over the sizes of both, of a motion that the table determines."""
LEAST_INERTIA = 1e-13
"""Inertia over mass times the squared length of a body that is added in weights, not in forces."""
MOST_NAMED = 8
"""Bodies that a message names."""


class Frame(NamedTuple):
    """The constraints and the given coordinates at one configuration; n unknowns, c equations,
    d degrees of freedom.
    """

    M: np.ndarray  # (n, n) mass matrix by z [kg]
    L: np.ndarray  # (n, n) M = L L^T
    G: np.ndarray  # (c, n)
    N: np.ndarray  # (n, d) null space of G with N^T M N = 1
    inverse: np.ndarray  # (n, c) G^+ weighted by mass
    H: np.ndarray  # (y, n)
    bodies: Bodies


class Chord(NamedTuple):
    """Matrices of a configuration nearby, by which positions are corrected."""

    N: np.ndarray  # (n, d) null space of the constraints between positions
    inverse: np.ndarray  # (n, c)
    H: np.ndarray  # (y, n)
    fit: np.ndarray  # (d, y) pseudoinverse of H N


class Follower:
    """Follows the motion of ``measures`` with the constraint ``equations`` of a system."""

    def __init__(self, equations: Equations, measures: Measures) -> None:
        self.equations, self.measures = equations, measures
        self.masses = masses(equations)
        self.chord: Chord | None = None

    def frame(self, state: State) -> Frame:
        """Evaluate constraints and given coordinates at a ``state``."""
        M = self.mass(state)
        # Bodies without inertia have no weight of their own.
        L = np.linalg.cholesky(M + LEAST_INERTIA * np.diag(self.masses))
        G, bodies = jacobian(self.equations, state), self.measures.bodies(state)
        N, inverse = _weighted(G, L)
        H = self.measures.jacobian(bodies)
        if self.equations.holonomic.all():
            self.chord = self._chord(N, inverse, H, float(state.time[0]))
        return Frame(M, L, G, N, inverse, H, bodies)

    def mass(self, state: State) -> np.ndarray:
        """(n, n) mass matrix of displacements and rotations times lengths [kg]."""
        equations, frames = self.equations, self.equations.system.frames
        equations.call(evaluate.prepare, equations.system, state, equations.start)
        nodes = node_count(equations.system)
        M = np.zeros((nodes, 3, nodes, 3))
        for b, f in enumerate(equations.system.bodies.frame.tolist()):
            u, theta = frames.displacement[f], frames.rotation[f]
            M[u, :, u, :] = np.eye(3) / equations.system.bodies.inverse_mass[b]
            M[theta, :, theta, :] = equations.start.bodies.J[b] / frames.length[f] ** 2
        flat = M.reshape(3 * nodes, 3 * nodes)
        return np.asarray(flat[np.ix_(equations.coordinate, equations.coordinate)])

    def settle(self, state: State, given: np.ndarray, time: float) -> np.ndarray:
        """Change the positions of ``state`` to those of the ``given`` values at ``time`` [s];
        return what remains of these (y,) [m]. Raises ``InverseError``.

        The matrices of the configuration before serve as long as they halve the corrections.
        """
        equations, last = self.equations, np.inf
        state.time[0] = time
        for _ in range(MOST_ITERATIONS):
            chord = self.chord or self._renew(state)
            violation = violations(equations, state)[0][equations.holonomic]
            difference = self.measures.difference(self.measures.bodies(state), given)
            closing = -chord.inverse @ violation
            z = self._limited(closing + chord.N @ (chord.fit @ (difference - chord.H @ closing)))
            size = float(np.linalg.norm(z)) / equations.size
            displace(equations, state, z)
            if size <= SMALL or (size <= SLOW and size >= 0.5 * last):
                break
            if size > 0.5 * last or (last == np.inf and size > NEAR):
                self.chord = None
            last = size
        violation = violations(equations, state)[0][equations.holonomic]
        left = float(np.abs(violation).max(initial=0.0))
        if not left <= CLOSED * equations.size:
            raise InverseError(
                f"at {time:.9g} s the joints cannot be closed with the given coordinates: "
                f"{left:.3g} m remain; check their values, or start the deck nearer to them"
            )
        return self.measures.difference(self.measures.bodies(state), given)

    def _renew(self, state: State) -> Chord:
        """Return the matrices of the present configuration."""
        bodies = self.measures.bodies(state)
        G = jacobian(self.equations, state)[self.equations.holonomic]
        found = self._chord(*null_space(G), self.measures.jacobian(bodies), float(state.time[0]))
        self.chord = found
        return found

    def _chord(self, N: np.ndarray, inverse: np.ndarray, H: np.ndarray, time: float) -> Chord:
        """Return the matrices for corrections; raises ``InverseError`` if motions in ``N`` (n, d)
        change none of the given values.
        """
        left, values, right = np.linalg.svd(H @ N, full_matrices=False)
        size = np.linalg.norm(H, axis=1).max() * np.linalg.norm(N, axis=0).max(initial=0.0)
        rank = int(np.count_nonzero(values > DETERMINED * size))
        if rank < N.shape[1]:
            self._refuse(H @ N, N, rank, time)
        return Chord(N, inverse, H, (right.T / values) @ left.T)

    def _limited(self, step: np.ndarray) -> np.ndarray:
        """The step (n,), so short that no body rotates further than linear equations reach."""
        largest = float(np.abs(step).max(initial=0.0)) / (0.5 * self._shortest())
        return step / largest if largest > 1.0 else step

    def _shortest(self) -> float:
        return float(self.equations.system.frames.length[:-1].min(initial=np.inf))

    def _refuse(self, HN: np.ndarray, N: np.ndarray, rank: int, time: float) -> None:
        """Raise ``InverseError``: the given values determine ``rank`` of the motions in ``N``."""
        free = N @ np.linalg.svd(HN)[2][rank:].T
        number = N.shape[1]
        raise InverseError(
            f"at {time:.9g} s, {number - rank} of {number} degrees of freedom are not determined "
            f"by the given coordinates, in the motion of {', '.join(self.moving_bodies(free))}; "
            "give more coordinates"
        )

    def moving_bodies(self, free: np.ndarray) -> list[str]:
        """Return the names of bodies that move in some of the motions ``free`` (n, k)."""
        equations = self.equations
        size = np.zeros(node_count(equations.system) * 3)
        size[equations.coordinate] = np.linalg.norm(free, axis=1)
        nodes = size.reshape(-1, 3).max(axis=1)
        frames, names = equations.system.frames, []
        for b, name in enumerate(self.measures.names):
            f = int(equations.system.bodies.frame[b])
            if max(nodes[frames.displacement[f]], nodes[frames.rotation[f]]) > 1e-6:
                names.append(self.measures.hidden.get(name, name))
        names = list(dict.fromkeys(names))
        more = len(names) - MOST_NAMED
        return [*names[:MOST_NAMED], f"{more} more bodies"] if more > 0 else names

    def velocities(self, state: State, frame: Frame, rates: np.ndarray) -> np.ndarray:
        """Set the velocities of ``state`` to those of the given ``rates`` (y,) in metres; return
        them (n,).
        """
        equations = self.equations
        closing = -frame.inverse @ violations(equations, state, at_rest=True)[1]
        z = closing + frame.N @ _fitted(frame, rates - frame.H @ closing)
        v, W = by_frames(equations, z)
        for f in range(moving_count(equations.system.frames)):
            state.v[f], state.w[f] = v[f], np.array(matrix(at(state.p, f))).T @ W[f]
        return z

    def accelerations(
        self, state: State, frame: Frame, changes: np.ndarray, second: np.ndarray
    ) -> np.ndarray:
        """Set the accelerations of ``state`` to those of the given ones, ``changes`` (y,) in
        metres; ``second`` (c,) are minus the constraints' second derivatives at zero
        accelerations. Return them (n,).
        """
        drift = self.measures.drift(self.measures.bodies(state))
        closing = frame.inverse @ second
        z = closing + frame.N @ _fitted(frame, changes - drift - frame.H @ closing)
        state.a[:-1], state.alpha[:-1] = by_frames(self.equations, z)
        return z


def masses(equations: Equations) -> np.ndarray:
    """(n,) mass of the body that each unknown moves [kg]."""
    frames = equations.system.frames
    moving = slice(moving_count(frames))
    mass = np.ones((node_count(equations.system), 3))
    for nodes in (frames.displacement[moving], frames.rotation[moving]):
        mass[nodes] = 1.0 / frames.inverse_mass[moving, None]
    return np.asarray(mass.reshape(-1)[equations.coordinate])


def _weighted(G: np.ndarray, L: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Null space and pseudoinverse of ``G`` weighted by mass."""
    back = np.linalg.inv(L).T
    N, inverse = null_space(G @ back)
    return back @ N, back @ inverse


def _fitted(frame: Frame, wanted: np.ndarray) -> np.ndarray:
    """(d,) coordinates along N by which the given values change as ``wanted`` (y,)."""
    if not frame.N.shape[1]:
        return np.zeros(0)
    return np.asarray(np.linalg.lstsq(frame.H @ frame.N, wanted, rcond=None)[0])
