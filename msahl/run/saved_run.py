"""Snapshots of a complete run, and how a run is resumed from one."""

import numpy as np

from msahl.run.record import Record
from msahl.run.report import Report
from msahl.run.setup import RunSetup
from msahl.run.snapshot import (
    ResumeError,
    Snapshot,
    copy_memory,
    counters,
    restore_counters,
    restore_memory,
)
from msahl.run.step_plan import Progress


def take_snapshot(system: str, setup: RunSetup, record: Record, report: Report) -> Snapshot:
    """Snapshot of a run between two chunks; ``system`` is the digest of its systems."""
    numbers = {
        "progress": setup.plan.progress.numbers(),
        "resumed": report.resumed,
        "seconds": dict(report.seconds),
        "extremes": record.extremes.numbers(),
        "capsules": record.capsules.numbers(),
        "subsystems": [counters(integrator) for integrator in setup.all_integrators],
        "error": setup.estimate and setup.estimate.numbers(),
        "mesh": setup.mesh and setup.mesh.numbers(),
        "attempts": setup.attempts and setup.attempts.numbers(),
        "observed": setup.observed.numbers(),
    }
    memory = copy_memory(setup.all_integrators)
    if setup.attempts:
        memory = np.append(memory, setup.attempts.memory())
    return Snapshot(system, numbers, memory)


def restore_snapshot(
    since: Snapshot, system: str, setup: RunSetup, record: Record, report: Report
) -> None:
    """Bring a run that has just been built to where the snapshot ``since`` was taken.

    Raises ``ResumeError`` if the systems are not the same to the last bit.
    """
    numbers = since.numbers
    if since.system != system:
        raise ResumeError(
            "the model's matrices differ in the last digits from those of the run to be resumed: "
            "another machine, or other libraries. Omit --resume to start again"
        )
    for integrator, counted in zip(setup.all_integrators, numbers["subsystems"], strict=True):
        restore_counters(integrator, counted)
    restore_memory(setup.all_integrators, since.memory)
    setup.plan.progress = Progress(**numbers["progress"])
    record.extremes.restore(numbers["extremes"])
    record.capsules.restore(numbers["capsules"])
    setup.observed.restore(numbers["observed"])
    if setup.estimate:
        setup.estimate.restore(numbers["error"])
    if setup.mesh:
        setup.mesh.restore(numbers["mesh"])
    report.resumed = [*numbers["resumed"], setup.plan.progress.time]
    for phase, seconds in numbers["seconds"].items():
        report.add_seconds(phase, seconds)
