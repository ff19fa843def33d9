"""Contacts and events of a run, of all its subsystems: what happened, and figures."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.run.subsystem import SubsystemIntegrator

if TYPE_CHECKING:
    from msahl.contact.events import ContactEvent
    from msahl.contact.modes import ContactModes
    from msahl.switching.modes import Switching


def rows_of_events(integrators: Sequence[SubsystemIntegrator]) -> np.ndarray:
    """Return the rows (m, columns) of ``events.csv`` that are not published yet, in order of time:
    objects, as some columns are words.
    """
    found = events_of(integrators)
    rows = np.empty((len(found), len(found[0]) if found else 0), dtype=object)
    for k, event in enumerate(found):
        rows[k] = event
    return rows


def events_of(integrators: Sequence[SubsystemIntegrator]) -> "list[ContactEvent]":
    """Return what happened and is not published yet, in order of time."""
    found = [event for source in _sources(integrators) for event in source.events]
    return sorted(found, key=lambda event: event.time)


def forget_events(integrators: Sequence[SubsystemIntegrator]) -> None:
    """Let all events so far count as published."""
    for source in _sources(integrators):
        source.forget_events()


def _sources(integrators: Sequence[SubsystemIntegrator]) -> "list[ContactModes | Switching]":
    """Return all that has events."""
    pairs = ((one.switching, one.modes) for one in integrators)
    return [source for pair in pairs for source in pair if source is not None]


def event_figures(integrators: Sequence[SubsystemIntegrator]) -> dict[str, Any] | None:
    """Return what ``run.json`` says of the deck's events; None if there are none."""
    found = [one.switching for one in integrators if one.switching]
    if not found:
        return None
    states = [pair for switching in found for pair in switching.states()]
    messages = [said for switching in found for said in switching.messages]
    return {
        "happened": {name: n for switching in found for name, n in switching.counts().items()},
        "messages": sorted(messages, key=lambda said: float(said["time"])),
        "energyLost": sum(switching.energy_lost() for switching in found),
        "engaged": [name for name, acts in states if acts],
        "released": [name for name, acts in states if not acts],
    }


def events_that_never_happened(integrators: Sequence[SubsystemIntegrator]) -> list[str]:
    """Return a warning for each event of the deck that did not happen."""
    found = [one.switching for one in integrators if one.switching]
    counts = [(name, n) for switching in found for name, n in switching.counts().items()]
    return [f"event '{name}' did not happen during the run" for name, n in counts if not n]


def omitted_heights(
    integrators: Sequence[SubsystemIntegrator], times: np.ndarray
) -> np.ndarray | float:
    """Return the heights [m] of the rebounds that were omitted up to these ``times`` (m,), of the
    subsystem that has the largest; 0 without contacts.
    """
    found = [_heights(one.modes.record.omitted, times) for one in integrators if one.modes]
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
    lost = -sum(float(modes.held.state.work[modes.held.contacts.column].sum()) for modes in found)
    return {
        "impacts": sum(modes.record.impacts for modes in found),
        "energyLost": lost,
        "energyGained": sum(modes.record.gained for modes in found),
        "omittedHeight": float(np.max(omitted_heights(integrators, np.array([np.inf])))),
        "closed": [
            name
            for modes in found
            for name, is_closed in zip(modes.names, modes.held.closed, strict=True)
            if is_closed
        ],
    }
