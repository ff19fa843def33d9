"""Models of many bodies: decisions of linear algebra in memory that grows with the bodies."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.structure_decks import structure_deck
from msahl.deck.source import Source
from msahl.run.subsystem import SubsystemIntegrator
from msahl.start import redundancy, velocities
from msahl.start.velocities import jacobian_at_rest, make_consistent, solve_sparse
from msahl.system.arrays import multiplier_count, node_count
from msahl.system.build import build_system
from msahl.system.reductions import all_unknowns
from msahl.system.state import build_state
from msahl.system.unknowns import choose
from tests.support.models import chain, deck, ring


def twice_pinned(model, *numbers):
    """The same with some pins doubled: three equations each follow from others."""
    twins = tuple(replace(model.joints[n], name=f"Twin{n}") for n in numbers)
    return replace(model, joints=(*model.joints, *twins))


MODELS = {
    "four_bar": lambda: deck("four_bar"),
    "bricard": lambda: deck("bricard"),
    "andrews_squeezer": lambda: deck("andrews_squeezer"),
    "one pin twice": lambda: twice_pinned(ring(6, (0,)), 3),
    "all pins twice": lambda: twice_pinned(chain(8), *range(8)),
    "40 links": lambda: twice_pinned(ring(40, (0, 17)), 5, 20),
}


@pytest.mark.parametrize("name", MODELS)
def test_redundant_equations_are_found_by_dense_and_by_sparse_algebra(name, monkeypatch):
    model = MODELS[name]()
    system = build_system(model)
    state = build_state(model, system)
    found = []
    for largest in (10**9, 0):
        monkeypatch.setattr(redundancy, "LARGEST_DENSE", largest)
        G = redundancy.constraint_matrix(system, state)
        basis = redundancy.null_space(G)
        # Both answer to what defines them, to the threshold of an independent equation.
        size = abs(G).sum()
        assert np.abs(basis.T @ G).max(initial=0.0) <= redundancy.INDEPENDENT * size
        assert np.abs(basis.T @ basis - np.eye(basis.shape[1])).max(initial=0.0) < 1e-9
        rank = redundancy.constraint_rank(system, state)
        shared = redundancy.non_unique_reactions(system, state)
        found.append((rank, shared))
    assert found[0] == found[1]
    assert found[0][0] < multiplier_count(system)
    names = [(*model.joints, *model.couplings, *model.motions)[e].name for e in found[0][1]]
    if "pin" in name or "links" in name:
        twins = [joint.name for joint in model.joints if joint.name.startswith("Twin")]
        assert set(names) == {*twins, *(twin.replace("Twin", "Pin") for twin in twins)}


def test_a_long_chain_is_known_to_be_regular():
    """The round-off of pivots in a fixed order adds up along a chain, to 1e-12 of 2000 links and
    1e-10 of 20,000, which was taken for redundancy; refined it is that of the equations' own terms.
    """
    model = chain(300)
    system = build_system(model)
    state = build_state(model, system)
    unknowns = choose(system, all_unknowns(system))
    values = jacobian_at_rest(system, state)
    wanted = np.random.default_rng(0).normal(size=3 * node_count(system))
    x = solve_sparse(values, wanted, unknowns)
    rows = np.abs(velocities._times(values, x, unknowns) - wanted[unknowns.free])
    terms = velocities._times(np.abs(values), np.abs(x), unknowns) + np.abs(wanted[unknowns.free])
    # A few products a row, each to half an epsilon, of the solution and of its own correction.
    assert (rows <= 8 * np.finfo(float).eps * terms).all()


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("wish", ["keepAngular", "massWeighted"])
def test_velocities_of_redundant_models_are_mended_by_either_algebra(name, wish, monkeypatch):
    """Velocities at random, made consistent by least squares of the dense or the sparse matrix."""
    model = MODELS[name]()
    changes = []
    for largest in (10**9, 0):
        monkeypatch.setattr(velocities, "LARGEST_DENSE", largest)
        system = build_system(model)
        state = build_state(model, system)
        state.v[:-1] = np.random.default_rng(1).normal(size=state.v[:-1].shape)
        if model.motions:
            state.v[:] = 0.0
        changes.append(make_consistent(system, state, all_unknowns(system), wish))
    dense, sparse = changes
    assert dense.method == sparse.method
    size = max(np.abs(dense.dv).max(), np.abs(dense.dw).max(), 1e-300)
    # The smallest change by mass is unique; matrices are ill-conditioned where models are long.
    assert np.abs(dense.dv - sparse.dv).max() < 1e-8 * size
    assert np.abs(dense.dw - sparse.dw).max() < 1e-8 * size


def test_a_chain_needs_memory_in_proportion_to_its_links(monkeypatch):
    """No array of a prepared system grows faster than the bodies, and no dense matrix is made."""

    def refuse(*_, **__):
        raise AssertionError("a dense decomposition of a complete model")

    for name in ("svd", "lstsq", "qr", "solve", "inv"):
        monkeypatch.setattr(np.linalg, name, refuse)
    sizes = []
    for n in (250, 500):
        workspace = SubsystemIntegrator(chain(n), "newton", False, 4).workspace
        arrays = [leaf for leaf in _leaves(workspace) if isinstance(leaf, np.ndarray)]
        sizes.append(sum(array.nbytes for array in arrays))
    assert sizes[1] == pytest.approx(2 * sizes[0], rel=0.01)


def _leaves(value):
    if isinstance(value, tuple):
        for part in value:
            yield from _leaves(part)
    else:
        yield value


@pytest.mark.parametrize(("kind", "is_tree"), [("chain", True), ("tree", True), ("net", False)])
def test_points_without_loops_are_independent(kind, is_tree):
    model = Source.of(structure_deck(kind, 60).encode()).model()
    system = build_system(model)
    assert redundancy.is_tree_of_points(system) is is_tree
    if is_tree:
        # Computed in the configuration of the deck, from the equations' derivatives.
        rank = redundancy.constraint_rank(system, build_state(model, system))
        assert rank == multiplier_count(system)


def test_two_points_between_the_same_bodies_are_no_tree():
    deck = structure_deck("chain", 3)
    joint = deck[deck.index("<spherical>") : deck.index("</spherical>") + len("</spherical>")]
    name = joint[joint.index("<name>") : joint.index("</name>")]
    deck = deck.replace(joint, joint + joint.replace(name, f"{name}Again", 1))
    model = Source.of(deck.encode()).model()
    assert not redundancy.is_tree_of_points(build_system(model))
