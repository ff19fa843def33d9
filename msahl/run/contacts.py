"""Contacts and events of a run, of all its subsystems: what happened, and figures for the report."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.run.subsystem import SubsystemIntegrator

if TYPE_CHECKING:
    from msahl.contact.modes import ContactModes
    from msahl.switching.modes import Switching


def rows_of_events(integrators: Sequence[SubsystemIntegrator]) -> np.ndarray:
    """Return the rows (m, columns) of ``events.csv`` that are not published yet, in order of time:
    objects, as some columns are words.
    """
    found = [event for source in _sources(integrators) for event in source.events]
    rows = np.empty((len(found), len(found[0]) if found else 0), dtype=object)
    for k, event in enumerate(sorted(found, key=lambda event: event.time)):
        rows[k] = event
    return rows


def forget_events(integrators: Sequence[SubsystemIntegrator]) -> None:
    """Let all events so far count as published."""
    for source in _sources(integrators):
        source.forget_events()


def _sources(integrators: Sequence[SubsystemIntegrator]) -> "list[ContactModes | Switching]":
    """Return all that has events."""
    pairs = ((one.switching, one.modes) for one in integrators)
    return [source for pair in pairs for source in pair if source is not None]


def happened(integrators: Sequence[SubsystemIntegrator]) -> dict[str, int]:
    """Return how often each event of the deck happened, by name."""
    found = [one.switching for one in integrators if one.switching]
    return {
        event.name: int(count)
        for switching in found
        for event, count in zip(switching.deck, switching.happened, strict=True)
    }


def omitted_heights(
    integrators: Sequence[SubsystemIntegrator], times: np.ndarray
) -> np.ndarray | float:
    """Return the heights [m] of the rebounds that were omitted up to these ``times`` (m,), of the
    subsystem that has the largest; 0 without contacts.
    """
    found = [_heights(one.modes.omitted, times) for one in integrators if one.modes]
    return np.max(found, axis=0) if found else 0.0


def _heights(omitted: Sequence[Sequence[float]], times: np.ndarray) -> np.ndarray:
    table = np.array([*omitted]).reshape(-1, 2)
    height: np.ndarray = np.where(table[:, 0] <= times[:, None], table[:, 1], 0.0).sum(axis=1)
    return height


def figures(integrators: Sequence[SubsystemIntegrator]) -> dict[str, Any] | None:
    """Return what ``run.json`` says of contacts; None if there are none."""
    found = [integrator.modes for integrator in integrators if integrator.modes]
    if not found:
        return None
    lost = -sum(float(modes.state.work[modes.contacts.column].sum()) for modes in found)
    return {
        "impacts": sum(modes.impacts for modes in found),
        "energyLost": lost,
        "energyGained": sum(modes.gained for modes in found),
        "omittedHeight": float(np.max(omitted_heights(integrators, np.array([np.inf])))),
        "closed": [
            name
            for modes in found
            for name, is_closed in zip(modes.names, modes.closed, strict=True)
            if is_closed
        ],
    }
