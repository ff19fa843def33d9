"""Completely prescribed motions with their results in memory."""

import time

from msahl.analysis.kinematics.solution import follow, output_times, prepare
from msahl.analysis.kinematics.verdict import COMMAND, SCHEME, kinematics_as_json, report_of
from msahl.api.result import Result, result_of
from msahl.results.job import Job
from msahl.run.tables import MemorySink


def kinematics_of(job: Job, every: int) -> Result:
    """Return the motion of a ``job`` at every ``every``-th output time, and the last one."""
    began, sink = time.perf_counter(), MemorySink()
    prepared = prepare(job.model)
    found = follow(prepared, output_times(job.model, every), sink)
    report = report_of(found, job.model.simulation.t_final)
    report.seconds["total"] = time.perf_counter() - began
    result = result_of(job, report, sink)
    options = {**result.report["options"], "scheme": SCHEME, "every": every}
    result.report |= {
        "command": COMMAND,
        "options": options,
        "kinematics": kinematics_as_json(found),
    }
    return result
