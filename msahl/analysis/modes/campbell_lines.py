"""Modes over a parameter in words and numbers: the lines that a command prints."""

import numpy as np

from msahl.analysis.modes.campbell import Campbell
from msahl.analysis.modes.critical import Critical
from msahl.analysis.modes.files import Over
from msahl.analysis.modes.following import Spectrum
from msahl.analysis.modes.mode_lines import counted

MOST_LINES = 40
"""Modes that are listed; the table has all."""
WHIRL = {1: ", forward whirl", -1: ", backward whirl", 0: ""}


def _at(over: Over, value: float, digits: int = 15) -> str:
    """Return a value with name and unit."""
    return f"{over.name} = {value:.{digits}g}" + (f" {over.unit}" if over.unit else "")


def report(found: Campbell, over: Over, title: str) -> list[str]:
    """Return what was found: modes with their ranges, then the critical values."""
    spectra = found.followed.spectra
    asked = [s for s in spectra if s.value in set(found.values.tolist())]
    lines = [
        f"{title or 'model'} over {over.name}: {counted(len(asked), 'value')} from "
        f"{asked[0].value:.9g} to {asked[-1].value:.9g}" + (f" {over.unit}" if over.unit else "")
    ]
    added = len(spectra) - len(asked)
    if added:
        lines.append(f"{added} more between them to follow the modes")
    lines += ["", *_modes(found)]
    lines += ["", *(_critical(group, over) for group in _coinciding(found.critical))]
    if not found.critical:
        lines.append("no critical values")
    return lines


def _modes(found: Campbell) -> list[str]:
    """Return a line for each mode: frequency and real part at its first and last value."""
    followed = found.followed
    lines = [f"{'mode':>4} {'from':>10} {'to':>10} {'frequency [Hz]':>25} {'real part [1/s]':>25}"]
    for mode in range(min(followed.modes, MOST_LINES)):
        places = [(k, followed.row(k, mode)) for k in range(len(followed.spectra))]
        ends = [(followed.spectra[k], i) for k, i in places if i is not None]
        (first, i), (last, j) = ends[0], ends[-1]
        hertz = f"{first.modes.frequency[i]:.6g} .. {last.modes.frequency[j]:.6g}"
        real = f"{_real(first, i):.6g} .. {_real(last, j):.6g}"
        lines.append(
            f"{mode + 1:>4} {first.value:>10.6g} {last.value:>10.6g} {hertz:>25} {real:>25}"
        )
    if followed.modes > MOST_LINES:
        lines.append(f"and {followed.modes - MOST_LINES} more")
    return lines


def _real(spectrum: Spectrum, i: int) -> float:
    """Return a real part without round-off."""
    value = float(spectrum.modes.value[i].real)
    return value if abs(value) > spectrum.modes.error[i] else 0.0


def _coinciding(critical: list[Critical]) -> list[list[Critical]]:
    """Group the critical values of several modes that are one within their errors."""
    groups = list[list[Critical]]()
    for c in critical:
        for group in groups:
            first = group[0]
            alike = (c.order, c.whirl, c.grows_above) == (
                *(first.order, first.whirl, first.grows_above),
            )
            near = abs(c.value - first.value) <= c.error + first.error
            same = abs(c.eigenvalue - first.eigenvalue) <= 1e-6 * abs(first.eigenvalue)
            if alike and near and same and c.mode != first.mode:
                group.append(c)
                break
        else:
            groups.append([c])
    return groups


def _critical(group: list[Critical], over: Over) -> str:
    """Return a critical value in words, of one mode or of several together."""
    critical, several = group[0], len(group) > 1
    hertz = abs(critical.eigenvalue.imag) / (2.0 * np.pi)
    names = [str(c.mode) for c in group]
    who = f"modes {', '.join(names[:-1])} and {names[-1]}" if several else f"mode {names[0]}"
    where = f"{_at(over, critical.value)} +- {critical.error:.1g}: {who}"
    if critical.order:
        multiple = f"{critical.order:g}x the speed"
        verb = "are" if several else "is"
        return f"{where}, {hertz:.9g} Hz, {verb} at {multiple}{WHIRL[critical.whirl]}"
    side = "above" if critical.grows_above else "below"
    kind = (
        f"oscillating at {hertz:.9g} Hz (flutter)" if hertz else "without oscillation (divergence)"
    )
    return f"{where} {'grow' if several else 'grows'} {side}, {kind}"


def warnings(found: Campbell, over: Over) -> list[str]:
    """Return what was not computed, and where the modes are not those of an equilibrium."""
    lines = [f"{_at(over, value)}: {why}" for value, why in found.failures]
    if found.still:
        lines.append(
            f"no body rotates faster or slower with {over.name}, so no frequency is compared with "
            "it; give a joint this rate, or a motor this speed"
        )
    spectra = found.followed.spectra
    by_text: dict[str, list[float]] = {}
    for spectrum in spectra:
        for text in spectrum.modes.warnings:
            kind = text.partition(":")[0] if "no equilibrium" in text else text
            by_text.setdefault(kind, []).append(spectrum.value)
    for text, values in by_text.items():
        where = f"at {len(values)} of {len(spectra)} values, first at {_at(over, values[0], 9)}"
        lines.append(f"{where}: {text}")
    return lines
