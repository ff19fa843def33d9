"""The order of elimination: multiplications on structures of known cost, memory that is linear."""

import tracemalloc

import pytest

from benchmarks.structure_decks import structure_deck
from msahl.deck import read_deck
from msahl.system.build import build_system
from msahl.system.ordering import eliminate
from msahl.system.reductions import all_unknowns


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
