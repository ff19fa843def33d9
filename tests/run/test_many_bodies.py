"""The work before the first step grows with the number of bodies: calls and memory, not seconds."""

import gc
import sys
import tracemalloc

import pytest

from benchmarks.structure_decks import structure_deck
from msahl.deck import read_deck
from msahl.model import Options, resolve
from msahl.run.setup import build_setup

MOST_CALLS = {"reading": 240, "building": 115}
"""Python and library functions called for each link of a chain; 202 and 110 are measured."""


def path_of(folder, n):
    path = folder / f"chain{n}.xml"
    path.write_text(structure_deck("chain", n))
    return path


def build(model):
    return build_setup(
        model, resolve(model.simulation, Options(solver="newton", error="off")), None
    )


def calls(function, argument):
    """How many functions are called."""
    count = 0

    def on_event(frame, event, _):
        nonlocal count
        count += event in ("call", "c_call")

    # What is collected, of other tests as well, calls functions of its own.
    gc.collect()
    gc.disable()
    sys.setprofile(on_event)
    try:
        function(argument)
    finally:
        sys.setprofile(None)
        gc.enable()
    return count


@pytest.fixture(scope="module")
def paths(tmp_path_factory):
    # Beyond 400 bodies kernels are compiled, and not counted.
    return [path_of(tmp_path_factory.mktemp("chains"), n) for n in (500, 1000, 2000)]


@pytest.mark.slow
@pytest.mark.parametrize("stage", MOST_CALLS)
def test_calls_grow_with_the_number_of_bodies(paths, stage):
    function = read_deck if stage == "reading" else build
    arguments = paths if stage == "reading" else [read_deck(path) for path in paths]
    for argument in arguments:
        function(argument)  # what is loaded or compiled once does not count
    few, more, many = (calls(function, argument) for argument in arguments)
    assert (more - few) / 500 < MOST_CALLS[stage]
    # The doubled model takes twice the additional calls, but for the steps of sorting.
    assert (many - more) / 1000 == pytest.approx((more - few) / 500, rel=0.02)


@pytest.mark.slow
def test_memory_grows_with_the_number_of_bodies(paths):
    peaks = []
    for path in paths[1:]:
        model = read_deck(path)
        build(model)
        tracemalloc.start()
        build(model)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # A matrix of all unknowns would take four times as much for twice as many bodies.
    assert peaks[1] < 2.1 * peaks[0]
