"""The state of a run between two steps: all that its next step depends on, to the last bit.

The accepted state of every subsystem is saved together with what was prepared from it, so nothing
is computed twice and no rounding can differ. What a system owes to its deck alone is not saved but
identified by a digest: a run that is resumed builds the system again, and must obtain the same.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from msahl.records import record
from msahl.run.subsystem import SubsystemIntegrator


class ResumeError(Exception):
    """A run that cannot be resumed; the message names the reason and the remedy."""


@record(slots=False)
class Snapshot:
    """A run between two steps.

    ``system`` is the digest of its systems, ``numbers`` are counters and figures as JSON can hold
    them, ``memory`` (m,) holds the changing doubles of all subsystems, one after the other.
    """

    system: str
    numbers: dict[str, Any]
    memory: np.ndarray


@dataclass
class SavedSteps:
    """Where the subsystems' steps stood, to go back to within the same run."""

    memory: np.ndarray
    counters: list[dict[str, Any]]

    @classmethod
    def of(cls, integrators: Sequence[SubsystemIntegrator]) -> "SavedSteps":
        """The present state of the ``integrators``."""
        return cls(
            copy_memory(integrators), [integrator.stepper.counters for integrator in integrators]
        )

    def update(self, integrators: Sequence[SubsystemIntegrator]) -> None:
        """Replace it by the present state of the same ``integrators``."""
        self.memory = copy_memory(integrators, self.memory)
        self.counters = [integrator.stepper.counters for integrator in integrators]

    def restore(self, integrators: Sequence[SubsystemIntegrator]) -> None:
        """Bring the same ``integrators`` back; the work counted since then stays counted."""
        for integrator, counters in zip(integrators, self.counters, strict=True):
            integrator.stepper.restore(counters)
        restore_memory(integrators, self.memory)


def copy_memory(
    integrators: Sequence[SubsystemIntegrator], memory: np.ndarray | None = None
) -> np.ndarray:
    """(m,) a copy of all doubles that the subsystems' next steps depend on, in ``memory`` if it has
    that size; those of another degree have not.
    """
    arrays = list(_changing(integrators))
    fits = memory is not None and memory.size == sum(array.size for array in arrays)
    return np.concatenate(arrays, out=memory if fits else None)


def restore_memory(integrators: Sequence[SubsystemIntegrator], memory: np.ndarray) -> None:
    """Restore what ``copy_memory`` copied from the same subsystems."""
    first = 0
    for array in _changing(integrators):
        array[:] = memory[first : first + array.size]
        first += array.size


def counters(integrator: SubsystemIntegrator) -> dict[str, Any]:
    """The counters of a subsystem, as JSON can hold them."""
    iterations, factorisations = integrator.workspace.counts.tolist()
    return {
        "scipySteps": integrator.stepper.scipy_steps,
        "pathSteps": integrator.stepper.path_steps,
        "subdivisions": integrator.stepper.subdivisions,
        "counts": [iterations, factorisations],
        "stepper": integrator.stepper.counters,
    }


def restore_counters(integrator: SubsystemIntegrator, counted: dict[str, Any]) -> None:
    """Restore what ``counters`` returned."""
    integrator.stepper.scipy_steps = counted["scipySteps"]
    integrator.stepper.path_steps = counted["pathSteps"]
    integrator.stepper.subdivisions = counted["subdivisions"]
    integrator.workspace.counts[:] = counted["counts"]
    integrator.stepper.restore(counted["stepper"])


def digest(integrators: Sequence[SubsystemIntegrator]) -> str:
    """SHA-256, in hexadecimal, of all that is constant in the subsystems."""
    found = hashlib.sha256()
    for integrator in integrators:
        found.update(f"{integrator.solver} {integrator.stepper.kind} {integrator.axis}\n".encode())
        workspace = integrator.workspace
        # The targets follow from the rest, and may be gigabytes.
        elimination = workspace.unknowns.elimination._replace(target=np.zeros(0))
        unknowns = workspace.unknowns._replace(elimination=elimination)
        for leaf in _leaves((workspace.system, unknowns)):
            if isinstance(leaf, np.ndarray):
                found.update(f"{leaf.shape}{leaf.dtype.str}\n".encode())
                found.update(np.ascontiguousarray(leaf).data)
            else:
                found.update(f"{leaf!r}\n".encode())
    return found.hexdigest()


def _leaves(value: Any) -> Iterator[Any]:
    """The values in nested tuples, in order."""
    if isinstance(value, tuple):
        for part in value:
            yield from _leaves(part)
    else:
        yield value


def _changing(integrators: Sequence[SubsystemIntegrator]) -> Iterator[np.ndarray]:
    """Flat views of the arrays that change from step to step and that the next step reads: all are
    doubles.
    """
    for integrator in integrators:
        yield from integrator.changing
        yield from integrator.storage.doubles(integrator.stepper.memory)
