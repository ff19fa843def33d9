"""Craig-Bampton bases: statics, frequencies of chains, beams and random bodies, error estimates."""

import numpy as np
import pytest
from scipy import linalg, sparse

from msahl.reduction import Wishes, reduce_model
from msahl.reduction.craig_bampton import craig_bampton
from msahl.reduction.elastic_model import Matrices, Nodes, build_model
from msahl.reduction.interfaces import interface_of
from msahl.reduction.normal_modes import DENSE, Wanted, count_below, factorised, normal_modes
from tests.reduction.bodies import RHO, E, beam, box, chain, ends

EI, RHO_A = E * 0.02 * 0.01**3 / 12, RHO * 0.02 * 0.01
"""Of the beam's weak bending."""
FREE = (4.730040744862704, 7.853204624095838)
CLAMPED = (1.8751040687119611, 4.694091132974175)
"""Roots of cosh x cos x = 1 and = -1: modes of an Euler beam, free and clamped at one end."""


def reduced(model, interfaces, number=None, frame="mean", frequency=None):
    wishes = Wishes(tuple(map(interface_of, interfaces)), Wanted(number, frequency), frame)
    return reduce_model(model, wishes).body


def full_frequencies(model, held=()):
    free = np.setdiff1d(np.arange(model.size), held)
    K, M = model.stiffness.toarray(), model.mass.toarray()
    values = linalg.eigh(K[np.ix_(free, free)], M[np.ix_(free, free)], eigvals_only=True)
    return np.sqrt(np.abs(values)) / (2 * np.pi)


def bending(roots):
    return np.array(roots) ** 2 * np.sqrt(EI / RHO_A) / (2 * np.pi)


def test_a_chain_of_masses_has_its_modes_and_statics():
    model = chain(count=12, mass=2.0, stiffness=300.0)
    basis, interior = craig_bampton(model, np.array([0, 11]), Wanted(4))
    j = np.arange(1, 6)
    exact = 4 * 300.0 / 2.0 * np.sin(j * np.pi / 22) ** 2  # ten masses between walls
    found = [*interior.modes.eigenvalues, interior.modes.following]
    assert found == pytest.approx(exact, rel=1e-12)  # a few machine epsilons by LAPACK
    # Eleven springs in series, and a linear displacement between them.
    assert basis.stiffness[:2, :2] == pytest.approx(300.0 / 11 * np.array([[1, -1], [-1, 1]]))
    assert basis.shapes[:, 1] == pytest.approx(np.arange(12) / 11, abs=1e-14)
    assert basis.mass[2:, 2:] == pytest.approx(np.eye(4))


def test_modes_below_a_frequency_are_all_kept():
    model = chain(count=12)
    values = np.sqrt(4 * 300.0 / 2.0) * np.sin(np.arange(1, 11) * np.pi / 22) / (2 * np.pi)
    for limit, count in ((0.5 * values[0], 0), (0.5 * (values[3] + values[4]), 4), (1e3, 10)):
        _, interior = craig_bampton(model, np.array([0, 11]), Wanted(frequency=limit))
        assert len(interior.modes.eigenvalues) == count
        following = np.append(values, np.inf)[count]
        assert np.sqrt(interior.modes.following) / (2 * np.pi) == pytest.approx(following)


@pytest.mark.parametrize("number", [0, 1, 8])
def test_loads_at_the_interface_give_the_displacements_of_beam_theory(number):
    body = reduced(beam(), ["Root=1", "Tip=21"], number, "Root")
    tip = body.interface_shapes[1]
    flexibility = tip @ np.diag(1.0 / body.eigenvalues) @ tip.T
    L = 1.0
    # Nodes of Hermite's element are exact; 1e-9 is the round-off of its matrices, whose entries
    # 12 E I / h^3 are 3e4 times the stiffness of the beam.
    assert flexibility[2, 2] == pytest.approx(L**3 / (3 * EI), rel=1e-9)
    assert flexibility[4, 4] == pytest.approx(L / EI, rel=1e-9)
    assert flexibility[2, 4] == pytest.approx(-(L**2) / (2 * EI), rel=1e-9)
    assert flexibility[0, 0] == pytest.approx(L / (E * 2e-4), rel=1e-9)
    assert body.static_residual < 1e-14


def test_a_free_beam_has_the_frequencies_of_theory_within_the_error_that_is_stated():
    model = beam()
    body = reduced(model, ["A=1", "B=21"], 24)
    true = full_frequencies(model)[6:]
    # Nearer to the omitted frequency modes mix, which the estimate to second order does not see.
    low = body.frequencies < 0.5 * body.following_frequency
    assert low.sum() > 5
    excess = body.frequencies[low] / true[: low.sum()] - 1.0
    # Round-off of frequencies: 1e-16 of the largest stiffness over the lowest.
    assert (excess > -1e-9).all()
    assert (excess <= body.frequency_errors[low] * (1.0 + 1e-6) + 1e-9).all()
    # Strong and weak bending alternate; the mesh of 20 elements adds 3e-6.
    found = body.frequencies[[0, 2]]
    assert found == pytest.approx(bending(FREE), rel=1e-4)


def test_the_estimate_is_close_for_low_modes():
    model = beam()
    body = reduced(model, ["A=1", "B=21"], 6)
    excess = body.frequencies[:3] / full_frequencies(model)[6:9] - 1.0
    # It sums all omitted modes as if at the frequency of the next: 6 % for the third mode here.
    assert body.frequency_errors[:3] == pytest.approx(excess, rel=0.1)


def test_a_frame_fixed_to_a_node_has_the_modes_of_the_clamped_beam():
    model = beam()
    body = reduced(model, ["Root=1", "Tip=21"], 20, "Root")
    assert np.abs(body.interface_shapes[0]).max() < 1e-12 * np.abs(body.interface_shapes[1]).max()
    assert body.frequencies[[0, 2]] == pytest.approx(bending(CLAMPED), rel=1e-4)  # mesh, as above
    held = full_frequencies(model, held=np.arange(6))
    assert body.frequencies[:4] == pytest.approx(held[:4], rel=1e-4)


def test_all_modes_are_the_full_model():
    model = beam(count=6)
    body = reduced(model, ["A=1", "B=4"], 42)
    assert len(body.eigenvalues) == model.size - 6
    assert body.frequencies == pytest.approx(full_frequencies(model)[6:], rel=1e-9)  # round-off
    assert body.following_frequency == np.inf
    assert body.effective_mass == pytest.approx(1.0)
    assert (body.frequency_errors == 0.0).all()


def test_mean_axes_have_no_momentum():
    body = reduced(beam(), ["A=1", "B=21"], 8)
    # Unit modal mass: the scale of momenta is the root of the mass and of the moments of inertia.
    assert np.abs(body.invariants.translation).max() < 1e-11
    assert np.abs(body.invariants.rotation).max() < 1e-11


def truss(seed, nodes=9):
    """Random points with random masses, joined by random springs along their lines."""
    rng = np.random.default_rng(seed)
    places = rng.normal(size=(nodes, 3))
    K = np.zeros((3 * nodes, 3 * nodes))
    for a in range(nodes):
        for b in range(a):
            line = (places[a] - places[b]) / np.linalg.norm(places[a] - places[b])
            k = rng.uniform(1.0, 10.0) * np.outer(line, line)
            for i, j, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                K[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] += sign * k
    labels = np.arange(1, nodes + 1)
    mass = np.repeat(rng.uniform(0.5, 2.0, nodes), 3)
    given = Matrices(
        np.repeat(labels, 3), np.tile(np.arange(3), nodes),
        sparse.csr_array(sparse.diags_array(mass)), sparse.csr_array(K), sparse.csr_array(0.01 * K),
    )  # fmt: skip
    return build_model("truss", Nodes(labels, places), given)


@pytest.mark.parametrize("seed", range(5))
def test_random_bodies_agree_with_dense_solutions(seed):
    model = truss(seed)
    true = full_frequencies(model)[6:]
    body = reduced(model, ["1", "2", "3"], 18)
    assert body.frequencies == pytest.approx(true, rel=1e-10)  # round-off, well conditioned
    # Damping proportional to stiffness is diagonal in the modes.
    assert body.damping == pytest.approx(np.diag(0.01 * body.eigenvalues), abs=1e-10)
    few = reduced(model, ["1", "2", "3"], 9)
    low = few.frequencies < 0.5 * few.following_frequency
    assert low.any()
    excess = few.frequencies[low] / true[: low.sum()] - 1.0
    assert (excess > -1e-12).all()
    assert (excess <= few.frequency_errors[low] + 1e-12).all()


def test_effective_mass_grows_with_the_modes():
    parts = [reduced(beam(), ["A=1", "B=21"], n).effective_mass for n in (0, 4, 12, 60)]
    assert (np.diff(parts, axis=0) >= -1e-12).all()
    assert parts[0].max() == 0.0
    assert parts[-1].min() > 0.8


@pytest.mark.parametrize("wanted", [Wanted(7), Wanted(frequency=800.0)])
def test_large_models_by_iterations_are_those_by_dense_matrices(wanted):
    model = beam(count=100)
    inner = np.arange(6, model.size - 6)
    assert len(inner) > DENSE
    K, M = (A[inner][:, inner] for A in (model.stiffness, model.mass))
    modes = normal_modes(K, M, factorised(K, "beam"), wanted, "beam")
    true = linalg.eigh(M.toarray(), K.toarray(), eigvals_only=True)[::-1]
    count = len(modes.eigenvalues)
    found = np.append(modes.eigenvalues, modes.following)
    assert found == pytest.approx(
        1.0 / true[: count + 1], rel=1e-6
    )  # iterations: 1e-16 of the last
    gram = modes.shapes.T @ M @ modes.shapes
    assert gram == pytest.approx(np.eye(count), abs=1e-8)
    assert count_below(K, M, np.sqrt(found[-2] * found[-1])) == count


def test_modes_of_one_frequency_are_kept_together():
    square = beam(width=0.02, height=0.02)
    for number, kept in ((1, 2), (2, 2), (3, 4)):
        _, interior = craig_bampton(
            square, np.r_[:6, square.size - 6 : square.size], Wanted(number)
        )
        assert len(interior.modes.eigenvalues) == kept


def test_a_box_of_bricks_is_a_beam():
    """Ends tied to points: as the rigid ends of beam theory. Bricks with incompatible modes bend as
    beams do; shear adds 3 % to the deflection's flexibility times (h / L)^2."""
    body = reduced(box(counts=(16, 1, 1)), ends((16, 1, 1)), 12, "Root")
    tip = body.interface_shapes[1]
    flexibility = tip @ np.diag(1.0 / body.eigenvalues) @ tip.T
    stiffness = E * 0.05**4 / 12
    # Both tied ends stiffen the bricks beside them, by less than the Poisson effect.
    assert flexibility[1, 1] == pytest.approx(1.0 / (3 * stiffness), rel=0.02)
    assert flexibility[5, 5] == pytest.approx(1.0 / stiffness, rel=0.02)
    assert flexibility[0, 0] == pytest.approx(1.0 / (E * 0.0025), rel=0.02)
    clamped = CLAMPED[0] ** 2 * np.sqrt(stiffness / (RHO * 0.0025)) / (2 * np.pi)
    assert body.frequencies[:2] == pytest.approx([clamped, clamped], rel=0.02)
    assert body.interface_rotates.all()


def test_tied_nodes_follow_their_point():
    body = reduced(box(), ends(), 3)
    label = np.flatnonzero(body.node_labels == 1)[0]
    arm = body.node_places[label] - body.interface_places[0]
    shapes = body.interface_shapes[0]
    moved = shapes[:3] + np.cross(shapes[3:], arm, axis=0)
    assert body.node_shapes[label] == pytest.approx(moved)
