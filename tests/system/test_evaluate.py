"""The evaluation of a system at one configuration against differences on the rotation manifold."""

import numpy as np
import pytest

from msahl.algebra.rotation import compose, from_increment, matrix
from msahl.algebra.vector import at
from msahl.system import evaluate
from msahl.system.arrays import new_system_workspace
from msahl.system.build import build_system
from msahl.system.state import build_state
from tests.support.element_samples import ELEMENTS
from tests.support.evaluation import evaluate_at
from tests.support.models import jointed

STEP = 1e-6


def moved(system, state, direction, step):
    """The state with its places changed by ``step`` times ``direction``, at the same v and W."""
    frames = system.frames
    by_node = np.zeros((evaluate.node_count(system), 3))
    by_node.reshape(-1)[: direction.size] = step * direction
    x, p, w = state.x.copy(), state.p.copy(), state.w.copy()
    for f in range(len(x) - 1):
        W = np.array(matrix(at(p, f))) @ w[f]
        x[f] += by_node[frames.displacement[f]]
        theta = by_node[frames.rotation[f]]
        # A rotation increment of the length |theta| is the angle |theta|, to its third power.
        p[f] = compose(from_increment(tuple(theta)), at(p, f))
        w[f] = np.array(matrix(at(p, f))).T @ W
    return state._replace(x=x, p=p, w=w)


def faster(system, state, direction, step):
    """The state with its velocities changed by ``step`` times ``direction``."""
    frames = system.frames
    by_node = np.zeros((evaluate.node_count(system), 3))
    by_node.reshape(-1)[: direction.size] = step * direction
    v, w = state.v.copy(), state.w.copy()
    for f in range(len(v) - 1):
        v[f] += by_node[frames.displacement[f]]
        w[f] += np.array(matrix(at(state.p, f))).T @ by_node[frames.rotation[f]]
    return state._replace(v=v, w=w)


def differences(system, state, direction, change):
    """Derivatives of force, violation and its rate along ``direction``, by central differences."""
    ahead, behind = (
        evaluate_at(system, change(system, state, direction, sign * STEP)) for sign in (1.0, -1.0)
    )
    return [
        (getattr(ahead, name) - getattr(behind, name)) / (2.0 * STEP)
        for name in ("force", "violation", "violation_rate")
    ]


def close(found, wanted, size=1.0):
    return np.abs(found - wanted).max(initial=0.0) <= 1e-6 * max(
        size, np.abs(wanted).max(initial=0.0)
    )


@pytest.mark.parametrize("name", ELEMENTS)
def test_derivatives_are_those_of_the_forces_and_constraints(name):
    rng = np.random.default_rng(7)
    model = ELEMENTS[name](rng)
    system = build_system(model)
    state = build_state(model, system)
    state.reaction[:] = rng.normal(size=state.reaction.shape)
    here = evaluate_at(system, state)
    holonomic = np.ones(here.equation.size, dtype=bool)
    if system.scalar:
        holonomic[system.coincide.a.size * 3 :] = system.scalar.equations.holonomic
    for _ in range(2):
        direction = rng.normal(size=here.coordinate.size)
        force, violation, _ = differences(system, state, direction, moved)
        size = max(1.0, np.abs(here.force_by_place).max())
        assert close(here.force_by_place @ direction, force, size)
        G = here.constraint_jacobian @ direction
        assert close(G[holonomic], violation[holonomic])
        force, _, rate = differences(system, state, direction, faster)
        assert close(here.force_by_rate @ direction, force, size)
        assert close(G, rate)


def test_forces_are_those_of_the_solvers_in_plain_units():
    rng = np.random.default_rng(3)
    model = jointed(rng, 4)
    system = build_system(model)
    state = build_state(model, system)
    here = evaluate_at(system, state)
    start = new_system_workspace(system, state)
    evaluate.prepare(system, state, start)
    rows = np.zeros((evaluate.node_count(system), 3))
    evaluate.free_acceleration(system, state, start, np.zeros_like(rows), rows)
    frames, force = system.frames, here.force.reshape(-1, 3)
    for f in range(len(state.x) - 1):
        u, theta, mass = frames.displacement[f], frames.rotation[f], 1.0 / frames.inverse_mass[f]
        assert force[u] == pytest.approx(mass * rows[u])
        assert force[theta] == pytest.approx(mass * frames.length[f] * rows[theta])
    assert np.linalg.eigvalsh(here.mass).min() > 0.0
