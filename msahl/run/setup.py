"""The parts of a run, built from the model: subsystems, output times, step plan, error estimate."""

import time

from msahl.jit.compiled import Call
from msahl.jit.storage import Storages
from msahl.model import Model, RunSettings
from msahl.model.settings import ESTIMATE, LOCAL, OFF
from msahl.records import record
from msahl.run.attempts import KNOWN_NUMBERS, Attempts
from msahl.run.companion import Companion, choose_companion
from msahl.run.error_estimate import ErrorEstimate
from msahl.run.mesh_error import FinerMesh, MeshError
from msahl.run.messages import start_warnings
from msahl.run.observed import ObservedTables
from msahl.run.output import OutputTimes, TableAssembly
from msahl.run.report import Report
from msahl.run.step_plan import ControlledSteps, GivenSteps, StepPlan
from msahl.run.subsystem import Shared, SubsystemIntegrator
from msahl.run.tables import needs_accelerations
from msahl.system.arrays import System
from msahl.system.subsystems import split
from msahl.system.unknowns import Unknowns

STORAGES = Storages((System, Unknowns))
"""Arrays of the runs of this process that have ended."""


@record(slots=False)
class RunSetup:
    """What a run consists of. ``attempts`` are the runs to a global tolerance, if there is one."""

    model: Model
    settings: RunSettings
    attempts: Attempts | None
    output: OutputTimes
    integrators: list[SubsystemIntegrator]
    plan: StepPlan
    tables: TableAssembly
    observed: ObservedTables
    estimate: ErrorEstimate | None
    mesh: MeshError | None
    began: float  # time of the clock when building began [s]

    @property
    def all_integrators(self) -> list[SubsystemIntegrator]:
        """Those of the run, of its companion, and of its finer mesh."""
        companion = self.estimate.companion.integrators if self.estimate else []
        finer = self.mesh.integrators if self.mesh else []
        return [*self.integrators, *companion, *finer]

    def release(self, report: Report) -> None:
        """Let later runs use the arrays of this one, which has ended with this ``report``."""
        spent = sum(report.seconds.get(phase, 0.0) for phase in ("loop", "companion", "output"))
        step_time = spent / max(report.steps, 1) / len(self.all_integrators)
        for integrator in self.all_integrators:
            integrator.release(step_time)

    @property
    def calls(self) -> list[Call]:
        """The compiled functions that the run calls."""
        return [call for integrator in self.all_integrators for call in integrator.stepper.calls]


def build_integrators(
    model: Model,
    settings: RunSettings,
    rows: int,
    full: bool | None = None,
    kind: type[SubsystemIntegrator] = SubsystemIntegrator,
) -> list[SubsystemIntegrator]:
    """Return the subsystems of a ``model`` at t = 0 with arrays for so many ``rows``; ``full`` in
    place of what the settings say. Raises ``StartError``.
    """
    full = settings.full if full is None else full
    # With step-size control all subsystems take the same steps: their local errors are added up.
    together, accelerations = full or settings.adaptive, needs_accelerations(model)
    given = settings.solver, full, rows, settings.instantaneous, accelerations, Shared(STORAGES)
    return [kind(part, *given) for part in ([model] if together else split(model))]


def build_setup(
    model: Model, settings: RunSettings, attempts: Attempts | None, finer: FinerMesh | None = None
) -> RunSetup:
    """Build the parts of a run; raises ``StartError`` if there is no consistent start. Where errors
    are estimated, that by the mesh is, too, if there is a ``finer`` one.
    """
    began, output = time.perf_counter(), OutputTimes.of(model, settings.every)
    integrators = build_integrators(model, settings, output.chunk)
    tables = TableAssembly(model, integrators)
    tolerance = settings.local_tolerance
    plan: StepPlan = GivenSteps(output) if tolerance is None else ControlledSteps(output, tolerance)
    estimate = mesh = None
    companion = _companion(integrators, settings, attempts, output)
    if companion is not None:
        estimate = ErrorEstimate(model, integrators, companion, settings)
        # Runs that stop where a condition holds end at different times.
        kept = output.shown.n * tables.width <= KNOWN_NUMBERS and not model.stops
        if attempts and kept:
            estimate.keep_rows()
        if finer is not None:
            mesh = MeshError(model, finer, integrators, settings, output.chunk)
    return RunSetup(
        model=model,
        settings=settings,
        attempts=attempts,
        output=output,
        integrators=integrators,
        plan=plan,
        tables=tables,
        observed=ObservedTables(model),
        estimate=estimate,
        mesh=mesh,
        began=began,
    )


def _companion(
    integrators: list[SubsystemIntegrator],
    settings: RunSettings,
    attempts: Attempts | None,
    output: OutputTimes,
) -> Companion | None:
    """The companion run; None if no estimate is wanted, or if it is too expensive."""
    if settings.error in (LOCAL, OFF):
        return None
    if attempts and attempts.earlier:
        return attempts.earlier
    wanted = settings.error == ESTIMATE or settings.accuracy is not None
    required = wanted or attempts is not None
    return choose_companion(integrators, settings, output.chunk, output.grid.n, required)


def new_report(setup: RunSetup) -> Report:
    """A report with what is known before the first step."""
    model, integrators = setup.model, setup.integrators
    return Report(
        joints=len(model.joints) + len(model.couplings),
        subsystems=len(integrators),
        planar_subsystems=sum(integrator.axis is not None for integrator in integrators),
        tree_subsystems=sum(integrator.formulation.tree is not None for integrator in integrators),
        unknowns=sum(integrator.unknowns for integrator in integrators),
        degrees_of_freedom=_degrees_of_freedom(model, integrators),
        warnings=start_warnings(integrators),
        seconds=dict.fromkeys(("prepare", "loop", "output", "checkpoints"), 0.0),
    )


def _degrees_of_freedom(model: Model, integrators: list[SubsystemIntegrator]) -> dict[str, int]:
    """Degrees of freedom by count (Hainge 2010, eq. 1.1) and by rank of the joints' equations."""
    n = 6 * len(model.bodies)
    rank = sum(integrator.rank for integrator in integrators)
    return {
        "byCount": n - rank - sum(integrator.redundant for integrator in integrators),
        "byRank": n - rank,
    }
