"""Campbell diagram: eigenvalues over a parameter, and the values at which something changes.

Critical values p are roots of functions that are smooth where they are sought:

    stability      Re lambda(p) = 0                   of a mode that is damped on one side
                   Re (lambda_1(p) - lambda_2(p))^2 = 0   where two undamped vibrations meet, or one
                                                      and its conjugate: the eigenvalues themselves
                                                      have a square root there
    order n        Im lambda(p) = n p                 of a speed p [rad/s]: n times per revolution

Each is refined by Brent's method to round-off of the eigenvalues; its error bar is theirs over the
slope of the function.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from msahl.analysis.linearised.point import Point
from msahl.analysis.modes.following import (
    ALL,
    BY_SHAPE,
    Followed,
    Request,
    Sampler,
    Spectrum,
    costs,
    follow,
    sampler,
)
from msahl.deck import DeckError
from msahl.start.velocities import StartError

COLUMNS = ("value", "mode", "real", "imaginary", "frequency", "damping", "condition", "error")
"""Of campbell.csv; frequency in Hz."""
CRITICAL_COLUMNS = ("value", "error", "order", "mode", "real", "imaginary", "frequency", "whirl")
"""Of critical.csv: order 0 where a mode begins or ceases to grow."""
NEUTRAL = 4.0
"""Errors of an eigenvalue within which its real part is zero."""
MOST_ITERATIONS = 60
SQUARE_ROOT = 1e-4
"""Eigenvalue, over its size at the values beside it, that is zero: without damping it is the square
root of a number that is zero but for round-off."""
LOST = 0.5
"""Cost of the nearest eigenvalue from which a mode is lost while a critical value is refined."""


class Critical(NamedTuple):
    """A value at which a mode begins or ceases to grow (``order`` 0), or at which its frequency is
    ``order`` times the speed.
    """

    value: float
    error: float  # what round-off of the eigenvalues may change
    order: float
    mode: int  # number, from 1
    eigenvalue: complex  # [1/s]
    whirl: int  # 1 forward, -1 backward, 0 neither
    grows_above: bool  # whether the mode grows at larger values


class Campbell(NamedTuple):
    """Modes over a parameter."""

    values: np.ndarray  # (k,) those that were asked for
    followed: Followed
    critical: list[Critical]
    failures: list[tuple[float, str]]  # values without modes, and why
    point: Point | None  # at the first value


def campbell(
    point_of: Callable[[float], Point],
    values: Sequence[float],
    wanted: Request = ALL,
    orders: Sequence[float] = (),
    speed: float = 1.0,
) -> Campbell:
    """Return the modes at all ``values``, followed, with the critical values between them.

    ``point_of`` returns the model at a value, or raises ``DeckError`` or ``StartError``; a value
    times ``speed`` is in rad/s, if ``orders`` are given.
    """
    kept: list[Point] = []

    def first_kept(value: float) -> Point:
        point = point_of(value)
        if not kept:
            kept.append(point)
        return point

    sample = sampler(first_kept, wanted)
    given, spectra, failures = np.unique(np.asarray(values, dtype=float)), [], []
    for value in given.tolist():
        try:
            spectra.append(sample(value, None))
        except (DeckError, StartError) as error:
            failures.append((value, str(error)))
    followed = follow(sample, spectra)
    intervals = range(len(followed.spectra) - 1)
    critical = [found for k in intervals for found in _stability(followed, k, sample)]
    # In rotating axes a frequency is not that of inertial ones.
    rotating = any(s.modes.equilibrium.axes.any() for s in followed.spectra)
    for order in () if rotating else orders:
        for k in intervals:
            critical += _crossings(followed, k, sample, order, speed)
    critical.sort(key=lambda c: (c.value, c.order, c.mode))
    return Campbell(given, followed, critical, failures, kept[0] if kept else None)


def _signs(spectrum: Spectrum) -> np.ndarray:
    """(m,) 1 of modes that grow, -1 of damped ones, 0 of those that are neither."""
    values = spectrum.modes.value
    least = NEUTRAL * spectrum.modes.error + 1e-13 * np.abs(values)
    return np.where(np.abs(values.real) > least, np.sign(values.real), 0.0)


def _stability(followed: Followed, k: int, sample: Sampler) -> Iterator[Critical]:
    """Critical values between the spectra ``k`` and ``k`` + 1 at which a mode starts or ceases to
    grow.
    """
    a, b = followed.spectra[k], followed.spectra[k + 1]
    before, after = _signs(a), _signs(b)
    for i in followed.rows(k):
        mode = int(followed.mode[k][i])
        j = followed.row(k + 1, mode)
        if j is None or before[i] == after[j]:
            continue
        if before[i] * after[j] < 0.0:
            yield from _root(Track(a, b, i, j, mode, sample), _real_part, 0.0)
        elif after[j] == 0.0 and _sign_at(followed, k + 2, mode) * before[i] < 0.0:
            # The value itself is critical to round-off: look from its neighbours.
            c = followed.spectra[k + 2]
            last = followed.row(k + 2, mode)
            assert last is not None
            yield from _root(Track(a, c, i, last, mode, sample), _real_part, 0.0)
        elif 1.0 in (before[i], after[j]) and _has_mirror(a, i) and _has_mirror(b, j):
            yield from _root(Track(a, b, i, j, mode, sample), _discriminant, 0.0)


def _sign_at(followed: Followed, k: int, mode: int) -> float:
    """The sign of a mode in the spectrum ``k``, 0 if it is not there."""
    if k >= len(followed.spectra):
        return 0.0
    row = followed.row(k, mode)
    return 0.0 if row is None else float(_signs(followed.spectra[k])[row])


def _has_mirror(spectrum: Spectrum, i: int) -> bool:
    """Return whether minus the conjugate of an eigenvalue is one, as without damping."""
    value, error = complex(spectrum.modes.value[i]), float(spectrum.modes.error[i])
    distance = np.abs(_both(spectrum) + value.conjugate())
    return bool(distance.min() <= 1e-6 * abs(value) + NEUTRAL * error)


def _both(spectrum: Spectrum) -> np.ndarray:
    """All eigenvalues, also those with negative imaginary parts."""
    values = spectrum.modes.value[spectrum.modes.zeros :]
    return np.concatenate([values, values[values.imag > 0.0].conj()])


def _crossings(
    followed: Followed, k: int, sample: Sampler, order: float, speed: float
) -> Iterator[Critical]:
    """Values between the spectra ``k`` and ``k`` + 1 at which a frequency is ``order`` times the
    speed.
    """
    a, b = followed.spectra[k], followed.spectra[k + 1]
    for i in followed.rows(k):
        mode = int(followed.mode[k][i])
        j = followed.row(k + 1, mode)
        if j is None or not (a.modes.value[i].imag > 0.0 and b.modes.value[j].imag > 0.0):
            continue

        def distance(track: "Track", s: Spectrum, row: int) -> tuple[float, float]:
            value = float(s.modes.value[row].imag) - order * speed * abs(s.value)
            return value, float(s.modes.error[row])

        ends = distance(None, a, i)[0], distance(None, b, j)[0]  # type: ignore[arg-type]
        if ends[0] * ends[1] < 0.0 or ends[1] == 0.0:
            yield from _root(Track(a, b, int(i), j, mode, sample), distance, order)


class Track(NamedTuple):
    """A mode between two spectra: its row in each, its number, and how to compute others."""

    a: Spectrum
    b: Spectrum
    i: int
    j: int
    mode: int
    sample: Sampler

    def at(self, value: float) -> tuple[Spectrum, int]:
        """Return the spectrum at a value, and the row of the mode; raises ``_LostError``."""
        a, b = self.a, self.b
        spectrum = self.sample(value, a.modes)
        part = (value - a.value) / (b.value - a.value)
        expected = (1.0 - part) * a.modes.value[self.i] + part * b.modes.value[self.j]
        ends = np.stack([a.vector[self.i], b.vector[self.j]])
        zeros = a.modes.zeros
        values, vectors = spectrum.modes.value[zeros:], spectrum.vector[zeros:]
        if not values.size:
            raise _LostError
        cost = costs(np.full(1, expected), values, ends[:1], vectors)[0]
        other = costs(np.full(1, expected), values, ends[1:], vectors)[0]
        best = np.minimum(cost, other)
        row = int(np.argmin(best))
        if best[row] > LOST + BY_SHAPE:
            raise _LostError
        return spectrum, zeros + row


class _LostError(Exception):
    """A mode was not found again."""


Function = Callable[[Track, Spectrum, int], tuple[float, float]]
"""Value of a function whose root is sought, and its error."""


def _real_part(track: Track, spectrum: Spectrum, row: int) -> tuple[float, float]:
    """Return Re lambda."""
    return float(spectrum.modes.value[row].real), float(spectrum.modes.error[row])


def _discriminant(track: Track, spectrum: Spectrum, row: int) -> tuple[float, float]:
    """Return Re (lambda_1 - lambda_2)^2 of the two eigenvalues that meet, as do a + i b and
    -a + i b: those nearest to the mean of the pair, which changes smoothly.
    """
    a, b = track.a, track.b
    middles = []
    for s, i in ((a, track.i), (b, track.j)):
        value = complex(s.modes.value[i])
        grows = value.real > NEUTRAL * float(s.modes.error[i])
        middles.append(1j * value.imag if grows else None)
    known = next(m for m in middles if m is not None)
    found = _both(spectrum)
    nearest = found[np.argsort(np.abs(found - known), kind="stable")[:2]]
    size = float(np.abs(nearest).max())
    scale = max(size, float(np.abs(known)))
    error = 64.0 * float(np.finfo(float).eps) * float(scale) ** 2
    # A frequency near zero is the root of a small number, whose own error is the square.
    error = max(error, float(spectrum.modes.error[row]) ** 2)
    return float(((nearest[0] - nearest[1]) ** 2).real), error


def _root(track: Track, function: Function, order: float) -> Iterator[Critical]:
    """Yield the critical value between two spectra, if the mode is found in between."""
    from scipy.optimize import brentq

    def of(value: float) -> float:
        return function(track, *track.at(value))[0]

    low, high = track.a.value, track.b.value
    try:
        if of(low) * of(high) > 0.0:
            return
        root = float(brentq(of, low, high, xtol=1e-300, rtol=8.9e-16, maxiter=MOST_ITERATIONS))
        spectrum, row = track.at(root)
        step = 1e-4 * (high - low)
        slope = (of(root + step) - of(root - step)) / (2.0 * step)
        error = function(track, spectrum, row)[1]
    except (_LostError, DeckError, StartError, RuntimeError):
        return
    eigenvalue = complex(spectrum.modes.value[row])
    usual = max(abs(track.a.modes.value[track.i]), abs(track.b.modes.value[track.j]))
    if abs(eigenvalue) <= SQUARE_ROOT * usual:
        eigenvalue = 0j
    yield Critical(
        value=root,
        error=float(abs(error / slope)) if slope else float("inf"),
        order=order,
        mode=track.mode + 1,
        eigenvalue=eigenvalue,
        whirl=int(spectrum.whirl[row]),
        grows_above=bool(track.b.modes.value[track.j].real > track.a.modes.value[track.i].real),
    )


def campbell_rows(found: Campbell) -> np.ndarray:
    """(r, 8) the rows of campbell.csv, at the values that were asked for."""
    rows = []
    asked = set(found.values.tolist())
    for spectrum, mode in zip(found.followed.spectra, found.followed.mode, strict=True):
        if spectrum.value not in asked:
            continue
        modes = spectrum.modes
        for i in np.flatnonzero(mode >= 0)[np.argsort(mode[mode >= 0])]:
            polar = (
                modes.frequency[i],
                modes.damping[i],
                np.nan_to_num(modes.condition[i]),
                modes.error[i],
            )
            rows.append(
                (spectrum.value, mode[i] + 1, modes.value[i].real, modes.value[i].imag, *polar)
            )
    return np.array(rows, dtype=float).reshape(-1, len(COLUMNS))


def critical_rows(found: Campbell) -> np.ndarray:
    """(c, 8) the rows of critical.csv."""
    rows = []
    for c in found.critical:
        value = c.eigenvalue
        hertz = abs(value) / (2.0 * np.pi)
        rows.append((c.value, c.error, c.order, c.mode, value.real, value.imag, hertz, c.whirl))
    return np.array(rows, dtype=float).reshape(-1, len(CRITICAL_COLUMNS))
