"""Newton's method for an equilibrium, by places and multipliers together.

    f(q) + G^T lam - M a = 0            balance of all forces and moments
    g(q) + C lam         = 0            constraints, C = 0; minus strains of beams

    [ K  G^T ] [ dq   ]     [ f + G^T lam - M a ]
    [ G   C  ] [ dlam ]  = -[ g + C lam         ]       K = d(f + G^T lam - M a)/dq at fixed lam

At rest a = 0. A model that rotates steadily about an axis through c, with the angular velocity w,
has v = w x (x - c), a = w x v, and W = w; what depends on v is then part of K.

The matrix is sparse. Since multipliers are unknowns of their own, no reaction has to be right
before the places are: far fewer iterations than by eliminating them, however stiff the directions
in which they act, of joints as of beams. Where constraints are redundant, or a direction has no
stiffness, small numbers on the diagonal choose the least multipliers and the least motion; the
residual is exact, so they change no result.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import at
from msahl.analysis.linearised.coefficients import Coefficients, coefficients, skews
from msahl.analysis.linearised.plain_units import evaluation_size
from msahl.analysis.linearised.projection import move, prepared
from msahl.analysis.linearised.steady import SMALL_TRAVEL, stiffest
from msahl.elements.beams.group import Beams
from msahl.jit.by_size import by_size
from msahl.system import evaluate
from msahl.system.arrays import State, System, node_count
from msahl.system.state import set_strains

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

MOST_ITERATIONS = 40
LARGEST_ROTATION = 1.0
"""Of a body in one iteration [rad]; displacements likewise, over the length of the system."""
USEFUL = 0.1
"""Share of a step below which its directions of little stiffness are made stiffer."""
REDUNDANT = 1e-10
"""On the diagonal of the multipliers, where the largest stiffness is 1."""
FLAT = 1e-12
"""Likewise on the diagonal of the places."""
BALANCED = 1e-9
"""Force that is not balanced, over the largest force, of an equilibrium; likewise a violation over
the size of the system."""
CANCELLED = 1e-6
"""Likewise where forces at one body cancel each other, so that none of them is seen; the step must
then be small."""
CONVERGED = 1e-13
"""Step, over the size of the system, after which another one changes nothing."""


class Balance(NamedTuple):
    """The equations at one configuration; n coordinates in lengths, c constraint equations."""

    found: Coefficients
    force: np.ndarray  # (n,) f + G^T lam over the lengths of rotations [N]
    violation: np.ndarray  # (c,) g
    relative: float  # largest of either, over the largest force and over the size of the system
    largest: float  # force that takes part in the balance [N]
    size: float  # of the model [m]


class Rest(NamedTuple):
    """Where Newton's method ended."""

    state: State
    balance: Balance
    iterations: int
    converged: bool


BalanceOf = Callable[[State], Balance]


class Factors(NamedTuple):
    """The factorised matrix of an iteration, with the scales of its unknowns and equations."""

    solver: "SuperLU"
    length: np.ndarray  # (n,)
    row: np.ndarray  # (c,) size of each row of G, and its multiplier's
    stiffness: float


class Spin(NamedTuple):
    """A steady rotation of the complete model."""

    rate: np.ndarray  # (3,) angular velocity w, inertial axes [rad/s]
    center: np.ndarray  # (3,) a point of its axis [m]


REST = Spin(np.zeros(3), np.zeros(3))


def with_rates(state: State, spin: Spin = REST) -> State:
    """Return the ``state`` with the velocities and accelerations of a ``spin``, and multipliers of
    its own.
    """
    v = np.cross(spin.rate, state.x - spin.center)
    v[-1] = 0.0
    w = np.zeros_like(v)
    for f in range(len(v) - 1):
        w[f] = np.array(matrix(at(state.p, f))).T @ spin.rate
    a = np.cross(spin.rate, v)
    return state._replace(force=state.force.copy(), v=v, w=w, a=a, alpha=np.zeros_like(state.alpha))


def balance(system: System, state: State, spin: Spin = REST) -> Balance:
    """Return the residual of a ``state``, whose multipliers are ``state.force``, at rest or in the
    rotation ``spin``.
    """
    state = with_rates(state, spin)
    found = _rotating(coefficients(system, state, resultants=True), spin)
    start = prepared(system, state)
    violation, rate = np.zeros_like(state.violation), np.zeros_like(state.violation)
    by_size(evaluate.observe, evaluation_size(system))(system, state, start, violation, rate)
    if system.beams is not None:
        own = state._replace(strain=state.strain.copy())
        set_strains(system, own)
        _set_equations(system.beams, own, violation)
    return weighed(found, state, violation.reshape(-1)[found.equation])


def _set_equations(group: Beams, state: State, violation: np.ndarray) -> None:
    """Set the rows of ``violation`` (k, 3) that belong to beams to C lam minus the strains."""
    lam = np.concatenate([state.force[group.place], state.force[group.place + 1]], axis=1)
    both = np.einsum("gij,gj->gi", group.compliance, lam) - state.strain
    both *= group.weight[:, None]
    violation[group.place], violation[group.place + 1] = both[:, :3], both[:, 3:]


def weighed(found: Coefficients, state: State, violation: np.ndarray) -> Balance:
    """Return the residual with the coefficients ``found`` and the ``violation`` (c,)."""
    lam = state.force.reshape(-1)[found.equation]
    force = (found.force + found.constraint.T @ lam) / found.length
    by_row = _scaled(found.constraint, lam, 1.0 / found.length).data
    least = (found.weight, stiffest(found), _stiffest_strain(found))
    parts = (found.force / found.length, by_row, np.array(least))
    largest = max(float(np.abs(part).max(initial=0.0)) for part in parts)
    size = size_of(found, state)
    relative = float(np.abs(force).max(initial=0.0)) / max(largest, 1e-300)
    relative = max(relative, float(np.abs(violation).max(initial=0.0)) / size)
    return Balance(found, force, violation, relative, largest, size)


def _rotating(found: Coefficients, spin: Spin) -> Coefficients:
    """Return the coefficients with inertia among the forces, and with rates that follow places."""
    from scipy.sparse import block_diag

    if not spin.rate.any():
        return found
    rotated_by = skews(spin.rate[None])[0]
    none = np.zeros((3, 3))
    nodes = found.rotational.reshape(-1, 3)[:, 0]
    rates = block_diag([none if rotates else rotated_by for rotates in nodes], format="csr")
    by_place = found.by_place + found.by_rate @ rates - found.mass @ (rates @ rates)
    force = found.force - found.mass @ found.acceleration
    return found._replace(by_place=by_place.tocsr(), force=force)


def _stiffest_strain(found: Coefficients) -> float:
    """Largest force [N] by which elastic strains resist a small displacement."""
    if found.compliance is None:
        return 0.0
    own = found.compliance.diagonal()
    row = _scaled(found.constraint, np.ones(own.size), 1.0 / found.length)
    squares = np.asarray((row * row).sum(axis=1)).reshape(-1)
    stiffness = np.divide(squares, own, out=np.zeros_like(own), where=own > 0.0)
    return SMALL_TRAVEL * float(np.mean(found.length) * stiffness.max(initial=0.0))


def newton(
    system: System, state: State, balance_of: BalanceOf | None = None, most: int = MOST_ITERATIONS
) -> Rest:
    """Return the equilibrium to which Newton's method leads from a ``state``, whose multipliers
    ``state.force`` are the first guess of the reactions; ``balance_of`` a state is by default that
    of the ``system`` at rest.
    """
    evaluated = balance_of or (lambda now: balance(system, now))
    now, shift, found = evaluated(state), 0.0, Search()
    for _ in range(most):
        step, multipliers = solve(factorise(now, shift), -now.force, -now.violation)
        share = shortened(now, step)
        if share < USEFUL:
            shift = max(10.0 * shift, now.largest / now.size)
            step, multipliers = solve(factorise(now, shift), -now.force, -now.violation)
            share = shortened(now, step)
        elif share == 1.0:
            shift = 0.1 * shift if shift * now.size > 1e-3 * now.largest else 0.0
        state = stepped(system, state, now, share * step, share * multipliers)
        now = evaluated(state)
        if found.ends(state, now, step):
            break
    return found.result(state, now)


class Search:
    """The best state of an iteration, and whether another one would not improve it."""

    def __init__(self) -> None:
        self.state: State | None = None
        self.balance: Balance | None = None
        self.iterations = self.waited = 0
        self.small = False

    @property
    def converged(self) -> bool:
        """Whether the best state is an equilibrium."""
        if self.balance is None:
            return False
        return self.balance.relative <= (CANCELLED if self.small else BALANCED)

    def ends(self, state: State, now: Balance, step: np.ndarray) -> bool:
        """Take note of a state that a ``step`` led to; return whether to stop."""
        self.iterations += 1
        if not np.isfinite(now.relative):
            return True
        last = np.inf if self.balance is None else self.balance.relative
        self.waited = self.waited + 1 if now.relative > 0.5 * last else 0
        if now.relative < last:
            self.state, self.balance = state, now
        self.small = float(np.abs(step).max(initial=0.0)) <= CONVERGED * now.size
        # At round-off the residual stops falling.
        return self.converged and (self.small or self.waited > 1)

    def result(self, state: State, now: Balance) -> Rest:
        """Return the best state, or the last one given if there is none."""
        return Rest(self.state or state, self.balance or now, self.iterations, self.converged)


def factorise(now: Balance, shift: float = 0.0) -> Factors:
    """Factorise the matrix of an iteration, scaled so that its largest numbers are about 1; a
    ``shift`` [N/m] makes all directions stiffer.
    """
    from scipy.sparse.linalg import splu

    matrix, row, stiffness = _matrix(now, shift)
    return Factors(splu(matrix.tocsc()), now.found.length, row, stiffness)


def symmetric_eigenvalues(now: Balance) -> np.ndarray:
    """(n + c,) eigenvalues of the symmetric part of [-K, G^T; G, -C], scaled, in ascending order: c
    of them are negative, and one more for each direction in which the equilibrium is unstable.
    """
    matrix, _, _ = _matrix(now, 0.0)
    dense = matrix.toarray()
    n = now.force.size
    dense[:n, :n] *= -1.0
    dense[n:, n:] *= -1.0
    values: np.ndarray = np.linalg.eigvalsh(0.5 * (dense + dense.T))
    return values


def _matrix(now: Balance, shift: float) -> tuple[Any, np.ndarray, float]:
    """The matrix of an iteration, the sizes (c,) by which its constraints are divided, and the
    stiffness [N/m] by which the equations of forces are.
    """
    from scipy.sparse import block_array, diags_array

    found, inverse = now.found, 1.0 / now.found.length
    K = _scaled(found.by_place, inverse, inverse)
    G = found.constraint @ diags_array(inverse)
    row = np.sqrt(np.asarray((G * G).sum(axis=1)).reshape(-1))
    row[row == 0.0] = 1.0
    G = diags_array(1.0 / row) @ G
    c, n = G.shape
    stiffness = float(abs(K).max()) if K.nnz else 0.0
    C = REDUNDANT * diags_array(np.ones(c))
    if found.compliance is not None:
        # An unloaded beam has all its stiffness in its compliance.
        own = _scaled(found.compliance, 1.0 / row, 1.0 / row)
        softest = float(abs(own).max())
        stiffness = max(stiffness, 1.0 / softest if softest else 0.0)
        C = C + stiffness * own
    stiffness = stiffness or max(now.largest / now.size, 1e-300)
    K = K / stiffness - (FLAT + shift / stiffness) * diags_array(np.ones(n))
    return block_array([[K, G.T], [G, C]] if c else [[K]]), row, stiffness


def solve(factors: Factors, force: np.ndarray, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(n,) displacements, rotations times lengths [m], and (c,) multipliers that change the forces
    over lengths by ``force`` [N] and the constraints by ``change``.
    """
    right = np.concatenate([force / factors.stiffness, change / factors.row])
    both = factors.solver.solve(right)
    n = factors.length.size
    return both[:n], both[n:] * factors.stiffness / factors.row


def shortened(now: Balance, step: np.ndarray) -> float:
    """Return the share of a ``step`` (n,) [m] that rotates and displaces no body too far."""
    rotation = np.abs((step / now.found.length)[now.found.rotational]).max(initial=0.0)
    travel = np.abs(step).max(initial=0.0) / now.size
    return min(1.0, LARGEST_ROTATION / max(float(rotation), float(travel), 1e-300))


def stepped(
    system: System, state: State, now: Balance, step: np.ndarray, multipliers: np.ndarray
) -> State:
    """Return the state after a ``step`` (n,) [m] and a change of the ``multipliers`` (c,)."""
    dq = np.zeros((node_count(system), 3))
    dq.reshape(-1)[now.found.coordinate] = step / now.found.length
    force = state.force.copy()
    force.reshape(-1)[now.found.equation] += multipliers
    return move(system, state, dq)._replace(force=force)


def size_of(found: Coefficients, state: State) -> float:
    """Size of the model [m]: its extent with the origin, or the largest length of a body."""
    extent = float(np.linalg.norm(state.x.max(axis=0) - state.x.min(axis=0)))
    return max(extent, float(found.length.max(initial=0.0)))


def _scaled(matrix: Any, left: np.ndarray, right: np.ndarray) -> Any:
    """Return diag(left) matrix diag(right)."""
    from scipy.sparse import diags_array

    return (diags_array(left) @ matrix @ diags_array(right)).tocsr()
