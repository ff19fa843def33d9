"""Solves a model's constraint equations at one time: positions, velocities and accelerations.

    g(q, t) = 0                    Newton's method           G dq = -g
    G v = -g_t                                               G = dg/dq
    G a = -d(G v)/dt - g_tt at zero accelerations

The unknowns are displacements u [m] and rotations times a length of the body, l theta [m], along
inertial axes; equations in radians count by a length. So G is dimensionless (``Equations``). Where
equations remove all degrees of freedom the solution is unique and needs no masses. Redundant
equations do no harm: ranks are counted by singular values. Equations that contradict each other
leave a violation, which is reported.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, from_axis_angle, from_increment, matrix
from msahl.algebra.vector import at
from msahl.analysis.linearised.coefficients import holonomic
from msahl.analysis.linearised.plain_units import coordinate_numbers, equation_numbers
from msahl.elements.constraints import coordinates, scalar
from msahl.formulations.absolute.frames import first_multiplier, moving_count
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
DIVERGING = 4.0
"""Ratio of a correction to the one before above which Newton's method is given up."""
SLOW = 0.05
"""Ratio of a correction to the one before above which the derivatives are evaluated again."""
CLOSED = 1e-11
"""Violation, relative to the size of the model, that may remain."""
EPSILON = float(np.finfo(float).eps)


class Equations(NamedTuple):
    """How the constraint equations of a system stand among its unknowns; c equations, n unknowns.

    ``call`` calls a kernel with its arguments, which are always the same arrays: compiled kernels
    keep those that they have got.
    """

    system: System
    call: Callable[..., Any]
    start: SystemWorkspace
    seen: State  # the state that is evaluated
    rest: State  # the same with velocities that are zero
    Z: np.ndarray  # (nodes, 3) zeros
    rows: np.ndarray  # (nodes, 3)
    values: np.ndarray  # block values of the Jacobian
    violation: np.ndarray  # (k, 3)
    rate: np.ndarray  # (k, 3)
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
        seen=copied(state),
        rest=copied(state)._replace(v=np.zeros_like(state.v), w=np.zeros_like(state.w)),
        Z=np.zeros((node_count(system), 3)),
        rows=np.zeros((node_count(system), 3)),
        values=np.zeros_like(system.constant),
        violation=np.zeros_like(state.violation),
        rate=np.zeros_like(state.violation),
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


def jacobian(equations: Equations, state: State) -> np.ndarray:
    """(c, n) derivative G of the equations by the unknowns; of equations between rates by rates."""
    rest, frames = _shown(equations.rest, state), equations.system.frames
    equations.call(evaluate.prepare, equations.system, rest, equations.start)
    if equations.system.scalar:
        group, coordinates_start = (
            equations.system.scalar.coordinates,
            equations.start.scalar.coordinates,
        )
        equations.call(coordinates.evaluate, group, coordinates_start, frames, equations.Z)
    # With h^2 = 2 an acceleration of 1 m/s^2 is a displacement of 1 m over the step.
    equations.call(
        evaluate.joint_jacobian,
        equations.system,
        equations.start,
        2.0**0.5,
        equations.Z,
        equations.values,
    )
    G = np.zeros(equations.equation.size * equations.coordinate.size)
    G[equations.place] = equations.values[equations.taken]
    return G.reshape(equations.equation.size, equations.coordinate.size)


def _shown(seen: State, state: State) -> State:
    """Return ``seen`` with the positions of ``state``, and its velocities unless it is at rest."""
    for name in ("time", "x", "p", "angle", "auxiliary", "reaction"):
        getattr(seen, name)[:] = getattr(state, name)
    return seen


def _moving(equations: Equations, state: State) -> State:
    equations.seen.v[:], equations.seen.w[:] = state.v, state.w
    return _shown(equations.seen, state)


def violations(
    equations: Equations, state: State, at_rest: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """(c,) constraint violations [m], 0 of equations between rates, and their rates [m/s], of the
    state or of the state ``at_rest``; counts angles in ``state.angle``.
    """
    seen = _shown(equations.rest, state) if at_rest else _moving(equations, state)
    equations.call(evaluate.prepare, equations.system, seen, equations.start)
    scalar.count_rotations(equations.system.scalar, equations.start.scalar, state.angle)
    equations.call(
        evaluate.observe,
        equations.system,
        seen,
        equations.start,
        equations.violation,
        equations.rate,
    )
    scalar.in_metres(equations.system.scalar, equations.violation, equations.rate)
    chosen = equations.equation - 3 * first_multiplier(equations.system.frames)
    return equations.violation.reshape(-1)[chosen], equations.rate.reshape(-1)[chosen]


def solve(G: np.ndarray, b: np.ndarray) -> Solved:
    """Return the least z (n,) with G z = b (c,), or nearest to it."""
    left, values, right = np.linalg.svd(G, full_matrices=False)
    rank = int(np.count_nonzero(values > INDEPENDENT * values.max(initial=0.0)))
    return again(Solved(np.zeros(G.shape[1]), rank, values, left, right, 0.0), G, b)


def again(known: Solved, G: np.ndarray, b: np.ndarray) -> Solved:
    """Return the least-squares solution of another right-hand side ``b`` (c,), of the matrix G
    whose solution is ``known``.
    """
    r = known.rank
    z = known.right[:r].T @ ((known.left[:, :r].T @ b) / known.values[:r])
    return known._replace(z=z, remaining=float(np.abs(b - G @ z).max(initial=0.0)))


class Closed(NamedTuple):
    """How well positions satisfy the equations."""

    converged: bool
    iterations: int
    first: float  # length of the first correction [m]
    last: float  # likewise of the last
    violation: float  # largest violation [m]


def close(equations: Equations, state: State) -> Closed:
    """Change the positions of ``state`` until they satisfy the equations at its time, which have to
    determine them, by Newton's method from where they are.
    """
    first = last = previous = np.inf
    # Equations between rates do not constrain positions.
    rows = equations.holonomic
    violation, _ = violations(equations, state)
    solution: Callable[[np.ndarray], np.ndarray] | None = None
    for iteration in range(1, MOST_ITERATIONS + 1):
        if solution is None or last > SLOW * previous:
            solution = _solution(jacobian(equations, state)[rows])
        z = solution(-violation[rows])
        previous, last = last, float(np.linalg.norm(z))
        first = last if iteration == 1 else first
        if not np.isfinite(last) or last > DIVERGING * previous:
            break
        displace(equations, state, z)
        violation, _ = violations(equations, state)
        stands = last >= 0.5 * previous and last <= CLOSED * equations.size
        following = last * min(last / previous, 1.0) if iteration > 1 else last**2 / equations.size
        if following <= 0.1 * EPSILON * equations.size or stands:
            break
    largest = float(np.abs(violation).max(initial=0.0))
    return Closed(largest <= CLOSED * equations.size, iteration, first, last, largest)


def _solution(G: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function that solves G z = b in the sense of least squares, of independent
    columns; by orthogonal factors, since singular values would take most of the time.
    """
    Q, R = np.linalg.qr(G)

    def by_factors(b: np.ndarray) -> np.ndarray:
        try:
            return np.asarray(np.linalg.solve(R, Q.T @ b))
        except np.linalg.LinAlgError:
            return np.full(len(R), np.nan)

    return by_factors


def displace(equations: Equations, state: State, z: np.ndarray) -> None:
    """Displace and rotate the bodies of ``state`` by ``z`` (n,): displacements, and rotation
    increments times lengths [m].
    """
    _move(equations, state, z, from_increment)


def predict(equations: Equations, state: State, h: float) -> None:
    """Advance ``state`` by ``h`` [s] with its velocities and accelerations, to second order."""
    flat = np.zeros((node_count(equations.system), 3))
    frames = equations.system.frames
    for f in range(moving_count(frames)):
        W = np.array(matrix(at(state.p, f))) @ state.w[f]
        flat[frames.displacement[f]] = h * state.v[f] + 0.5 * h * h * state.a[f]
        flat[frames.rotation[f]] = frames.length[f] * (h * W + 0.5 * h * h * state.alpha[f])
    _move(equations, state, flat.reshape(-1)[equations.coordinate], _by_vector)
    state.time[0] += h


def _by_vector(c: tuple[float, float, float]) -> tuple[float, float, float]:
    """Parameters of the rotation by the rotation vector ``c``."""
    angle = float(np.linalg.norm(c))
    return from_axis_angle(c, angle) if angle > 0.0 else (0.0, 0.0, 0.0)


def _move(equations: Equations, state: State, z: np.ndarray, rotation: Callable[..., Any]) -> None:
    flat, frames = np.zeros((node_count(equations.system), 3)), equations.system.frames
    flat.reshape(-1)[equations.coordinate] = z
    for f in range(moving_count(frames)):
        state.x[f] += flat[frames.displacement[f]]
        x, y, c = (flat[frames.rotation[f]] / frames.length[f]).tolist()
        state.p[f] = compose(rotation((x, y, c)), at(state.p, f))


def set_velocities(equations: Equations, state: State, G: np.ndarray) -> Solved:
    """Set the velocities of ``state``, whose positions satisfy the equations, by G v = -g_t; ``G``
    is its ``jacobian``.
    """
    _, rate = violations(equations, state, at_rest=True)
    solved = solve(G, -rate)
    v, W = _by_frames(equations, solved.z)
    for f in range(moving_count(equations.system.frames)):
        state.v[f], state.w[f] = v[f], np.array(matrix(at(state.p, f))).T @ W[f]
    return solved


def set_accelerations(equations: Equations, state: State, G: np.ndarray, known: Solved) -> Solved:
    """Set the accelerations of ``state``, whose positions and velocities satisfy the equations;
    ``G`` is its ``jacobian``, ``known`` what ``set_velocities`` returned.
    """
    seen = _moving(equations, state)
    equations.rows[:] = 0.0
    equations.call(evaluate.prepare, equations.system, seen, equations.start)
    equations.call(
        evaluate.free_acceleration,
        equations.system,
        seen,
        equations.start,
        equations.Z,
        equations.rows,
    )
    solved = again(known, G, equations.rows.reshape(-1)[equations.equation])
    state.a[:-1], state.alpha[:-1] = _by_frames(equations, solved.z)
    return solved


def _by_frames(equations: Equations, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(f, 3) vectors of translation and of rotation in ``z`` (n,), inertial axes."""
    flat, frames = np.zeros((node_count(equations.system), 3)), equations.system.frames
    flat.reshape(-1)[equations.coordinate] = z
    moving = slice(moving_count(frames))
    by_length = frames.length[moving, None]
    return flat[frames.displacement[moving]], flat[frames.rotation[moving]] / by_length


def copied(state: State) -> State:
    """Return a state with arrays of its own."""
    return State(*(np.array(part) for part in state))


def copy_to(other: State, state: State) -> State:
    """Set the arrays of the ``other`` state, and return it: compiled functions know its arrays."""
    for there, here in zip(other, state, strict=True):
        np.copyto(there, here)
    return other
