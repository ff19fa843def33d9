"""Runs after others in one process: equal to the bit to a run in a process of its own."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msahl.deck import read_deck
from msahl.jit.arguments import Block
from msahl.jit.recent import Recent
from msahl.jit.storage import Storage, Storages
from msahl.model import Options
from msahl.run import loop, setup
from msahl.run.options import with_options
from msahl.run.tables import MemorySink
from msahl.system import build, unknowns
from msahl.system.arrays import System
from msahl.system.unknowns import Unknowns

DECKS = Path(__file__).parents[2] / "decks"
STEPS = 40
CASES = [
    ("thesis/double_pendulum_89", {}),  # planar
    ("thesis/double_pendulum_89", {"scheme": "decaying", "reactions": "instantaneous"}),
    ("thesis/double_pendulum_89", {"scheme": "gauss3"}),
    ("thesis/top_1", {"scheme": "auto", "tolerance": 1e-5}),
    ("mechanisms/four_bar", {}),  # redundant
    ("mechanisms/bricard", {"scheme": "radau2"}),  # redundant
    ("mechanisms/two_pendulums", {}),  # two subsystems
    ("mechanisms/cam_valve", {"scheme": "gauss2", "accelerations": "yes"}),
    ("forces/actuator_pid", {}),  # signals
    ("machines/cart_pole", {"scheme": "auto", "local_tolerance": 1e-4}),  # signals
    ("forces/friction_hinge", {"scheme": "gauss3"}),
    ("basics/ballistic_cylinder", {}),
    ("basics/stop", {}),
    ("elastic/cable", {}),  # rigid strains
    ("elastic/spin_up", {"scheme": "gauss2"}),
]


@pytest.fixture
def forget(monkeypatch):
    """A function after which nothing is known of earlier runs."""

    def forget():
        monkeypatch.setattr(setup, "STORAGES", Storages((System, Unknowns)))
        monkeypatch.setattr(build, "_TOPOLOGIES", Recent(32))
        monkeypatch.setattr(unknowns, "_ORDERS", Recent(32))
        monkeypatch.setattr(unknowns, "_CHOSEN", Recent(64))

    return forget


def short(name, given):
    """A model of a deck, for a few steps."""
    model = read_deck(DECKS / f"{name}.xml")
    return with_options(model, {"t_final": STEPS * model.simulation.dt, **given})


def heavier(model, factor):
    """The model with other masses and weights."""
    bodies = tuple(replace(body, mass=factor * body.mass) for body in model.bodies)
    return replace(model, bodies=bodies, gravity=tuple(factor * g for g in model.gravity))


def results(model, **options):
    """Tables and report of a run; the seconds that it took are no result."""
    sink = MemorySink()
    report = loop.run(model, Options(**options), sink)
    figures = report.as_json()
    del figures["seconds"]
    return {name: sink.table(name) for name in sink.kept}, figures


def assert_same(one, other):
    (tables, figures), (other_tables, other_figures) = one, other
    assert tables.keys() == other_tables.keys()
    for name, table in tables.items():
        assert table.tobytes() == other_tables[name].tobytes(), name
    assert figures == other_figures


@pytest.mark.sampled
@pytest.mark.parametrize(("name", "given"), CASES)
def test_a_run_after_others_has_the_results_of_a_first_one(name, given, forget):
    model = short(name, given)
    forget()
    alone = results(model)
    for factor in (1.25, 0.8):
        results(heavier(model, factor))
    assert_same(results(model), alone)
    assert_same(results(model), alone)


def spinning(model):
    """The model with its first body turning out of the plane of the others."""
    first, *others = model.bodies
    spin = tuple(w + 0.1 for w in first.angular_velocity)
    return replace(model, bodies=(replace(first, angular_velocity=spin), *others))


@pytest.mark.parametrize("given", [{}, {"scheme": "gauss3"}])
def test_what_follows_from_numbers_is_found_for_each_run(given, forget):
    planar = short("thesis/double_pendulum_89", given)
    models = [planar, spinning(planar), heavier(planar, 2.0), spinning(heavier(planar, 2.0))]
    alone = []
    for model in models:
        forget()
        alone.append(results(model))
    assert [figures["planar_subsystems".replace("_s", "S")] for _, figures in alone] == [1, 0, 1, 0]
    forget()
    for model, expected in [*zip(models, alone, strict=True)] * 2:
        assert_same(results(model), expected)


def test_redundancy_is_found_for_each_run(forget):
    """A four-bar closes with parallel axes only, so other axes make other equations redundant."""
    redundant, regular = (
        short("mechanisms/four_bar", {}),
        short("mechanisms/spatial_slider_crank", {}),
    )
    forget()
    expected = [results(model) for model in (redundant, regular)]
    for model, of_first in [*zip((redundant, regular), expected, strict=True)] * 2:
        assert_same(results(model), of_first)


@pytest.mark.slow
def test_runs_in_threads_do_not_disturb_each_other(forget):
    double, cart = short("thesis/double_pendulum_89", {}), short("machines/cart_pole", {})
    models = [double, cart, spinning(double), heavier(cart, 1.1), heavier(double, 3.0)]
    forget()
    alone = [results(model) for model in models]
    forget()
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(results, models * 4))
    for result, expected in zip(found, alone * 4, strict=True):
        assert_same(result, expected)


def test_a_repeated_run_lays_out_no_arguments(forget, monkeypatch):
    made = []

    class Counted(Block):
        def __init__(self, arguments, described):
            made.append(arguments)
            super().__init__(arguments, described)

    monkeypatch.setattr("msahl.jit.arguments.Block", Counted)
    model = short("thesis/double_pendulum_89", {})
    forget()
    results(model)
    first = len(made)
    results(heavier(model, 1.5))
    assert first > 0
    assert len(made) == first


def test_storage_takes_numbers_but_no_other_indices():
    storage = Storage((System, Unknowns))
    system = build.build_system(short("thesis/double_pendulum_89", {}))
    other = build.build_system(heavier(short("thesis/double_pendulum_89", {}), 2.0))
    assert storage.place("system", system) is system
    assert storage.place("system", other) is system
    assert np.array_equal(system.bodies.inverse_mass, other.bodies.inverse_mass)
    column = other.bodies.column[::-1].copy()
    changed = other._replace(bodies=other.bodies._replace(column=column))
    assert storage.place("system", changed) is changed
    assert system.bodies.column.tolist() == [0, 12]


def test_storage_distinguishes_plain_numbers():
    storage = Storage()
    zeros, kept = np.zeros(2), storage.place("a", (np.ones(2), 0.0, None))
    assert storage.place("a", (zeros, 0.0, None)) is kept
    assert storage.place("a", (zeros, -0.0, None)) is not kept
    assert storage.place("a", (np.zeros(3), -0.0, None))[0].size == 3
    assert storage.place("a", (np.zeros(3), -0.0, 1))[2] == 1


def test_storage_keeps_shared_arrays_shared():
    storage = Storage()
    everything = storage.place("everything", (np.ones(2),))
    part = storage.place("part", (everything[0], np.ones(1)))
    again = storage.place("everything", (np.zeros(2),))
    assert again is everything
    assert storage.place("part", (again[0], np.zeros(1))) is part
    other = storage.place("everything", (np.zeros(3),))  # which does not fit
    assert storage.place("part", (other[0], np.zeros(1)))[0] is other[0]


def test_storages_drop_what_was_used_first(monkeypatch):
    monkeypatch.setattr("msahl.jit.storage.MOST_BYTES", 100)
    storages = Storages()
    for kind in ("first", "second"):
        storage = storages.take(kind)
        storage.place("a", (np.zeros(8),))
        storages.give_back(storage)
    assert storages.take("first").size == 0
    assert storages.take("second").size == 64
