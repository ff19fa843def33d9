"""Build the state at t = 0 as the model gives it, and copy states."""

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.rotation_arrays import rotations
from msahl.algebra.vector import add, copy, cross, times
from msahl.elements.beams import instant
from msahl.elements.beams.group import new_workspace
from msahl.elements.constraints import coordinates
from msahl.formulations.absolute.frames import moving_count
from msahl.jit.by_size import by_size
from msahl.jit.kernel import kernel
from msahl.model import Model, resolve
from msahl.model.beams import is_damped
from msahl.ports import compliance, forces, sliding
from msahl.system.arrays import State, System, coordinate_count, new_coordinates_workspace
from msahl.system.build import initial_places


def build_state(model: Model, system: System) -> State:
    """The state at t = 0 as the deck gives it, accelerations and forces still zero."""
    x, p = initial_places(model)
    v, w = np.zeros_like(x), np.zeros_like(x)
    for i, body in enumerate(model.bodies):
        R = matrix(body.orientation)
        v[i] = times(R, add(body.velocity, cross(body.angular_velocity, body.r_BG)))
        w[i] = body.angular_velocity
    multipliers = (system.multipliers.node.size, 3)
    joints = (sliding.reaction_count(system.forces.sliding, system.reactions.child.size), 6)
    strain = np.zeros((system.beams.element.size if system.beams else 0, 6))
    state = State(
        time=np.zeros(1),
        x=x,
        x_low=np.zeros_like(x),
        p=p,
        v=v,
        w=w,
        a=np.zeros_like(x),
        alpha=np.zeros_like(x),
        force=np.zeros(multipliers),
        a_trend=np.zeros((3, *x.shape)),
        alpha_trend=np.zeros((3, *x.shape)),
        force_trend=np.zeros((3, *multipliers)),
        mean_v=np.zeros_like(x),
        mean_w=np.zeros_like(x),
        prediction=np.ones(1),
        violation=np.zeros(multipliers),
        angle=np.zeros(coordinate_count(system)),
        reaction=np.zeros(joints),
        reaction_trend=np.zeros(joints),
        work=np.zeros(work_count(model)),
        v_rise=np.zeros_like(x),
        w_rise=np.zeros_like(x),
        stretch=forces.new_stretch(system.forces),
        auxiliary=np.array([s.initial for s in model.states], float),
        strain=strain,
        strain_rise=np.zeros_like(strain),
        elongation=forces.new_elongation(system.forces),
        held=forces.held_switches(system.forces),
    )
    set_strains(system, state)
    return state


def set_strains(system: System, state: State) -> None:
    """Set the strains of beams, and the elongations of springs in the compliance form, to those of
    the positions and orientations of ``state``.
    """
    if system.scalar is not None and system.forces.compliance is not None:
        group = system.scalar.coordinates
        at = new_coordinates_workspace(group)
        coordinates.prepare(group, state.x, rotations(state.p), state.angle, at)
        springs = system.forces.along
        compliance.correct_elongations(system.forces.compliance, springs, at, 1.0, state.elongation)
    if system.beams is not None:
        start = new_workspace(system.beams, state.strain, state.strain_rise)
        R, size = rotations(state.p), moving_count(system.frames)
        by_size(instant.prepare, size)(system.beams, state.x, R, start)
        by_size(instant.set_strains, size)(system.beams, start)


def work_count(model: Model) -> int:
    """Columns of work: one a load, a motion, a side of a rigid contact, an event, a compliant
    contact and a damped beam, and a decaying scheme's own.
    """
    own = len(model.events) + len(model.compliant_contacts) + sum(map(is_damped, model.beams))
    own += len(model.elastic_bodies)
    return work_of_events(model) + own + resolve(model.simulation).dissipative


def work_of_contacts(model: Model) -> int:
    """Return the first column of the works of rigid contacts."""
    return len(model.loads) + len(model.motions)


def work_of_events(model: Model) -> int:
    """Return the first column of the works of events."""
    return work_of_contacts(model) + len(model.contact_sides)


@kernel
def copy_state(state: State, other: State) -> None:
    """Copy all of ``state`` to ``other``."""
    for source, target in (
        (state.time, other.time),
        (state.prediction, other.prediction),
        (state.angle, other.angle),
        (state.work, other.work),
        (state.stretch, other.stretch),
        (state.auxiliary, other.auxiliary),
        (state.elongation, other.elongation),
        (state.held, other.held),
    ):
        for i in range(source.size):
            target[i] = source[i]
    for table, other_table in (
        (state.x, other.x),
        (state.x_low, other.x_low),
        (state.p, other.p),
        (state.v, other.v),
        (state.w, other.w),
        (state.a, other.a),
        (state.alpha, other.alpha),
        (state.force, other.force),
        (state.mean_v, other.mean_v),
        (state.mean_w, other.mean_w),
        (state.violation, other.violation),
        (state.reaction, other.reaction),
        (state.reaction_trend, other.reaction_trend),
        (state.v_rise, other.v_rise),
        (state.w_rise, other.w_rise),
        (state.strain, other.strain),
        (state.strain_rise, other.strain_rise),
    ):
        copy(table, other_table)
    for trend, other_trend in (
        (state.a_trend, other.a_trend),
        (state.alpha_trend, other.alpha_trend),
        (state.force_trend, other.force_trend),
    ):
        for k in range(trend.shape[0]):
            copy(trend[k], other_trend[k])
