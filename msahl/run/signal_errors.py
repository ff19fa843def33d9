"""Estimated errors of published signals: of expressions, auxiliary states, loads of actuators.

Each is compared with its own size, the largest value that it has in the run. A value that is zero
but for noise has no size. So no error counts that is within ``NOISE`` of what the terms of the
expression would be if lengths, angles and rates had the size that they have in the model, nor one
of a value that is smaller than any quantity (``NOTHING``). Nor does it where a value is not above
``UNKNOWN`` errors of its own and those follow from the errors of the positions and velocities in it
by the derivatives of the expression, as in a model at rest, where velocities are nothing but
errors: these are judged by themselves. Only small errors follow so, up to ``ZERO`` of the terms and
what the accuracy asked for allows: a motion that is wrong altogether is no rest.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from msahl.elements.signals.group import Signals
from msahl.model import Model, SignalState
from msahl.run.lasting import Lasting
from msahl.run.subsystem import SubsystemIntegrator
from msahl.system.names import signal_columns
from msahl.system.signal_terms import Scales, Sizes, motion_errors, state_terms, tape_terms

NOISE = 1e-9
"""Relative error of an expression's terms that may be noise: rates by differences over 1e-6 of the
run lose six digits of sixteen."""
ZERO, PER_TOLERANCE, AT_REST = 3e-4, 10.0, 1e-6
"""Relative error of an expression's terms that may be zero: the largest at all; its ratio to the
relative error asked for, as rates have larger errors than positions; and the one that rates at rest
may have at any accuracy, where steps are as long as the run and time constants far shorter."""
EXPLAINED = 3.0
"""Ratio up to which an error follows from those of the motion: a coordinate is between two bodies,
and the derivatives are those at the end of the run."""
UNKNOWN = 3.0
NOTHING = 1e-50
"""Size in SI units of a value that is zero, as after a long decay: times, lengths and masses of
physics are above 1e-45, and no force that a motion shows follows from so little."""
STATE, SIGNAL = 0.01, 0.05
"""Share of its largest value by which an auxiliary state, and a signal or the load of an actuator,
may be wrong: these may be rates or differences."""


LISTED = 20
"""Columns of which ``run.json`` has the errors, the largest; ``error.csv`` has them of all."""


class SignalErrors:
    """Errors of the columns of the table of signals, over the run so far.

    ``largest`` are those at any output time, ``lasting`` those at two of three in succession.
    ``size`` is the largest absolute value.
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
        self.medians = Lasting(count)
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
        self.lasting = np.maximum(self.lasting, self.medians.add(errors).max(axis=0))
        self.largest = np.maximum(self.largest, errors.max(axis=0))
        return errors

    def compare_sizes(
        self,
        integrators: Sequence[SubsystemIntegrator],
        scales: Scales,
        asked: float,
        of_motion: Sizes,
    ) -> None:
        """Set ``share``, the lasting errors over the size of each column; 0 where it is noise. The
        user ``asked`` for this error relative to the longest body; the errors ``of_motion`` are the
        largest of the run.
        """
        terms, follows = np.zeros((2, len(self.names)))
        for places, integrator in zip(self.places, integrators, strict=True):
            if places and integrator.workspace.system.forces.signals is not None:
                terms[places] = _terms(integrator, scales)
                follows[places] = _follows(integrator, of_motion, self.size[places])
        zero = max(AT_REST, min(ZERO, PER_TOLERANCE * asked))
        cancels = self.size <= UNKNOWN * self.lasting
        nothing = np.where(cancels, np.minimum(zero * terms, EXPLAINED * follows), 0.0)
        counts = (self.lasting > np.maximum(nothing, NOISE * terms)) & (self.size > NOTHING)
        self.share = np.divide(self.lasting, self.size, out=np.zeros_like(terms), where=counts)

    def over_limits(self, relative: float) -> float:
        """Largest share over its limit, which for states is ``relative`` if that is smaller."""
        limits = np.where(self.is_state, min(STATE, relative), SIGNAL)
        return float((self.share / limits).max(initial=0.0))

    def numbers(self) -> dict[str, list[Any]]:
        """All figures so far, for a snapshot."""
        parts = {name: getattr(self, name).tolist() for name in ("largest", "lasting", "size")}
        return {**parts, "last": self.medians.last.tolist()}

    def restore(self, numbers: dict[str, list[Any]]) -> None:
        """Restore what ``numbers`` returned."""
        for name in ("largest", "lasting", "size"):
            setattr(self, name, np.array(numbers[name]))
        self.medians.last = np.array(numbers["last"])

    def as_json(self) -> dict[str, dict[str, Any]]:
        """Largest error and largest value of each column, and the share that the verdict judges."""
        columns = zip(self.names, self.largest, self.size, self.share, self.is_state, strict=True)
        return {
            name: {"error": float(e), "largest": float(s), "share": float(r), "state": bool(state)}
            for name, e, s, r, state in columns
        }


def with_largest(columns: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return what ``run.json`` has of the errors of columns: those of the largest shares, and if
    there are more the number of the others.
    """
    if len(columns) <= LISTED:
        return {"signals": columns} if columns else {}

    def share(name: str) -> tuple[float, float]:
        column = columns[name]
        # Of shares that are round-off the larger one, as far as there is one.
        return column["share"], column["error"] / column["largest"] if column["largest"] else 0.0

    largest = sorted(columns, key=share, reverse=True)[:LISTED]
    listed = {name: column for name, column in columns.items() if name in largest}
    return {"signals": listed, "otherSignals": len(columns) - LISTED}


def _terms(integrator: SubsystemIntegrator, scales: Scales) -> np.ndarray:
    """(columns,) what the terms of the expressions of a subsystem are, at most, in its present
    state, if none of their inputs is smaller than the ``scales``.
    """
    workspace = integrator.workspace
    system, start, state = workspace.system, workspace.start, workspace.state
    group = system.forces.signals
    assert group is not None, "a subsystem with signals"
    terms = tape_terms(system, start, np.abs(state.auxiliary), scales)
    over_run = state_terms(system, start, state, terms)
    shown = _shown(integrator.model, tape_terms(system, start, over_run, scales), over_run, group)
    return np.append(shown, scales.speed * shown[_loads(integrator.model, shown.size)])


def _follows(integrator: SubsystemIntegrator, of_motion: Sizes, largest: np.ndarray) -> np.ndarray:
    """(columns,) errors of the expressions of a subsystem, of which the ``largest`` values are
    known, that follow from the errors ``of_motion``.
    """
    workspace, rate = integrator.workspace, max(of_motion.velocity, of_motion.spin)
    group = workspace.system.forces.signals
    assert group is not None, "a subsystem with signals"
    values, states = motion_errors(workspace.system, workspace.start, workspace.state, of_motion)
    shown = _shown(integrator.model, values, states, group)
    loads = _loads(integrator.model, shown.size)
    return np.append(shown, (largest[loads] + shown[loads]) * rate)


def _shown(model: Model, values: np.ndarray, states: np.ndarray, group: Signals) -> np.ndarray:
    """(columns but powers,) what is known of the ``values`` of the tape and of the ``states``, by
    the columns that show them.
    """
    shown = values[group.shown]
    by_name = dict(zip(_states(model), states, strict=True))
    names = signal_columns(model)[1 : 1 + shown.size]
    return np.maximum(shown, [by_name.get(name, 0.0) for name in names])


def _loads(model: Model, first: int) -> list[int]:
    """Columns of the loads whose powers are the columns from the ``first`` on."""
    names = signal_columns(model)[1:]
    return [names.index(f"{name[:-5]}load") for name in names[first:]]


def _states(model: Model) -> list[str]:
    """Names of the auxiliary states, in the order of their rates."""
    return [signal.name for signal in model.signals if isinstance(signal, SignalState)]
