"""Modes in words and numbers: the lines that a command prints."""

import numpy as np

from msahl.analysis.linearised.contact_lines import contact_lines
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.steady import Equilibrium, residual_in_words
from msahl.analysis.modes.solution import SHAPE_COLUMNS, Modes
from msahl.run.hidden_bodies import shown_numbers

PARTS = 3
"""Largest parts of a shape that are named."""
SMALL_PART = 0.05
"""Part of a shape, relative to the largest, below which it is not named."""
CONSTRAINTS = (
    "closed contacts are constraints: those that slide or have no friction of their gap, those "
    "that stick of their slip as well"
)
MOST_LINES = 40
"""Modes that are printed; the table has all."""


def report(point: Point, found: Modes, most: int = MOST_LINES) -> list[str]:
    """Return what was found, a line for each mode."""
    lines = [*_head(point, found), ""]
    if found.zeros:
        lines.append(
            f"{counted(found.zeros, 'eigenvalue')} zero, with "
            f"{counted(found.rigid, 'independent shape')} (rigid-body modes, counted by rank)"
        )
    if found.zeros == found.value.size:
        return lines if found.zeros else [*lines, "nothing can move"]
    lines.append(
        f"{'mode':>4} {'frequency [Hz]':>15} {'damping':>9} {'eigenvalue [1/s]':>31} "
        f"{'error':>8}  largest parts"
    )
    shown = range(found.zeros, found.value.size)
    lines += [_line(point, found, m) for m in shown[:most]]
    if len(shown) > most:
        lines.append(f"and {len(shown) - most} more")
    unstable = int(np.count_nonzero(found.value.real > np.maximum(found.error, 1e-9)))
    if unstable:
        lines.append(f"unstable: {counted(unstable, 'mode')} with a positive real part")
    return lines


def _head(point: Point, found: Modes) -> list[str]:
    """Return what is linearised, and how far it is from an equilibrium."""
    state = found.equilibrium
    lines = [
        title_line(point.model.simulation.title, point.time, state),
        f"{counted(found.degrees_of_freedom, 'degree', 'degrees')} of freedom, "
        f"{counted(found.redundant, 'redundant constraint equation')}",
    ]
    lines += contact_lines(point)
    if point.touching is not None and point.touching.closed.any():
        lines.append(CONSTRAINTS)
    if np.any(state.axes):
        axes = ", ".join(f"{w:.9g}" for w in state.axes)
        lines.append(f"seen in axes that rotate with ({axes}) rad/s")
    return lines


def title_line(title: str, time: float, state: Equilibrium) -> str:
    """Return the title of a model with what it is in at the ``time`` [s] of its linearisation."""
    kind = "equilibrium" if state.at_rest else "steady motion"
    kind = kind if state.holds else "no equilibrium"
    return (
        f"{title or 'model'} at t = {time:.9g} s: {kind}, "
        f"residual {residual_in_words(state.residual, state.relative)}"
    )


def _line(point: Point, found: Modes, m: int) -> str:
    value, ratio = complex(found.value[m]), found.damping[m]
    if value.imag and abs(value.real) <= found.error[m]:
        value, ratio = complex(0.0, value.imag), 0.0  # not known to be another
    number = f"{value.real:.9g}" + (f" +- {value.imag:.9g} i" if value.imag else "")
    return (
        f"{m + 1:>4} {found.frequency[m]:>15.9g} {ratio:>9.5f} {number:>31} "
        f"{found.error[m]:>8.1e}  {largest_parts(point, found, m)}"
    )


def largest_parts(point: Point, found: Modes, m: int) -> str:
    """Return the largest parts of a shape by name, with their size relative to the largest."""
    lengths = point.system.frames.length[point.system.bodies.frame]
    weight = np.repeat([[1.0, 1.0, 1.0, 0.0, 0.0, 0.0]], len(lengths), axis=0)
    weight[:, 3:] = lengths[:, None]
    sizes = np.abs(found.shape[m] * weight)[shown_numbers(point.model)].reshape(-1)
    names = [f"{body.name}.{c}" for body in point.model.shown_bodies for c in SHAPE_COLUMNS]
    if not sizes.max(initial=0.0) > 0.0:
        sizes = np.abs(found.states[m])
        names = [s.name for s in point.model.states]
    largest = float(sizes.max(initial=0.0)) or 1.0
    order = np.argsort(-sizes, kind="stable")[:PARTS]
    named = [(names[k], sizes[k] / largest) for k in order if sizes[k] > SMALL_PART * largest]
    return ", ".join(f"{name} {size:.2f}" for name, size in named)


def counted(n: int, word: str, several: str = "") -> str:
    """Return a number with its noun, in the plural if there is need."""
    return f"{n} {word if n == 1 else several or word + 's'}"
