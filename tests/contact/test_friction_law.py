"""Impacts and forces with friction: complementarity, the circular cone, and energy."""

import numpy as np
import pytest

from msahl.contact.cones import Cones
from msahl.contact.friction import Jammed, solve
from msahl.contact.impact import SeveralAtOnce, impulses

EXACT = 4e-12
"""Violation of a condition, over the terms: units of contacts differ from those of the solution."""


def cones(count, mu):
    """Cones of contacts whose normals come first."""
    tangent = count + np.arange(2 * count).reshape(-1, 2)
    free = np.full((count, 2), np.nan)
    return Cones(np.arange(count), tangent, np.full(count, mu), np.zeros(count), free)


def mechanism(rng):
    """Matrix and rates of one to four contacts of one to three bodies with up to two joints."""
    count, bodies, joints = rng.integers(1, 5), rng.integers(1, 4), rng.integers(0, 3)
    G = np.zeros((3 * count, 6 * bodies))
    for c in range(count):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        pair = rng.permutation(bodies)[: rng.integers(1, 3)]
        for b, sign in zip(pair, (1.0, -1.0), strict=False):
            x, y, z = rng.normal(size=3)
            arm = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
            rows = sign * axes @ np.hstack([np.eye(3), arm])
            G[[c, count + 2 * c, count + 2 * c + 1], 6 * b : 6 * b + 6] += rows
    inverse, u = np.diag(np.exp(rng.normal(size=6 * bodies))), rng.normal(size=6 * bodies)
    if joints:
        J = rng.normal(size=(joints, 6 * bodies))
        held = inverse @ J.T @ np.linalg.inv(J @ inverse @ J.T)
        inverse, u = inverse - held @ J @ inverse, u - held @ (J @ u)
    W = G @ inverse @ G.T
    return count, 0.5 * (W + W.T), G @ u


@pytest.mark.slow
@pytest.mark.parametrize("mechanisms", [300, pytest.param(10_000, marks=pytest.mark.slow)])
def test_random_mechanisms(mechanisms):
    """The conditions of the problem itself, which no method solves here; poisson gains no energy.

    Newton's method leaves 1e-12 of the largest term (``friction.EXACT``).
    """
    rng, tried = np.random.default_rng(36), 0
    for _ in range(mechanisms):
        (count, W, v), mu, e = mechanism(rng), 1.5 * rng.random(), rng.random()
        if not (v[:count] < 0.0).any():
            continue
        tried += 1
        given = cones(count, mu)
        z = solve(W, v, given)
        w, n, size = W @ z + v, given.normal, 1.0 + np.abs(z).max()
        near = EXACT * (1.0 + np.abs(v).max() + np.abs(W * z).max())
        assert z[n].min() >= -near
        assert w[n].min() >= -near
        assert np.abs(np.minimum(z[n], w[n])).max() <= near
        for k, t in enumerate(given.tangent):
            force, slip = z[t], w[t]
            assert np.hypot(*force) <= mu * z[k] + near
            aligned = force * np.hypot(*slip) + mu * z[k] * slip
            assert np.abs(aligned).max() <= near * size
        L = impulses("poisson", W, v, np.full(count, e), given)
        assert L @ (v + 0.5 * W @ L) <= near * size
    assert tried > 0.6 * mechanisms


def stepped(W, v, L_n, mu, steps=4000):
    """Impulse of one contact by small steps of its normal impulse up to ``L_n``."""
    u, total, dL = v.copy(), np.zeros(3), L_n / steps
    stuck = np.linalg.solve(W[1:, 1:], W[1:, 0])
    for _ in range(steps):
        slip = np.hypot(*u[1:])
        push = np.array([1.0, *(-mu * u[1:] / slip)])
        if slip < 2.0 * dL * np.abs(W).max() and np.hypot(*stuck) <= mu:
            push = np.array([1.0, *-stuck])
        u, total = u + dL * (W @ push), total + dL * push
    return total


@pytest.mark.slow
def test_stronge_is_the_limit_of_small_steps():
    rng = np.random.default_rng(5)
    for _ in range(8):
        A = rng.normal(size=(3, 6))
        W, v, e, mu = A @ A.T, rng.normal(size=3), rng.random(), rng.random()
        v[0] = -abs(v[0])
        L = impulses("stronge", W, v, np.array([e]), cones(1, mu))
        assert L @ (v + 0.5 * W @ L) < 0.0
        assert (v + W @ L)[0] >= 0.0
        assert np.hypot(*L[1:]) <= mu * L[0] * (1.0 + 1e-12)
        # Steps are of first order: 4000 of them.
        assert pytest.approx(stepped(W, v, L[0], mu), abs=5e-3 * L[0]) == L


def test_stronge_refuses_several_at_once():
    W, v = np.eye(6), np.array([-1.0, -1.0, 0.1, 0.0, 0.1, 0.0])
    W[0, 1] = W[1, 0] = 0.1
    with pytest.raises(SeveralAtOnce):
        impulses("stronge", W, v, np.full(2, 0.5), cones(2, 0.3))


def test_jammed_contact_is_refused_with_its_coefficient():
    W, toward = np.array([[1.0, 1.2, 0.0], [1.2, 2.0, 0.0], [0.0, 0.0, 1.0]]), [[1.0, 0.0]]
    given = cones(1, 1.0)._replace(toward=np.array(toward))
    with pytest.raises(Jammed) as error:
        solve(W, np.array([-1.0, 0.0, 0.0]), given)
    assert error.value.coefficient == pytest.approx(-0.2, abs=1e-15)
