"""Sparse matrices give the eigenvalues that dense ones give, and those known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from msahl.algebra.vector import ZERO
from msahl.analysis.linearised.coefficients import coefficients
from msahl.analysis.linearised.point import at_start, at_time
from msahl.analysis.modes.solution import DENSE, SPARSE, modes
from msahl.analysis.modes.sparse_eigenvalues import pencil, without_stiffness
from msahl.model import Joint, SpringDamper
from msahl.start.velocities import StartError
from tests.analysis.modes.test_modes import (
    chain_frequencies,
    free_bodies_at_rest,
    hanging,
)
from tests.support.models import GROUND, build_model, deck, random_vector, tensor


def agree(point, tolerance=1e-9, **wanted):
    """Dense and sparse eigenvalues of the same modes."""
    dense, sparse = (modes(point, method=name, **wanted) for name in (DENSE, SPARSE))
    assert sparse.degrees_of_freedom == dense.degrees_of_freedom
    assert sparse.redundant == dense.redundant
    compared = min(len(dense.value), len(sparse.value))
    assert compared > 0
    for value, error in zip(sparse.value, sparse.error, strict=True):
        distance = np.abs(dense.value - value)
        nearest = int(np.argmin(distance))
        allowed = max(tolerance * abs(value), dense.error[nearest] + error)
        assert distance[nearest] <= allowed
    return dense, sparse


def damped_chain(n=40):
    """Hanging rods with dampers and springs from rod to rod, not symmetric about the vertical."""
    model = hanging(n)
    springs = [
        SpringDamper(
            name=f"S{k}",
            parent=f"R{k}",
            child=f"R{k + 2}",
            parent_point=(0.2, 0.0, 0.0),
            child_point=(0.1, 0.0, 0.1),
            stiffness=3.0,
            damping=0.4,
            free_length=None,
        )
        for k in range(0, n - 2, 3)
    ]
    return replace(model, loads=tuple(springs))


def spinning_chain(n=30):
    """Symmetric rotors on ball joints, one below the other, which spin about the vertical."""
    model = hanging(n)
    bodies = [
        replace(b, inertia=tensor(np.diag([0.1, 0.1, 0.05])), angular_velocity=(0.0, 0.0, 8.0))
        for b in model.bodies
    ]
    joints = [replace(joint, kind="universal") for joint in model.joints]
    balls = [
        Joint(j.name, "spherical", j.parent, j.child, j.parent_point, j.child_point) for j in joints
    ]
    return replace(model, bodies=tuple(bodies), joints=tuple(balls))


def test_sparse_and_dense_agree_with_damping():
    dense, sparse = agree(at_start(damped_chain()), number=4)
    assert len(sparse.value) == 4
    assert np.abs(np.sort(np.abs(sparse.value)) - np.abs(dense.value)).max() <= 1e-9
    assert sparse.damping.min() > 0.0


@pytest.mark.slow
def test_sparse_and_dense_agree_with_gyroscopic_terms():
    point = at_start(spinning_chain())
    found = agree(point, number=4, frequency=1.0)[1]
    assert found.equilibrium.holds
    # Each rotor may spin faster: as many zeros with one eigenvector for two of them.
    dense, sparse = agree(point, number=4)
    assert (sparse.zeros, sparse.rigid) == (dense.zeros, dense.rigid) == (60, 30)
    assert np.abs(sparse.value[60:] - dense.value[60:]).max() <= 1e-12


def test_redundant_equations_are_removed_from_sparse_matrices():
    model = hanging(30)
    first = model.joints[2]
    second = replace(
        first, name="Again", parent_point=(0.0, 0.7, 0.5), child_point=(0.0, 0.7, -0.5)
    )
    found = agree(at_start(replace(model, joints=(*model.joints, second))), 1e-11, number=2)
    assert found[1].redundant == 5
    exact = chain_frequencies(30)[:2] * np.sqrt(9.81)
    assert np.abs(found[1].value.imag - exact).max() <= 1e-12


def row_of_bodies(count, each, damping):
    """Bodies on ``each`` springs between neighbours in a row, which nothing holds."""
    rng = np.random.default_rng(5)
    bodies = [replace(free_bodies_at_rest().bodies[0], name=f"B{k}") for k in range(count)]
    springs = [
        SpringDamper(
            name=f"S{k}{i}",
            parent=f"B{k}",
            child=f"B{k + 1}",
            parent_point=random_vector(rng),
            child_point=random_vector(rng),
            stiffness=3.0 + i,
            damping=damping,
            free_length=None,
        )
        for k in range(count - 1)
        for i in range(each)
    ]
    return at_start(build_model(bodies, loads=springs))


@pytest.mark.parametrize("damping", [0.0, 3.0])
def test_directions_across_single_springs_are_refused_by_one_factorisation(damping, monkeypatch):
    """A hundred bodies on one spring each to the next, in general directions."""
    name = "msahl.analysis.modes.solution.nearest"
    monkeypatch.setattr(name, lambda *_: pytest.fail("eigenvectors were sought"))
    with pytest.raises(StartError, match="at least 506 rigid-body modes"):
        modes(row_of_bodies(101, 1, damping))


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.0, 0.1, 3.0])
def test_zeros_of_a_large_model_are_counted(damping):
    point = row_of_bodies(12, 7, damping)
    assert without_stiffness(pencil(coefficients(point.system, point.state), np.zeros(3))) == 6
    dense, sparse = agree(point, number=3)
    assert (sparse.zeros, sparse.rigid) == (dense.zeros, dense.rigid) == (12, 6)
    others = sparse.value[12:]
    assert np.abs(others - dense.value[12 : 12 + len(others)]).max() <= 1e-12
    # Shapes of zeros are motions without force: springs keep their lengths.
    found = coefficients(point.system, point.state)
    moved = sparse.shape[: sparse.rigid].reshape(sparse.rigid, -1).real
    assert np.abs(found.by_place @ moved.T).max() <= 1e-10 * abs(found.by_place).max()


def test_long_chain_has_its_lowest_modes():
    n = 300
    found = modes(at_start(hanging(n)))
    exact = chain_frequencies(n)[:10] * np.sqrt(9.81)
    assert len(found.value) == 10
    assert np.abs(found.value.imag - exact).max() <= 1e-11 * exact[0]
    assert np.all(np.abs(found.value.imag - exact) <= found.error + 1e-11 * exact)
    assert found.equilibrium.holds


def test_upside_down_chain_grows():
    model = replace(hanging(40), gravity=(0.0, 0.0, -9.81))
    _, sparse = agree(at_start(model), 1e-12, number=4)
    assert np.count_nonzero(sparse.value.real > 0.0) == 2


def test_pencil_is_made_of_the_mass_normalised_coefficients():
    point = at_time(deck("triple_pendulum_45"), 0.1)
    found = coefficients(point.system, point.state)
    of = pencil(found, np.zeros(3))
    back = of.back.toarray()
    assert np.abs(back.T @ found.mass.toarray() @ back - np.eye(of.coordinates)).max() <= 1e-14
    assert of.E.sum() == 2 * of.coordinates


def evenly_damped(rods, time):
    """Rods on springs, which have nothing but these, with dampers that are ``time`` times as strong
    [s]: each vibration is damped by zeta = time omega/2.
    """
    springs = []
    for k in range(rods):
        other, points = f"R{k + 1}", ((0.3, 0.0, 0.2), (-0.2, 0.0, 0.1))
        if k + 1 == rods:
            other = GROUND.name
        c = 40.0 + k
        springs.append(SpringDamper(f"S{k}", f"R{k}", other, *points, c, time * c, None))
    return at_start(replace(hanging(rods), gravity=ZERO, loads=tuple(springs)))


@pytest.mark.parametrize("time", [0.0, 3.0])
def test_condition_numbers_of_sparse_eigenvalues(time):
    found = modes(evenly_damped(40, time), number=4, method=SPARSE)
    zeta = 0.5 * time * np.abs(found.value)
    assert found.damping == pytest.approx(zeta, abs=1e-9)
    # Right and left vector of [[0, omega], [-omega, -2 zeta omega]], where places count by omega.
    assert found.condition == pytest.approx(1.0 / np.sqrt(1.0 - zeta**2), rel=1e-10)


def test_the_error_of_sparse_eigenvalues_is_the_largest_by_rounded_entries():
    """Each entry of both matrices may be wrong by a machine epsilon. The pencil whose entries are
    wrong by ``part``, all with the sign that adds to the change, is solved as dense matrices.
    """
    point, part, eps = evenly_damped(21, 10.0), 1e-9, np.finfo(float).eps
    found = modes(point, number=1, method=SPARSE)
    of = pencil(coefficients(point.system, point.state), np.zeros(3))
    A, E = of.A.toarray(), np.diag(of.E)
    value, left, right = scipy.linalg.eig(A, E, left=True)
    k = int(np.argmin(np.abs(value - found.value[0])))
    signs = np.outer(left[:, k], right[:, k].conj())
    signs /= np.maximum(np.abs(signs), 1e-300)
    # In the first order the change by E has the factor -lambda.
    other = -signs * np.exp(-1j * np.angle(value[k]))
    moved = scipy.linalg.eigvals(A + part * np.abs(A) * signs, E + part * E * other)
    change = np.abs(moved - value[k]).min()
    # Both pairs of vectors and the linear range are good to a percent.
    assert found.error[0] == pytest.approx(eps / part * change, rel=0.02, abs=0.0)
    # Without damping symmetric matrices are used, with a bound of their own.
    symmetric, other = (
        modes(evenly_damped(21, time), number=1, method=SPARSE) for time in (0.0, 1e-6)
    )
    assert symmetric.error == pytest.approx(other.error, rel=0.02, abs=0.0)
