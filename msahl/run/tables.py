"""The tables of a run by name, their columns, and the sinks that receive them.

To add a table, let the workspace of the steppers hold its array (a field of ``Tables``), name its
columns in ``COLUMNS``, and say in ``tables_of_model`` which models have it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Protocol

import numpy as np

from msahl.joints.coordinates import ORIENTATION, coordinates, is_angle
from msahl.model import Model
from msahl.model.settings import AUTOMATIC, YES
from msahl.system.names import (
    STATE_COLUMNS,
    acceleration_columns,
    amplitude_columns,
    beam_columns,
    coordinate_columns,
    group_columns,
    joint_columns,
    marker_columns,
    reaction_columns,
    resultant_columns,
    signal_columns,
    state_columns,
    work_columns,
    workers,
)

STATES, REACTIONS, WORK, SIGNALS = "states", "reactions", "work", "signals"
ERROR = "error"
EVENTS = "events"
"""What happened to contacts, and by events of the deck; its rows are no output times."""
ACCELERATIONS = "accelerations"
RESULTANTS = "resultants"
"""Of beams at their Gauss points; other tables are made of it."""
JOINTS, MARKERS, SYSTEM, BEAMS = "joints", "markers", "system", "beams"
AMPLITUDES = "amplitudes"
MOST_JOINTS = 50
"""Most joints whose coordinates are written without being asked for."""
COLUMNS: dict[str, Callable[[Model], list[str]]] = {
    STATES: state_columns,
    REACTIONS: reaction_columns,
    WORK: work_columns,
    ACCELERATIONS: acceleration_columns,
    SIGNALS: signal_columns,
    RESULTANTS: resultant_columns,
}
"""Tables that the steppers fill, by name, with their columns, of which the first is the time."""
ERROR_OF = "estimatedError"
"""Suffix of the columns of signals in the table of estimated errors."""
OBSERVED = (JOINTS, MARKERS, SYSTEM, BEAMS, AMPLITUDES)
"""Tables that are computed from others."""
TABLES = (*COLUMNS, *OBSERVED, ERROR)
"""Names of all tables."""


def column_counts(model: Model) -> dict[str, int]:
    """The number of columns of each table that the steppers fill, without making their names."""
    return {
        STATES: 1 + len(STATE_COLUMNS) * len(model.bodies),
        REACTIONS: len(reaction_columns(replace(model, joints=())))
        + sum(len(joint_columns(joint)) for joint in model.joints),
        WORK: len(work_columns(model)),
        ACCELERATIONS: len(acceleration_columns(model)) if needs_accelerations(model) else 0,
        SIGNALS: len(signal_columns(model)) if has_signals(model) else 0,
        RESULTANTS: len(resultant_columns(model)) if model.beams else 0,
    }


def needs_accelerations(model: Model) -> bool:
    """Return whether a table of the model needs the accelerations of bodies."""
    return model.simulation.accelerations == YES or bool(model.markers)


def has_joint_table(model: Model) -> bool:
    """Return whether the coordinates of joints are written."""
    wanted = model.simulation.joint_table
    all_having = (joint for joint in model.joints if coordinates(joint))
    having = list(islice(all_having, MOST_JOINTS + 1))  # a model may have very many
    if wanted != AUTOMATIC:
        return wanted == YES and bool(having)
    scalar = any(coordinates(joint) != (ORIENTATION,) for joint in having)
    return scalar and len(having) <= MOST_JOINTS


def counts_revolutions(model: Model) -> bool:
    """Return whether a table has angles that are counted over all revolutions."""
    names = (name for joint in model.joints for name in coordinates(joint))
    return has_joint_table(model) and any(map(is_angle, names))


def has_signals(model: Model) -> bool:
    """Whether a run writes a table of signals."""
    return len(signal_columns(model)) > 1


def tables_of_model(model: Model) -> dict[str, list[str]]:
    """The tables that a run of the ``model`` writes, with their columns; that of errors apart."""
    tables = {STATES: state_columns(model)}
    if model.constrained or model.compliant_contacts:
        tables[REACTIONS] = reaction_columns(model)
    if workers(model) or model.beams:
        tables[WORK] = work_columns(model)
    if model.simulation.accelerations == YES:
        tables[ACCELERATIONS] = acceleration_columns(model)
    if has_joint_table(model):
        tables[JOINTS] = coordinate_columns(model, 3 if needs_accelerations(model) else 2)
    if model.markers:
        tables[MARKERS] = marker_columns(model)
    if model.groups:
        tables[SYSTEM] = group_columns(model)
    if model.beams:
        tables[BEAMS] = beam_columns(model)
    if model.elastic_bodies:
        tables[AMPLITUDES] = amplitude_columns(model)
    if has_signals(model):
        tables[SIGNALS] = signal_columns(model)
    return tables


def error_columns(model: Model) -> list[str]:
    """Header of ``error.csv``: positions and orientations [m], then as ``signals.csv`` [SI]."""
    of_signals = [f"{name}.{ERROR_OF}" for name in signal_columns(model)[1:]]
    return ["time", "position", "orientation", *of_signals]


class Sink(Protocol):
    """Receives the tables of a run, by name; those that are computed from others (``OBSERVED``)
    only if it takes them.
    """

    @property
    def takes_observed(self) -> bool:
        """Whether the tables of ``OBSERVED`` are wanted."""

    def write(self, tables: Mapping[str, np.ndarray]) -> None:
        """Append the rows (m, columns) of each table; the first column is the time [s].

        All tables of ``COLUMNS`` have the same number of rows; ``ERROR`` is missing, or has fewer,
        where the error is not known, and ``EVENTS`` has rows of objects.
        """

    def restart(self) -> None:
        """Drop all rows: the run begins again with smaller steps."""


class MemorySink:
    """A sink that keeps every row in memory, or only those of the tables ``only``."""

    def __init__(self, only: Sequence[str] | None = None) -> None:
        self.only = only
        self.takes_observed = only is None or bool(set(only) & set(OBSERVED))
        self.kept: dict[str, list[np.ndarray]] = {}

    def write(self, tables: Mapping[str, np.ndarray]) -> None:
        """See ``Sink``."""
        for name, rows in tables.items():
            if len(rows) and (self.only is None or name in self.only):
                self.kept.setdefault(name, []).append(np.array(rows))

    def restart(self) -> None:
        """See ``Sink``."""
        self.kept.clear()

    def table(self, name: str) -> np.ndarray:
        """All rows of one table; without rows if it was never written."""
        parts = self.kept.get(name)
        return np.concatenate(parts) if parts else np.zeros((0, 1))


class BothSinks:
    """Two sinks that get the same rows."""

    def __init__(self, first: Sink, second: Sink) -> None:
        self.first, self.second = first, second
        self.takes_observed = first.takes_observed or second.takes_observed

    def write(self, tables: Mapping[str, np.ndarray]) -> None:
        """See ``Sink``."""
        self.first.write(tables)
        self.second.write(tables)

    def restart(self) -> None:
        """See ``Sink``."""
        self.first.restart()
        self.second.restart()
