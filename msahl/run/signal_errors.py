"""Estimated errors of published signals: of expressions, auxiliary states, loads of actuators.

Each is compared with its own size, the largest value that it has in the run. A value that is zero
but for noise has no size. So no error counts that is within ``NOISE`` of what the terms of the
expression would be if lengths, angles and rates had the size that they have in the model.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from msahl.elements.constraints.coordinate_kinds import ANGLE
from msahl.elements.signals import group as kinds
from msahl.elements.signals import results
from msahl.expressions.tape import magnitudes
from msahl.model import Model, SignalState
from msahl.ports import forces
from msahl.run.subsystem import SubsystemIntegrator
from msahl.system.names import signal_columns

NOISE = 1e-9
"""Relative error of an expression's terms that may be noise: rates by differences over 1e-6 of the
run lose six digits of sixteen."""
STATE_NOISE = 1e-12
"""The same of a state: its rate's terms over the run, known to the residuals of the steps. That of
a stiff state has terms as large as its inverse time constant."""
ZERO = 1e-4
"""Relative error of an expression's terms, or the one asked for if that is smaller, within which a
value that is not above ``UNKNOWN`` errors of its own is zero: the terms cancel."""
UNKNOWN = 3.0
STATE, SIGNAL = 0.01, 0.05
"""Share of its largest value by which an auxiliary state, and a signal or the load of an actuator,
may be wrong: these may be rates or differences."""


class Scales(NamedTuple):
    """What a model's motion is measured by."""

    length: float  # [m]
    speed: float  # [m/s]
    energy: float  # [J]
    asked: float  # error asked for, relative to the longest body


class SignalErrors:
    """Errors of the columns of the table of signals, over the run so far.

    ``largest`` are those at any output time, ``lasting`` those at two of three in succession: where
    a value jumps, run and companion may differ at one time by all of the jump, though they only
    jump a little before and after it. ``size`` is the largest absolute value.
    """

    def __init__(self, model: Model, integrators: Sequence[SubsystemIntegrator]) -> None:
        self.names = signal_columns(model)[1:]
        states = {s.name for s in model.signals if isinstance(s, SignalState)}
        self.is_state = np.array([name in states for name in self.names], dtype=bool)
        place = {name: i for i, name in enumerate(self.names)}
        self.places = [
            [place[name] for name in signal_columns(one.model)[1:]] for one in integrators
        ]
        count = len(self.names)
        self.largest, self.lasting, self.size = (np.zeros(count) for _ in range(3))
        self.last = np.zeros((2, count))  # errors at the last two output times
        self.share = np.zeros(count)  # see ``compare_sizes``

    def compare(
        self, own: Sequence[np.ndarray], others: Sequence[np.ndarray], factor: float
    ) -> np.ndarray:
        """Add the differences of the subsystems' tables (m, c), times ``factor``; returns the
        errors (m, columns).
        """
        errors = np.zeros((len(own[0]), len(self.names)))
        for places, mine, other in zip(self.places, own, others, strict=True):
            errors[:, places] = factor * np.abs(mine - other)
            self.size[places] = np.maximum(self.size[places], np.abs(mine).max(axis=0))
        every = np.concatenate([self.last, errors])
        threes = np.median(np.stack([every[:-2], every[1:-1], every[2:]]), axis=0)
        self.lasting = np.maximum(self.lasting, threes.max(axis=0))
        self.largest = np.maximum(self.largest, errors.max(axis=0))
        self.last = every[-2:]
        return errors

    def compare_sizes(self, integrators: Sequence[SubsystemIntegrator], scales: Scales) -> None:
        """Set ``share``, the lasting errors over the size of each column; 0 where it is noise."""
        terms = np.zeros(len(self.names))
        for places, integrator in zip(self.places, integrators, strict=True):
            if places and integrator.workspace.system.forces.signals is not None:
                terms[places] = _terms(integrator, scales)
        cancels = (self.size <= UNKNOWN * self.lasting) & ~self.is_state
        relative = np.where(cancels, min(ZERO, scales.asked), NOISE)
        floor = np.where(self.is_state, STATE_NOISE, relative) * terms
        counts = (self.lasting > floor) & (self.size > 0.0)
        self.share = np.divide(self.lasting, self.size, out=np.zeros_like(terms), where=counts)

    def over_limits(self, relative: float) -> float:
        """Largest share over its limit, which for states is ``relative`` if that is smaller."""
        limits = np.where(self.is_state, min(STATE, relative), SIGNAL)
        return float((self.share / limits).max(initial=0.0))

    def numbers(self) -> dict[str, list[Any]]:
        """All figures so far, for a snapshot."""
        parts = ("largest", "lasting", "size", "last")
        return {name: getattr(self, name).tolist() for name in parts}

    def restore(self, numbers: dict[str, list[Any]]) -> None:
        """Restore what ``numbers`` returned."""
        for name, values in numbers.items():
            setattr(self, name, np.array(values))

    def as_json(self) -> dict[str, dict[str, Any]]:
        """Largest error and largest value of each column, and the share that the verdict judges."""
        columns = zip(self.names, self.largest, self.size, self.share, self.is_state, strict=True)
        return {
            name: {"error": float(e), "largest": float(s), "share": float(r), "state": bool(state)}
            for name, e, s, r, state in columns
        }


def _terms(integrator: SubsystemIntegrator, scales: Scales) -> np.ndarray:
    """(columns,) what the terms of the expressions of a subsystem are, at most, in its present
    state, if none of their inputs is smaller than the ``scales``.
    """
    system, start = integrator.workspace.system, integrator.workspace.start.forces
    group, state = system.forces.signals, integrator.workspace.state
    assert group is not None, "a subsystem with signals"
    with np.errstate(all="ignore"):
        forces.set_prepared_inputs(group, start, system.scalar)
        results.evaluate(group, start.signals)
        given = _inputs(group, system.scalar, scales)
        terms = magnitudes(
            group.tape, start.signals.values, np.append(given, np.abs(state.auxiliary))
        )
    shown = terms[group.shown]
    names = signal_columns(integrator.model)[1:]
    # Of a state the rate's terms over the run; of a power those of the load, which come before it.
    rates = dict(zip(_states(integrator.model), terms[group.rate], strict=True))
    time = float(state.time[0])
    shown = np.maximum(shown, [time * rates.get(name, 0.0) for name in names[: shown.size]])
    power = [shown[names.index(f"{name[:-5]}load")] for name in names[shown.size :]]
    return np.append(shown, scales.speed * np.array(power))


def _states(model: Model) -> list[str]:
    """Names of the auxiliary states, in the order of their rates."""
    return [signal.name for signal in model.signals if isinstance(signal, SignalState)]


def _inputs(group: kinds.Signals, scalar: Any, scales: Scales) -> np.ndarray:
    """(y,) sizes of the inputs by the ``scales``."""
    per_second = scales.speed / scales.length
    by_kind = {
        kinds.POSITION: scales.length,
        kinds.VELOCITY: scales.speed,
        kinds.SPIN: per_second,
        kinds.QUATERNION: 1.0,
        kinds.REACTION: scales.energy / min(scales.length, 1.0),
        kinds.TIME: 0.0,
    }
    sizes = []
    for kind, item in zip(group.kind, group.item, strict=True):
        size = by_kind.get(int(kind))
        if size is None:
            length = 1.0 if scalar.coordinates.kind[item] == ANGLE else scales.length
            size = length * (per_second if kind == kinds.RATE else 1.0)
        sizes.append(size)
    return np.array(sizes)
