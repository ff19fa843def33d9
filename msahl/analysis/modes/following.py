"""Modes followed from one value of a parameter to the next, by continuity of eigenvalue and shape.

Eigenvalues lambda_i at one value and lambda_j at the next are assigned to each other so that the
sum of

    |lambda_i + prediction - lambda_j| / (|lambda_i| + |lambda_j| + omega) + w (1 - MAC_ij)

is least, with MAC_ij = |u_i^H u_j|^2 of unit vectors of the shapes (modal assurance criterion). The
prediction continues the straight line through the value before. Where another assignment is nearly
as good, or a change is large, a value between the two is computed, as often as needed.

A mode begins or ends where the number of eigenvalues with imaginary part >= 0 changes: two real
ones meet and become a vibration, or the other way round.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.steady import spins_of
from msahl.analysis.modes.solution import AUTO, DENSE, Modes, is_large, modes

BY_SHAPE = 0.5
"""w: weight of the shapes."""
SLOW = 0.1
"""omega, relative to the median of the eigenvalues: changes below it are small."""
SMALL, LARGE = 0.05, 0.3
"""Cost of a pair that needs no comparison with others, and one that asks for values between."""
BROKEN = 0.75
"""Cost of a pair above which one mode ends and another begins."""
CLEARLY_BEST = 0.5
"""Cost of a pair, relative to that of the next best, which is clear."""
EQUAL = 1e-6
"""Distance of eigenvalues, relative to their size, that are one: their shapes are arbitrary."""
MOST_BISECTIONS = 6
"""Of the interval between two values."""
PART = 0.47
"""Of an interval at which it is divided to look for critical values: these are often in the middle,
where nothing can be seen of them."""


class Spectrum(NamedTuple):
    """Modes at a ``value`` of the parameter, with unit vectors of their shapes."""

    value: float
    modes: Modes
    vector: np.ndarray  # (m, n) complex
    whirl: np.ndarray  # (m,) 1 forward, -1 backward, 0 neither
    spins: np.ndarray  # (b, 3) angular velocities of the bodies, inertial axes [rad/s]
    is_complete: bool  # whether all modes are there


Sampler = Callable[[float, Modes | None], Spectrum]
"""Returns the spectrum at a value; ``nearby`` as in ``modes``."""


class Request(NamedTuple):
    """Which modes are wanted: the arguments of ``modes``."""

    number: int | None = None
    frequency: float = 0.0
    method: str = AUTO


ALL = Request()


def sampler(point_of: Callable[[float], Point], wanted: Request) -> Sampler:
    """Return the function that computes the spectrum at a value."""

    def sample(value: float, nearby: Modes | None = None) -> Spectrum:
        point = point_of(value)
        # All modes of small models are followed, those of beams too.
        small = wanted.method == AUTO and not is_large(point)
        request = wanted._replace(method=DENSE) if small else wanted
        found = modes(point, *request, nearby=nearby)
        spins = spins_of(point)
        whirl = _whirl(point, found, spins)
        return Spectrum(
            value, found, _vectors(point, found), whirl, spins, small and not wanted.number
        )

    return sample


def _vectors(point: Point, found: Modes) -> np.ndarray:
    """(m, n) unit vectors of displacements, rotations times lengths, and auxiliary states relative
    to the largest of all modes.
    """
    lengths = point.system.frames.length[point.system.bodies.frame]
    m = found.value.size
    moved = found.shape.copy().reshape(m, len(lengths), 6)
    moved[:, :, 3:] *= lengths[:, None]
    states = found.states / np.maximum(np.abs(found.states).max(axis=0, initial=0.0), 1e-300)
    vectors = np.concatenate([moved.reshape(m, 6 * len(lengths)), states], axis=1)
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0.0)


def _whirl(point: Point, found: Modes, spins: np.ndarray) -> np.ndarray:
    """(m,) whether points go round with the body that spins fastest, or against it."""
    fastest = spins[np.argmax(np.linalg.norm(spins, axis=1))]
    lengths = point.system.frames.length[point.system.bodies.frame]
    areas = np.zeros((found.value.size, 3))
    sizes = np.zeros(found.value.size)
    for part, scale in ((slice(0, 3), np.ones_like(lengths)), (slice(3, 6), lengths)):
        u = found.shape[:, :, part] * scale[:, None]
        areas += np.cross(u.conj(), u).imag.sum(axis=1)
        sizes += (np.abs(u) ** 2).sum(axis=(1, 2))
    about = areas @ fastest
    least = 1e-6 * sizes * np.linalg.norm(fastest)
    # u exp(i w t) goes round along Im(conj(u) x u) backward: Re and -Im follow each other.
    return np.where(np.abs(about) > least, -np.sign(about), 0.0) * (found.value.imag > 0.0)


@dataclass
class Followed:
    """Spectra by increasing position along the values, and the number of the mode of each
    eigenvalue, from 0; -1 of those that are zero everywhere.
    """

    spectra: list[Spectrum] = field(default_factory=list)
    mode: list[np.ndarray] = field(default_factory=list)
    modes: int = 0

    def rows(self, k: int) -> np.ndarray:
        """Rows of the spectrum ``k`` that are followed."""
        return np.flatnonzero(self.mode[k] >= 0)

    def row(self, k: int, mode: int) -> int | None:
        """The row of a mode in the spectrum ``k``, None if it is not there."""
        places = np.flatnonzero(self.mode[k] == mode)
        return int(places[0]) if places.size else None


def follow(sample: Sampler, spectra: Sequence[Spectrum]) -> Followed:
    """Return the modes followed through the ``spectra``; ``sample`` computes those between."""
    found = Followed()
    if not spectra:
        return found
    zeros = min(s.modes.zeros for s in spectra)
    first = spectra[0]
    number = np.arange(first.modes.value.size) - zeros
    found.spectra.append(first)
    found.mode.append(np.maximum(number, -1))
    found.modes = max(int(number.size) - zeros, 0)
    left = [2 * len(spectra) + 20]
    for following in spectra[1:]:
        _advance(found, sample, following, MOST_BISECTIONS, left)
    return found


def halved(found: Followed, k: int, sample: Sampler) -> Followed | None:
    """Return the modes followed from the spectrum ``k`` to ``k`` + 1 by way of one between, with
    the numbers of the first; None if there is none between.
    """
    first, last = found.spectra[k : k + 2]
    between = _between(sample, first, last, PART)
    if between is None:
        return None
    result = Followed([first], [found.mode[k]], found.modes)
    for following in (between, last):
        _advance(result, sample, following, 0, [0])
    return result


def _advance(
    found: Followed, sample: Sampler, following: Spectrum, bisections: int, left: list[int]
) -> None:
    """Follow to the next spectrum, by way of some between if the assignment is not clear."""
    last = found.spectra[-1]
    zeros = last.modes.zeros - int(np.count_nonzero(found.mode[-1][: last.modes.zeros] >= 0))
    columns = np.arange(min(zeros, following.modes.value.size), following.modes.value.size)
    rows = found.rows(len(found.spectra) - 1)
    pairs, is_clear = _assign(found, rows, following, columns)
    if not is_clear and bisections and left[0] > 0:
        between = _between(sample, last, following)
        if between is not None:
            left[0] -= 1
            _advance(found, sample, between, bisections - 1, left)
            _advance(found, sample, following, bisections - 1, left)
            return
    number = np.full(following.modes.value.size, -1)
    for i, j in pairs:
        number[j] = found.mode[-1][i]
    for j in columns[number[columns] < 0]:
        number[j], found.modes = found.modes, found.modes + 1
    found.spectra.append(following)
    found.mode.append(number)


def _between(
    sample: Sampler, last: Spectrum, following: Spectrum, part: float = 0.5
) -> Spectrum | None:
    """The spectrum a ``part`` of the interval further, None if there is none."""
    from msahl.deck import DeckError
    from msahl.start.velocities import StartError

    try:
        return sample(last.value + part * (following.value - last.value), None)
    except (DeckError, StartError):
        return None


def _assign(
    found: Followed, rows: np.ndarray, following: Spectrum, columns: np.ndarray
) -> tuple[list[tuple[int, int]], bool]:
    """Pairs of rows of the last spectrum and of the following one, and whether they are clear."""
    from scipy.optimize import linear_sum_assignment

    last = found.spectra[-1]
    old, new = last.modes.value[rows], following.modes.value[columns]
    if not rows.size or not columns.size:
        return [], True
    cost = costs(
        _predicted(found, rows, following.value), new, last.vector[rows], following.vector[columns]
    )
    same_old, same_new = _same(old), _same(new)
    pairs, is_clear = [], True
    for i, j in zip(*linear_sum_assignment(cost), strict=True):
        others = np.concatenate([cost[i, ~same_new[j]], cost[~same_old[i], j]])
        next_best = float(others.min(initial=np.inf))
        if cost[i, j] > LARGE or (cost[i, j] > SMALL and cost[i, j] > CLEARLY_BEST * next_best):
            is_clear = False
        if cost[i, j] <= BROKEN:
            pairs.append((int(rows[i]), int(columns[j])))
    return pairs, is_clear


def costs(
    old: np.ndarray, new: np.ndarray, old_vectors: np.ndarray, new_vectors: np.ndarray
) -> np.ndarray:
    """(a, b) costs of pairs of eigenvalues with their shapes."""
    sizes = np.abs(old)[:, None] + np.abs(new)
    both = np.concatenate([np.abs(old), np.abs(new)])
    distance = np.abs(old[:, None] - new) / (sizes + SLOW * float(np.median(both)) + 1e-300)
    likeness = np.abs(old_vectors.conj() @ new_vectors.T) ** 2
    # Shapes of eigenvalues that coincide are arbitrary combinations.
    plain = (_same(old).sum(axis=1)[:, None] == 1) & (_same(new).sum(axis=1) == 1)
    plain &= (np.abs(old)[:, None] > 0.0) & (np.abs(new) > 0.0)
    result: np.ndarray = distance + np.where(plain, BY_SHAPE * (1.0 - likeness), 0.0)
    return result


def _same(values: np.ndarray) -> np.ndarray:
    """(m, m) which eigenvalues are equal."""
    distance = np.abs(values[:, None] - values)
    equal: np.ndarray = distance <= EQUAL * np.abs(values)
    return equal | np.eye(values.size, dtype=bool)


def _predicted(found: Followed, rows: np.ndarray, value: float) -> np.ndarray:
    """Eigenvalues at a ``value`` by the straight lines through the last two."""
    k = len(found.spectra) - 1
    predicted = found.spectra[k].modes.value[rows].copy()
    if k == 0:
        return predicted
    before, last = found.spectra[k - 1], found.spectra[k]
    part = (value - last.value) / (last.value - before.value)
    for place, i in enumerate(rows):
        row = found.row(k - 1, int(found.mode[k][i]))
        if row is None:
            continue
        then, now = before.modes.value[row], last.modes.value[i]
        if (then.imag > 0.0) == (now.imag > 0.0):
            step = part * (now - then)
            limit = 0.5 * abs(now)
            predicted[place] += step if abs(step) <= limit else 0.0
    return predicted
