"""Large nets are factored by dense panels: the same solutions, in a fraction of the memory."""

import numpy as np
import pytest

from benchmarks.structure_decks import structure_deck
from msahl.deck.source import Source
from msahl.start.velocities import solve_at_rest
from msahl.system.arrays import node_count
from msahl.system.build import build_system
from msahl.system.graph import node_order
from msahl.system.reductions import all_unknowns
from msahl.system.state import build_state
from msahl.system.unknowns import choose


def _built(kind, n):
    model = Source.of(structure_deck(kind, n).encode()).model()
    system = build_system(model)
    return system, build_state(model, system)


@pytest.fixture(scope="module")
def net():
    """A net whose factors have 110 products of blocks per node."""
    return _built("net", 2500)


@pytest.mark.slow
def test_panels_give_the_solution_of_the_products(net):
    system, state = net
    free = all_unknowns(system)
    panels, products = choose(system, free, node_order(system)), choose(system, free)
    assert panels.elimination.supernodes is not None
    assert products.elimination.supernodes is None
    rows = np.sin(np.arange(3.0 * node_count(system))).reshape(-1, 3)
    one, other = (solve_at_rest(system, state, rows, chosen) for chosen in (panels, products))
    # Round-off times the condition number, which is some 1e4 for a net of these rows.
    assert np.abs(one - other).max() < 1e-10 * np.abs(other).max()


def test_panels_take_a_fraction_of_the_memory(net):
    system, _ = net
    free = all_unknowns(system)
    panels, products = choose(system, free, node_order(system)), choose(system, free)
    sizes = [
        sum(array.nbytes for array in _arrays(chosen.elimination)) for chosen in (panels, products)
    ]
    assert sizes[0] < 0.5 * sizes[1]


def test_structures_that_fill_little_keep_the_list_of_products():
    for kind, n in (("chain", 2500), ("ladder", 2500), ("net", 500)):
        system, _ = _built(kind, n)
        chosen = choose(system, all_unknowns(system), node_order(system))
        assert chosen.elimination.supernodes is None, kind


def _arrays(value):
    parts = value if isinstance(value, tuple) else ()
    return [value] if isinstance(value, np.ndarray) else [a for p in parts for a in _arrays(p)]
