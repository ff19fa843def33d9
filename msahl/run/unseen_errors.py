"""Errors that a companion run does not show, because both runs make them.

prescribed motion   oscillates between the times at which both runs evaluate it: its deviation
                    from the parabola through these times is the error [m]
friction            a joint's rate passes the regularisation width w [m/s] within one step of
                    order 2: it may be wrong by w/2 until the end of the run, a displacement of
                    w t/2 [m]
impact              an output time that both runs reach before it, or after it, may be on its
                    other side: the velocity there is wrong by the jump
"""

from typing import TYPE_CHECKING

import numpy as np

from msahl.algebra.functions import build_laws, evaluate
from msahl.contact.events import IMPACT
from msahl.events.margins import ENDS_AT_KINKS
from msahl.expressions.pulses import BETWEEN, MET, PARABOLA
from msahl.model import Model
from msahl.model.motions import JointMotion
from msahl.ports import forces
from msahl.run.subsystem import SubsystemIntegrator

if TYPE_CHECKING:
    from msahl.contact.events import ContactEvent
    from msahl.contact.modes import ContactModes

MOTION_SAMPLES = 64
"""Number of steps at which prescribed motions are examined, from the first to the last."""
CONSTANT = 1e-9
"""Change within a step, relative to the change over the run, below which a motion is at rest."""
UNRESOLVED, OFTEN = 0.3, 0.25
"""A step does not resolve a motion that deviates from the parabola by this fraction of its change
within the step. This must be so in this fraction of all steps: one step alone may hold a jump of
the velocity."""


def unseen_motion(model: Model, length: float) -> float:
    """Largest deviation [m] of prescribed motions between the times at which run and companion
    evaluate them; 0 where these times resolve them. Angles count with ``length`` [m].
    """
    simulation, motions = model.simulation, model.motions
    laws = build_laws([motion.law for motion in motions])
    steps = np.linspace(0.0, simulation.t_final - simulation.dt, MOTION_SAMPLES)
    worst = 0.0
    for k, motion in enumerate(motions):
        met, between = (
            np.array(
                [[evaluate(laws, k, t + tau * simulation.dt)[0] for tau in places] for t in steps]
            )
            for places in (MET, BETWEEN)
        )
        deviation = np.abs(between - met @ PARABOLA).max(axis=1)
        change = np.ptp(np.hstack([met, between]), axis=1)
        missed = deviation > np.maximum(UNRESOLVED * change, CONSTANT * np.ptp(met))
        if np.count_nonzero(missed) > OFTEN * MOTION_SAMPLES:
            angle = isinstance(motion, JointMotion) and motion.coordinate == "angle"
            worst = max(worst, float(deviation[missed].max()) * (length if angle else 1.0))
    return worst


def unresolved_friction(
    integrator: SubsystemIntegrator, order: int, h: float, t_final: float
) -> float:
    """Position error [m] where friction can change a rate by more than its regularisation width in
    one step ``h`` [s] of a scheme of this ``order``, in a run until ``t_final`` [s].

    While a rate passes through the width, friction is below its limit. If that happens within one
    step, both runs miss it. Steps of higher order end at the width, and resolve the rest beyond it.
    """
    if order >= ENDS_AT_KINKS:
        return 0.0
    system, reaction = integrator.workspace.system, integrator.workspace.state.reaction
    passed = forces.unresolved_speed(system.forces, system.scalar, system.frames, reaction, h)
    return passed * t_final


def unseen_jump(
    integrator: SubsystemIntegrator,
    companion: SubsystemIntegrator,
    share: float,
    times: np.ndarray,
    error: float,
    length: float,
) -> float:
    """Largest jump [m/s] of the rate of a gap in an impact that was, in the run and in its
    companion, on the other side of one of the output ``times`` (m,) than in the exact motion. That
    has it at the time of the run, and ``share`` times the difference of both. In this time the gap
    changes by no more than twice the estimated ``error`` of positions [m], or the companion's
    impact is another one. Angles count with ``length`` [m].
    """
    if integrator.modes is None or companion.modes is None:
        return 0.0
    impacts = _impacts(integrator.modes)
    if not impacts:
        return 0.0
    angles = {side.name for side in integrator.model.contact_sides if side.is_angle}
    largest = 0.0
    for event in impacts:
        scale = length if event.element in angles else 1.0
        alike = [e.time for e in _impacts(companion.modes) if e.element == event.element]
        other = min(alike, key=lambda t: abs(t - event.time), default=event.time)
        exact = event.time + share * (other - event.time)
        change = scale * abs(event.speed_before * (exact - event.time))
        if change <= 2.0 * error and ((times - event.time) * (times - exact) < 0.0).any():
            largest = max(largest, scale * abs(event.speed_after - event.speed_before))
    return largest


def _impacts(modes: "ContactModes") -> "list[ContactEvent]":
    """Return the impacts that are not yet published."""
    return [event for event in modes.events if event.kind == IMPACT]
