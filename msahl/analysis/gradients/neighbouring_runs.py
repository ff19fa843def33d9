"""Derivatives of a run's tables by complete runs with other values of the parameters.

Where constraints change during a run, by contacts or events of the deck, and where steps are
explicit, the steps of the run are taken again for values p + k e near that of a parameter:

    dy/dp = (y(p - 2 e) - 8 y(p - e) + 8 y(p + e) - y(p + 2 e)) / (12 e)

or the difference of the same order to one side. Their sizes are held fixed, and each run locates
its own events within them. So the computed motion is a smooth function of p as long as the same
events happen in the same order, times of impacts and jumps of velocities included; e is chosen
such that positions change by ``SHARE`` of their scale, made smaller where events change their
order, and derivatives are refused where they do so however small it is.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from msahl.analysis.gradients.same_steps import Along, Happened, Trace, trace
from msahl.analysis.gradients.start import NotDifferentiable
from msahl.analysis.gradients.step_sequence import Step
from msahl.analysis.gradients.tables import (
    CENTRAL,
    STATE_SIZE,
    TableGradients,
    angle_columns,
    change_of,
    with_moved_end,
)
from msahl.model import Model, RunSettings
from msahl.records import record
from msahl.run.tables import STATES
from msahl.start.velocities import StartError

SHARE = 2e-3
"""Change of positions over the longest length, of orientations in rad, and of the parameter over
itself, in the differences: their error is about its fourth power, and round-off of the times of
events, 1e-12, over it."""
ONE_SIDED = ((0.0, -25 / 12), (1.0, 4.0), (2.0, -3.0), (3.0, 4 / 3), (4.0, -1 / 4))
"""Shifts and weights of the difference of order 4 to one side."""
PILOT = 1e-7
"""Shift of a value, relative to it or in its unit where it is zero, by which the largest change of
positions is found."""
SMALLER, MOST_TRIES = 0.1, 4
"""Factor of the shift where events are others, and how often it is made smaller."""
NEAR_END = 1e-8
"""Time before the end of a run, relative to it, within which an event is at it: a jump that stops a
run has happened 1e-9 of the time before."""
SAME_ORIENTATION = 4.0
"""Difference of the parameters of two orientations above which they are the two sets of one."""
OTHER_EVENTS = (
    "the events of runs with values near it are others, as at the edge of a contact or an impact: "
    "{}. Derivatives exist only where the same events happen in the same order"
)
AT_THE_END = "the run is stopped by the jump of an impact or event, whose time has no derivative"


class Nearby(NamedTuple):
    """Models with a ``value`` near that of a parameter. ``at`` returns that with the value shifted,
    and raises ``NotDifferentiable`` if the deck does not allow it."""

    value: float
    at: Callable[[float], Model]


@record(slots=False)
class RunModel:
    """A model with others ``nearby`` for each parameter, to be differentiated along any steps."""

    model: Model
    settings: RunSettings
    nearby: Sequence[Nearby]

    def along(
        self,
        steps: Sequence[Step],
        times: Mapping[int, float],
        tables: Sequence[str],
        free: bool,
        halved: bool = False,
    ) -> TableGradients:
        """Do what ``TangentModel.along`` does; with steps that are ``halved``, two for each."""
        last = max((k for k, step in enumerate(steps) if step.rows), default=0)
        # One step more, in which all have what happens about the last row.
        own = Along(steps[: last + 2], times, [*dict.fromkeys((STATES, *tables))], halved)
        try:
            with np.errstate(all="ignore"):
                base = trace(self.model, self.settings, own)
                found = [self._by_parameter(near, base, own) for near in self.nearby]
                by_end = self._by_end(base, own) if free else None
        except (StartError, np.linalg.LinAlgError) as error:
            raise NotDifferentiable(f"near the values of the parameters, {error}") from error
        return _assembled(base, found, by_end)

    def _by_parameter(self, near: Nearby, base: Trace, along: Along) -> "_Slopes":
        e, other = self._shift(near, base, along), base
        for _ in range(MOST_TRIES):
            traces, weights = [], []
            for _, model, weight in _neighbours(near, e):
                traces.append(base if model is None else trace(model, self.settings, along))
                weights.append(weight)
            others = [one for one in traces if one.happened != base.happened]
            if not others:
                return _slopes(base, traces, weights, angle_columns(self.model))
            other, e = others[0], e * SMALLER
        raise NotDifferentiable(OTHER_EVENTS.format(_difference_of_events(base, other)))

    def _shift(self, near: Nearby, base: Trace, along: Along) -> float:
        """Return the shift of a parameter that changes positions by ``SHARE`` of their scale, and
        the parameter by no more than that.
        """
        size = abs(near.value) or 1.0
        pilot = next(m for node, m, _ in _neighbours(near, PILOT * size) if node == 1.0)
        assert pilot is not None
        moved = float(_moved(base, trace(pilot, self.settings, along)).max(initial=0.0))
        return min(SHARE * size, PILOT * size * SHARE / moved if moved else np.inf)

    def _by_end(self, base: Trace, along: Along) -> "_Slopes":
        """Return the derivatives by the end of the run [s], which its last step moves."""
        count = 2 if along.halved else 1
        last = along.steps[-count:]
        end, size = max(along.times.values()), sum(step.size for step in last)
        if any(at.size and end - at[-1] <= NEAR_END * end for at in base.at):
            raise NotDifferentiable(AT_THE_END)
        e, traces = SHARE * size, []
        for node, _ in CENTRAL:
            moved = [step._replace(size=step.size + node * e / count) for step in last]
            steps = [*along.steps[:-count], *moved]
            traces.append(trace(self.model, self.settings, along._replace(steps=steps)))
        return _slopes(
            base, traces, [weight / e for _, weight in CENTRAL], angle_columns(self.model)
        )


def _neighbours(near: Nearby, e: float) -> list[tuple[float, Model | None, float]]:
    """Return the nodes of the difference with a shift ``e``, the models there, None of that without
    a shift, and their weights in the derivative: on both sides, or on that which the deck allows.
    Raises ``NotDifferentiable``.
    """
    refused = None
    for nodes, side in ((CENTRAL, 1.0), (ONE_SIDED, 1.0), (ONE_SIDED, -1.0)):
        try:
            return [
                (node, near.at(node * side * e) if node else None, side * weight / e)
                for node, weight in nodes
            ]
        except NotDifferentiable as error:
            refused = refused or error
    raise NotDifferentiable(str(refused))


class _Slopes(NamedTuple):
    """Derivatives by one parameter."""

    tables: dict[str, np.ndarray]  # (m, columns)
    sizes: np.ndarray  # (pieces,) largest change of a position or orientation, as ``_moved``
    margin: float
    at_events: np.ndarray  # (k,) output times at which one of the runs is before an event [s]


def _slopes(
    base: Trace, traces: Sequence[Trace], weights: Sequence[float], angles: np.ndarray
) -> _Slopes:
    """Return the sums of what ``traces`` differ from ``base`` by, with their ``weights``; nan in
    rows that an event separates.
    """
    tables = {name: np.zeros_like(rows) for name, rows in base.rows.items()}
    for one, weight in zip(traces, weights, strict=True):
        for name, rows in one.rows.items():
            tables[name] += weight * _change(name, rows, base.rows[name], angles)
    t = base.rows[STATES][:, 0]
    apart = np.any([_counts(one, t) != _counts(base, t) for one in traces], axis=0)
    for table in tables.values():
        table[apart] = np.nan
    pairs = [*zip(traces, weights, strict=True)]
    margin = sum(weight * (one.margin - base.margin) for one, weight in pairs if weight)
    last, weight = max(pairs, key=lambda pair: abs(pair[1]))
    return _Slopes(tables, abs(weight) * _moved(base, last), margin, t[apart])


def _change(name: str, rows: np.ndarray, base: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the change (m, columns) of a table: of orientations and angles in the
    parameters and on the revolution of the ``base``.
    """
    change = change_of(name, rows, base, angles)
    if name == STATES:
        p, own = (of[:, 1:].reshape(len(of), -1, STATE_SIZE)[..., 3:6] for of in (rows, base))
        change[:, 1:].reshape(len(rows), -1, STATE_SIZE)[..., 3:6] = _same_set(p, own) - own
    return change


def _same_set(p: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return parameters of orientations (..., 3) from the same of their two sets as ``other``."""
    square = np.maximum((p * p).sum(axis=-1, keepdims=True), 1e-300)
    far = np.linalg.norm(p - other, axis=-1, keepdims=True) > SAME_ORIENTATION
    return np.where(far, -16.0 / square * p, p)


def _moved(base: Trace, other: Trace) -> np.ndarray:
    """Return (pieces,) the largest change of a position, over the longest length of a frame, or of
    an orientation [rad].
    """
    change = other.places - base.places
    change[:, 1] = _same_set(other.places[:, 1], base.places[:, 1]) - base.places[:, 1]
    change[:, 0] /= base.length
    found: np.ndarray = np.abs(change).reshape(len(change), -1).max(axis=1, initial=0.0)
    return found


def _counts(of: Trace, times: np.ndarray) -> np.ndarray:
    """Return (m, subsystems) how many events there were up to these ``times`` (m,) [s]."""
    counts = [np.searchsorted(at, times, side="right") for at in of.at]
    return np.array(counts).sum(axis=0)


def _difference_of_events(base: Trace, other: Trace) -> str:
    """Return in words the first event that is not the same."""
    for k, (own, found) in enumerate(zip(base.happened, other.happened, strict=True)):
        same = 0
        while same < min(len(own), len(found)) and own[same] == found[same]:
            same += 1
        if own != found:
            words = [_words(of[same:], at[same:]) for of, at in
                     ((own, base.at[k]), (found, other.at[k]))]  # fmt: skip
            return f"in this run {words[0]}, in another {words[1]}"
    return "in none"


def _words(happened: Happened, at: np.ndarray) -> str:
    if not happened:
        return "nothing more happens"
    kind, element, event = happened[0]
    return f"'{element or event}' {kind} at t = {at[0]:.9g} s"


def _assembled(base: Trace, found: Sequence[_Slopes], by_end: _Slopes | None) -> TableGradients:
    """Return the derivatives by all parameters; those of the end of a run that it moves with."""
    every = [*found, by_end] if by_end else found
    slopes = {name: np.stack([one.tables[name] for one in every]) for name in base.rows}
    end = np.zeros(len(found))
    if by_end:
        margin = np.array([one.margin for one in every])
        end, slopes = with_moved_end(slopes, margin, -1)
    gradients = TableGradients(base.rows, slopes, end)
    gradients.sizes = np.stack([one.sizes for one in found], axis=1)
    gradients.left, gradients.not_unique = np.zeros(len(found)), base.not_unique
    gradients.at_events = np.unique(np.concatenate([one.at_events for one in found]))
    return gradients
