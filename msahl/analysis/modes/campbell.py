"""Campbell diagram: eigenvalues over a parameter, and the values at which something changes."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from msahl.analysis.linearised.point import Point
from msahl.analysis.modes.critical import Critical, crossings, stability_changes
from msahl.analysis.modes.following import ALL, Followed, Request, follow, sampler
from msahl.deck import DeckError
from msahl.start.velocities import StartError

COLUMNS = ("value", "mode", "real", "imaginary", "frequency", "damping", "condition", "error")
"""Of campbell.csv; frequency in Hz."""
CRITICAL_COLUMNS = ("value", "error", "order", "mode", "real", "imaginary", "frequency", "whirl")
"""Of critical.csv: order 0 where a mode begins or ceases to grow."""


STILL = 1e-9
"""Change of an angular velocity, over that of a speed, that is round-off."""


class Campbell(NamedTuple):
    """Modes over a parameter."""

    values: np.ndarray  # (k,) those that were asked for
    followed: Followed
    critical: list[Critical]
    failures: list[tuple[float, str]]  # values without modes, and why
    point: Point | None  # at the first value
    still: bool = False  # whether no body rotates with a speed that was to be compared with


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
    critical = stability_changes(followed, sample)
    # In rotating axes a frequency is not that of inertial ones.
    rotating = any(s.modes.equilibrium.axes.any() for s in followed.spectra)
    still = bool(orders) and _is_still(followed, speed)
    for order in () if rotating or still else orders:
        critical += crossings(followed, sample, order, speed)
    critical.sort(key=lambda c: (c.value, c.order, c.mode))
    return Campbell(given, followed, critical, failures, kept[0] if kept else None, still)


def _is_still(followed: Followed, speed: float) -> bool:
    """Return whether no body rotates faster or slower at other values of a ``speed``."""
    spectra = followed.spectra
    if len(spectra) < 2:
        return False
    spins = np.array([s.spins for s in spectra])
    change = np.abs(spins - spins[0]).max(axis=(1, 2), initial=0.0)
    values = np.array([s.value for s in spectra])
    return not bool((change > STILL * speed * np.abs(values - values[0])).any())


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
