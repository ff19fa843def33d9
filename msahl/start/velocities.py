"""Find consistent velocities, accelerations and reactions at t = 0.

    G v = 0                                       hidden velocity constraint of every joint
    [ M  -G^T ] [ dv ]   [   0  ]                 smallest change by mass
    [ G    0  ] [ mu ] = [ -G v ]

    [ M  -G^T ] [ a   ]   [ forces          ]     index-1 problem of the accelerations and
    [ G    0  ] [ lam ] = [ -dG/dt v        ]     the initial reactions

Both matrices are the step's Jacobian for a system at rest with h^2 = 2. By default the angular
velocities are kept and only the translational ones change (the thesis's top decks give v = 0 with a
spin that moves the mass centre); where that cannot close the joints, all may change. Velocities
that break a joint would alternate with its multiplier for ever, at conserved energy.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.functions import rate_round_off
from msahl.elements import reactions
from msahl.elements.beams import instant
from msahl.elements.constraints import scalar
from msahl.elements.reactions import MOST_ROUNDS
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.jit.by_size import by_size
from msahl.linalg import sparse_lu
from msahl.linalg.elimination import new_factor, products
from msahl.ports import forces, sliding
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, node_count
from msahl.system.unknowns import Unknowns, choose
from msahl.system.work_arrays import WorkArrays, jacobian_at_rest, new_work_arrays

CONSISTENT = 1e-12
"""Violation rate, relative to the largest speed, that is taken for round-off."""
ROUND_OFF = 1e-10
"""Residual of a linear solution, relative to its right-hand side, above which pivots failed."""

REFINEMENTS = 1
"""Solutions for the residual that the first left: the round-off of pivots in a fixed order adds up
along a chain, to 1e-10 of 20,000 bodies, which is that of a matrix without an inverse."""

LARGEST_DENSE = 600
"""Most unknowns of a singular matrix for which least squares are taken of the dense matrix."""
RELAXED = 1e-9
"""Compliance put on multipliers that redundant equations leave open, against those of order 1."""
REPETITIONS = 4
"""Each leaves a share of RELAXED over the joints' own compliance."""


class VelocityChange(NamedTuple):
    """What was done to the velocities of the deck."""

    method: str  # "none", "keepAngular", "massWeighted" or "asGiven"
    rate: float  # largest violation rate as given [m/s]
    dv: np.ndarray  # (n, 3) change of the mass centres' velocities, inertial axes [m/s]
    dw: np.ndarray  # (n, 3) change of the angular velocities, inertial axes [rad/s]


class StartError(Exception):
    """There is no consistent start, or the deck refuses to have it made; the message says more."""


def make_consistent(
    system: System,
    state: State,
    free: np.ndarray,
    wish: str = "keepAngular",
    work_arrays: WorkArrays | None = None,
) -> VelocityChange:
    """Change the velocities of the ``free`` unknowns so that no joint opens; say how.

    ``wish`` is "keepAngular", "massWeighted", "asGiven", which changes nothing, or "refuse": then
    inconsistent velocities raise ``StartError``, as do those that cannot be mended (two motions at
    odds).
    """
    n = moving_count(system.frames)
    work_arrays = work_arrays or new_work_arrays(system, state)
    start = work_arrays.start
    v0, w0 = state.v.copy(), state.w.copy()
    given = _largest(_violation_rate(system, state, work_arrays))
    speed = max(np.abs(v0).max(), (np.abs(start.frames.W) * system.frames.length[:, None]).max())
    near = CONSISTENT * max(speed, given) + _round_off_of_motions(system)
    method = "none"
    if given > near and wish == "asGiven":
        return VelocityChange(wish, given, np.zeros((n, 3)), np.zeros((n, 3)))
    if given > near:
        if wish == "refuse":
            raise StartError(
                f"the initial velocities open a joint at {given:.3g} m/s, and the deck says "
                'velocity="refuse"; mend them, or let them be changed: velocity="keepAngular"'
            )
        method = wish
        if wish == "keepAngular":
            project(system, state, work_arrays, choose(system, _translations(system, free)))
            if _largest(_violation_rate(system, state, work_arrays)) > 1e3 * near:
                method = "massWeighted"
                state.v[:], state.w[:] = v0, w0
        if method == "massWeighted":
            project(system, state, work_arrays, choose(system, free))
        left = _largest(_violation_rate(system, state, work_arrays))
        if left > 1e3 * near:
            raise StartError(
                f"no velocities satisfy all joints and motions: {left:.3g} m/s are left over; "
                "look for motions that contradict each other or the joints at t = 0"
            )
    R = start.frames.R
    dw = np.einsum("bij,bj->bi", R, state.w - w0)
    return VelocityChange(method, given, (state.v - v0)[:n], dw[:n])


def solve_accelerations(
    system: System,
    state: State,
    unknowns: Unknowns,
    values: np.ndarray | None = None,
    work_arrays: WorkArrays | None = None,
) -> None:
    """Set accelerations, multipliers and reactions of ``state`` to their values at t = 0;
    ``values`` are those of ``jacobian_at_rest``, if they are known.

    Friction presses by the reaction, which depends on friction: rounds until it stands still.
    """
    work_arrays = work_arrays or new_work_arrays(system, state)
    values = jacobian_at_rest(system, state, work_arrays) if values is None else values
    start, _, call = work_arrays
    rows, Z = np.zeros((2, node_count(system), 3))
    frames = system.frames
    for _ in range(MOST_ROUNDS):
        last = state.reaction.copy()
        call(evaluate.prepare, system, state, start)
        call(evaluate.free_acceleration, system, state, start, Z, rows)
        matrix = _with_friction(system, start, values, call)
        solution = solve_at_rest(system, state, rows, unknowns, matrix)
        state.a[:] = solution[frames.displacement]
        state.alpha[:] = solution[frames.rotation] / frames.length[:, None]
        state.force[:] = solution[first_multiplier(frames) :] * system.unit
        call(evaluate.set_reactions, system, state, start, Z)
        if not forces.depend_on_reactions(system.forces) or reactions.is_unchanged(
            state.reaction, last
        ):
            break


def _with_friction(
    system: System, start: SystemWorkspace, values: np.ndarray, call: Callable[..., Any]
) -> np.ndarray:
    """Return the ``values`` of the matrix at rest with the friction of contacts that slide."""
    group = system.forces.sliding
    if group is None:
        return values
    matrix, dt2 = values.copy(), evaluate.dt2(system, math.sqrt(2.0))
    call(sliding.add_to_matrix, group, system.scalar, start.scalar, system.frames, dt2, matrix)
    return matrix


def _largest(vectors: np.ndarray) -> float:
    """Length of the longest of ``vectors`` (k, 3)."""
    return float(np.linalg.norm(vectors, axis=1).max(initial=0.0))


def _round_off_of_motions(system: System) -> float:
    """Round-off of the rates of prescribed motions at t = 0 [m/s]: of one at rest, as a sine at its
    crest, it is all that is left."""
    if system.scalar is None:
        return 0.0
    rows = system.scalar.equations
    return sum(
        float(rows.scale[r]) * rate_round_off(system.laws, rows.law[r], 0.0)
        for r in np.flatnonzero(rows.law >= 0)
    )


def _violation_rate(system: System, state: State, work_arrays: WorkArrays) -> np.ndarray:
    """(k, 3) violation rates of the state [m/s], radians times a length; prepares ``start``."""
    work_arrays.call(evaluate.prepare, system, state, work_arrays.start)
    violation, rate = np.zeros_like(state.violation), np.zeros_like(state.violation)
    work_arrays.call(evaluate.observe, system, state, work_arrays.start, violation, rate)
    scalar.in_metres(system.scalar, violation, rate)
    instant.in_metres(system.beams, violation, rate)
    return rate


def _translations(system: System, free: np.ndarray) -> np.ndarray:
    """The free unknowns without the rotations."""
    node = free // 3
    translations: np.ndarray = free[~np.isin(node, system.frames.rotation)]
    return translations


def project(system: System, state: State, work_arrays: WorkArrays, unknowns: Unknowns) -> None:
    """Change the velocities among ``unknowns``, least by mass, so that the violation rate is 0."""
    rows = np.zeros((node_count(system), 3))
    frames = system.frames
    rows[first_multiplier(frames) :] = -_violation_rate(system, state, work_arrays)
    R = work_arrays.start.frames.R.copy()  # of the state; at rest it is the same
    at_rest = jacobian_at_rest(system, state, work_arrays)
    add_to_velocities(system, state, solve_at_rest(system, state, rows, unknowns, at_rest), R)


def add_to_velocities(system: System, state: State, change: np.ndarray, R: np.ndarray) -> None:
    """Add a ``change`` (nodes, 3) to the velocities of bodies with the rotations ``R``."""
    frames = system.frames
    state.v[:] += change[frames.displacement]
    dW = change[frames.rotation] / frames.length[:, None]
    state.w[:] += np.einsum("bji,bj->bi", R, dW)


def solve_at_rest(
    system: System,
    state: State,
    rows: np.ndarray,
    unknowns: Unknowns,
    values: np.ndarray | None = None,
    factor: np.ndarray | None = None,
) -> np.ndarray:
    """Solve with the Jacobian at rest, whose block values are ``values`` if they are known, in the
    ``unknowns``; (nodes, 3), zero elsewhere. Its ``factor`` may be known as well.
    """
    values = jacobian_at_rest(system, state) if values is None else values
    factor = factor_at_rest(values, unknowns) if factor is None else factor
    first = 3 * first_multiplier(system.frames)
    solution = np.zeros_like(rows)
    solution.reshape(-1)[unknowns.free] = _solve(values, rows.reshape(-1), unknowns, first, factor)
    return solution


def factor_at_rest(values: np.ndarray, unknowns: Unknowns) -> np.ndarray:
    """Return the sparse factors of the matrix with these block ``values`` in the ``unknowns``; not
    numbers where a pivot is zero.
    """
    lu = unknowns.elimination
    factor = new_factor(lu)
    factorise = by_size(sparse_lu.factor, lu.order.size, products(lu))
    with np.errstate(all="ignore"):
        factorise(lu, values, factor)
    return factor


def _solve(
    values: np.ndarray, rows: np.ndarray, unknowns: Unknowns, first: int, factor: np.ndarray
) -> np.ndarray:
    """The free unknowns by the sparse ``factor``, or, where joints are redundant, by least squares;
    multipliers begin at the flat unknown ``first``.
    """
    x = solve_sparse(values, rows, unknowns, factor)
    if x is not None:
        return x
    size = unknowns.free.size
    if size > LARGEST_DENSE:
        return _solve_relaxed(values, rows, unknowns, first)
    A = np.zeros(size * size)
    A[unknowns.dense_to] = values[unknowns.dense_from]
    least: np.ndarray = np.linalg.lstsq(A.reshape(size, size), rows[unknowns.free], rcond=None)[0]
    return least


def _solve_relaxed(
    values: np.ndarray, rows: np.ndarray, unknowns: Unknowns, first: int
) -> np.ndarray:
    """A solution (f,) for many unknowns, of which redundant equations leave multipliers open:
    these are relaxed, and what that changes in the others is taken back by repetition.
    """
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import splu

    size = unknowns.free.size
    places = np.divmod(unknowns.dense_to, size)
    A = coo_array((values[unknowns.dense_from], places), shape=(size, size)).tocsc()
    factors = splu((A - diags_array(np.where(unknowns.free >= first, RELAXED, 0.0))).tocsc())
    wanted, x = rows[unknowns.free], np.zeros(size)
    for _ in range(REPETITIONS):
        x += factors.solve(wanted - A @ x)
    return x


def solve_sparse(
    values: np.ndarray, rows: np.ndarray, unknowns: Unknowns, factor: np.ndarray | None = None
) -> np.ndarray | None:
    """The free unknowns (f,) by the sparse factors, or None if the matrix is (nearly) singular."""
    lu = unknowns.elimination
    order = lu.order
    factor = factor_at_rest(values, unknowns) if factor is None else factor
    solution, left, y = np.zeros_like(rows), np.zeros_like(rows), rows[order]
    wanted = rows[unknowns.free]
    solve = by_size(sparse_lu.solve, order.size, int(lu.base[-1]))
    largest = np.abs(wanted).max(initial=0.0)
    with np.errstate(all="ignore"):
        solve(lu, factor, y)
        solution[order] = y
        for _ in range(REFINEMENTS):
            left[unknowns.free] = wanted - _times(values, solution[unknowns.free], unknowns)
            y = left[order]
            solve(lu, factor, y)
            solution[order] += y
        x = solution[unknowns.free]
        good = np.abs(_times(values, x, unknowns) - wanted).max(initial=0.0) <= ROUND_OFF * largest
        bounded = np.abs(x).max(initial=0.0) <= largest / ROUND_OFF
    return x if good and bounded else None


def _times(values: np.ndarray, x: np.ndarray, unknowns: Unknowns) -> np.ndarray:
    """(f,) the matrix of the free unknowns times ``x``."""
    rows, columns = np.divmod(unknowns.dense_to, max(x.size, 1))
    return np.bincount(rows, values[unknowns.dense_from] * x[columns], x.size)
