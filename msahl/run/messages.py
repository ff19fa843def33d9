"""Messages of a run: what went wrong, where, and what to do."""

import errno
from collections.abc import Mapping, Sequence

import numpy as np

from msahl.check.loads import jumps_of_speed
from msahl.events.expressions import jumps_by_reactions
from msahl.model import Model, resolve
from msahl.model.model import in_deck
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.common.criteria import FAR
from msahl.schemes.outcome import TOLERANCE, Outcome
from msahl.system.names import describe_row
from msahl.system.nonfinite import names_of_users, overflow

DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of the operating system that mean that no more can be written."""
REPORTED_CHANGE = 1e-12
"""Smallest change of the initial velocities that is reported: its displacement in a step, relative
to the length of the bodies."""


def not_written(error: OSError, extent: str = "") -> str:
    """Why results could not be written, and what to do; ``extent`` says which of them exist."""
    if error.errno in (errno.ENOENT, errno.ENOTDIR, errno.ESTALE):
        return f"{error.filename}: the folder was removed or renamed while the run wrote into it"
    text = f"{error.filename}: {error.strerror or error}{extent}"
    return f"{text}. Free some disk space" if error.errno in DISK_FULL else text


def step_failed(
    integrator: SubsystemIntegrator, step: int, t: float, h: float, outcome: Outcome
) -> str:
    """Why a subsystem could not take step number ``step`` of size ``h`` [s] from time ``t`` [s]."""
    if integrator.stepper.sliding:
        return str(slides(integrator, ends_run=True))
    if integrator.stepper.trouble:
        return integrator.stepper.trouble
    name, smallest = integrator.find_nonfinite(h), integrator.stepper.smallest_tried(h)
    if np.isnan(outcome.residual):
        name = name or integrator.find_undefined(h)
        return overflow(t, name or describe_equation(integrator, outcome.worst))
    if name is not None:
        return overflow(t, name)
    settings = resolve(integrator.model.simulation)
    if np.isinf(outcome.residual) and settings.explicit:
        return (
            f"step {step} of {settings.scheme} from t = {t:g} s is unstable: it and most parts of "
            f"it, down to {smallest:.3g} s, end beyond the range of a step. Explicit schemes are "
            "unstable where springs or dampers are stiff: take a smaller --dt, or an implicit "
            "scheme such as --scheme gauss3 or radau3."
        )
    if np.isinf(outcome.residual):
        return (
            f"steps from t = {t:g} s, down to {smallest:.3g} s, end {FAR:g} times farther away "
            "than the motion so far and the sizes of the bodies suggest. Look for forces or "
            "velocities that appear suddenly, and try a smaller --dt."
        )
    return (
        f"step {step} from t = {t:g} s did not converge, nor did steps down to {smallest:.3g} s: "
        f"the relative residual stayed at {outcome.residual:.1e} (solved: {TOLERANCE:g}), largest "
        f"in {describe_equation(integrator, outcome.worst)}. Try a smaller --dt, and look at the "
        "last rows of the tables for forces or velocities that grow without bound."
    )


def tolerance_not_met(
    integrator: SubsystemIntegrator, t: float, h: float, tolerance: float, outcome: Outcome
) -> str:
    """Why no step from time ``t`` [s] meets the local ``tolerance`` [m]."""
    if integrator.stepper.sliding:
        return str(slides(integrator, ends_run=True))
    if integrator.stepper.trouble:
        return integrator.stepper.trouble
    tried = integrator.stepper.smallest_tried(h)
    name = integrator.find_nonfinite(tried)
    if name is None and np.isnan(outcome.residual):
        name = integrator.find_undefined(tried)
    if name is not None:
        return overflow(t, name)
    why = f"the local errors stay above their share of {tolerance:g} m"
    if not outcome.converged:
        worst = describe_equation(integrator, outcome.worst)
        why = f"the relative residual stays at {outcome.residual:.1e}, largest in {worst}"
    return (
        f"no step from t = {t:g} s, down to {tried:.3g} s, meets the tolerance: {why}. Look at the "
        "last rows of the tables for forces or velocities that grow without bound, or jump."
    )


def slides(integrator: SubsystemIntegrator, ends_run: bool) -> str | None:
    """Where the motion slides along a jump of an expression, and what to do; None if nowhere."""
    if integrator.stepper.sliding is None:
        return None
    switch, t = integrator.stepper.sliding
    names = names_of_users(integrator.model, integrator.workspace.system, switch)
    whose = " and of ".join(names[:3]) or "a signal"
    effect = (
        "no step can be taken there"
        if ends_run
        else "it is of order 1 from there on, and its force or rate may alternate from step to step"
    )
    return (
        f"from t = {t:g} s on the motion slides along a jump in the expression of {whose}: on both "
        f"sides of it the expression drives the motion back to the other one; {effect}. Give the "
        "jump a width, such as tanh(x/w) for sign(x); for dry friction use <friction>."
    )


def jumping_by_reactions(integrators: Sequence[SubsystemIntegrator]) -> list[str]:
    """What has expressions that may jump by reactions of joints."""
    names = {
        name: None
        for one in integrators
        for switch in jumps_by_reactions(one.workspace.system.forces.signals)
        for name in names_of_users(one.model, one.workspace.system, switch)
    }
    return list(names)


def speeds_that_jump(model: Model, end: float) -> list[str]:
    """The prescribed motions whose speeds jump before ``end`` [s], with their place and when."""
    found = []
    for motion in model.motions:
        times = jumps_of_speed(motion.law, end)
        if times:
            more = f" and {len(times) - 1} times more" if len(times) > 1 else ""
            found.append(
                f"'{motion.name}'{in_deck(model, motion.name)} at t = {times[0]:g} s{more}"
            )
    return found


def parallel_capsules(model: Model, found: Mapping[str, float]) -> list[str]:
    """The contacts of capsules that were ``found`` to press while parallel, and when [s]."""
    return [f"'{name}'{in_deck(model, name)} at t = {t:.6g} s" for name, t in found.items()]


def describe_equation(integrator: SubsystemIntegrator, row: int) -> str:
    """Equation ``row`` of a subsystem in words."""
    return describe_row(integrator.model, integrator.workspace.system, row)


def start_warnings(integrators: Sequence[SubsystemIntegrator]) -> list[str]:
    """What was changed in the deck's positions and velocities at t = 0, in sentences."""
    return [
        warning
        for integrator in integrators
        for warning in (*_position_warnings(integrator), *_velocity_warnings(integrator))
    ]


def _position_warnings(integrator: SubsystemIntegrator) -> list[str]:
    moved = integrator.moved
    if moved is None or moved.violation == 0.0:
        return []
    hidden = integrator.model.hidden
    changes = [
        f"body '{body.name}' by {displacement:.3g} m and {angle:.3g} rad"
        for body, displacement, angle in zip(
            integrator.model.bodies, moved.displacements, moved.rotations, strict=True
        )
        if body.name not in hidden
    ]
    return [
        f"the joints' constraint violation of {moved.violation:.3g} m at t = 0 was removed by "
        f"moving {', '.join(changes)}"
    ]


def _velocity_warnings(integrator: SubsystemIntegrator) -> list[str]:
    change, dt = integrator.change, integrator.model.simulation.dt
    length = float(integrator.workspace.system.frames.length.max())
    if change.method == "none" or change.rate * dt <= REPORTED_CHANGE * length:
        return []
    violated = f"initial velocities violate the joints' constraints by {change.rate:.3g} m/s"
    if change.method == "asGiven":
        return [
            f"{violated} and were left as given: velocities and reactions will alternate from "
            "step to step"
        ]
    how = {"keepAngular": "angular velocities kept"}.get(
        change.method, "smallest change, weighted by mass"
    )
    hidden = integrator.model.hidden
    changes = [
        f"body '{hidden.get(body.name, body.name)}' by {np.linalg.norm(dv):.3g} m/s"
        + (f" and {np.linalg.norm(dw):.3g} rad/s" if dw.any() else "")
        for body, dv, dw in zip(integrator.model.bodies, change.dv, change.dw, strict=True)
        if dv.any() or dw.any()
    ]
    listed = ", ".join(dict.fromkeys(changes))
    return [f"{violated} and were changed ({how}): {listed}"]


def stops_at_once(condition: str) -> str:
    """Why a run whose stop ``condition`` is fulfilled at t = 0 is not begun."""
    return f"stop: '{condition}' is fulfilled at t = 0 already; give one that is fulfilled later"


def stop_not_found(condition: str, begin: float, end: float) -> str:
    """Why a run that is to end where a ``condition`` begins to hold cannot end there."""
    return (
        f"stop: '{condition}' begins to hold between t = {begin:g} s and {end:g} s, but no step of "
        "another size could be solved there. Try a smaller --dt."
    )


def angles_uncertain(rotation: float) -> str:
    """Why angles in the table of joints may be wrong by revolutions: bodies rotate by up to
    ``rotation`` [rad] relative to each other between two rows.
    """
    return (
        f"joints.csv: bodies may rotate by {rotation:.3g} rad relative to each other between two "
        "output times, so angles may be wrong by revolutions. Write rows more often (--every, "
        "outputInterval), or give the angle as a <signal>, which counts at every step"
    )
