"""Errors that a companion run does not show, because both runs make them.

prescribed motion   oscillates between the times at which both runs evaluate it: its deviation
                    from the parabola through these times is the error [m]
friction            a rate passes the regularisation width w [m/s] within one step: it may be
                    wrong by w/2 until the end of the run, a displacement of w t/2 [m]
"""

import numpy as np

from msahl.algebra.functions import build_laws, evaluate
from msahl.events.expressions import BETWEEN, MET, PARABOLA
from msahl.model import Model
from msahl.model.motions import JointMotion
from msahl.ports import forces
from msahl.run.subsystem import SubsystemIntegrator

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


def unresolved_friction(integrator: SubsystemIntegrator, h: float, t_final: float) -> float:
    """Position error [m] where friction can change a rate by more than its regularisation width in
    one step ``h`` [s], in a run until ``t_final`` [s].

    While a rate passes through the width, friction is below its limit. If that happens within one
    step, both runs miss it.
    """
    system, reaction = integrator.workspace.system, integrator.workspace.state.reaction
    passed = forces.unresolved_speed(system.forces, system.scalar, system.frames, reaction, h)
    return passed * t_final
