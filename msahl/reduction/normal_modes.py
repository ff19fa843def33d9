"""Normal modes of lowest frequency: K phi = lambda M phi with K positive definite.

Small systems are solved densely, large ones by Lanczos iterations with the factors of K (shift and
invert). Of large systems the signs of the pivots of K - lambda M count the eigenvalues below lambda
(Sylvester), which shows whether the iterations missed one.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import ArpackError, LinearOperator, SuperLU, eigsh, splu

from msahl.reduction.faults import ReductionError

DENSE = 500
"""Degrees of freedom up to which dense matrices are faster than iterations."""
PAIR = 1e-6
"""Relative difference of two eigenvalues that are one, as those of a square beam's two bendings."""
MORE = 4
"""Modes computed beyond those wanted: the next frequency, and partners of the last mode."""
MASSLESS = 1e-14
"""Inverse eigenvalues below this part of the largest are round-off: modes without mass."""
MOST_MODES = 2000
"""Modes that can be wanted; a floating frame has more than a hundred at most."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """Modes to keep: a ``number`` of them, or all below a ``frequency`` [Hz]."""

    number: int | None = None
    frequency: float | None = None


@dataclass(frozen=True, eq=False, slots=True)
class NormalModes:
    """Modes kept: ``eigenvalues`` (k,) [rad^2/s^2], ``shapes`` (m, k) with unit modal mass, and the
    ``following`` eigenvalue, the lowest one that is omitted (infinite if there is none)."""

    eigenvalues: np.ndarray
    shapes: np.ndarray
    following: float


def factorised(K: sparse.csr_array, source: str) -> SuperLU:
    """Return the factors of a stiffness; raises ``ReductionError`` if it is singular."""
    try:
        return splu(sparse.csc_array(K), **SYMMETRIC)
    except RuntimeError as error:
        raise ReductionError(source, MECHANISM) from error


SYMMETRIC = {
    "permc_spec": "MMD_AT_PLUS_A",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True},
}
MECHANISM = (
    "the stiffness is singular while the interface nodes are held: parts are not joined, or move "
    "without strain; correct the model or add interface nodes"
)


def normal_modes(
    K: sparse.csr_array, M: sparse.csr_array, factors: SuperLU, wanted: Wanted, source: str
) -> NormalModes:
    """Return the modes wanted, in the order of their frequencies. Raises ``ReductionError``."""
    size = K.shape[0]
    if wanted.number == 0 or size == 0:
        first = _lowest(K, M, factors, 1, source)[0] if size else np.zeros(0)
        return NormalModes(np.zeros(0), np.zeros((size, 0)), float(min(first, default=math.inf)))
    count = _first_count(K, M, wanted)
    while True:
        values, shapes = _lowest(K, M, factors, count + MORE, source)
        complete = len(values) < count + MORE or len(values) == size
        kept = _kept(values, wanted)
        if kept < len(values) or complete:
            break
        count = 2 * (count + MORE)
        _require_few(count, source)
    following = float(values[kept]) if kept < len(values) else math.inf
    _require_all(K, M, values[:kept], following, source)
    return NormalModes(values[:kept], _signed(shapes[:, :kept]), following)


def _first_count(K: sparse.csr_array, M: sparse.csr_array, wanted: Wanted) -> int:
    if wanted.number is not None:
        return wanted.number
    assert wanted.frequency is not None
    below = count_below(K, M, (2.0 * math.pi * wanted.frequency) ** 2) if _is_large(K) else None
    return MORE if below is None else below


def _require_few(count: int, source: str) -> None:
    if count > MOST_MODES:
        raise ReductionError(
            source, f"more than {MOST_MODES} modes are wanted; lower --modes or --up-to"
        )


def _kept(values: np.ndarray, wanted: Wanted) -> int:
    """Return how many of the modes computed are kept: those of one frequency together."""
    if wanted.number is None:
        assert wanted.frequency is not None
        return int(np.searchsorted(values, (2.0 * math.pi * wanted.frequency) ** 2, "right"))
    kept = min(wanted.number, len(values))
    while 0 < kept < len(values) and values[kept] <= (1.0 + PAIR) * values[kept - 1]:
        kept += 1
    return kept


def _is_large(K: sparse.csr_array) -> bool:
    return bool(K.shape[0] > DENSE)


def _lowest(
    K: sparse.csr_array, M: sparse.csr_array, factors: SuperLU, count: int, source: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return up to ``count`` lowest eigenvalues and their modes."""
    if not _is_large(K) or 3 * count > K.shape[0]:
        return lowest_dense(K.toarray(), M.toarray(), count, source)
    inverse = LinearOperator(K.shape, matvec=factors.solve, dtype=float)
    # A fixed start: the same modes at each run. A random one is orthogonal to none of them.
    start = np.random.default_rng(1).standard_normal(K.shape[0])
    try:
        values, shapes = eigsh(K, count, M, sigma=0.0, OPinv=inverse, v0=start)
    except ArpackError as error:
        raise ReductionError(
            source, "the iterations for the normal modes do not converge; ask for fewer modes"
        ) from error
    order = np.argsort(values)
    return values[order], shapes[:, order]


def lowest_dense(
    K: np.ndarray, M: np.ndarray, count: int, source: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return up to ``count`` lowest eigenvalues and modes by the inverse problem M phi = mu K phi,
    in which the low ones are the accurate ones and those without mass are zero."""
    size = len(K)
    first = max(0, size - count)
    try:
        inverse, shapes = linalg.eigh(M, K, subset_by_index=(first, size - 1))
    except linalg.LinAlgError as error:
        raise ReductionError(source, MECHANISM) from error
    inverse, shapes = inverse[::-1], shapes[:, ::-1]
    good = inverse > MASSLESS * max(inverse.max(initial=0.0), 0.0)
    return 1.0 / inverse[good], shapes[:, good] / np.sqrt(inverse[good])


def count_below(K: sparse.csr_array, M: sparse.csr_array, value: float) -> int | None:
    """Return the number of eigenvalues below a value; None if the pivots do not count them, because
    rows were exchanged."""
    try:
        factors = splu(sparse.csc_array(K - value * M), **SYMMETRIC)
    except RuntimeError:  # the value is an eigenvalue to round-off
        return None
    if (factors.perm_r != factors.perm_c).any():
        return None
    return int((factors.U.diagonal() < 0.0).sum())


def _require_all(
    K: sparse.csr_array, M: sparse.csr_array, kept: np.ndarray, following: float, source: str
) -> None:
    """Raise ``ReductionError`` if the iterations missed a mode below the next one."""
    last = float(kept[-1]) if len(kept) else 0.0
    if not _is_large(K) or math.isinf(following) or following <= (1.0 + PAIR) * last:
        return
    count = count_below(K, M, math.sqrt(max(last, 1e-6 * following) * following))
    if count is not None and count != len(kept):
        raise ReductionError(
            source,
            f"{len(kept)} modes were found of {count}; ask for other --modes or --up-to",
        )


def _signed(shapes: np.ndarray) -> np.ndarray:
    """Return modes whose largest entry is positive."""
    if shapes.size == 0:
        return shapes
    largest = np.argmax(np.abs(shapes), axis=0)
    signs = np.sign(shapes[largest, np.arange(shapes.shape[1])])
    result: np.ndarray = shapes * np.where(signs == 0.0, 1.0, signs)
    return result
