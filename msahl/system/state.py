"""The state at t = 0, and the constants that are what the scene is there."""

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import add, at, cross, times
from msahl.elements import forces
from msahl.elements.constraints.coordinates import prepare
from msahl.elements.constraints.equations import left_side
from msahl.model import Model, decays
from msahl.system.arrays import State, System, coordinate_count, new_coordinates_workspace


def build_state(model: Model, system: System) -> State:
    """The state at t = 0 as the deck gives it, accelerations and forces still zero."""
    n = len(model.bodies)
    x, p, v, w = (np.zeros((n + 1, 3)) for _ in range(4))
    for i, body in enumerate(model.bodies):
        R = matrix(body.orientation)
        x[i] = add(body.position, times(R, body.r_BG))
        p[i] = body.orientation
        v[i] = times(R, add(body.velocity, cross(body.angular_velocity, body.r_BG)))
        w[i] = body.angular_velocity
    multipliers = (system.multipliers.node.size, 3)
    joints = (system.reactions.child.size, 6)
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
        foresight=np.ones(1),
        violation=np.zeros(multipliers),
        angle=np.zeros(coordinate_count(system)),
        reaction=np.zeros(joints),
        reaction_trend=np.zeros(joints),
        work=np.zeros(work_count(model)),
        v_rise=np.zeros_like(x),
        w_rise=np.zeros_like(x),
        stretch=forces.new_stretch(system.forces),
    )
    settle(system, state)
    return state


def settle(system: System, state: State) -> None:
    """Fill in constants of rows and springs that are what their quantities are at t = 0."""
    x, p = state.x, state.p
    if system.scalar is None:
        return
    coords, rows = system.scalar.coordinates, system.scalar.equations
    R = np.array([matrix(at(p, b)) for b in range(len(p))])
    start = new_coordinates_workspace(coords)
    prepare(coords, x, R, np.zeros(coords.kind.size), start)
    for r in np.flatnonzero(np.isnan(rows.offset)):
        rows.offset[r] = left_side(rows, system.laws, start, int(r))
    forces.set_origins(system.forces, start.value)


def work_count(model: Model) -> int:
    """Columns of work: one a load, one a motion, and a decaying scheme's own."""
    return len(model.loads) + len(model.motions) + decays(model)
