"""Evaluate all forces of a system: the list of kinds of force that every scheme goes through.

Each kind is a module of this package. It states its law once, at one configuration, and beside it
the discrete form over a step of the midpoint element. The functions here call each kind once and in
the same order; schemes, start, study and diagnostics call nothing else. Gravity and gyroscopic
moments are inertial and belong to ``formulations.absolute.rigid_body``.

    concentrated, point    act on a point of a body and write to the rows of bodies
    coordinate, compliance,  act along a coordinate; their loads are summed with the multipliers of
    actuator                 constraint equations and then distributed to the rows of bodies

At one configuration (``set_time`` or ``set_node``, then ``add_forces``, ``add_derivatives``,
``add_power``) rows are accelerations: a force by mass [m/s^2], a moment by mass and length [m/s^2].
Derivatives are by displacement and by length times rotation (place), and by their rates.

Over a step of the midpoint element (``over_step``, then ``mean_residual``, ``mean_jacobian``,
``mean_work``) rows are lengths: -dt2 times those accelerations, where dt2 is h^2/2 or, of a
decaying scheme, more.

In a system without coordinates ``scalar`` is None, and the kernels compiled for it hold no code of
forces along coordinates; likewise ``compliance`` without springs in the compliance form,
``signals`` and ``actuator`` in a system without expressions of the motion. Signals are evaluated
before the forces that depend on them.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws
from msahl.algebra.vector import copy
from msahl.elements.constraints import coordinate_jacobians, coordinates
from msahl.elements.constraints.coordinate_kinds import CoordinatesWorkspace, Derivatives
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace
from msahl.elements.constraints.scalar import differentiate as scalar_differentiate
from msahl.elements.constraints.scalar import rates as scalar_rates
from msahl.elements.signals import group as signals
from msahl.elements.signals import inputs, results, states
from msahl.elements.signals.group import Signals, SignalsWorkspace, Stages
from msahl.formulations.absolute.frames import Frames, FramesWorkspace
from msahl.jit.kernel import kernel, optional
from msahl.laws.contact import CONTACT, DAMPING, SIDE
from msahl.ports import (
    actuator,
    compliance,
    concentrated,
    coordinate,
    point,
    rubbing,
    sliding,
)
from msahl.ports.actuator import Actuators
from msahl.ports.compliance import Compliances
from msahl.ports.concentrated import ConcentratedLoads, ConcentratedWorkspace
from msahl.ports.coordinate import AlongForces
from msahl.ports.point import PointForces
from msahl.ports.rubbing import Rubbing
from msahl.ports.sliding import Sliding


class Forces(NamedTuple):
    """The groups of all forces of a system, one of each kind."""

    concentrated: ConcentratedLoads
    point: PointForces | None
    along: AlongForces
    compliance: Compliances | None
    actuator: Actuators | None
    controlled: ConcentratedLoads | None  # whose factors are expressions
    signals: Signals | None  # expressions of the motion
    sliding: Sliding | None  # rigid contacts with friction
    rubbing: Rubbing | None  # compliant ones
    laws: Laws  # of time and of coordinates, to which the groups refer by number


ReactionForces = AlongForces | Sliding
"""The forces that depend on the reactions of joints or contacts."""


class ForcesWorkspace(NamedTuple):
    """What the forces need of the configuration they are evaluated at, in inertial axes."""

    motion: FramesWorkspace
    place: ScalarWorkspace  # coordinates and their rates; None where the system has none
    concentrated: ConcentratedWorkspace
    point: np.ndarray  # (k, 3) arms [m]
    reactions: np.ndarray  # (j, 6) reactions extrapolated to the step [N, N m]
    elastic: np.ndarray  # (s,) elastic energies of the springs [J]
    stretch: np.ndarray  # (s,) smoothed changes of the springs' coordinates, the state's own
    elongation: np.ndarray  # (c,) of springs in the compliance form, the state's own
    load: np.ndarray  # (c,) loads of these at one configuration
    signals: SignalsWorkspace  # None where the system has none
    controlled: ConcentratedWorkspace  # likewise


def new_workspace(
    forces: Forces,
    motion: FramesWorkspace,
    place: ScalarWorkspace,
    reaction: np.ndarray,
    stretch: np.ndarray,
    elongation: np.ndarray,
) -> ForcesWorkspace:
    """Return the arrays that ``prepare`` fills beside ``motion`` and ``place``, which are shared;
    ``reaction`` (j, 6), ``stretch`` (s,) and ``elongation`` (c,) are those of the state.
    """
    return ForcesWorkspace(
        motion=motion,
        place=place,
        concentrated=concentrated.new_workspace(forces.concentrated),
        point=point.new_arms(forces.point),
        reactions=np.zeros_like(reaction),
        elastic=np.zeros(forces.along.coordinate.size),
        stretch=stretch,
        elongation=elongation,
        load=np.zeros_like(elongation),
        signals=signals.new_workspace(forces.signals, len(reaction)),
        controlled=concentrated.new_workspace(forces.controlled),
    )


@kernel
def prepare(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    reaction: np.ndarray,
    trend: np.ndarray,
) -> None:
    """Set what forces need of the configuration of ``start.motion``, and extrapolate the joints'
    ``reaction`` (j, 6) by its ``trend``.
    """
    point.prepare(forces.point, start.motion.R, start.point)
    if scalar is None:
        return
    for j in range(reaction.shape[0]):
        for i in range(6):
            start.reactions[j, i] = reaction[j, i] + trend[j, i]


@kernel
def set_time(forces: Forces, start: ForcesWorkspace, t: float) -> None:
    """Set the forces that depend on time to their values at the time ``t``."""
    concentrated.at_time(forces.concentrated, forces.laws, t, start.concentrated.factor)
    set_node(forces, start, start.concentrated.factor)


def new_node_factors(forces: Forces, degree: int) -> np.ndarray:
    """Return the array that ``node_factors`` fills."""
    return np.zeros((degree, forces.concentrated.frame.size))


@kernel
def node_factors(
    forces: Forces, t: float, h: float, from_moments: np.ndarray, factor: np.ndarray
) -> None:
    """Set ``factor`` (s, k), by which the forces that depend on time are multiplied at the nodes of
    a collocation step, from the moments of their laws over it.
    """
    concentrated.at_nodes(forces.concentrated, forces.laws, t, h, from_moments, factor)


@kernel
def set_node(forces: Forces, start: ForcesWorkspace, factor: np.ndarray) -> None:
    """Set the forces that depend on time to their values by the ``factor`` (k,) of one node."""
    concentrated.prepare(forces.concentrated, factor, start.motion.R, start.concentrated)


@kernel
def add_forces(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    reaction: np.ndarray,
    F: np.ndarray,
) -> None:
    """Add all forces at one configuration by mass to the rows ``F`` (nodes, 3) [m/s^2], after
    ``scalar.rates``, and ``set_compliant_loads`` or ``set_stage_loads``; ``reaction`` (j, 6) are
    the joints' reactions.
    """
    _evaluate_signals(forces.signals, start, scalar)
    if scalar is not None:
        q = start.place.coordinates
        rate = start.place.rate
        coordinate.add_load(forces.along, forces.laws, scalar.coordinates, q, rate, reaction)
        rubbing.add_loads(forces.rubbing, forces.along, forces.laws, start.place)
        compliance.add_loads(forces.compliance, forces.along, start.load, q)
        actuator.add_load(forces.actuator, start.signals, start.place)
        coordinates.push(scalar.coordinates, q, frames, 1.0, F)
    _prepare_expressions(forces.controlled, start)
    concentrated.set_units(forces.controlled, start.controlled, start.motion.R)
    concentrated.add_force(forces.controlled, start.controlled, frames, F)
    concentrated.add_force(forces.concentrated, start.concentrated, frames, F)
    point.add_force(forces.point, start.point, frames, start.motion, F)


@kernel
def add_derivatives(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    reaction: np.ndarray,
    out: Derivatives,
) -> None:
    """Add the derivatives of ``add_forces`` at the loads of springs in the compliance form, after
    it and after ``scalar.differentiate``.
    """
    motion = start.motion
    concentrated.add_derivatives(forces.concentrated, start.concentrated, frames, out.by_place)
    point.add_derivatives(forces.point, start.point, frames, motion, out.by_place, out.by_rate)
    inputs.differentiate(
        forces.signals, start.signals, frames, start.motion, scalar, start.place, out
    )
    concentrated.add_derivatives(forces.controlled, start.controlled, frames, out.by_place)
    _add_slopes(forces.signals, forces, start, scalar, frames, out)
    if scalar is None:
        return
    place, group = start.place, scalar.coordinates
    coordinate.add_derivatives(
        forces.along, forces.laws, group, place, reaction, frames, motion, out
    )
    rubbing.add_derivatives(
        forces.rubbing, forces.along, forces.laws, group, place, frames, motion, out
    )
    # The unit forces' mean over a step changes by half as much as the forces themselves.
    coordinate_jacobians.stiffness(group, place.coordinates, frames, 2.0, out.still, out.by_place)


@kernel
def add_power(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    reaction: np.ndarray,
    dt: float,
    work: np.ndarray,
) -> None:
    """Add ``dt`` times the power of all forces to ``work`` (w,) [J], after ``add_forces``.

    Springs count by their elastic energy, not by work.
    """
    concentrated.add_power(forces.concentrated, start.concentrated, start.motion, dt, work)
    concentrated.add_power(forces.controlled, start.controlled, start.motion, dt, work)
    point.add_power(forces.point, start.point, start.motion, dt, work)
    if scalar is None:
        return
    coordinate.add_power(forces.along, forces.laws, start.place, reaction, dt, work)
    actuator.add_power(forces.actuator, start.signals, start.place, dt, work)
    sliding.add_power(forces.sliding, start.place, reaction, dt, work)
    rubbing.add_power(forces.rubbing, forces.along, forces.laws, start.place, dt, work)


@kernel
def set_compliant_loads(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    F: np.ndarray,
) -> None:
    """Set the loads of springs in the compliance form to those by places and rates, after
    ``scalar.rates``, and their equations in ``F`` to the multipliers of these.
    """
    if scalar is not None:
        q, rate = start.place.coordinates, start.place.rate
        group, springs = forces.compliance, forces.along
        compliance.set_loads(group, springs, forces.laws, frames, q, rate, start.load, F)


@kernel
def add_compliant_derivatives(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    out: Derivatives,
) -> None:
    """Add the derivatives of the loads that ``set_compliant_loads`` sets."""
    if scalar is not None:
        group, springs, q = forces.compliance, forces.along, start.place.coordinates
        compliance.add_derivatives(
            group, springs, forces.laws, scalar.coordinates, q, frames, start.motion, out
        )


@kernel
def isolate_multipliers(forces: Forces, values: np.ndarray) -> None:
    """Set the derivatives in the block ``values`` by which the unknowns of springs in the
    compliance form stand alone at one configuration; a step replaces them.
    """
    compliance.isolate_multipliers(forces.compliance, values)


@kernel
def accept(forces: Forces, start: ForcesWorkspace, scalar: ScalarConstraints | None) -> None:
    """Advance the elongations of springs in the compliance form by the step evaluated last."""
    if scalar is not None:
        group, springs, q = forces.compliance, forces.along, start.place.coordinates
        compliance.accept(group, springs, q, start.elongation)


@kernel
def correct_elongations(
    forces: Forces, start: ForcesWorkspace, scalar: ScalarConstraints | None, share: float
) -> None:
    """Bring the elongations of springs in the compliance form nearer to those at the prepared
    places by a ``share``; 1 sets them.
    """
    if scalar is not None:
        group, springs, q = forces.compliance, forces.along, start.place.coordinates
        compliance.correct_elongations(group, springs, q, share, start.elongation)


@kernel
def set_stage_elongations(
    forces: Forces,
    begin: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    increments: np.ndarray,
    elongation: np.ndarray,
) -> None:
    """Set ``elongation`` (c,) to those after the ``increments`` (nodes, 3) since the start of a
    collocation step, whose workspace is ``begin``.
    """
    if scalar is not None:
        group, springs, q = forces.compliance, forces.along, begin.place.coordinates
        elongations = begin.elongation, elongation
        compliance.set_stage_elongations(
            group, springs, scalar.coordinates, q, frames, increments, elongations
        )


@kernel
def accept_stage(
    forces: Forces,
    begin: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    Z: np.ndarray,
    increments: np.ndarray,
) -> None:
    """Advance the elongations of springs in the compliance form by a collocation step, at whose end
    ``Z`` are the displacements and rotation parameters; ``increments`` (nodes, 3) is a work array.
    """
    if scalar is not None:
        group, springs, q = forces.compliance, forces.along, begin.place.coordinates
        compliance.set_increments(group, springs, scalar.coordinates, frames, Z, increments)
        elongations = begin.elongation, begin.elongation
        compliance.set_stage_elongations(
            group, springs, scalar.coordinates, q, frames, increments, elongations
        )


@kernel
def set_stage_loads(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    h: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the loads of springs in the compliance form at a node of a collocation step to the
    multipliers in ``Z``, and their equations in ``F``, after ``scalar.rates``.
    """
    if scalar is not None:
        at_node = start.elongation, start.place.rate, start.load
        group, springs = forces.compliance, forces.along
        compliance.set_stage_equations(group, springs, frames, at_node, h, Z, F)


@kernel
def add_stage_derivatives(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    h: float,
    out: Derivatives,
) -> None:
    """Add the derivatives of ``set_stage_loads``, of its equations over h, after
    ``add_derivatives``.
    """
    if scalar is not None:
        group, springs, q = forces.compliance, forces.along, start.place.coordinates
        compliance.add_stage_derivatives(
            group, springs, scalar.coordinates, q, frames, start.motion, h, out
        )


@kernel
def over_step(forces: Forces, start: ForcesWorkspace, t: float, h: float) -> bool:
    """Set the forces that depend on time to their means over a step ``h`` from ``t``; return
    whether they have first moments as well.
    """
    group, R = forces.concentrated, start.motion.R
    return concentrated.over_step(group, forces.laws, t, h, R, start.concentrated)


@kernel
def mean_residual(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    step: tuple[float, float],
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Subtract all mean forces over the ``step`` (h, dt2), and the loads of constraint equations
    along coordinates, from the equations ``F`` (nodes, 3) [m], and set those of springs in the
    compliance form. Call it after ``scalar.residual``.
    """
    h, dt2 = step
    _evaluate_signals_over_step(forces.signals, start, scalar, frames, h, Z)
    if scalar is not None:
        q = start.place.coordinates
        sliding.add_mean_loads(forces.sliding, scalar, start.place, frames, step, Z)
        coordinate.add_mean_load(
            *(forces.along, forces.laws, scalar.coordinates, q, start.stretch),
            *(start.reactions, h),
        )
        rubbing.add_mean_loads(forces.rubbing, forces.along, forces.laws, start.place, h)
        compliance.mean_residual(
            *(forces.compliance, forces.along, q, start.elongation, start.stretch, frames),
            *(step, Z, F),
        )
        actuator.add_load(forces.actuator, start.signals, start.place)
        coordinates.push(scalar.coordinates, q, frames, -dt2, F)
    _prepare_expressions(forces.controlled, start)
    concentrated.set_mean_units(forces.controlled, start.controlled, frames, start.motion.R, Z)
    concentrated.mean_residual(forces.controlled, start.controlled, frames, -dt2, Z, F)
    concentrated.mean_residual(forces.concentrated, start.concentrated, frames, -dt2, Z, F)
    point.mean_residual(forces.point, start.point, frames, h, -dt2, Z, F)
    results.refuse_over_step(forces.signals, start.signals, F)


@kernel
def mean_jacobian(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    step: tuple[float, float],
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of ``mean_residual`` to the block ``values``, after it and after
    ``scalar.joint_jacobian`` at the same ``Z``.
    """
    h, dt2 = step
    inputs.differentiate_over_step(forces.signals, start.signals, frames, scalar, start.place, h, Z)
    if scalar is not None:
        q, group = start.place.coordinates, scalar.coordinates
        coordinate.mean_jacobian(
            forces.along, forces.laws, group, q, start.reactions, frames, (h, -dt2), values
        )
        compliance.mean_jacobian(forces.compliance, forces.along, group, q, frames, step, values)
        sliding.mean_jacobian(forces.sliding, scalar, start.place, frames, step, Z, values)
        rubbing.mean_jacobian(
            *(forces.rubbing, forces.along, forces.laws, group, start.place, frames),
            *((h, -dt2), values),
        )
        coordinate_jacobians.stiffness(group, q, frames, -dt2, Z, values)
    concentrated.mean_jacobian(forces.controlled, start.controlled, frames, -dt2, Z, values)
    _add_mean_slopes(forces.signals, forces, start, scalar, frames, -dt2, values)
    concentrated.mean_jacobian(forces.concentrated, start.concentrated, frames, -dt2, Z, values)
    point.mean_jacobian(forces.point, start.point, frames, h, -dt2, Z, values)


@kernel
def mean_work(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    step: tuple[float, float],
    Z: np.ndarray,
    work: np.ndarray,
) -> None:
    """Add the work of all mean forces over the solved ``step`` (h, dt2) to ``work`` (w,) [J]."""
    h, _ = step
    concentrated.mean_work(forces.concentrated, start.concentrated, frames, Z, work)
    concentrated.mean_work(forces.controlled, start.controlled, frames, Z, work)
    point.mean_work(forces.point, start.point, frames, h, Z, work)
    if scalar is None:
        return
    q = start.place.coordinates
    coordinate.mean_work(forces.along, forces.laws, start.reactions, q, h, work)
    actuator.mean_work(forces.actuator, start.signals, start.place, work)
    sliding.mean_work(forces.sliding, scalar, start.place, frames, step, Z, work)
    rubbing.mean_work(forces.rubbing, forces.along, forces.laws, start.place, h, work)


@kernel
def set_result_row(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    factor: float,
    r: int,
    row: np.ndarray,
) -> None:
    """Set ``row`` (4, 3) to ``factor`` times what a unit of a result of the signals adds by mass to
    the equations of the parts it acts on.
    """
    actuator.set_rows(forces.actuator, scalar, start.place, frames, factor, r, row)
    _set_load_row(forces.controlled, start, frames, factor, r, row)


@optional()
def _prepare_expressions(group: ConcentratedLoads, start: ForcesWorkspace) -> None:
    """Prepare the concentrated loads by expressions."""
    concentrated.by_expressions(group, start.controlled, start.signals.result, start.motion.R)


@optional()
def _set_load_row(
    group: ConcentratedLoads,
    start: ForcesWorkspace,
    frames: Frames,
    factor: float,
    r: int,
    row: np.ndarray,
) -> None:
    """Set the ``row`` of a result that is the factor of a load; those of actuators come before."""
    k = r - (start.signals.result.size - group.frame.size)
    concentrated.set_rows(group, start.controlled, frames, factor, k, row)


@optional()
def _add_mean_slopes(
    group: Signals,
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    factor: float,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the signals' results over a step, times what they act on."""
    own = start.signals
    for r in range(group.result.size):
        results.set_gradient(group, own, r)
        set_result_row(forces, start, scalar, frames, factor, r, own.row)
        results.add_rows(group, own.row, r, own.gradient, values)


@optional()
def _add_slopes(
    group: Signals,
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    out: Derivatives,
) -> None:
    """Add the derivatives of the signals' results at one configuration, by places and by rates,
    times what they act on.
    """
    own = start.signals
    for r in range(group.result.size):
        results.set_gradient(group, own, r)
        set_result_row(forces, start, scalar, frames, 1.0, r, own.row)
        results.add_rows(group, own.row, r, own.gradient, out.by_place)
        results.add_rows(group, own.row, r, own.gradient_rate, out.by_rate)


@optional()
def set_signal_inputs(
    group: Signals,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    still: np.ndarray,
) -> None:
    """Set the inputs of the signals at the prepared configuration; ``still`` is a step without
    motion.
    """
    scalar_rates(scalar, start.place, frames, start.motion, still)
    inputs.set_inputs(group, start.signals, start.motion, scalar, start.place)


@optional()
def set_prepared_inputs(
    group: Signals, start: ForcesWorkspace, scalar: ScalarConstraints | None
) -> None:
    """Set the inputs of the signals at the prepared configuration."""
    _set_rates(scalar, start.place, start.motion)
    inputs.set_inputs(group, start.signals, start.motion, scalar, start.place)


@optional()
def begin_signals(group: Signals, start: ForcesWorkspace, scalar: ScalarConstraints | None) -> None:
    """Save the inputs of the signals at the prepared start of a step of the midpoint element."""
    begin_stages(group, start, scalar, start.signals.step)


@optional()
def begin_stages(
    group: Signals, start: ForcesWorkspace, scalar: ScalarConstraints | None, stages: Stages
) -> None:
    """Save the inputs of the signals at the prepared start of a step for its ``stages``."""
    if group.rate.size > 0:
        set_prepared_inputs(group, start, scalar)
        states.save_start(group, start.signals, stages)


@optional()
def differentiate_signal_inputs(
    group: Signals,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    out: Derivatives,
) -> None:
    """Set the derivatives of the signals' inputs, after ``set_signal_inputs``."""
    scalar_differentiate(scalar, start.place, frames, out.still)
    inputs.differentiate(group, start.signals, frames, start.motion, scalar, start.place, out)


@optional()
def _evaluate_signals(
    group: Signals, start: ForcesWorkspace, scalar: ScalarConstraints | None
) -> None:
    """Set the signals' results at one configuration, after ``scalar.rates``."""
    inputs.set_inputs(group, start.signals, start.motion, scalar, start.place)
    results.evaluate(group, start.signals)


@optional()
def _evaluate_signals_over_step(
    group: Signals,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    frames: Frames,
    h: float,
    Z: np.ndarray,
) -> None:
    """Set the signals' results over a step, after ``scalar.residual``."""
    inputs.set_inputs_over_step(group, start.signals, frames, scalar, start.place, h, Z)
    results.evaluate_over_step(group, start.signals, h)


@optional()
def publish_signals(
    group: Signals,
    actuators: Actuators | None,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    table: np.ndarray,
    row: int,
) -> None:
    """Write the signals at the prepared configuration to a ``row`` of the table, and the power of
    the actuators.
    """
    set_prepared_inputs(group, start, scalar)
    results.evaluate(group, start.signals)
    results.publish(group, start.signals, table, row)
    actuator.publish_power(actuators, start.signals, start.place, table, row)


@optional()
def set_expressions(
    group: Signals, start: ForcesWorkspace, scalar: ScalarConstraints | None
) -> None:
    """Evaluate all expressions at the prepared configuration."""
    set_prepared_inputs(group, start, scalar)
    results.evaluate(group, start.signals)


@optional()
def set_expressions_by(
    group: Signals,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    reaction: np.ndarray,
    last: np.ndarray,
) -> None:
    """Evaluate all expressions at the prepared configuration with this ``reaction`` (j, 6) of the
    joints, in place of the ``last`` one.
    """
    copy(reaction, start.signals.reaction)
    set_expressions(group, start, scalar)
    copy(last, start.signals.reaction)


@optional(0.0)
def expression_at(group: Signals, start: ForcesWorkspace, place: int) -> float:
    """Return the value at a ``place`` on the tape, after ``set_expressions``."""
    return start.signals.values.value[place]


@optional(-1.0)
def margin_of_stops(
    group: Signals, start: ForcesWorkspace, scalar: ScalarConstraints | None
) -> float:
    """Return the largest margin of the conditions that end the run, at the prepared configuration:
    positive where one of them holds, -1 where there is none.
    """
    if group.stop.size == 0:
        return -1.0
    set_expressions(group, start, scalar)
    return results.largest_margin(group, start.signals)


@optional()
def _set_rates(scalar: ScalarConstraints, place: ScalarWorkspace, motion: FramesWorkspace) -> None:
    """Set the coordinates' rates of the prepared configuration."""
    coordinates.slopes(scalar.coordinates, place.coordinates)
    coordinates.rates(scalar.coordinates, place.coordinates, motion.v, motion.W, place.rate)


@kernel
def has_first(start: ForcesWorkspace) -> bool:
    """Return whether a force has a first moment over the step."""
    return concentrated.has_first(start.concentrated)


@kernel
def add_first(forces: Forces, start: ForcesWorkspace, frames: Frames, F: np.ndarray) -> None:
    """Add the forces' first moments over the step by mass to the rows ``F`` (nodes, 3)."""
    concentrated.add_first(forces.concentrated, start.concentrated, frames, F)


@kernel
def work_of_first(
    forces: Forces,
    start: ForcesWorkspace,
    h: float,
    a: np.ndarray,
    alpha: np.ndarray,
    deficit: float,
    work: np.ndarray,
) -> None:
    """Add the work of the first moments over a step with the accelerations ``a`` and ``alpha``
    (n+1, 3), whose sum is ``-deficit`` [J], to ``work`` (w,).
    """
    group, at_start = forces.concentrated, start.concentrated
    concentrated.work_of_first(group, at_start, h, a, alpha, deficit, work)


@kernel
def smooth(
    forces: Forces, start: ForcesWorkspace, scalar: ScalarConstraints | None, pole: float
) -> float:
    """Return the energy [J] that a decaying scheme took from the springs over the accepted step."""
    if scalar is None:
        return 0.0
    return coordinate.smooth(forces.along, start.place.coordinates, pole, start.stretch)


@kernel
def elastic_energy(
    forces: Forces, start: ForcesWorkspace, scalar: ScalarConstraints | None
) -> float:
    """Set ``start.elastic`` to the elastic energy of each spring; return their sum [J]."""
    if scalar is None:
        return 0.0
    return coordinate.energy(forces.along, forces.laws, start.place.coordinates, start.elastic)


@kernel
def publish_energy(
    forces: Forces, start: ForcesWorkspace, first: int, table: np.ndarray, row: int
) -> None:
    """Add each spring's elastic energy to its column of ``table``, counted from ``first``."""
    column = forces.along.energy_column
    for s in range(column.size):
        if column[s] >= 0:
            table[row, first + column[s]] += start.elastic[s]


@kernel
def publish_contacts(
    forces: Forces,
    start: ForcesWorkspace,
    scalar: ScalarConstraints | None,
    table: np.ndarray,
    row: int,
) -> None:
    """Write the loads of compliant contacts at the prepared configuration to the last columns of a
    ``row`` of the table of reactions.
    """
    if scalar is not None and coordinate.presses_itself(forces.along):
        _set_rates(scalar, start.place, start.motion)
        coordinate.publish_loads(forces.along, forces.laws, start.place, table, row)


@kernel
def depend_on_reactions(forces: Forces) -> bool:
    """Return whether a force depends on the joints' reactions."""
    return coordinate.by_reactions(forces.along)


# What a system's set-up and its reports ask of the forces, in plain Python.


def new_elongation(forces: Forces) -> np.ndarray:
    """Return the elongations of springs in the compliance form, still zero."""
    return np.zeros(forces.compliance.spring.size if forces.compliance else 0)


def new_stretch(forces: Forces) -> np.ndarray:
    """Return the smoothed changes of the springs' coordinates at t = 0."""
    return np.zeros(forces.along.coordinate.size)


def held_switches(forces: Forces) -> np.ndarray:
    """Return the held values of switches of expressions, the tape's own array."""
    return np.zeros(0) if forces.signals is None else forces.signals.tape.held


def energy_columns(forces: Forces) -> int:
    """Return the number of columns of elastic energy in the table of work."""
    return len({*forces.along.energy_column.tolist()} - {-1})


def loads_of_contacts(forces: Forces) -> int:
    """Return the number of columns of loads of compliant contacts."""
    return int(np.count_nonzero(forces.along.joint == coordinate.OWN_TENSION))


def signal_values(forces: Forces) -> int:
    """Return the number of columns of the table of signals."""
    if forces.signals is None:
        return 0
    powers = forces.actuator.coordinate.size if forces.actuator else 0
    return int(forces.signals.shown.size + powers)


def acts_at_points(forces: Forces) -> bool:
    """Return whether a force acts on a body from outside the system."""
    return forces.point is not None or any(group.frame.size for group in _concentrated(forces))


def _concentrated(forces: Forces) -> list[ConcentratedLoads]:
    """Return the groups of concentrated loads, by laws of time and by expressions of the motion."""
    groups = (forces.concentrated, forces.controlled)
    return [group for group in groups if group is not None]


def pressed_by_reactions(forces: Forces) -> ReactionForces | None:
    """Return the forces that depend on reactions, None if there are none."""
    return forces.along if depend_on_reactions(forces) else forces.sliding


def coordinates_of(forces: Forces) -> np.ndarray:
    """Return the numbers of the coordinates along which forces act."""
    along = [forces.along.coordinate]
    if forces.actuator is not None:
        along.append(forces.actuator.coordinate)
    if forces.rubbing is not None:
        along.append(forces.rubbing.along.reshape(-1))
    return np.concatenate(along)


def coordinates_needed(forces: Forces) -> np.ndarray:
    """Return the numbers of the coordinates along which forces act or on which they depend."""
    return np.concatenate([coordinates_of(forces), signals.coordinates_of(forces.signals)])


def renumbered(forces: Forces, number: np.ndarray) -> Forces:
    """Return the forces with coordinate q as number[q]."""
    return forces._replace(
        along=forces.along._replace(coordinate=number[forces.along.coordinate]),
        sliding=forces.sliding and forces.sliding._replace(along=number[forces.sliding.along]),
        rubbing=forces.rubbing and forces.rubbing._replace(along=number[forces.rubbing.along]),
        actuator=forces.actuator
        and forces.actuator._replace(coordinate=number[forces.actuator.coordinate]),
        signals=signals.renumbered(forces.signals, number),
    )


def set_origins(forces: Forces, value: np.ndarray) -> None:
    """Set what the forces count from, where the deck leaves it open, to the coordinates' ``value``
    (q,) at t = 0.
    """
    for constant in (forces.along.origin, forces.along.free):
        unset = np.isnan(constant)
        constant[unset] = value[forces.along.coordinate[unset]]


def vectors(
    forces: Forces, start: ForcesWorkspace
) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Return the vectors (k, 3) of all forces at points that lie in the plane of a planar system:
    forces and their arms; and those normal to it: moments. Inertial axes, sizes without the laws of
    time, which may vanish at t = 0.
    """
    R = start.motion.R
    in_plane: list[np.ndarray] = []
    across: list[np.ndarray] = []
    for group in _concentrated(forces):
        arms = np.einsum("kij,kj->ki", R[group.frame], group.s)
        of_forces = np.einsum("kij,kj->ki", R[group.f_axes], group.f)
        across.append(np.einsum("kij,kj->ki", R[group.m_axes], group.m))
        # The arm matters only where a force acts.
        in_plane += [of_forces, arms[of_forces.any(axis=1)]]
    return (*in_plane, start.point), tuple(across)


def work_scales(forces: Forces, length: np.ndarray) -> tuple[float, float]:
    """Return the work [J] of constant moments over one radian, and of constant forces over the
    lengths (n+1,) of their bodies.
    """
    of_moments, of_forces = 0.0, 0.0
    for group in _concentrated(forces):
        force, moment = (np.linalg.norm(loads, axis=1) for loads in (group.f, group.m))
        of_moments += float(moment.sum())
        of_forces += float(force @ length[group.frame])
    return of_moments, of_forces


def laws_of_time(forces: Forces) -> list[int]:
    """Return the numbers of the laws of time, -1 for a force without one."""
    return list(forces.concentrated.law.tolist())


def laws_of_coordinates(forces: Forces) -> Iterator[tuple[int, int, float]]:
    """Yield (law, coordinate, origin from which it counts) of each table, with law -1 for a force
    without one.
    """
    group = forces.along
    yield from zip(group.table, group.coordinate, group.origin, strict=True)


def places_of_stops(forces: Forces) -> list[int]:
    """Return the places on the tape of the margins of conditions that end the run."""
    return [] if forces.signals is None else list(forces.signals.stop.tolist())


def rate_breakpoints(forces: Forces) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinates along which forces change fast with the rate, and at which rates."""
    fast = forces.along.width > 0.0
    return forces.along.coordinate[fast], forces.along.width[fast]


def slip_breakpoints(forces: Forces) -> np.ndarray:
    """Return the slips (k,) [m/s] at which the friction of each compliant contact changes fast."""
    return np.zeros(0) if forces.rubbing is None else forces.rubbing.width


def kinks_of_contacts(forces: Forces) -> Iterator[tuple[int, float, float]]:
    """Yield the coordinate of each compliant contact, its value where the contact touches, and its
    rate where the force of one that opens ends, 0 if it does not.
    """
    group = forces.along
    for s in np.flatnonzero(group.law == coordinate.LAWS.index(CONTACT)):
        c = group.constants[s]
        rate = float(c[SIDE] / c[DAMPING]) if c[DAMPING] > 0.0 else 0.0
        yield int(group.coordinate[s]), float(group.origin[s] + group.free[s]), rate


def unresolved_speed(
    forces: Forces, scalar: ScalarConstraints | None, frames: Frames, reaction: np.ndarray, h: float
) -> float:
    """Return half the largest speed [m/s] within which a force changes fast and which the system
    passes within one step ``h`` under the joints' ``reaction`` (j, 6).
    """
    if scalar is None:
        return 0.0
    group = forces.along
    return coordinate.unresolved_speed(group, scalar.coordinates, frames, reaction, h)


def numbers_at_points(
    forces: Forces, start: ForcesWorkspace, v: np.ndarray
) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the column of work and the numbers of each force at a point, for the message about
    numbers that are not finite; ``v`` (n+1, 3) are the state's velocities.
    """
    for k, column in enumerate(forces.concentrated.column):
        yield column, np.concatenate([np.ravel(part[k]) for part in start.concentrated])
    if forces.point is not None:
        group = forces.point
        for k, column in enumerate(group.column):
            yield column, np.array(point.load_of(group, k, tuple(v[group.frame[k]])))


def numbers_along(forces: Forces, start: CoordinatesWorkspace) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the same of each force along a coordinate."""
    group = forces.along
    for s, column in enumerate(group.column):
        q = coordinate.elongation(group, start, s)
        parts = [*coordinate.tension(group, forces.laws, s, q)]
        parts.append(coordinate.potential(group, forces.laws, s, q))
        yield column, np.array(parts)
