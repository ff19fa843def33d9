"""Run a job with its results in memory."""

import time
from collections.abc import Sequence

from msahl.api.result import Result, result_of
from msahl.model.settings import EQUILIBRIUM
from msahl.results.job import Job
from msahl.run import loop
from msahl.run.loop import Hooks
from msahl.run.mesh_error import FinerMesh
from msahl.run.report import INTERRUPTED
from msahl.run.tables import MemorySink


def run_job(job: Job, only: Sequence[str] | None = None, hooks: Hooks | None = None) -> Result:
    """Run a ``job`` and return its results: all tables, or those whose names are in ``only``.

    Raises ``StartError`` if the model has no consistent state at t = 0, and KeyboardInterrupt if
    the user stops the run.
    """
    job = at_start(job)
    began, sink = time.perf_counter(), MemorySink(only)
    report = loop.run(
        job.model, job.options, sink, hooks or Hooks(), checked=True, finer=finer_mesh(job)
    )
    report.seconds["total"] = time.perf_counter() - began
    if report.status == INTERRUPTED:
        raise KeyboardInterrupt(report.message)
    return result_of(job, report, sink)


def finer_mesh(job: Job) -> FinerMesh | None:
    """Return the model with a finer mesh of its beams, if it has any."""
    if not job.model.beams:
        return None
    from msahl.study.more_elements import finer

    return finer(job)


def at_start(job: Job) -> Job:
    """Return a run where it starts, at an equilibrium if its deck asks for it; raises
    ``StartError`` if none is found.
    """
    if job.model.simulation.start != EQUILIBRIUM:
        return job
    from msahl.analysis.equilibria.begin import beginning

    return beginning(job)
