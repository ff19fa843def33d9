"""Solves a model's constraint equations at one time: positions, velocities and accelerations.

    g(q, t) = 0                    Newton's method           G dq = -g
    G v = -g_t                                               G = dg/dq
    G a = -d(G v)/dt - g_tt at zero accelerations

The unknowns are displacements u [m] and rotations times a length of the body, l theta [m], along
inertial axes; equations in radians count by a length. So G is dimensionless (``Equations``). Where
equations remove all degrees of freedom the solution is unique and needs no masses; else it is the
least one. Redundant equations do no harm: ranks are counted by singular values.

Equations that are ``fitted`` are satisfied as well as the others let them be, in the sense of least
squares: the others are satisfied exactly. Without any, all equations are exact, and those that
contradict each other leave a violation, which is reported.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, from_axis_angle, from_increment, matrix
from msahl.algebra.vector import at
from msahl.analysis.coefficients import holonomic
from msahl.analysis.plain_units import coordinate_numbers, equation_numbers
from msahl.elements.constraints import coordinates, scalar
from msahl.elements.frames import first_multiplier, moving_count
from msahl.jit.by_size import by_size
from msahl.start.redundancy import INDEPENDENT
from msahl.system import evaluate
from msahl.system.arrays import (
    State,
    System,
    SystemWorkspace,
    new_system_workspace,
    node_count,
)

MOST_ITERATIONS = 25
QUADRATIC = 1e-9
"""Correction, relative to the size of the model, after which Newton's method, which squares it, has
reached round-off."""
CLOSED = 1e-11
"""Violation, relative to the size of the model, that may remain."""
EPSILON = float(np.finfo(float).eps)


class Equations(NamedTuple):
    """How the constraint equations of a system stand among its unknowns; c equations, n unknowns.

    ``call`` calls a kernel with its arguments.
    """

    system: System
    call: Callable[..., Any]
    start: SystemWorkspace
    rest: State  # with velocities that are zero
    coordinate: np.ndarray  # (n,) numbers of the unknowns among the flat ones of the system
    equation: np.ndarray  # (c,) likewise of the equations
    holonomic: np.ndarray  # (c,) whether an equation constrains positions, not rates alone
    taken: np.ndarray  # (k,) entries of the block values that G has
    place: np.ndarray  # (k,) where they stand in G, flat
    size: float  # of the model [m], by which violations are judged


def new_equations(
    system: System, state: State, call: Callable[..., Any] | None = None
) -> Equations:
    """Return the equations of a ``system`` whose states have the form of ``state``."""
    size = moving_count(system.frames)
    coordinate, equation = coordinate_numbers(system), equation_numbers(system)
    taken, place = _entries(system, equation, coordinate)
    return Equations(
        system=system,
        call=call or (lambda kernel, *given: by_size(kernel, size)(*given)),
        start=new_system_workspace(system, state),
        rest=copied(state)._replace(v=np.zeros_like(state.v), w=np.zeros_like(state.w)),
        coordinate=coordinate,
        equation=equation,
        holonomic=holonomic(system),
        taken=taken,
        place=place,
        size=max(float(system.frames.length.max()), float(np.abs(state.x).max())),
    )


def _entries(
    system: System, equation: np.ndarray, coordinate: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Entries (k,) of the block values in rows of equations, and their places in G."""
    row, column = np.full((2, 3 * node_count(system)), -1)
    row[equation], column[coordinate] = np.arange(equation.size), np.arange(coordinate.size)
    three = np.arange(3)
    i = row[3 * system.blocks[:, 0, None, None] + three[:, None]]
    j = column[3 * system.blocks[:, 1, None, None] + three]
    i, j = (array.reshape(-1) for array in np.broadcast_arrays(i, j))
    kept = (i >= 0) & (j >= 0)
    kept[:9] = False  # block 0 belongs to the ground
    taken = np.flatnonzero(kept)
    return taken, i[taken] * coordinate.size + j[taken]


class Solved(NamedTuple):
    """Least-squares solution of G z = b, with what it says about G."""

    z: np.ndarray  # (n,)
    rank: int
    values: np.ndarray  # singular values, the largest first
    left: np.ndarray  # (c, k) singular vectors
    right: np.ndarray  # (k, n)
    remaining: float  # largest entry of b - G z

    @property
    def smallest(self) -> float:
        """Smallest singular value of those that the rank counts, 0 without any."""
        return float(self.values[self.rank - 1]) if self.rank else 0.0


def jacobian(of: Equations, state: State) -> np.ndarray:
    """(c, n) derivative G of the equations by the unknowns; of equations between rates by rates."""
    rest, Z = _at_rest(of, state), np.zeros((node_count(of.system), 3))
    values = np.zeros_like(of.system.constant)
    of.call(evaluate.prepare, of.system, rest, of.start)
    if of.system.scalar:
        group, own = of.system.scalar.coordinates, of.start.scalar.coordinates
        of.call(coordinates.evaluate, group, own, of.system.frames, Z)
    # With h^2 = 2 an acceleration of 1 m/s^2 is a displacement of 1 m over the step.
    of.call(evaluate.joint_jacobian, of.system, of.start, 2.0**0.5, Z, values)
    G = np.zeros(of.equation.size * of.coordinate.size)
    G[of.place] = values[of.taken]
    return G.reshape(of.equation.size, of.coordinate.size)


def _at_rest(of: Equations, state: State) -> State:
    """Return the state with velocities that are zero, in arrays of the equations."""
    rest = of.rest
    for name in ("time", "x", "p", "angle", "auxiliary", "reaction"):
        getattr(rest, name)[:] = getattr(state, name)
    return rest


def violations(of: Equations, state: State, at_rest: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """(c,) constraint violations [m], 0 of equations between rates, and their rates [m/s], of the
    state or of the state ``at_rest``; counts angles in ``state.angle``.
    """
    seen = _at_rest(of, state) if at_rest else state
    violation, rate = np.zeros_like(state.violation), np.zeros_like(state.violation)
    of.call(evaluate.prepare, of.system, seen, of.start)
    scalar.count_rotations(of.system.scalar, of.start.scalar, state.angle)
    of.call(evaluate.observe, of.system, seen, of.start, violation, rate)
    scalar.in_metres(of.system.scalar, violation, rate)
    chosen = of.equation - 3 * first_multiplier(of.system.frames)
    return violation.reshape(-1)[chosen], rate.reshape(-1)[chosen]


def solve(G: np.ndarray, b: np.ndarray, fitted: np.ndarray | None = None) -> Solved:
    """Return the least z (n,) with G z = b (c,), or nearest to it; equations ``fitted`` (c,) are
    satisfied as well as the others let them be.
    """
    left, values, right = np.linalg.svd(G, full_matrices=False)
    rank = int(np.count_nonzero(values > INDEPENDENT * values.max(initial=0.0)))
    if fitted is None or not fitted.any():
        z = right[:rank].T @ ((left[:, :rank].T @ b) / values[:rank])
    else:
        z = _fit(G, b, fitted)
    remaining = float(np.abs(b - G @ z).max(initial=0.0))
    return Solved(z, rank, values, left, right, remaining)


def _fit(G: np.ndarray, b: np.ndarray, fitted: np.ndarray) -> np.ndarray:
    """(n,) the least z that satisfies the equations that are not ``fitted``, and nearly the
    others.
    """
    exact, n = ~fitted, G.shape[1]
    z, N = np.zeros(n), np.eye(n)
    if exact.any():
        left, values, right = np.linalg.svd(G[exact])
        rank = int(np.count_nonzero(values > INDEPENDENT * values.max(initial=0.0)))
        z = right[:rank].T @ ((left[:, :rank].T @ b[exact]) / values[:rank])
        N = right[rank:].T
    free = np.linalg.lstsq(G[fitted] @ N, b[fitted] - G[fitted] @ z, rcond=INDEPENDENT)[0]
    return np.asarray(z + N @ free)


class Closed(NamedTuple):
    """How well positions satisfy the equations, and G there."""

    converged: bool
    iterations: int
    first: float  # length of the first correction [m]
    last: float  # likewise of the last
    violation: float  # largest violation of equations that are exact [m]
    misfit: float  # likewise of those that are fitted
    jacobian: np.ndarray
    solved: Solved


def close(
    of: Equations,
    state: State,
    fitted: np.ndarray | None = None,
    reach: Callable[[Solved], bool] | None = None,
) -> Closed:
    """Change the positions of ``state`` until they satisfy the equations at its time, by Newton's
    method from where they are; ends at once where ``reach`` says so of the first correction.
    """
    first = last = previous = np.inf
    # Equations between rates do not constrain positions.
    positions = of.holonomic
    for iteration in range(1, MOST_ITERATIONS + 1):
        violation, _ = violations(of, state)
        G = jacobian(of, state)
        solved = solve(G[positions], -violation[positions], _part(fitted, positions))
        last = float(np.linalg.norm(solved.z))
        first = last if iteration == 1 else first
        if not np.isfinite(last) or (iteration == 1 and reach is not None and not reach(solved)):
            return Closed(False, iteration, first, last, np.inf, np.inf, G, solved)
        displace(of, state, solved.z)
        stands = last >= 0.5 * previous and last <= CLOSED * of.size
        if last <= QUADRATIC * of.size * min(1.0, solved.smallest) or stands:
            break
        previous = last
    violation, _ = violations(of, state)
    exact = np.ones(violation.size, bool) if fitted is None else ~fitted
    largest = float(np.abs(violation[exact]).max(initial=0.0))
    misfit = float(np.abs(violation[~exact]).max(initial=0.0))
    converged = largest <= CLOSED * of.size
    return Closed(converged, iteration, first, last, largest, misfit, G, solved)


def _part(fitted: np.ndarray | None, rows: np.ndarray) -> np.ndarray | None:
    return None if fitted is None else fitted[rows]


def displace(of: Equations, state: State, z: np.ndarray) -> None:
    """Displace and rotate the bodies of ``state`` by ``z`` (n,): displacements, and rotation
    increments times lengths [m].
    """
    _move(of, state, z, from_increment)


def predict(of: Equations, state: State, h: float) -> None:
    """Advance ``state`` by ``h`` [s] with its velocities and accelerations, to second order."""
    flat = np.zeros((node_count(of.system), 3))
    frames = of.system.frames
    for f in range(moving_count(frames)):
        W = np.array(matrix(at(state.p, f))) @ state.w[f]
        flat[frames.displacement[f]] = h * state.v[f] + 0.5 * h * h * state.a[f]
        flat[frames.rotation[f]] = frames.length[f] * (h * W + 0.5 * h * h * state.alpha[f])
    _move(of, state, flat.reshape(-1)[of.coordinate], _by_vector)
    state.time[0] += h


def _by_vector(c: tuple[float, float, float]) -> tuple[float, float, float]:
    """Parameters of the rotation by the rotation vector ``c``."""
    angle = float(np.linalg.norm(c))
    return from_axis_angle(c, angle) if angle > 0.0 else (0.0, 0.0, 0.0)


def _move(of: Equations, state: State, z: np.ndarray, rotation: Callable[..., Any]) -> None:
    flat, frames = np.zeros((node_count(of.system), 3)), of.system.frames
    flat.reshape(-1)[of.coordinate] = z
    for f in range(moving_count(frames)):
        state.x[f] += flat[frames.displacement[f]]
        x, y, c = (flat[frames.rotation[f]] / frames.length[f]).tolist()
        state.p[f] = compose(rotation((x, y, c)), at(state.p, f))


def set_velocities(
    of: Equations, state: State, fitted: np.ndarray | None = None, G: np.ndarray | None = None
) -> Solved:
    """Set the velocities of ``state``, whose positions satisfy the equations, by G v = -g_t; ``G``
    is the ``jacobian`` of the state, if it is known.
    """
    _, rate = violations(of, state, at_rest=True)
    solved = solve(jacobian(of, state) if G is None else G, -rate, fitted)
    v, W = _by_frames(of, solved.z)
    for f in range(moving_count(of.system.frames)):
        state.v[f], state.w[f] = v[f], np.array(matrix(at(state.p, f))).T @ W[f]
    return solved


def set_accelerations(
    of: Equations, state: State, fitted: np.ndarray | None = None, G: np.ndarray | None = None
) -> Solved:
    """Set the accelerations of ``state``, whose positions and velocities satisfy the equations;
    ``G`` is the ``jacobian`` of the state, if it is known.
    """
    system = of.system
    rows, Z = np.zeros((2, node_count(system), 3))
    of.call(evaluate.prepare, system, state, of.start)
    of.call(evaluate.free_acceleration, system, state, of.start, Z, rows)
    solved = solve(jacobian(of, state) if G is None else G, rows.reshape(-1)[of.equation], fitted)
    state.a[:-1], state.alpha[:-1] = _by_frames(of, solved.z)
    return solved


def _by_frames(of: Equations, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(f, 3) vectors of translation and of rotation in ``z`` (n,), inertial axes."""
    flat, frames = np.zeros((node_count(of.system), 3)), of.system.frames
    flat.reshape(-1)[of.coordinate] = z
    moving = slice(moving_count(frames))
    by_length = frames.length[moving, None]
    return flat[frames.displacement[moving]], flat[frames.rotation[moving]] / by_length


def copied(state: State) -> State:
    """Return a state with arrays of its own."""
    return State(*(np.array(part) for part in state))
