"""Critical values of a parameter: where modes begin or cease to grow, or frequencies are speeds.

With the parameter p, they are roots of functions that are smooth where they are sought:

    damped modes       Re lambda(p) = 0
    undamped ones      Re mean_i (lambda_i(p) - c(p))^2 = 0     c the mean of 2 m eigenvalues: two
                       vibrations meet, or one and its conjugate, m times at once (a round column
                       buckles to all sides). The eigenvalues themselves have a square root there
    order n            Im lambda(p) = n p                       of a speed p [rad/s]: n times per
                                                                revolution

Each is refined by Brent's method to round-off of the eigenvalues; its error bar is theirs over the
slope of the function. The number of modes that grow must change at the values found as it does
between the values beside them. Where it does not (several critical values lie close together, a
mode was not followed), the interval is halved.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np

from msahl.analysis.modes.following import (
    BY_SHAPE,
    Followed,
    Sampler,
    Spectrum,
    costs,
    halved,
)
from msahl.deck import DeckError
from msahl.start.velocities import StartError

NEUTRAL = 4.0
"""Errors of an eigenvalue within which its real part is zero."""
MOST_ITERATIONS = 60
SQUARE_ROOT = 1e-4
"""Eigenvalue, over its size at the values beside it, that is zero: without damping it is the square
root of a number that is zero but for round-off."""
LOST = 0.5
"""Cost of the nearest eigenvalue from which a mode is lost while a critical value is refined."""
MIRRORED = 1e-6
"""Distance of minus the conjugate of an eigenvalue from one, over its size, without damping."""
APART = 1e-4
"""Distance from a critical value, over that of the values beside it, at which its slope and the
number of modes that grow are taken."""
MOST_DIVISIONS, FEW_DIVISIONS = 34, 6
"""Of an interval: critical values nearer to each other than 1e-9 of it are one."""
FAULTS = (DeckError, StartError, np.linalg.LinAlgError)
"""At a value that has no modes."""
EPS = float(np.finfo(float).eps)


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


class _LostError(Exception):
    """A mode was not found again, or a value is not critical."""


def stability_changes(followed: Followed, sample: Sampler) -> list[Critical]:
    """Return the critical values at which modes begin or cease to grow."""
    chosen = _without_critical(followed)
    # Of some modes only, others may take the place of those that grow.
    divisions = MOST_DIVISIONS if all(s.is_complete for s in chosen.spectra) else FEW_DIVISIONS
    intervals = range(len(chosen.spectra) - 1)
    return [found for k in intervals for found in _changes(chosen, k, sample, divisions)]


def _without_critical(followed: Followed) -> Followed:
    """Return the spectra without those at values that are critical to round-off themselves: they
    are found from their neighbours.
    """
    last = len(followed.spectra) - 1
    kept = [k for k in range(last + 1) if k in (0, last) or not _is_critical(followed, k)]
    spectra, mode = [followed.spectra[k] for k in kept], [followed.mode[k] for k in kept]
    return Followed(spectra, mode, followed.modes)


def _is_critical(followed: Followed, k: int) -> bool:
    """Return whether the spectrum ``k`` has more zeros than those beside it, or a mode that is
    damped on one side of it and grows on the other.
    """
    before, here, after = followed.spectra[k - 1 : k + 2]
    if here.modes.zeros > max(before.modes.zeros, after.modes.zeros):
        return True
    signs = _signs(here)
    modes = [int(followed.mode[k][i]) for i in followed.rows(k) if signs[i] == 0.0]
    return any(_sign_at(followed, k - 1, m) * _sign_at(followed, k + 1, m) < 0.0 for m in modes)


def _changes(followed: Followed, k: int, sample: Sampler, divisions: int) -> list[Critical]:
    """Likewise, with at most so many ``divisions`` of the interval."""
    a, b = followed.spectra[k], followed.spectra[k + 1]
    wanted = _growing(b) - _growing(a)
    try:
        found = [*_passing(followed, k, sample), *_beginning(followed, k, sample)]
        if sum(map(_change, found)) == wanted:
            return found
    except _LostError:
        found = []
    between = halved(followed, k, sample) if divisions else None
    if between is None:
        return found or (_unresolved(followed, k, wanted) if b.is_complete else [])
    found = []
    for part in (0, 1):
        for c in _changes(between, part, sample, divisions - 1):
            found.append(c._replace(mode=_known_number(between, followed, k, c.mode)))
    return found


def _known_number(between: Followed, followed: Followed, k: int, mode: int) -> int:
    """Return the number of a mode, from 1, in ``followed``, from that by way of the middle between
    the spectra ``k`` and ``k`` + 1.
    """
    if mode - 1 in followed.mode[k]:
        return mode
    row = between.row(2, mode - 1)
    return mode if row is None else max(int(followed.mode[k + 1][row]) + 1, 1)


def _unresolved(followed: Followed, k: int, wanted: int) -> list[Critical]:
    """Return the middle as the critical value of modes that begin or cease to grow in an interval
    that is too small to be halved.
    """
    a, b = followed.spectra[k], followed.spectra[k + 1]
    end, at = (b, k + 1) if wanted > 0 else (a, k)
    rows = [i for i in followed.rows(at) if _signs(end)[i] > 0.0]
    rows.sort(key=lambda i: end.modes.value[i].real)
    number = np.cumsum([2 if end.modes.value[i].imag else 1 for i in rows])
    return [
        Critical(
            value=0.5 * (a.value + b.value),
            error=0.5 * (b.value - a.value),
            order=0.0,
            mode=int(followed.mode[at][i]) + 1,
            eigenvalue=1j * float(end.modes.value[i].imag),
            whirl=int(end.whirl[i]),
            grows_above=wanted > 0,
        )
        for i in rows[: int(np.searchsorted(number, abs(wanted), side="right"))]
    ]


def _signs(spectrum: Spectrum) -> np.ndarray:
    """(m,) 1 of modes that grow, -1 of damped ones, 0 of those that are neither."""
    values = spectrum.modes.value
    least = NEUTRAL * spectrum.modes.error + 1e-13 * np.abs(values)
    return np.where(np.abs(values.real) > least, np.sign(values.real), 0.0)


def _growing(spectrum: Spectrum) -> int:
    """Return how many eigenvalues grow, with those of negative imaginary parts: their number does
    not change where two real ones become a vibration.
    """
    grow = _signs(spectrum) > 0.0
    return int(np.count_nonzero(grow) + np.count_nonzero(spectrum.modes.value[grow].imag))


def _change(critical: Critical) -> int:
    """Return by how much a critical value changes the number of eigenvalues that grow."""
    number = 2 if critical.eigenvalue.imag else 1
    return number if critical.grows_above else -number


def _passing(followed: Followed, k: int, sample: Sampler) -> Iterator[Critical]:
    """Critical values at which the real part of a mode passes through zero."""
    a, b = followed.spectra[k], followed.spectra[k + 1]
    before, after = _signs(a), _signs(b)
    for i in followed.rows(k):
        mode = int(followed.mode[k][i])
        j = followed.row(k + 1, mode)
        if j is None:
            continue
        track = Track(a, b, int(i), j, mode, sample)
        if before[i] * after[j] < 0.0:
            if not (_has_mirror(a, int(i)) and _has_mirror(b, j)):
                yield _root(track, _real_part)
            else:
                yield from _exchange(track)


def _exchange(track: "Track") -> Iterator[Critical]:
    """The critical value of a mode of which another one is the mirror image at both ends: of two
    that exchange their stability the real part passes through zero, of undamped ones it is zero
    between two values.
    """
    step = APART * (track.b.value - track.a.value)
    with suppress(_LostError):
        found = _root(track, _real_part)
        beside = [track.at(found.value + side) for side in (-step, step)]
        signs = [float(_signs(spectrum)[row]) for spectrum, row in beside]
        if signs[0] * signs[1] < 0.0:
            yield found


def _sign_at(followed: Followed, k: int, mode: int) -> float:
    """The sign of a mode in the spectrum ``k``, 0 if it is not there."""
    row = followed.row(k, mode)
    return 0.0 if row is None else float(_signs(followed.spectra[k])[row])


def _has_mirror(spectrum: Spectrum, i: int) -> bool:
    """Return whether minus the conjugate of an eigenvalue is one, as without damping."""
    value, error = complex(spectrum.modes.value[i]), float(spectrum.modes.error[i])
    distance = np.abs(_both(spectrum) + value.conjugate())
    return bool(distance.min(initial=np.inf) <= MIRRORED * abs(value) + NEUTRAL * error)


def _both(spectrum: Spectrum) -> np.ndarray:
    """All eigenvalues, also those with negative imaginary parts."""
    values = spectrum.modes.value[spectrum.modes.zeros :]
    return np.concatenate([values, values[values.imag > 0.0].conj()])


def _beginning(followed: Followed, k: int, sample: Sampler) -> Iterator[Critical]:
    """Critical values at which undamped modes begin or cease to grow: all those, as many as
    coincide, that grow at one end only.
    """
    for at, beside in ((k + 1, k), (k, k + 1)):
        end, other = followed.spectra[at], followed.spectra[beside]
        rows = _one_sided(followed, at, beside)
        straight = _straight(end)
        if set(straight).isdisjoint(rows):
            straight = []
        for number in range(len(_straight(other)), len(straight)):
            row = straight[number]
            mode = int(followed.mode[at][row]) + 1
            squares = partial(_square, number=number)
            yield from _Meeting(end, other, squares, sample).found([row], [mode])
        for group in _copies(end, [i for i in rows if end.modes.value[i].imag]):
            modes = [int(followed.mode[at][i]) + 1 for i in group]
            middle = 1j * float(np.mean(end.modes.value[group].imag))
            squares = partial(_distance, middle=middle, number=2 * len(group))
            yield from _Meeting(end, other, squares, sample).found(group, modes)


def _straight(spectrum: Spectrum) -> list[int]:
    """Rows of the undamped modes that grow without oscillation, the fastest first."""
    values = spectrum.modes.value
    rows = np.flatnonzero((_signs(spectrum) > 0.0) & (values.imag == 0.0))
    rows = rows[np.argsort(-values[rows].real, kind="stable")]
    return [int(i) for i in rows if _has_mirror(spectrum, int(i))]


def _one_sided(followed: Followed, at: int, beside: int) -> list[int]:
    """Rows of the spectrum ``at`` of undamped modes that grow there, but not ``beside``."""
    end, other = followed.spectra[at], followed.spectra[beside]
    grow, signs, rows = _signs(end), _signs(other), []
    for i in followed.rows(at):
        if grow[i] > 0.0 and _has_mirror(end, int(i)):
            j = followed.row(beside, int(followed.mode[at][i]))
            if j is None or (signs[j] == 0.0 and _has_mirror(other, j)):
                rows.append(int(i))
    return rows


def _copies(spectrum: Spectrum, rows: list[int]) -> list[list[int]]:
    """Group ``rows`` by equal eigenvalues; raises ``_LostError`` if groups are too near to each
    other to be told apart where they cease to grow.
    """
    values, errors = spectrum.modes.value, spectrum.modes.error
    groups = list[list[int]]()
    for i in sorted(rows, key=lambda i: (values[i].imag, values[i].real)):
        for group in groups:
            j = group[0]
            least = NEUTRAL * (errors[i] + errors[j]) + 1e-13 * abs(values[i])
            if abs(values[i] - values[j]) <= least:
                group.append(i)
                break
            if abs(values[i].imag - values[j].imag) <= values[i].real + values[j].real:
                raise _LostError
        else:
            groups.append([i])
    return groups


def _square(spectrum: Spectrum, number: int) -> tuple[float, float, complex]:
    """Return the square of an undamped eigenvalue, by its ``number`` from the largest, as they pass
    through zero in this order; with its error, and zero, the mean of it and its mirror image.
    """
    values = spectrum.modes.value[spectrum.modes.zeros :]
    errors = spectrum.modes.error[spectrum.modes.zeros :]
    # The others are damped, or grow by oscillating.
    kept = np.minimum(np.abs(values.real), np.abs(values.imag)) <= NEUTRAL * errors
    # Each square counts twice: +-s are two rows, +-iw one.
    values, errors = (
        np.repeat(each[kept], np.where(values[kept].imag > 0.0, 2, 1)) for each in (values, errors)
    )
    squares = (values**2).real
    if 2 * number >= squares.size:
        raise _LostError
    which = np.argsort(-squares, kind="stable")[2 * number]
    # A frequency near zero is the root of a small number, whose own error is the square.
    return float(squares[which]), float(errors[which] ** 2), 0j


def _distance(spectrum: Spectrum, middle: complex, number: int) -> tuple[float, float, complex]:
    """Return the mean square of the distances of the eigenvalues nearest to a ``middle`` from their
    mean, with its error, and this mean.
    """
    found = _both(spectrum)
    nearest = found[np.argsort(np.abs(found - middle), kind="stable")[:number]]
    if nearest.size < number:
        raise _LostError
    mean = complex(nearest.mean())
    error = max(64.0 * EPS * abs(middle) ** 2, _error_beside(spectrum, mean) ** 2)
    return float(((nearest - mean) ** 2).mean().real), error, mean


class _Meeting:
    """Undamped eigenvalues that meet between two spectra: those that grow at the ``end`` with their
    mirror images, which lie on the imaginary axis at the ``other`` one. The function of their
    ``squares`` is zero there.
    """

    def __init__(
        self,
        end: Spectrum,
        other: Spectrum,
        squares: Callable[[Spectrum], tuple[float, float, complex]],
        sample: Sampler,
    ) -> None:
        self.end, self.other, self.squares, self.sample = end, other, squares, sample
        self.known = dict[float, tuple[float, float, complex, Spectrum]]()

    def at(self, value: float) -> tuple[float, float, complex, Spectrum]:
        """Return the square with its error, the mean, and the spectrum at a ``value``."""
        if value not in self.known:
            spectrum = self.sample(value, self.end.modes)
            self.known[value] = *self.squares(spectrum), spectrum
        return self.known[value]

    def found(self, rows: list[int], modes: list[int]) -> list[Critical]:
        """Return the critical value of all ``modes``, which have these ``rows`` at the end; raises
        ``_LostError`` if there is none.
        """
        low, high = sorted((self.end.value, self.other.value))
        try:
            square, error, _, _ = self.at(self.other.value)
            root = self.other.value
            if abs(square) > error:
                root = _zero(lambda value: self.at(value)[0], low, high)
            _, error, mean, spectrum = self.at(root)
            slope = self._slope(root, rows)
        except FAULTS as fault:
            raise _LostError from fault
        value = 1j * mean.imag
        if abs(value) <= SQUARE_ROOT * float(np.abs(self.end.modes.value[rows]).max()):
            value = 0j
        row = int(np.argmin(np.abs(spectrum.modes.value - mean)))
        whirl, above = int(spectrum.whirl[row]), self.end.value > self.other.value
        bar = abs(error / slope)
        return [Critical(root, bar, 0.0, mode, value, whirl, above) for mode in modes]

    def _slope(self, root: float, rows: list[int]) -> float:
        """Return the slope of the square; raises ``_LostError`` if as many modes as expected do not
        begin or cease to grow at the ``root``.
        """
        reach = abs(self.end.value - self.other.value)
        forward = 1.0 if self.end.value > self.other.value else -1.0
        number = len(rows) * (2 if self.end.modes.value[rows[0]].imag else 1)
        step = APART * reach
        while step < reach:
            beyond, before = root + forward * step, root - forward * step
            if (self.end.value - beyond) * forward < 0.0:
                beyond = self.end.value
            above, below = self.at(beyond), self.at(before)
            if _growing(above[3]) - _growing(below[3]) >= number:
                return (above[0] - below[0]) / (beyond - before)
            # Near the critical value growth cannot be told from round-off.
            step *= 8.0
        raise _LostError


def _error_beside(spectrum: Spectrum, value: complex) -> float:
    """Return the error of the eigenvalue nearest to a ``value``."""
    zeros = spectrum.modes.zeros
    nearest = int(np.argmin(np.abs(spectrum.modes.value[zeros:] - value)))
    return float(spectrum.modes.error[zeros + nearest])


def _zero(function: Callable[[float], float], low: float, high: float) -> float:
    """Return the root of a ``function`` between two values, to round-off; raises ``_LostError`` if
    it has the same sign at both.
    """
    from scipy.optimize import brentq

    if function(low) * function(high) > 0.0:
        raise _LostError

    # A root at zero has no relative accuracy that could be reached.
    accuracy = {"xtol": 1e-300, "rtol": 8.9e-16, "maxiter": MOST_ITERATIONS, "disp": False}
    return float(brentq(function, low, high, **accuracy))


def crossings(
    followed: Followed, sample: Sampler, order: float, speed: float
) -> Iterator[Critical]:
    """Values at which a frequency is ``order`` times the speed."""
    for k in range(len(followed.spectra) - 1):
        for track in _pairs(followed, k, sample):
            yield from _crossing(track, order, speed)


def _pairs(followed: Followed, k: int, sample: Sampler) -> Iterator["Track"]:
    """Modes that oscillate at the spectra ``k`` and ``k`` + 1."""
    a, b = followed.spectra[k], followed.spectra[k + 1]
    for i in followed.rows(k):
        mode = int(followed.mode[k][i])
        j = followed.row(k + 1, mode)
        if j is not None and a.modes.value[i].imag > 0.0 and b.modes.value[j].imag > 0.0:
            yield Track(a, b, int(i), j, mode, sample)


def _crossing(track: "Track", order: float, speed: float) -> Iterator[Critical]:
    """The value between two spectra at which the frequency of a mode is ``order`` times the
    speed.
    """

    def distance(track: Track, s: Spectrum, row: int) -> tuple[float, float]:
        value = float(s.modes.value[row].imag) - order * speed * abs(s.value)
        return value, float(s.modes.error[row])

    low = distance(track, track.a, track.i)[0]
    high = distance(track, track.b, track.j)[0]
    if low * high < 0.0 or high == 0.0:
        with suppress(_LostError):
            yield _root(track, distance, order)


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
        nearby = min(a.modes, b.modes, key=lambda modes: modes.zeros)
        spectrum = self.sample(value, nearby)
        part = (value - a.value) / (b.value - a.value)
        expected = (1.0 - part) * a.modes.value[self.i] + part * b.modes.value[self.j]
        ends = np.stack([a.vector[self.i], b.vector[self.j]])
        zeros = nearby.zeros
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


Function = Callable[[Track, Spectrum, int], tuple[float, float]]
"""Value of a function whose root is sought, and its error."""


def _real_part(track: Track, spectrum: Spectrum, row: int) -> tuple[float, float]:
    """Return Re lambda."""
    return float(spectrum.modes.value[row].real), float(spectrum.modes.error[row])


def _root(track: Track, function: Function, order: float = 0.0) -> Critical:
    """Return the critical value between two spectra; raises ``_LostError`` if the mode is not found
    in between.
    """

    def of(value: float) -> float:
        return function(track, *track.at(value))[0]

    low, high = track.a.value, track.b.value
    try:
        root = _zero(of, low, high)
        spectrum, row = track.at(root)
        step = APART * (high - low)
        beside = [function(track, *track.at(root + side * step)) for side in (1.0, -1.0)]
        slope = (beside[0][0] - beside[1][0]) / (2.0 * step)
        # At the root itself the eigenvalue may be one of several that are zero.
        error = min(beside[0][1], beside[1][1])
    except FAULTS as fault:
        raise _LostError from fault
    eigenvalue = complex(spectrum.modes.value[row])
    usual = max(abs(track.a.modes.value[track.i]), abs(track.b.modes.value[track.j]))
    if abs(eigenvalue) <= SQUARE_ROOT * usual:
        eigenvalue = 0j
    return Critical(
        value=root,
        error=float(abs(error / slope)) if slope else float("inf"),
        order=order,
        mode=track.mode + 1,
        eigenvalue=eigenvalue,
        whirl=int(spectrum.whirl[row]),
        grows_above=bool(track.b.modes.value[track.j].real > track.a.modes.value[track.i].real),
    )
