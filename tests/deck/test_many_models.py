"""Decks that are read once for many models: each is the one that is read alone."""

from copy import deepcopy
from pathlib import Path

import pytest

import msahl
from msahl.api.model import read_together
from msahl.deck.overrides import _numbers, find_number

DECKS = Path(__file__).parents[2] / "decks"
FACTORS = (1.0, 1.0 + 1e-9, 1.001)


def numbers_of(model, most):
    """Names of numbers of a deck with their values, at most so many, from all parts of it."""
    root = model._deck._root
    names = list(dict.fromkeys([*model.parameters, *map(str, _numbers(root))]))
    found = {}
    for name in names[:: max(1, len(names) // most)]:
        try:
            found[name] = find_number(deepcopy(root), name).value
        except (LookupError, ValueError):  # several have this name, or it is an expression
            continue
    return found


def read_alone(model, samples):
    """The records of each sample; None if one has a fault."""
    try:
        return [model.with_(**sample).records for sample in samples]
    except msahl.DeckError:
        return None


@pytest.mark.parametrize(
    ("deck", "least"),
    [
        ("thesis/double_pendulum_89", 10),
        ("basics/parameters", 3),
        ("mechanisms/four_bar", 6),
        ("machines/cart_pole", 4),
        ("forces/bushing", 4),
    ],
)
def test_models_that_are_read_at_once_are_those_that_are_read_alone(deck, least):
    model, at_once = msahl.load(DECKS / f"{deck}.xml"), 0
    for name, value in numbers_of(model, 20).items():
        samples = [{name: value * factor if value else factor - 0.5} for factor in FACTORS]
        together, alone = read_together(model, samples), read_alone(model, samples)
        if together is None:
            continue
        assert [repr(one.records) for one in together] == list(map(repr, alone)), name
        at_once += 1
    assert at_once >= least


def test_models_have_changes_and_text_of_their_own():
    model = msahl.load(DECKS / "basics" / "parameters.xml")
    samples = [{"L": 0.5, "start": 10.0}, {"L": 0.75, "start": 20.0}]
    for one, sample in zip(read_together(model, samples), samples, strict=True):
        alone = model.with_(**sample)
        assert (one.changes, one.xml) == (alone.changes, alone.xml)


@pytest.mark.parametrize(
    "samples",
    [
        [{"L": 0.5}, {"start": 10.0}],
        [{"L": 0.5}, {"L": "90 cm"}],
        [{"L": 0.5}, {"L": -1.0}],
        [{"L": 0.5}, {"L": "{2*r}"}],
        [{"L": 0.5}, {"M": 1.0}],
        [{"nothing": 0.5}, {"nothing": 1.0}],
        [{"L": 0.5}, {"L": None}],
    ],
)
def test_others_are_left_to_be_read_alone(samples):
    assert read_together(msahl.load(DECKS / "basics" / "parameters.xml"), samples) is None
