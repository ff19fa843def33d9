"""The order of elimination: multiplications on structures of known cost, memory that is linear."""

import tracemalloc

import numpy as np
import pytest

from benchmarks.structure_decks import structure_deck
from msahl.deck import read_deck
from msahl.linalg.node_order import GAIN, by_bodies, by_elements, neighbours, smallest_degree
from msahl.start.velocities import solve_sparse
from msahl.system.arrays import node_count
from msahl.system.build import build_system
from msahl.system.evaluate import jacobian_at_rest
from msahl.system.graph import graph_of, node_order
from msahl.system.reductions import all_unknowns
from msahl.system.state import build_state
from msahl.system.unknowns import choose, eliminate


def system_of(folder, kind, n):
    path = folder / f"{kind}{n}.xml"
    path.write_text(structure_deck(kind, n))
    return build_system(read_deck(path))


def elimination_of(folder, kind, n):
    system = system_of(folder, kind, n)
    return eliminate(system, all_unknowns(system))


@pytest.mark.parametrize("kind", ["chain", "tree", "ladder"])
def test_multiplications_grow_with_the_number_of_bodies(tmp_path, kind):
    few, many = (elimination_of(tmp_path, kind, n) for n in (60, 240))
    ratio = (many.target.size / many.order.size) / (few.target.size / few.order.size)
    # What the ends of a structure save becomes rarer: 3 % in these.
    assert 1.0 <= ratio < 1.1


def test_every_unknown_is_eliminated_once(tmp_path):
    system = system_of(tmp_path, "net", 60)
    free = all_unknowns(system)
    assert sorted(eliminate(system, free).order.tolist()) == free.tolist()


def test_memory_grows_with_the_number_of_bodies(tmp_path):
    peaks = []
    for n in (500, 2000):  # both run the compiled kernels
        system = system_of(tmp_path, "chain", n)
        free = all_unknowns(system)
        eliminate(system, free)  # what is loaded once does not count
        tracemalloc.start()
        eliminate(system, free)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # Four times as many bodies; a matrix of all unknowns would take sixteen times as much.
    assert peaks[1] < 4.4 * peaks[0]


def test_structures_without_loops_keep_the_order_by_bodies(tmp_path):
    for kind in ("chain", "tree"):
        system = system_of(tmp_path, kind, 450)
        graph = graph_of(system)
        nodes = by_bodies(graph, smallest_degree(*neighbours(graph)))
        assert np.array_equal(node_order(system), nodes)


def test_a_large_net_is_eliminated_by_elements_with_fewer_multiplications(tmp_path):
    system = system_of(tmp_path, "net", 450)
    free, graph = all_unknowns(system), graph_of(system)
    nodes = by_bodies(graph, smallest_degree(*neighbours(graph)))
    chosen, other = eliminate(system, free), eliminate(system, free, nodes)
    assert GAIN * chosen.target.size < other.target.size


def test_both_orders_solve_the_same_equations(tmp_path):
    path = tmp_path / "net.xml"
    path.write_text(structure_deck("net", 450))
    model = read_deck(path)
    system = build_system(model)
    free, graph = all_unknowns(system), graph_of(system)
    values = jacobian_at_rest(system, build_state(model, system))
    rows = np.random.default_rng(1).normal(size=3 * node_count(system))
    bodies = by_bodies(graph, smallest_degree(*neighbours(graph)))
    x, y = (
        solve_sparse(values, rows, choose(system, free, nodes))
        for nodes in (bodies, by_elements(graph))
    )
    # Both are refined once; what is left is the condition number, some 1e4, times 1e-16.
    assert np.abs(x - y).max() < 1e-10 * np.abs(x).max()
