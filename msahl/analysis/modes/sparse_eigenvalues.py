"""Eigenvalues nearest to a shift, of large models: shift-invert with sparse factors.

The linearised equations with multipliers are a pencil, x = (q~, v~, ds, dlam), with q~ = L^T dq and
v~ = L^T dv, M = L L^T, as in ``reduced``:

    lambda E x = A x        E = diag(1, 1, 1, 0)
                            | T~  1            |    places
                        A = | K~  D~  S~  G~^T |    forces by mass
                            | s_q s_v s_s      |    auxiliary states
                            | G_h~             |    constraints between places
                            | B~  G_n~         |    constraints between rates

Multipliers belong to infinite eigenvalues. (A - sigma E)^-1 E has the eigenvalues
1/(lambda - sigma), those nearest to the shift first and infinite ones at zero: Arnoldi's method
finds the first. The left eigenvectors y come from the transposed matrix. With both

    lambda = y^H A x / y^H E x        exact to second order of the errors of x and y
    error  = (eps |y|^T (|A| + |lambda E|) |x| + |y^H (A - lambda E) x|) / |y^H E x|

which does not depend on units. Redundant constraint equations are removed first.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msahl.analysis.linearised.coefficients import Coefficients, skews
from msahl.start.redundancy import INDEPENDENT, null_space

if TYPE_CHECKING:
    from scipy.sparse import csc_array

    from msahl.analysis.modes.zero_eigenvalues import ZeroSpace

EXTRA = 4
"""Eigenvalues computed beyond those that are wanted, as pairs may be cut in half at the end."""
LEAST = 4
"""Degrees of freedom for each eigenvalue that is wanted from which this method is used."""
SAME = 1e-6
"""Distance, relative to their size, of right and left eigenvalues that are one."""
NO_STIFFNESS = 1e-13
"""Eigenvalue of a stiffness matrix, relative to its largest entry, that is round-off; that of the
factors is smaller by a thousand."""
SYMMETRIC = 1e-13
"""Asymmetry of a stiffness matrix, relative to its largest entry, that is round-off."""
ZERO = 1e-12
"""Square of an eigenvalue, relative to the terms it is the sum of, that is zero."""
NEAR_ZERO = 1e-6
"""Shift, relative to the largest stiffness by mass, where zero is an eigenvalue."""
MOST_RIGID = 200
"""Zeros that are computed to reach eigenvalues behind them."""
MOST_RESTARTS = 300
"""Of Arnoldi's method; it needs some ten where eigenvalues are not nearly equal."""
NOT_ZERO = 10.0
"""Size of an eigenvalue, relative to its error, from which it is not zero."""
SHIFTS = (1e-4, 1e-5, 1e-6, 1e-3, 1e-7)
"""Shifts beside zero that are tried, relative to the highest frequency: one has to be smaller than
the lowest by a factor of ten or more, and not by so much that round-off hides that."""
SINGULAR = 1e13
"""Growth of a solution from which a matrix counts as singular."""


class NotFoundError(Exception):
    """There is an eigenvalue at the shift, or there are too many nearly equal ones."""


class Pencil(NamedTuple):
    """A and E of lambda E x = A x, and how x becomes dq and ds; n coordinates, s states."""

    A: "csc_array"  # (m, m)
    E: np.ndarray  # (m,) its diagonal
    back: "csc_array"  # (n, n) dq = back q~
    coordinates: int  # n
    states: int  # s
    redundant: int
    independent: int  # constraint equations
    stiffness: Any  # (n, n) K~, if it is symmetric and nothing depends on rates; else None
    constraint: Any  # (c, n) G_h~


def is_worthwhile(of: Pencil, number: int) -> bool:
    """Return whether there are many more eigenvalues than are wanted, as Arnoldi's method needs."""
    between_rates = int(np.count_nonzero(of.E)) - of.coordinates - of.independent
    return between_rates > LEAST * (number + EXTRA)


def without_stiffness(of: Pencil) -> int:
    """Return the number of directions in which the stiffness is round-off: by Sylvester's law of
    inertia the eigenvalues between two shifts are as many as pivots change their signs.
    """
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import splu

    n = of.coordinates
    K = of.A[n : 2 * n, :n]
    tiny = NO_STIFFNESS * (float(abs(K).max()) if K.nnz else 0.0)
    if not tiny:
        return n
    positive = []
    for shift in (tiny, -tiny):
        shifted = (0.5 * (K + K.T) + shift * eye_array(n)).tocsc()
        try:
            factors = splu(
                shifted,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError:
            return 0  # not known
        positive.append(int(np.count_nonzero(factors.U.diagonal() > 0.0)))
    return positive[0] - positive[1]


class Found(NamedTuple):
    """Eigenvalues with imaginary part >= 0 by size."""

    zeros: int  # eigenvalues that are zero, the first ones
    rigid: int  # their eigenvectors
    value: np.ndarray  # (k,) complex [1/s]
    places: np.ndarray  # (n, k) dq
    states: np.ndarray  # (s, k) ds
    condition: np.ndarray  # (k,)
    error: np.ndarray  # (k,) [1/s]


def pencil(found: Coefficients, axes: np.ndarray) -> Pencil:
    """Return the pencil of a linearised system, seen in axes with this angular velocity."""
    from scipy.sparse import block_array, csr_array, eye_array, kron

    n, s = found.coordinate.size, found.state_rate.size
    lower, back = _mass_factors(found)
    W = kron(eye_array(n // 3), skews(axes[None])[0]).tocsr()
    one = eye_array(n)
    G, B, redundant = _independent(found, back)
    between_places = found.holonomic if not redundant else G.holonomic
    G_all, G_h, G_n = G.matrix, G.matrix[between_places], G.matrix[~between_places]
    B_n = B[~between_places]
    drift = lower.T @ (found.drift - W) @ back
    K, D = back.T @ found.by_place @ back, back.T @ found.by_rate @ back - lower.T @ W @ back
    states = csr_array(found.state_by_state) if s else None
    A = block_array(
        [
            [drift, one, None, None],
            [K, D, csr_array(back.T @ found.by_state) if s else None, G_all.T],
            *(
                [[csr_array(found.state_by_place @ back), csr_array(found.state_by_rate @ back),
                  states, None]]
                if s else []
            ),
            *([[G_h, None, None, None]] if G_h.shape[0] else []),
            *([[B_n, G_n, None, None]] if G_n.shape[0] else []),
        ],
        format="csc",
    )  # fmt: skip
    E = np.concatenate([np.ones(2 * n + s), np.zeros(A.shape[0] - 2 * n - s)])
    is_symmetric = abs(K - K.T).max() <= SYMMETRIC * abs(K).max()
    conservative = is_symmetric and not (s or G_n.shape[0] or abs(D).max() or abs(drift).max())
    return Pencil(
        A, E, back.tocsc(), n, s, redundant, G_all.shape[0], K if conservative else None, G_h
    )


class _Constraints(NamedTuple):
    matrix: Any  # csr_array (c, n), rows of unit length
    holonomic: np.ndarray  # (c,)


def _independent(found: Coefficients, back: Any) -> tuple[_Constraints, Any, int]:
    """Return the constraints without those that follow from others, B of these, and the number of
    those removed.
    """
    from scipy.linalg import qr
    from scipy.sparse import diags_array

    G = (found.constraint @ back).tocsr()
    size = np.sqrt(np.asarray(G.multiply(G).sum(axis=1)).reshape(-1))
    scale = diags_array(1.0 / np.where(size > 0.0, size, 1.0))
    G, B = (scale @ G).tocsr(), (scale @ found.constraint_rate @ back).tocsr()
    if not G.shape[0] or _is_regular(G):
        return _Constraints(G, found.holonomic), B, 0
    null = null_space(G)
    _, _, pivots = qr(null.T, mode="economic", pivoting=True)
    kept = np.ones(G.shape[0], dtype=bool)
    kept[pivots[: null.shape[1]]] = False
    return _Constraints(G[kept], found.holonomic[kept]), B[kept], null.shape[1]


def _is_regular(G: Any) -> bool:
    """Return whether the rows of ``G`` are independent."""
    from scipy.sparse.linalg import splu

    S = (G @ G.T).tocsc()
    b = np.random.default_rng(0).normal(size=S.shape[0])
    try:
        x = splu(S).solve(b)
    except RuntimeError:
        return False
    # The eigenvalues of G G^T are the squares of the singular values.
    return bool(np.linalg.norm(x) <= np.linalg.norm(b) / INDEPENDENT**1.2)


def _mass_factors(found: Coefficients) -> tuple[Any, Any]:
    """L of M = L L^T, which has 3 x 3 blocks on its diagonal, and the transpose of its inverse."""
    from scipy.sparse import bsr_array

    n = found.coordinate.size
    blocks = bsr_array(found.mass, blocksize=(3, 3))
    blocks.sum_duplicates()
    data = np.zeros((n // 3, 3, 3))
    rows = np.repeat(np.arange(n // 3), np.diff(blocks.indptr))
    data[rows] = blocks.data
    lower = np.linalg.cholesky(data)
    at = (np.arange(n // 3), np.arange(n // 3 + 1))
    L = bsr_array((lower, *at), shape=(n, n)).tocsr()
    back = bsr_array((np.linalg.inv(lower).transpose(0, 2, 1), *at), shape=(n, n)).tocsr()
    return L, back


def nearest(of: Pencil, number: int, frequency: float = 0.0) -> Found:
    """Return the zeros and about ``number`` other eigenvalues with imaginary part >= 0, nearest to
    2 pi i times the ``frequency`` [Hz]; raises ``NotFoundError`` if that is impossible.
    """
    from scipy.sparse.linalg import ArpackError

    try:
        if of.stiffness is not None:
            return _all_vibrations(of, number, frequency)
        return _general(of, number, frequency)
    except ArpackError as error:
        raise NotFoundError from error


def _general(of: Pencil, number: int, frequency: float) -> Found:
    """Eigenvalues of a model with damping, gyroscopic terms, auxiliary states or forces that follow
    the motion.
    """
    from scipy.sparse.linalg import ArpackError

    finite = int(np.count_nonzero(of.E))
    wanted = min((number if frequency else 2 * number) + EXTRA, max(finite - 2, 1))
    if frequency:
        return _by_both(of, wanted, 2j * np.pi * frequency)
    try:
        found = _by_both(of, wanted, 0.0)
    except (NotFoundError, ArpackError):
        return _behind_zeros(of, wanted)
    # What is not larger than its error may be zero.
    is_clear = np.all(np.abs(found.value) > NOT_ZERO * found.error)
    return found if is_clear else _behind_zeros(of, wanted)


def _by_both(of: Pencil, wanted: int, shift: complex) -> Found:
    """Eigenvalues by right and left eigenvectors."""
    from scipy.sparse import diags_array

    factors = _factors((of.A - shift * diags_array(of.E)).tocsc())
    right_values, right = _arnoldi(of, factors, "N", wanted, shift)
    left_values, left = _arnoldi(of, factors, "H", wanted, shift)
    return _refined(of, right_values, right, left_values.conj(), left)


def _highest(of: Pencil) -> float:
    """The size of the largest eigenvalues [1/s], about."""
    n = of.coordinates
    K, D = of.A[n : 2 * n, :n], of.A[n : 2 * n, n : 2 * n]
    stiffest = float(abs(K).max()) ** 0.5 if K.nnz else 0.0
    return max(stiffest, float(abs(D).max()) if D.nnz else 0.0) or 1.0


def _behind_zeros(of: Pencil, wanted: int) -> Found:
    """Zeros, counted by rank, and the other eigenvalues next to them, whose eigenvectors have
    nothing of the zeros'.
    """
    from scipy.sparse import diags_array

    from msahl.analysis.modes.zero_eigenvalues import zero_space

    highest, zeros = _highest(of), None
    for shift_size in SHIFTS:
        shift = shift_size * highest
        factors = _factors((of.A - shift * diags_array(of.E)).tocsc())
        zeros = zero_space(of.A, of.E, of.coordinates, factors, shift)
        if zeros is not None:
            break
    if zeros is None:
        raise NotFoundError
    right_values, right = _arnoldi(of, factors, "N", wanted, shift, zeros)
    left_values, left = _arnoldi(of, factors, "H", wanted, shift, zeros)
    found = _refined(of, right_values, right, left_values.conj(), left)
    n, z = of.coordinates, zeros.right.shape[1]
    states = zeros.right[2 * n : 2 * n + of.states]
    return Found(
        zeros=z,
        rigid=zeros.null,
        value=np.concatenate([np.zeros(z), found.value]),
        places=np.concatenate([of.back @ zeros.right[:n], found.places], axis=1),
        states=np.concatenate([states, found.states], axis=1),
        condition=np.concatenate([np.full(z, np.nan), found.condition]),
        error=np.concatenate([np.zeros(z), found.error]),
    )


def _factors(matrix: Any) -> Any:
    """The sparse factors of a ``matrix``; ``NotFoundError`` if it has none."""
    from scipy.sparse.linalg import splu

    try:
        return splu(matrix)
    except RuntimeError as error:
        raise NotFoundError from error


def _arnoldi(
    of: Pencil,
    factors: Any,
    transposed: str,
    wanted: int,
    shift: complex,
    without: "ZeroSpace | None" = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and eigenvectors of the pencil, or of its conjugate transpose, ``without`` those
    that are zero.
    """
    from scipy.sparse.linalg import LinearOperator, eigs

    m, finite = len(of.E), int(np.count_nonzero(of.E))
    kind = complex if isinstance(shift, complex) else float
    sigma = np.conj(shift) if transposed == "H" else shift
    rest = np.zeros(m - finite)

    def solve(x: np.ndarray) -> np.ndarray:
        """(A - sigma E)^-1 E x with all unknowns, or the same of the transposed matrices."""
        right = np.concatenate([x.reshape(-1), rest]).astype(kind, copy=False)
        solved: np.ndarray = factors.solve(right, transposed)
        return solved if without is None else without.removed(solved, of.E, transposed)

    # Beside zero, a small shift is meant to let it grow.
    limit = np.inf if shift and kind is float else SINGULAR
    start = _start(lambda x: solve(x)[:finite], finite, limit).astype(kind)
    operator = LinearOperator(
        (finite, finite), matvec=lambda x: solve(x)[:finite], dtype=np.dtype(kind)
    )
    basis = min(finite - 1, max(2 * wanted + 2, 20))
    values, vectors = eigs(
        operator, wanted, which="LM", v0=start, ncv=basis, tol=0.0, maxiter=MOST_RESTARTS
    )
    complete = np.zeros((m, values.size), dtype=complex)
    for k in range(values.size):
        x = vectors[:, k]
        both = (solve(x.real), solve(x.imag)) if kind is float else (solve(x), 0.0)
        complete[:, k] = (both[0] + 1j * both[1]) / values[k]
    return sigma + 1.0 / values, complete


def _start(
    apply: Callable[[np.ndarray], np.ndarray], m: int, limit: float = SINGULAR
) -> np.ndarray:
    """A vector (m,) that has nothing of infinite eigenvalues but round-off, as the operator was
    applied to it; raises ``NotFoundError`` if that grows beyond the ``limit``.
    """
    start = np.random.default_rng(0).normal(size=m)
    start /= np.linalg.norm(start)
    for _ in range(3):
        start = apply(start)
        size = float(np.linalg.norm(start))
        if not size < limit:
            raise NotFoundError
        start /= size
    return start


def _refined(
    of: Pencil,
    right_values: np.ndarray,
    right: np.ndarray,
    left_values: np.ndarray,
    left: np.ndarray,
) -> Found:
    """Pair right and left eigenvectors, and improve the eigenvalues by both."""
    n, found = of.coordinates, []
    size, eps = abs(of.A), np.finfo(float).eps
    allowed = _allowed(of, left[:n])
    for k in np.flatnonzero(right_values.imag >= -1e-9 * np.abs(right_values)):
        i = int(np.argmin(np.abs(left_values - right_values[k])))
        if abs(left_values[i] - right_values[k]) > SAME * abs(right_values[k]):
            continue
        x, y = right[:, k], left[:, i]
        product = y.conj() @ (of.E * x)
        value = complex(y.conj() @ (of.A @ x) / product)
        rounding = np.abs(y) @ (size @ np.abs(x) + abs(value) * of.E * np.abs(x))
        residual = np.abs(y.conj() @ (of.A @ x - value * of.E * x))
        error = float((eps * rounding + residual) / np.abs(product))
        # Places count by the frequency, so that an undamped vibration has the condition 1.
        scale = np.concatenate([np.full(n, abs(value)), np.ones(n + of.states)])
        x_size = np.linalg.norm(scale * x[: scale.size])
        y_size = np.linalg.norm(np.concatenate([allowed[:, i], y[n : scale.size]]) / scale)
        found.append((value, k, float(x_size * y_size / np.abs(product)), error))
    found.sort(key=lambda entry: (round(abs(entry[0]), 12), -entry[0].imag))
    chosen = [entry[1] for entry in found]
    x = right[:, chosen]
    return Found(
        zeros=0,
        rigid=0,
        value=np.array([_cleaned(value, error) for value, _, _, error in found]),
        places=of.back @ x[:n],
        states=x[2 * n : 2 * n + of.states],
        condition=np.array([entry[2] for entry in found]),
        error=np.array([entry[3] for entry in found]),
    )


def _allowed(of: Pencil, y: np.ndarray) -> np.ndarray:
    """Return ``y`` (n, k) without the parts along constraints, where no places can be."""
    from scipy.sparse import block_array, eye_array

    c, n = of.constraint.shape
    if not c:
        return y
    one = eye_array(n)
    factors = _factors(block_array([[one, of.constraint.T], [of.constraint, None]], format="csc"))
    rows = np.concatenate([y, np.zeros((c, y.shape[1]))])
    solved: np.ndarray = factors.solve(rows.real.copy()) + 1j * factors.solve(rows.imag.copy())
    return solved[:n]


def _all_vibrations(of: Pencil, number: int, frequency: float) -> Found:
    """The zeros and ``number`` others of a model without damping."""
    limit = of.coordinates - of.constraint.shape[0]
    shift, wanted = -((2.0 * np.pi * frequency) ** 2), number
    while True:
        try:
            found = _vibrations(of, min(wanted, limit), shift)
        except NotFoundError:
            if frequency or shift > 0.0:
                raise
            # Beyond the zeros, where a stable model has no eigenvalue.
            shift = NEAR_ZERO * float(abs(of.stiffness).max()) or NEAR_ZERO
            continue
        others = int(np.count_nonzero(found.value[found.zeros :].imag > 0.0))
        others += int(np.count_nonzero(found.value.real > 0.0))
        if others >= number or wanted >= limit:
            return found
        if wanted > MOST_RIGID:
            raise NotFoundError
        wanted *= 2


def _vibrations(of: Pencil, number: int, shift: float) -> Found:
    """Vibrations without damping, lambda^2 q~ = K~ q~ + G~^T lam with G~ q~ = 0: mu = lambda^2 are
    the eigenvalues of a symmetric matrix, real and well conditioned; those nearest to ``shift``.
    """
    from scipy.sparse import block_array, eye_array
    from scipy.sparse.linalg import LinearOperator, eigsh

    n, c = of.coordinates, of.constraint.shape[0]
    top = [of.stiffness - shift * eye_array(n), of.constraint.T]
    matrix = block_array([top, [of.constraint, None]] if c else [top[:1]], format="csc")
    factors = _factors(matrix)

    def solve(x: np.ndarray) -> np.ndarray:
        """(n + c,) q~ and multipliers under the inertia of x."""
        solved: np.ndarray = factors.solve(np.concatenate([x.reshape(-1), np.zeros(c)]))
        return solved

    start = _start(lambda x: solve(x)[:n], n)
    operator = LinearOperator((n, n), matvec=lambda x: solve(x)[:n], dtype=np.dtype(float))
    number = min(number, n - 1)
    basis = min(n, max(2 * number + 1, 20))
    values, vectors = eigsh(
        operator, number, which="LM", v0=start, ncv=basis, tol=0.0, maxiter=MOST_RESTARTS
    )
    solutions = [solve(vectors[:, k]) for k in np.flatnonzero(values)]
    return _of_squares(of, [x / np.linalg.norm(x[:n]) for x in solutions])


def _of_squares(of: Pencil, solutions: list[np.ndarray]) -> Found:
    """Eigenvalues from vectors (n + c,) of places and multipliers."""
    n, eps = of.coordinates, np.finfo(float).eps
    size, forces = abs(of.stiffness), abs(of.constraint.T)
    value, places, errors, zeros = [], [], [], 0
    for x in solutions:
        q, force = x[:n], of.constraint.T @ x[n:]
        mu = float(q @ (of.stiffness @ q))
        rounding = float(np.abs(q) @ (size @ np.abs(q) + forces @ np.abs(x[n:])) + abs(mu))
        error = float(eps) * rounding + float(np.abs(q @ (of.stiffness @ q + force - mu * q)))
        root = abs(mu) ** 0.5
        if abs(mu) <= ZERO * rounding:
            pairs, zeros, error = [0j, 0j], zeros + 2, 0.0
        else:
            # An unstable equilibrium has a growing and a decaying motion.
            pairs = [complex(0.0, root)] if mu < 0.0 else [complex(root), complex(-root)]
            error /= 2.0 * root
        for entry in pairs:
            value.append(entry)
            places.append(q)
            errors.append(error)
    order = np.argsort(np.abs(value), kind="stable")
    return Found(
        zeros=zeros,
        rigid=zeros // 2,
        value=np.array(value)[order],
        places=(of.back @ np.array(places)[order].T).astype(complex),
        states=np.zeros((0, len(value)), dtype=complex),
        condition=np.ones(len(value)),
        error=np.array(errors)[order],
    )


def _cleaned(value: complex, error: float) -> complex:
    """Return a real eigenvalue without the round-off of an imaginary part."""
    return complex(value.real, 0.0) if abs(value.imag) <= error else value
