"""Where a run stands between two steps: all that its next step depends on, to the last bit.

The accepted state of every island goes with what was prepared from it, so that nothing is computed
twice and no rounding can differ. What a scene has by its deck is not kept but known by its digest:
a run that goes on builds the scene anew, and must come to the same.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from msahl.run.subsystem import SubsystemIntegrator


class ResumeError(Exception):
    """A run that cannot go on from where it stood; the message names the reason and the remedy."""


@dataclass(frozen=True)
class Snapshot:
    """A run between two steps: digest of its scene, counters and extremes, and what advances.

    ``numbers`` are what JSON can hold; ``memory`` (m,) is all islands' states, one after the other.
    """

    workspace: str
    numbers: dict[str, Any]
    memory: np.ndarray


def remember(integrators: Sequence[SubsystemIntegrator]) -> np.ndarray:
    """(m,) a copy of all that the islands hand to their next steps."""
    return np.concatenate([array.ravel() for array in _advancing(integrators)])


def recall(integrators: Sequence[SubsystemIntegrator], memory: np.ndarray) -> None:
    """Put back what ``remember`` copied from the same islands."""
    first = 0
    for array in _advancing(integrators):
        array[:] = memory[first : first + array.size].reshape(array.shape)
        first += array.size


def counters(integrator: SubsystemIntegrator) -> dict[str, Any]:
    """What an island's runner counts, and whether it has begun."""
    iterations, factorisations = integrator.workspace.counts.tolist()
    return {
        "scipySteps": integrator.stepper.scipy_steps,
        "subdivisions": integrator.stepper.subdivisions,
        "counts": [iterations, factorisations],
        "stepper": integrator.stepper.counters,
    }


def set_counters(integrator: SubsystemIntegrator, counted: dict[str, Any]) -> None:
    """Put back what ``counters`` told."""
    integrator.stepper.scipy_steps = counted["scipySteps"]
    integrator.stepper.subdivisions = counted["subdivisions"]
    integrator.workspace.counts[:] = counted["counts"]
    integrator.stepper.restore(counted["stepper"])


def digest(integrators: Sequence[SubsystemIntegrator]) -> str:
    """SHA-256, in hexadecimal, of all that is constant in the islands' scenes."""
    found = hashlib.sha256()
    for integrator in integrators:
        found.update(f"{integrator.solver} {integrator.stepper.kind} {integrator.axis}\n".encode())
        for leaf in _leaves((integrator.workspace.system, integrator.workspace.unknowns)):
            if isinstance(leaf, np.ndarray):
                found.update(f"{leaf.shape}{leaf.dtype.str}\n".encode())
                found.update(leaf.tobytes())
            else:
                found.update(f"{leaf!r}\n".encode())
    return found.hexdigest()


def _leaves(value: Any) -> Iterator[Any]:
    """What nested groups hold, in order."""
    if isinstance(value, tuple):
        for part in value:
            yield from _leaves(part)
    else:
        yield value


def _advancing(integrators: Sequence[SubsystemIntegrator]) -> Iterator[np.ndarray]:
    """What changes from step to step and is read by the next: all of it doubles."""
    for integrator in integrators:
        workspace = integrator.workspace
        for leaf in _leaves(
            (workspace.state, workspace.start, workspace.pivots, integrator.stepper.memory)
        ):
            # ``along`` is None in a scene of points; numbers that count are constant.
            if isinstance(leaf, np.ndarray) and leaf.dtype == float:
                yield leaf
