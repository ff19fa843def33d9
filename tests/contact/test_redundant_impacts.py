"""Impacts of stacks of boxes, whose contacts are redundant: solutions, groups, laws without one."""

import numpy as np
import pytest

from msahl.contact import friction
from msahl.contact.gradient import project
from msahl.contact.impact import Contradictory, SeveralAtOnce, impulses
from msahl.contact.independent import groups
from msahl.contact.response import stopping
from tests.contact.test_friction_law import cones

EXACT = 4e-12
"""As in ``test_friction_law``: Newton's method leaves 1e-12 of the largest term."""
HARD = (156, 187, 237, 319, 368)
"""Seeds of stacks that had no solution, as one contact after the other led nowhere near enough."""


def stack(seed):
    """Matrix, rates and cones of the corners of up to four boxes on each other, each with one more
    contact at times, and the number of boxes.
    """
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 5))
    inverse, lines, middles, top = [], [], [], 0.0
    for b in range(count):
        half, m = rng.uniform(0.05, 0.2, 3), float(rng.choice([0.5, 1.0, 2.0, 20.0]))
        squares = (2.0 * half) ** 2
        inverse += [1.0 / m] * 3 + (12.0 / m / (squares.sum() - squares)).tolist()
        middles.append(np.array([*rng.uniform(-0.03, 0.03, 2), top + half[2]]))
        below = middles[b][2] - half[2]
        signs = [(x, y) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
        normal = np.array([0.0, 0.0, 1.0])
        for x, y in signs[: rng.choice([1, 2, 4, 4])]:
            place = middles[b][:2] + np.array([x, y]) * half[:2]
            lines.append((b - 1, b, np.array([*place, below]), normal))
        if rng.random() < 0.4:
            n = rng.normal(size=3)
            place = middles[b] + half * rng.uniform(-1.0, 1.0, 3)
            lines.append((b - 1, b, place, n / np.sqrt(n @ n)))
        top += 2.0 * half[2]
    axes = [_axes(normal) for *_, normal in lines]
    rows = [_row(middles, line, axis[0]) for line, axis in zip(lines, axes, strict=True)]
    for line, axis in zip(lines, axes, strict=True):
        rows += [_row(middles, line, t) for t in axis[1:]]
    G, u = np.array(rows), 0.3 * rng.normal(size=6 * count)
    u[2::6] -= np.abs(rng.normal(size=count))
    mu = float(rng.choice([0.1, 0.3, 0.5, 0.8]))
    W = G @ (np.array(inverse)[:, None] * G.T)
    return 0.5 * (W + W.T), G @ u, cones(len(lines), mu)


def _axes(normal):
    t = np.cross(normal, (1.0, 0.3, 0.2))
    t /= np.sqrt(t @ t)
    return normal, t, np.cross(normal, t)


def _row(middles, line, axis):
    row = np.zeros(6 * len(middles))
    for b, sign in zip(line[:2], (-1.0, 1.0), strict=True):
        if b >= 0:
            row[6 * b : 6 * b + 6] = sign * np.array([*axis, *np.cross(line[2] - middles[b], axis)])
    return row


def violation(W, v, given, z):
    """What is left of the conditions of the problem, over its terms."""
    w, n, size = W @ z + v, given.normal, np.abs(v).max() + np.abs(W * z).max()
    force, slip = z[given.tangent], w[given.tangent]
    radius = given.friction * z[n]
    beyond = np.hypot(*force.T) - radius
    aligned = force * np.hypot(*slip.T)[:, None] + radius[:, None] * slip
    found = [-z[n], -w[n] / size, np.minimum(z[n], w[n]), beyond, *(np.abs(aligned.T) / size)]
    return max(float(part.max()) for part in found) / (1.0 + np.abs(z).max())


@pytest.mark.parametrize("seed", HARD)
def test_stacks_of_boxes_have_a_solution(seed):
    W, v, given = stack(seed)
    z = friction.solve(W, v, given)
    assert violation(W, v, given, z) <= EXACT
    e = np.full(given.normal.size, 0.5)
    L = impulses("poisson", W, v, e, given)
    assert L @ (v + 0.5 * W @ L) <= EXACT * np.abs(L * v).sum()
    assert (v + W @ L)[given.normal].min() >= -EXACT * np.abs(v).max()


def test_projection_is_onto_the_cone_and_least_normal_parts():
    """Against the nearest of many points of the set: none of them is nearer."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        mu, least, z = rng.random(), 0.5 * rng.random() * rng.integers(0, 2), rng.normal(size=3)
        given = cones(1, mu)._replace(least=np.array([least]))
        found = project(z, given)
        n = least + 3.0 * rng.random(2000)
        radius, angle = mu * n * np.sqrt(rng.random(2000)), 2.0 * np.pi * rng.random(2000)
        others = np.stack([n, radius * np.cos(angle), radius * np.sin(angle)], axis=1)
        assert found[0] >= least
        assert np.hypot(*found[1:]) <= mu * found[0] + 1e-15  # one rounding error of the radius
        # A vector from the projection into a convex set is at no acute angle with that from it to
        # z; 1e-14 is the round-off of products of numbers up to ten.
        assert ((others - found) @ (z - found)).max() <= 1e-14


def test_groups_are_contacts_that_act_on_each_other():
    W = np.zeros((9, 9))
    W[np.ix_([0, 3, 4, 2, 7, 8], [0, 3, 4, 2, 7, 8])] = 0.1
    W += np.eye(9)
    given = cones(3, 0.5)
    assert [k.tolist() for k in groups(W, given.normal, given.tangent)] == [[0, 2], [1]]


def apart(*matrices):
    """The matrix and cones of contacts of bodies that do not touch each other."""
    count = len(matrices)
    W, given = np.zeros((3 * count, 3 * count)), cones(count, 0.3)
    for k, own in enumerate(matrices):
        W[np.ix_([k, *given.tangent[k]], [k, *given.tangent[k]])] = own
    return W, given


@pytest.mark.parametrize("law", ["poisson", "newton", "stronge"])
def test_impacts_of_bodies_that_do_not_touch_are_their_own(law):
    rng = np.random.default_rng(8)
    A, B = (a @ a.T for a in rng.normal(size=(2, 3, 6)))
    W, given = apart(A, B)
    v, e = np.array([-1.0, -2.0, 0.1, 0.2, -0.4, 0.3]), np.array([0.5, 0.8])
    L = impulses(law, W, v, e, given)
    for k, own in enumerate((A, B)):
        used = [k, *given.tangent[k]]
        alone = impulses(law, own, v[used], e[k : k + 1], cones(1, 0.3))
        # The same operations on the same numbers, but for the scale of residuals: 4e-12.
        assert L[used] == pytest.approx(alone, abs=EXACT * np.abs(alone).max())


def test_by_stronge_contacts_that_open_take_no_part():
    """One contact is hit; what it does opens the other one, which takes no part."""
    W, v, e = np.array([[1.0, 0.4], [0.4, 1.0]]), np.array([-1.0, 0.0]), np.array([0.5, 0.5])
    # One product and one quotient.
    assert impulses("stronge", W, v, e) == pytest.approx([1.5, 0.0], abs=1e-15)
    with pytest.raises(SeveralAtOnce):
        impulses("stronge", W * np.array([[1.0, -1.0], [-1.0, 1.0]]), v, e)


def test_newton_may_contradict_itself_and_poisson_not():
    """A body touches the walls on both sides of it: it cannot bounce off one of them."""
    G = np.array([[1.0], [-1.0]])
    W, v, e = G @ G.T, G @ np.array([-1.0]), np.array([0.5, 0.5])
    with pytest.raises(Contradictory):
        impulses("newton", W, v, e)
    L = impulses("poisson", W, v, e)
    assert v + W @ L == pytest.approx([0.0, 0.0], abs=1e-15)  # exact numbers


def test_rates_that_contradict_each_other_take_no_huge_impulse():
    """Two contacts at one place whose rates differ by 1e-7, and a matrix with round-off."""
    W = np.ones((2, 2)) + np.diag([1e-14, 0.0])
    L = stopping(W, np.array([1.0, 1.0 + 1e-7]))
    # The least impulse that leaves the least rates is half of the mean rate each, to that 1e-7.
    assert pytest.approx([-0.5, -0.5], abs=1e-7) == L
