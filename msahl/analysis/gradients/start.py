"""Derivatives of a subsystem at t = 0: of its numbers, its consistent state and its first rows.

They are differences between subsystems that are built for models with other values of a parameter.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, inverse
from msahl.analysis.gradients.arrays import blocks_of, constants, flat, places_in_state
from msahl.model import Model, RunSettings
from msahl.run.setup import build_integrators
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.common.tangents import FIRST_P, FRAMES, SHARE
from msahl.system.names import LOAD_COLUMN

ROUND_OFF = 2e-15
"""Change of a number relative to it that is no change."""
NEGLIGIBLE = 1e-12
"""Number that does not limit the shifts of differences."""
SMALL = 1e-2
"""Fraction of the largest number of its kind that any one counts as: it may be a rounding error."""


class NotDifferentiable(Exception):  # noqa: N818 - an answer to the user
    """Why there are no derivatives, in words."""


class Shape(NamedTuple):
    """How subsystems are built: the run's settings, the most rows in a step, the degrees of its
    steps (none of order 2)."""

    settings: RunSettings
    rows: int
    degrees: tuple[int, ...]
    full: bool


class Start(NamedTuple):
    """Numbers, state and first row of a subsystem at t = 0."""

    numbers: np.ndarray
    state: np.ndarray
    rows: np.ndarray
    kind: tuple[Any, ...]  # what must be equal for a difference to be taken


class Variation(NamedTuple):
    """Derivatives of a subsystem at t = 0 by one parameter, and the largest e of its tangents."""

    numbers: np.ndarray
    state: np.ndarray
    rows: np.ndarray
    most: float


class DifferentiatedIntegrator(SubsystemIntegrator):
    """A subsystem whose steps are differentiated: their equations are in absolute coordinates."""

    joint_coordinates = False


def build_parts(model: Model, shape: Shape) -> list[SubsystemIntegrator]:
    """Return the subsystems of a model at t = 0, as a run has them, each with its first row."""
    settings = shape.settings
    rows, kind = max(shape.rows, 2), DifferentiatedIntegrator
    parts = build_integrators(model, settings, rows, shape.full, kind)
    for part in parts:
        method: Any = part.stepper.method  # type: ignore[attr-defined]
        for degree in shape.degrees:
            method.set_degree(degree)
        part.workspace.tables.accelerations[:] = 0.0
        part.workspace.monitor.rows[:] = 0.0
        part.show_start()
    return parts


def not_unique(part: SubsystemIntegrator) -> list[str]:
    """Return the columns of reactions that redundant constraints leave undetermined."""
    shared = part.shared if part.workspace.system.relaxation > 0.0 else {}
    found = [f"{name}.{column}" for name, columns in shared.items() for column in columns]
    contacts = part.modes.record.shared if part.modes else ()
    return [*found, *(f"{name}.{LOAD_COLUMN}" for name in contacts)]


def start_of(part: SubsystemIntegrator) -> Start:
    """Return what a subsystem begins with."""
    blocks, workspace = blocks_of(part), part.workspace
    axis = part.axis is None
    kind = axis, workspace.unknowns.free.tobytes(), workspace.system.relaxation > 0.0
    shapes = tuple(array.shape for array in (*blocks.numbers, *blocks.state))
    rows = [array[:1] for array in blocks.rows]
    return Start(constants(blocks), flat(blocks.state), flat(rows), (*kind, shapes))


def starts_of(model: Model, shape: Shape) -> list[Start]:
    """Return the starts of all subsystems of a model; their memory is used again afterwards."""
    parts = build_parts(model, shape)
    starts = [start_of(part) for part in parts]
    for part in parts:
        part.release(0.0)
    return starts


def variations(
    parts: Sequence[SubsystemIntegrator],
    starts: Sequence[Start],
    neighbours: Sequence[tuple[list[Start], float]],
    size: float,
) -> list[Variation]:
    """Return the derivatives of all ``parts`` from their ``starts`` and those of models with other
    values of a parameter, each with its weight; ``size`` is the size of its value, or 0.

    Raises ``NotDifferentiable`` where the models differ by more than numbers.
    """
    found = []
    for k, (part, start) in enumerate(zip(parts, starts, strict=True)):
        others = []
        for of_model, weight in neighbours:
            if len(of_model) != len(starts) or of_model[k].kind != start.kind:
                raise NotDifferentiable("models with other values of it have other unknowns")
            others.append((of_model[k], weight))
        found.append(_variation(part, start, others, size))
    return found


def _variation(
    part: SubsystemIntegrator, start: Start, others: list[tuple[Start, float]], size: float
) -> Variation:
    numbers, state, rows = (
        np.zeros_like(array) for array in (start.numbers, start.state, start.rows)
    )
    changed = np.zeros(numbers.size, dtype=bool)
    for other, weight in others:
        change = np.abs(_difference(other.numbers, start.numbers))
        changed |= change > ROUND_OFF * np.abs(start.numbers)
        numbers += weight * _difference(other.numbers, start.numbers)
        state += weight * _difference(other.state, start.state)
        rows += weight * _difference(other.rows, start.rows)
    numbers[~changed] = 0.0
    places = places_in_state(part.workspace)
    span = slice(places[FIRST_P], places[FIRST_P] + 3 * places[FRAMES])
    base = start.state[span].reshape(-1, 3)
    rotated = np.zeros_like(base)
    for other, weight in others:
        for f, p in enumerate(other.state[span].reshape(-1, 3)):
            change = compose(tuple(p.tolist()), inverse(tuple(base[f].tolist())))
            rotated[f] += weight * np.array(change)
    state[span] = rotated.reshape(-1)
    return Variation(numbers, state, rows, _largest_shift(part, numbers, size))


def _difference(other: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Return the difference of numbers, 0 where both are the same infinity or none."""
    same = (other == reference) | (np.isnan(other) & np.isnan(reference))
    return np.where(same, 0.0, other - np.where(same, 0.0, reference))


def _largest_shift(part: SubsystemIntegrator, change: np.ndarray, size: float) -> float:
    """Return the shift of a parameter that changes no number by more than ``SHARE`` of it, or of
    what a small one among larger ones of its kind counts as; zeros do not limit it.
    """
    most, begin, blocks = SHARE * max(size, 1.0), 0, blocks_of(part)
    for array, count in zip(blocks.numbers, blocks.first, strict=True):
        kept = np.abs(array.ravel(order="K")[:count])
        of_array = np.abs(change[begin : begin + count])
        begin += array.size
        if count == array.size:  # of one kind; constants of expressions are not
            largest = float(kept.max(initial=0.0, where=np.isfinite(kept)))
            kept = np.maximum(kept, SMALL * largest)
        limits = np.isfinite(kept) & (kept > NEGLIGIBLE)
        limits &= of_array > NEGLIGIBLE * of_array.max(initial=0.0)
        most = min(most, SHARE * float((kept[limits] / of_array[limits]).min(initial=np.inf)))
    return most


def relative_change(start: Start, other: Start) -> float:
    """Return the largest change of a number or state, relative to the largest of its kind."""
    sizes = [math.prod(shape) for shape in start.kind[-1]]
    own, others = (np.concatenate([point.numbers, point.state]) for point in (start, other))
    change = _difference(others, own)
    first, largest = 0, 0.0
    for size in sizes:
        part = slice(first, first + size)
        first += size
        scale = float(np.abs(own[part]).max(initial=0.0, where=np.isfinite(own[part])))
        if scale > 0.0:
            largest = max(largest, float(np.abs(change[part]).max(initial=0.0)) / scale)
    return largest
