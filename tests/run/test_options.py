"""One table of options: the command line, the deck, run.json and command lines follow from it."""

import json
from dataclasses import fields, replace

import click
import pytest
from click.testing import CliRunner
from lxml import etree

from msahl.cli.main import main
from msahl.cli.run import run as command
from msahl.deck import read_deck
from msahl.model import Options, RunSettings, Simulation, resolve
from msahl.run.options import (
    OPTIONS,
    command_words,
    deck_changes,
    options_beside_deck,
    recorded_options,
    with_options,
)
from tests.support.effective import effective_deck
from tests.support.models import ROOT

DECK = ROOT / "decks" / "thesis" / "single_pendulum_45.xml"
GIVEN = {
    "dt": 0.004,
    "t_final": 0.2,
    "scheme": "gauss2",
    "damping": 0.25,
    "rotation_update": "exponential",
    "solver": "newton",
    "tolerance": 1e-5,
    "local_tolerance": 1e-6,
    "output_interval": 0.01,
    "every": 3,
    "reactions": "instantaneous",
    "accelerations": "yes",
    "joint_table": "no",
    "error": "local",
    "accuracy": 0.5,
    "full": True,
}
"""A value of every option that is not the default."""


def test_every_option_has_a_value_here():
    assert GIVEN.keys() == {option.name for option in OPTIONS}


@pytest.mark.parametrize("option", OPTIONS, ids=lambda option: option.name)
def test_every_option_is_a_field_of_the_settings(option):
    of_deck = {field.name for field in fields(Simulation)}
    beside = {field.name for field in fields(Options)}
    assert (option.name in of_deck) == bool(option.deck)
    assert option.name in of_deck | beside
    assert option.name in {field.name for field in fields(RunSettings)} or option.deck


def test_the_command_line_has_every_option_with_its_help():
    parameters = {p.name: p for p in command.params if isinstance(p, click.Option)}
    for option in OPTIONS:
        assert parameters[option.name].opts == [option.flag]
        assert parameters[option.name].help == option.help
        assert option.help.endswith(".")


@pytest.mark.parametrize("option", OPTIONS, ids=lambda option: option.name)
def test_an_option_on_the_command_line_is_the_one_in_the_settings(option):
    given = {option.name: GIVEN[option.name]}
    words = command_words(given)
    context = command.make_context("run", [str(DECK), *words])
    assert context.params[option.name] == GIVEN[option.name]
    model = with_options(read_deck(DECK), given)
    settings = resolve(model.simulation, options_beside_deck(given))
    before = recorded_options(resolve(read_deck(DECK).simulation))
    # The damping, and a tolerance, belong to other schemes than the deck's.
    if option.name not in ("damping", "tolerance", "local_tolerance"):
        assert recorded_options(settings)[option.key] != before[option.key]


@pytest.mark.parametrize(
    "option", [option for option in OPTIONS if option.deck], ids=lambda option: option.name
)
def test_the_deck_as_it_was_run_gives_the_same_model(option, tmp_path):
    given = {option.name: GIVEN[option.name]}
    if "tolerance" in option.name or option.name == "output_interval":
        given["scheme"] = "gauss2"
    copy = tmp_path / "deck.xml"
    copy.write_bytes(effective_deck(DECK, deck_changes(given)))
    assert read_deck(copy) == with_options(read_deck(DECK), given)
    simulation = etree.parse(copy).find("simulation")
    assert simulation.get(option.deck) or simulation.find(option.deck) is not None


def test_nothing_given_changes_nothing():
    given = dict.fromkeys(GIVEN)
    assert deck_changes(given) == {}
    assert command_words(given) == []
    assert with_options(read_deck(DECK), given) == read_deck(DECK)
    assert options_beside_deck(given) == Options()


def test_run_json_has_every_option(tmp_path):
    out = tmp_path / "out"
    result = CliRunner().invoke(main, ["run", str(DECK), "--t-final", "0.05", "-o", str(out)])
    assert result.exit_code == 0
    found = json.loads((out / "run.json").read_text())["options"]
    assert found.keys() == {option.key for option in OPTIONS} | {"degree"}
    assert (found["dt"], found["scheme"], found["degree"]) == (0.002, "preserving", None)
    assert found["rotationUpdate"] == "cayley"


def test_a_tolerance_replaces_the_other_one():
    model = read_deck(DECK)
    local = replace(model.simulation, scheme="gauss", local_tolerance=1e-3)
    simulation = with_options(replace(model, simulation=local), {"tolerance": 1e-4}).simulation
    assert (simulation.tolerance, simulation.local_tolerance) == (1e-4, None)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, ("preserving", 0, 2, False, "mean", None, None)),
        ({"scheme": "decaying"}, ("decaying", 0, 2, True, "mean", None, None)),
        ({"scheme": "decaying", "damping": 0.0}, ("decaying", 0, 2, False, "mean", None, None)),
        ({"scheme": "gauss"}, ("gauss", 3, 6, False, "instantaneous", None, None)),
        ({"scheme": "radau", "degree": 2}, ("radau", 2, 3, True, "instantaneous", None, None)),
        ({"scheme": "auto"}, ("gauss", 5, 10, False, "instantaneous", 1e-6, 1e-6)),
        (
            {"scheme": "auto", "local_tolerance": 1e-3},
            ("gauss", 5, 10, False, "instantaneous", None, 1e-3),
        ),
        (
            {"scheme": "gauss", "tolerance": 1e-4},
            ("gauss", 3, 6, False, "instantaneous", 1e-4, 1e-4),
        ),
    ],
)
def test_settings_are_resolved(changes, expected):
    of = resolve(Simulation("", 0.01, 1.0, **changes))
    found = (of.family, of.degree, of.order, of.dissipative, of.reactions)
    assert (*found, of.tolerance, of.local_tolerance) == expected
    assert of.adaptive == (expected[-1] is not None)
