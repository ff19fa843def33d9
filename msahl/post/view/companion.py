"""Run a model again with smaller steps, to show the error of a run in the viewer."""

from dataclasses import replace

from msahl.model import Options, resolve
from msahl.model.settings import OFF
from msahl.results.sample import Sample
from msahl.run import loop
from msahl.run.options import with_options
from msahl.run.report import COMPLETED, INTERRUPTED
from msahl.run.tables import MemorySink, tables_of_model

FINER = 1e-3
"""Factor of the local tolerance, where the step size is controlled: at the highest orders even this
only halves the steps."""


def companion_of(sample: Sample) -> Sample:
    """Return the same motion with half the step size, or with a thousandth of the local tolerance
    where the step size is controlled, at the output times of ``sample``.
    """
    simulation, given = sample.model.simulation, sample.info.get("options", {})
    settings = resolve(simulation)
    if settings.adaptive:
        local = _local_tolerance(sample) or settings.local_tolerance or settings.tolerance
        assert local is not None
        finer = {"local_tolerance": FINER * local}
    else:
        interval = simulation.output_interval or simulation.dt
        finer = {"dt": 0.5 * simulation.dt, "output_interval": interval}
    model = with_options(sample.model, finer | {"t_final": float(sample.time[-1])})
    options = Options(
        solver=given.get("solver") or "auto",
        every=sample.stride * int(given.get("every") or 1),
        full=bool(given.get("full")),
        error=OFF,
    )
    sink = MemorySink()
    report = loop.run(model, options, sink, checked=True)
    if report.status == INTERRUPTED:
        raise KeyboardInterrupt(report.message)
    columns = tables_of_model(model)
    tables = {name: (columns[name], sink.table(name)) for name in columns}
    return replace(sample, tables=tables, partial=report.status != COMPLETED)


def _local_tolerance(sample: Sample) -> float | None:
    """Return the local tolerance [m] of the last one of the runs to a global tolerance."""
    runs = (sample.info.get("stepControl") or {}).get("runs", ())
    return float(runs[-1]["localTolerance"]) if runs else None
