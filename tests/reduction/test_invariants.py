"""Inertia invariants: against sums over masses and the kinetic energy of all nodes."""

import numpy as np
import pytest

from msahl.reduction.craig_bampton import craig_bampton
from msahl.reduction.floating import floating_modes
from msahl.reduction.interfaces import interface_of, tied
from msahl.reduction.invariants import invariants
from msahl.reduction.normal_modes import Wanted
from tests.reduction.bodies import RHO, beam, box, ends
from tests.reduction.test_craig_bampton import truss


def modes_of(model, nodes, frame=None, number=4):
    rows = np.concatenate([model.rows_of(model.node_of(label)) for label in nodes])
    basis, _ = craig_bampton(model, np.sort(rows), Wanted(number))
    return floating_modes(basis, None if frame is None else model.node_of(frame))


def tied_box():
    parts = tied(box(), [interface_of(text) for text in ends()])
    return parts.model, list(parts.nodes.values())


def random_state(count, seed=0):
    rng = np.random.default_rng(seed)
    return rng.normal(size=3), rng.normal(size=3), rng.normal(size=count), rng.normal(size=count)


def energy(found, v, w, q, rate):
    """Twice the kinetic energy by the formula of the docstring."""
    gyration = np.einsum("i,ijk,j,k", w, found.gyration, q, rate)
    moment = np.einsum("a,aij,i,j", v, found.moment, w, q)
    return (
        found.mass * v @ v + w @ found.inertia_at(q) @ w + rate @ rate
        + 2 * (v @ found.translation @ rate + moment + w @ found.rotation @ rate + gyration)
    )  # fmt: skip


@pytest.mark.parametrize("frame", [None, 1])
def test_kinetic_energy_of_point_masses(frame):
    """Of masses at nodes without rotations: velocities v + w x (x + u) + u', by the vectors."""
    model = truss(1)
    if frame is not None:
        parts = tied(model, [interface_of("A=1,2,3"), interface_of("4")])
        model, frame = parts.model, parts.nodes["A"]
        nodes = list(parts.nodes.values())
    else:
        nodes = [1, 2, 3]
    modes = modes_of(model, nodes, frame)
    v, w, q, rate = random_state(len(modes.eigenvalues))
    found = invariants(modes)
    field = modes.rigid @ np.r_[v, w] + modes.shapes @ rate
    u = modes.shapes @ q
    for k in range(len(model.labels)):
        rows = model.rows_of(k)
        for part in (rows[:3], rows[3:]):
            field[part] += np.cross(w, u[part]) if len(part) else 0.0
    assert energy(found, v, w, q, rate) == pytest.approx(field @ (model.mass @ field), rel=1e-11)


def test_inertia_of_the_deformed_body_by_sums_over_masses():
    model = truss(2)
    modes = modes_of(model, [1, 2, 3])
    q = np.random.default_rng(3).normal(size=len(modes.eigenvalues))
    mass = model.mass.diagonal()[::3]
    r = model.places - modes.centre + (modes.shapes @ q).reshape(-1, 3)
    direct = np.einsum("k,k,ij->ij", mass, (r**2).sum(axis=1), np.eye(3)) - (r.T * mass) @ r
    assert invariants(modes).inertia_at(q) == pytest.approx(direct, rel=1e-11)
    assert modes.centre == pytest.approx(mass @ model.places / mass.sum())
    # The first moment by mean axes does not change.
    assert np.abs(mass @ r).max() < 1e-11


def test_consistent_mass_of_solids_integrates_the_fields():
    """Of bricks: the scalar mass of two nodes a, b, times products of their positions."""
    model = box(counts=(4, 1, 1))
    modes = modes_of(model, [1, 4, 17, 20])
    q = 0.01 * np.random.default_rng(4).normal(size=len(modes.eigenvalues))
    scalar = model.mass.toarray()[::3, ::3]
    r = model.places - modes.centre + (modes.shapes @ q).reshape(-1, 3)
    products = r.T @ scalar @ r
    direct = np.trace(products) * np.eye(3) - products
    assert invariants(modes).inertia_at(q) == pytest.approx(direct, rel=1e-11)
    # exact for a trilinear position field: the cuboid
    mass = RHO * 1.0 * 0.05 * 0.05
    cuboid = mass / 12 * np.diag([0.05**2 + 0.05**2, 1 + 0.05**2, 1 + 0.05**2])
    assert modes.inertia[3:, 3:] == pytest.approx(cuboid, rel=1e-12, abs=1e-12)
    assert modes.centre == pytest.approx([0.5, 0.025, 0.025])


def test_tying_keeps_mass_and_inertia():
    plain, (model, nodes) = box(), tied_box()
    first, second = modes_of(plain, [1, 4, 41, 44]), modes_of(model, nodes)
    assert second.inertia == pytest.approx(first.inertia, rel=1e-12, abs=1e-12)


def test_slopes_are_derivatives_of_the_rigid_inertia():
    """A beam whose modes displace it as a rigid body would have the inertia of the moved body."""
    model = beam(count=8)
    modes = modes_of(model, [1, 9])
    found = invariants(modes)
    step = 1e-4
    q = np.zeros(len(modes.eigenvalues))
    for j in range(3):
        q[j] = step
        ahead, behind = found.inertia_at(q), found.inertia_at(-q)
        slope = (ahead - behind) / (2 * step)  # of a quadratic: exact but for round-off
        assert slope == pytest.approx(found.inertia_slope[:, :, j], abs=1e-9)
        assert np.allclose(ahead, ahead.T, rtol=0, atol=1e-12)
        q[j] = 0.0


def test_both_frames_have_the_same_deformations():
    model, nodes = tied_box()
    mean, held = modes_of(model, nodes), modes_of(model, nodes, nodes[0])
    both = np.column_stack([mean.shapes, mean.rigid])
    rest = held.shapes - both @ np.linalg.lstsq(both, held.shapes, rcond=None)[0]
    assert np.abs(rest).max() < 1e-9 * np.abs(held.shapes).max()
    assert len(mean.eigenvalues) == len(held.eigenvalues)
    # The frame at a node takes part in the motion of the deformation.
    assert np.abs(invariants(held).translation).max() > 0.1
