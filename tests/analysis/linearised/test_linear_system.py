"""The linearised equations against differences of the nonlinear ones, on the rotation manifold."""

import numpy as np
import pytest

from msahl.algebra.rotation import compose, matrix, to_axis_angle
from msahl.algebra.rotation import inverse as opposite
from msahl.algebra.vector import at
from msahl.analysis.linearised.coefficients import coefficients
from msahl.analysis.linearised.projection import close, move
from msahl.analysis.linearised.rate_gradients import rates_by_place
from msahl.analysis.linearised.reduced import linear_system
from msahl.ports import forces
from msahl.start.positions import assemble
from msahl.start.velocities import make_consistent, solve_accelerations
from msahl.system import evaluate
from msahl.system.build import build_system
from msahl.system.reductions import all_unknowns
from msahl.system.state import build_state
from msahl.system.unknowns import choose
from tests.support.element_samples import ELEMENTS
from tests.support.models import deck

SIXTH = ((1, 3 / 4), (2, -3 / 20), (3, 1 / 60))
"""Weights of central differences of the order 6."""
STEP = 1e-3
"""With lengths and rates of 1 the error of the differences is of 1e-13 / STEP."""
CLOSED_LOOPS = ("bricard", "four_bar_sketched", "andrews_squeezer", "spatial_slider_crank")
DECKS = (
    *CLOSED_LOOPS,
    *("bicycle", "suspension", "flyball_governor", "gyroscope", "robot", "cart_pole"),
    *("quarter_car", "knife_edge", "top_1", "triple_pendulum_45", "engine"),
    *("actuator_pid", "actuator_motor", "joint_motion_sine", "point_motion", "cranks", "toggle"),
)
PIECEWISE = ("camFollower", "jointMotion, table", "springDamper, table")
"""Laws with jumps in a derivative, within the reach of the differences."""


def prepared(model):
    """System, consistent state and unknowns."""
    system = build_system(model)
    state = build_state(model, system)
    if model.position == "project":
        assemble(system, state)
    state.reaction[:] = np.random.default_rng(1).normal(size=state.reaction.shape)
    unknowns = choose(system, all_unknowns(system))
    make_consistent(system, state, unknowns.free)
    return system, state, unknowns


def displaced(system, state, dq, dv, ds):
    """The state changed by ``dq`` and ``dv`` (n,), and then made to satisfy all constraints."""
    unknowns = choose(system, all_unknowns(system))
    numbers = coefficients(system, state).coordinate
    place, rate = np.zeros((2, evaluate.node_count(system), 3))
    place.reshape(-1)[numbers], rate.reshape(-1)[numbers] = dq, dv
    own = {name: getattr(state, name).copy() for name in ("force", "a", "alpha", "reaction")}
    moved = move(system, state._replace(**own), place)
    moved = close(system, moved, unknowns)
    frames, v, w = system.frames, state.v.copy(), moved.w.copy()
    for f in range(len(v) - 1):
        v[f] += rate[frames.displacement[f]]
        w[f] += np.array(matrix(at(moved.p, f))).T @ rate[frames.rotation[f]]
    moved = moved._replace(v=v, w=w, auxiliary=state.auxiliary + ds)
    make_consistent(system, moved, unknowns.free, "massWeighted")
    return moved


def difference(system, state, other):
    """(2 n + s,) places, rates and states of ``other`` less those of ``state``, and (2 n + s,) the
    rates of these.
    """
    frames, nodes = system.frames, evaluate.node_count(system)
    out = np.zeros((4, nodes, 3))
    for f in range(len(state.x) - 1):
        axis, angle = to_axis_angle(compose(at(other.p, f), opposite(at(state.p, f))))
        W0 = np.array(matrix(at(state.p, f))) @ state.w[f]
        W1 = np.array(matrix(at(other.p, f))) @ other.w[f]
        u, theta = frames.displacement[f], frames.rotation[f]
        rotation = angle * np.array(axis)
        out[0, u], out[0, theta] = other.x[f] - state.x[f], rotation
        out[1, u], out[1, theta] = other.v[f] - state.v[f], W1 - W0
        # To first order; the second order is even in the step of the differences.
        out[2, u], out[2, theta] = out[1, u], W1 - W0 + np.cross(W0, rotation)
        out[3, u] = other.a[f] - state.a[f]
        out[3, theta] = other.alpha[f] - state.alpha[f]
    numbers = coefficients(system, state).coordinate
    flat = out.reshape(4, -1)[:, numbers]
    value = np.concatenate([flat[0], flat[1], other.auxiliary - state.auxiliary])
    rate = np.concatenate([flat[2], flat[3], auxiliary_rates(system, other)])
    return value, rate


def auxiliary_rates(system, state):
    """(s,) the rates of the auxiliary states."""
    rate = np.zeros(state.auxiliary.size)
    if rate.size:
        rate[:] = coefficients(system, state).state_rate
    return rate


def check(model, tolerance, step=STEP):
    """Compare A y with differences along a random direction."""
    rng = np.random.default_rng(4)
    system, state, unknowns = prepared(model)
    if not forces.depend_on_reactions(system.forces):
        solve_accelerations(system, state, unknowns)
    else:
        pytest.skip("friction: the normal force changes")
    linear = linear_system(coefficients(system, state), rates_by_place(system, state))
    if not linear.A.size:
        return
    size = np.abs(linear.A).max()
    y = rng.normal(size=len(linear.A))
    # Directions of a unit length in coordinates that are lengths, or rates.
    scale = max(np.abs(linear.places @ y).max(), np.abs(linear.rates @ y).max())
    y /= max(scale, np.abs(y).max() / size, 1e-3)
    moved = rate = 0.0
    for k, weight in SIXTH:
        for sign in (1.0, -1.0):
            z = sign * k * step * y
            other = displaced(system, state, linear.places @ z, linear.rates @ z, linear.states @ z)
            solve_accelerations(system, other, unknowns)
            dy, dy_dot = difference(system, state, other)
            moved = moved + sign * weight / step * (linear.into @ dy)
            rate = rate + sign * weight / step * (linear.into @ dy_dot)
    expected = linear.A @ moved
    assert np.abs(rate - expected).max() <= tolerance * max(np.abs(expected).max(), 1.0)


@pytest.mark.sampled
@pytest.mark.parametrize("name", [name for name in ELEMENTS if "friction" not in name])
def test_linear_system_of_every_element(name):
    piecewise = name in PIECEWISE
    check(ELEMENTS[name](np.random.default_rng(7)), 1e-4 if piecewise else 1e-8)


@pytest.mark.sampled
@pytest.mark.parametrize("name", DECKS)
def test_linear_system_of_decks(name):
    # Differences of stiff forces have their round-off: largest force times 1e-13 over the step.
    check(deck(name), 1e-7)
