"""The end of a run: its report is completed with figures, error estimate and verdict."""

import math
from collections.abc import Callable

from msahl.model.settings import OFF
from msahl.run.contacts import event_figures
from msahl.run.contacts import figures as contact_figures
from msahl.run.messages import (
    angles_uncertain,
    jumping_by_reactions,
    parallel_capsules,
    slides,
    speeds_that_jump,
)
from msahl.run.record import Record
from msahl.run.report import Report
from msahl.run.setup import RunSetup
from msahl.run.signal_errors import with_largest
from msahl.run.tables import counts_revolutions
from msahl.run.unseen_errors import unresolved_friction
from msahl.run.verdict import Figures, judge
from msahl.system.names import LOAD_COLUMN
from msahl.system.signal_terms import Scales

ROTATES = 0.75
"""Share of the fastest displacement in a step above which it is the rotation of a body, which is
less over a step than by its highest speed."""


def conclude(setup: RunSetup, record: Record, report: Report) -> None:
    """Complete the ``report`` on a run that has ended."""
    progress = setup.plan.progress
    report.steps, report.output_times = progress.steps, progress.output_times
    report.time = progress.time
    _count_work(setup, report)
    for integrator in setup.integrators:
        integrator.review_reactions()
        report.non_unique_reactions |= integrator.shared
        if integrator.modes:
            shared = sorted(integrator.modes.record.shared)
            report.non_unique_reactions |= {name: [LOAD_COLUMN] for name in shared}
    _add_extremes(setup, record, report)
    _complete_estimate(setup, record, report)
    if setup.attempts and setup.estimate:
        setup.attempts.add(report, setup.estimate)
    if not setup.settings.adaptive:
        found = (slides(integrator, ends_run=False) for integrator in setup.integrators)
        report.warnings += [message for message in found if message]
    rotation = _rotation_between_rows(setup, report)
    if rotation >= math.pi and counts_revolutions(setup.model):
        report.warnings.append(angles_uncertain(rotation))
    report.error = setup.estimate.as_json() if setup.estimate else None
    report.contacts = contact_figures(setup.integrators)
    report.events = event_figures(setup.integrators)
    if report.error and report.contacts:
        report.error["position"] += report.contacts["omittedHeight"]
    if report.error and setup.mesh:
        # The errors of the steps and of the mesh add up, at worst.
        report.error["position"] += setup.mesh.largest
        report.error["mesh"] = setup.mesh.as_json()
    report.verdict = judge(_figures(setup, record, report), setup.settings.limits).as_json()
    if report.error:
        report.error |= with_largest(report.error.get("signals", {}))


def _count_work(setup: RunSetup, report: Report) -> None:
    """Add up what the subsystems' solvers did."""
    report.iterations = sum(int(integrator.workspace.counts[0]) for integrator in setup.integrators)
    report.factorisations = sum(
        int(integrator.workspace.counts[1]) for integrator in setup.integrators
    )
    report.scipy_steps = sum(integrator.stepper.scipy_steps for integrator in setup.integrators)
    report.path_steps = sum(integrator.stepper.path_steps for integrator in setup.integrators)
    report.subdivisions = sum(integrator.stepper.subdivisions for integrator in setup.integrators)


def _add_extremes(setup: RunSetup, record: Record, report: Report) -> None:
    """Enter the extremes; local errors are those of the schemes of order 2, or of the control."""
    settings = setup.settings
    report.extremes = record.extremes.as_json()
    if settings.degree:
        report.extremes |= {"localErrorMax": None, "localErrorSum": None}
    report.step_control, local = setup.integrators[0].stepper.as_json()
    report.extremes |= local
    if settings.dissipative:
        report.extremes |= {"energyTaken": record.energy_taken}


def _complete_estimate(setup: RunSetup, record: Record, report: Report) -> None:
    """Add the errors that a comparison at the output times does not show."""
    settings, estimate, extremes = setup.settings, setup.estimate, report.extremes
    speed, h = extremes["speedMax"] or 0.0, setup.output.grid.h
    if estimate and settings.dissipative:
        kinetic = extremes["largestKineticEnergy"] or 0.0
        displacement = speed * longest_step(setup, report)
        estimate.add_damped(record.energy_taken, record.extremes.size, kinetic, displacement)
    if estimate and not settings.adaptive:
        displacement = min(h, report.time) * speed
        rotation = record.length * (extremes["rotationPerStepMax"] or 0.0)
        displacement = displacement - rotation if rotation < ROTATES * displacement else 0.0
        friction = [
            unresolved_friction(integrator, settings.order, h, report.time)
            for integrator in setup.integrators
        ]
        estimate.add_unresolved(displacement, record.extremes.displacement, max(friction))
    if estimate and (unexplained := estimate.taken_at_any_step(setup.integrators)) is not None:
        extremes["energyTakenAtAnyStep"] = unexplained
    if estimate:
        energy = max(record.extremes.size, record.extremes.scale)
        by_time = record.length / report.time if report.time > 0.0 else 0.0
        asked = setup.attempts.goal / record.length if setup.attempts else math.inf
        scales = Scales(record.length, max(speed, by_time), energy)
        estimate.judge_signals(setup.integrators, scales, asked)
    if settings.error == OFF:
        report.extremes |= {"localErrorMax": None, "localErrorSum": None}


def _figures(setup: RunSetup, record: Record, report: Report) -> Figures:
    """What the verdict is based on."""
    settings = setup.settings
    return Figures(
        status=report.status,
        time=report.time,
        steps=report.steps,
        iterations=report.iterations,
        subdivisions=report.subdivisions,
        scipy_steps=report.scipy_steps,
        path_steps=report.path_steps,
        joints=report.joints,
        dt=longest_step(setup, report),
        order=settings.order,
        conserves=not settings.degree,
        explicit=settings.explicit,
        works=any(bool(integrator.workspace.state.work.any()) for integrator in setup.integrators),
        by_cayley=not settings.degree and not settings.exponential,
        tolerance=setup.attempts.goal if setup.attempts else None,
        local_tolerance=settings.local_tolerance,
        length=record.length,
        energy_size=record.extremes.size,
        extremes=report.extremes,
        momentum=record.momentum_lost(settings),
        pivot_ratio=record.pivot_ratio,
        velocity_change=record.velocity_change,
        non_unique_reactions=report.non_unique_reactions,
        error=report.error,
        horizon=_horizon(setup),
        energy_gained=(report.contacts or {}).get("energyGained", 0.0),
        jumping=jumping_by_reactions(setup.integrators),
        speed_jumps=speeds_that_jump(setup.model, report.time),
        parallel=parallel_capsules(setup.model, record.capsules.found),
    )


def _horizon(setup: RunSetup) -> Callable[[float], float] | None:
    """The time up to which the errors of steps and of the mesh are within an accuracy."""
    estimate, mesh = setup.estimate, setup.mesh
    if estimate is None or mesh is None or not mesh.known:
        return estimate.horizon if estimate else None
    return lambda accuracy: min(estimate.horizon(accuracy), mesh.history.horizon(accuracy))


def _rotation_between_rows(setup: RunSetup, report: Report) -> float:
    """Bound of the relative rotation of two bodies between two output times [rad]; 0 where every
    step has a row, since a step shows its own rotation.
    """
    steps = setup.output.every * setup.output.shown.h / longest_step(setup, report)
    return 2.0 * steps * (report.extremes["rotationPerStepMax"] or 0.0) if steps > 1.5 else 0.0


def longest_step(setup: RunSetup, report: Report) -> float:
    """Size of the longest step [s]; where none was taken, of the one to begin with."""
    longest = report.step_control["stepMax"] if report.step_control else 0.0
    return float(longest) or setup.output.grid.h
