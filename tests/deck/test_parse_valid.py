"""A valid deck is parsed and validated in one pass; whatever might have a fault is not."""

import re
import shutil

import pytest
from lxml import etree

from msahl.deck import read_deck
from msahl.deck.faults import Faults
from msahl.deck.parse import parse, parse_valid
from msahl.deck.schema import schema_bytes, validator
from tests.support.models import DECKS, ROOT


def without_schema(path):
    """The bytes of a deck that names no schema, as those that programs write."""
    return re.sub(rb"<data\s[^>]*>", b"<data>", path.read_bytes())


DECK = without_schema(ROOT / "decks/thesis/double_pendulum_89.xml")


def once(data):
    return parse_valid(data, validator(schema_bytes()))


@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_one_pass_returns_the_tree_of_the_parser(path):
    data = without_schema(path)
    root = once(data)
    assert root is not None
    assert etree.tostring(root) == etree.tostring(parse(data, Faults("deck")))


@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_one_pass_leads_to_the_same_model(path, tmp_path):
    for parts in path.parent.glob("parts"):
        shutil.copytree(parts, tmp_path / "parts")
    copy = tmp_path / path.name
    copy.write_bytes(without_schema(path))
    assert read_deck(copy) == read_deck(path)


def replaced(old, new):
    assert old in DECK
    return DECK.replace(old, new, 1)


@pytest.mark.parametrize(
    "data",
    [
        replaced(b"<data", b"<!DOCTYPE data><data"),
        replaced(b"<data", b"<data xmlns:xsi='http://www.w3.org/2001/XMLSchema-instance'"),
        replaced(b"<mass", b"<mess"),
        replaced(b"<system>", b"<system"),
        DECK.decode().replace("utf-8", "utf-16").replace("UTF-8", "utf-16").encode("utf-16"),
    ],
    ids=["document type", "namespace", "not valid", "not well-formed", "another encoding"],
)
def test_what_may_have_a_fault_is_left_to_the_parser_that_words_it(data):
    assert once(data) is None


def test_a_deck_of_another_encoding_is_read(tmp_path):
    text = DECK.decode().replace("utf-8", "utf-16").replace("UTF-8", "utf-16")
    path, other = tmp_path / "deck.xml", tmp_path / "other.xml"
    path.write_bytes(DECK)
    other.write_bytes(text.encode("utf-16"))
    assert read_deck(path) == read_deck(other)
