"""The examples of the documentation's pages on Python, run as they stand."""

import doctest
import re
import shutil

import pytest

from tests.support.models import ROOT

FLAGS = doctest.ELLIPSIS
DECKS = {
    "rod.xml": ROOT / "decks" / "basics" / "parameters.xml",
    "two_rods.xml": ROOT / "decks" / "basics" / "two_rods.xml",
    "quarter_car.xml": ROOT / "decks" / "machines" / "quarter_car.xml",
    "slider_crank.xml": ROOT / "decks" / "mechanisms" / "slider_crank.xml",
    "cart_pole.xml": ROOT / "decks" / "machines" / "cart_pole.xml",
}


def examples(page):
    """The examples of a page, on the lines that they have there."""
    text = (ROOT / "docs" / page).read_text()
    blocks = re.findall(r"^```pycon\n(.*?)^```", text, re.M | re.S)
    source = re.sub(r"^```.*$", "", text, flags=re.M)
    parsed = doctest.DocTestParser().get_doctest(source, {}, page, page, 0)
    assert len(parsed.examples) == sum(block.count(">>> ") for block in blocks) > 0
    return parsed


@pytest.mark.slow
@pytest.mark.parametrize(
    ("page", "needed"),
    [
        ("python.md", ()),
        ("gradients.md", ()),
        ("optimise.md", ("optuna",)),
        ("linearize.md", ("control",)),
    ],
)
def test_the_examples_of_a_page_print_what_it_says(page, needed, tmp_path, monkeypatch):
    for package in needed:
        pytest.importorskip(package)
    for name, deck in DECKS.items():
        shutil.copy(deck, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    told = []
    runner = doctest.DocTestRunner(optionflags=FLAGS, verbose=False)
    runner.run(examples(page), out=told.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(told)
