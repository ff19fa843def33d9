"""Contacts of a run, of all its subsystems: their events, and figures for the report."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from msahl.run.subsystem import SubsystemIntegrator


def rows_of_events(integrators: Sequence[SubsystemIntegrator]) -> np.ndarray:
    """Return the rows (m, columns) of ``events.csv`` that are not published yet, in order of time:
    objects, as some columns are words.
    """
    found = [event for one in integrators if one.modes for event in one.modes.events]
    rows = np.empty((len(found), len(found[0]) if found else 0), dtype=object)
    for k, event in enumerate(sorted(found, key=lambda event: event.time)):
        rows[k] = event
    return rows


def forget_events(integrators: Sequence[SubsystemIntegrator]) -> None:
    """Let all events so far count as published."""
    for integrator in integrators:
        if integrator.modes:
            integrator.modes.forget_events()


def omitted_height(integrators: Sequence[SubsystemIntegrator]) -> float:
    """Return the largest height [m] of the rebounds of a subsystem that were omitted."""
    return max((one.modes.bound for one in integrators if one.modes), default=0.0)


def figures(integrators: Sequence[SubsystemIntegrator]) -> dict[str, Any] | None:
    """Return what ``run.json`` says of contacts; None if there are none."""
    found = [integrator.modes for integrator in integrators if integrator.modes]
    if not found:
        return None
    lost = -sum(float(modes.state.work[modes.contacts.column].sum()) for modes in found)
    return {
        "impacts": sum(modes.impacts for modes in found),
        "energyLost": lost,
        "omittedHeight": omitted_height(integrators),
        "closed": [
            name
            for modes in found
            for name, is_closed in zip(modes.names, modes.closed, strict=True)
            if is_closed
        ],
    }
