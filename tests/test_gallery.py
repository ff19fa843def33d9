"""The gallery of the documentation: every motion is that of a deck, and the player shows it."""

import json

import pytest

from tests.support.models import ROOT
from tools.docs.gallery import MOTIONS, THUMBS, as_script, player_page

MOST_BYTES = 1_700_000
"""Of all motions and pictures: everybody who clones the repository gets them."""


def names(folder):
    return {f"{path.parent.name}/{path.stem}" for path in folder.glob("*/*.*")}


def test_every_deck_has_a_motion_and_a_picture():
    decks = names(ROOT / "decks")
    assert names(MOTIONS) == names(THUMBS)
    assert names(MOTIONS) <= decks  # of a new deck: make examples
    assert len(names(MOTIONS)) > 0.8 * len(decks)
    files = [*MOTIONS.glob("*/*.json"), *THUMBS.glob("*/*.webp")]
    assert sum(path.stat().st_size for path in files) < MOST_BYTES


def test_titles_on_a_page_differ():
    """Of old decks that share a title it is the first sentence of the header."""
    deck_title = pytest.importorskip("tools.docs.pages").deck_title  # needs mkdocs
    for folder in (ROOT / "decks").iterdir():
        titles = [deck_title(path) for path in folder.glob("*.xml")]
        assert len(set(titles)) == len(titles)
    assert deck_title(ROOT / "decks/thesis/top_2.xml") == "Heavy top on a ball joint, case 2"


def test_the_site_takes_the_scripts_of_motions_and_not_their_data():
    """MkDocs excludes pages of its hooks, too, if a pattern fits."""
    load_config = pytest.importorskip("mkdocs.config").load_config
    excluded = load_config(str(ROOT / "mkdocs.yml")).exclude_docs
    assert excluded.match_file("examples/motions/mechanisms/four_bar.json")
    assert not excluded.match_file("examples/motions/mechanisms/four_bar.js")
    assert not excluded.match_file("examples/view.html")


def test_motions_are_of_the_decks_as_they_are():
    """A deck that was changed much needs: python -m tools.docs.gallery DECK."""
    for name in ("mechanisms/four_bar", "machines/robot", "elastic/flexible_four_bar"):
        (run,) = json.loads((MOTIONS / f"{name}.json").read_text())["runs"]
        deck = (ROOT / "decks" / f"{name}.xml").read_text()
        bodies = [body for body in run["scene"]["bodies"] if body["beam"] is None]
        assert all(f"<name>{body['name']}</name>" in deck for body in bodies)
        assert f"<title>{run['scene']['title']}</title>" in deck


def test_the_player_plays_the_motion_that_its_address_names(browser, tmp_path):
    name = "mechanisms/four_bar"
    (tmp_path / "view.html").write_text(player_page())
    script = tmp_path / "motions" / f"{name}.js"
    script.parent.mkdir(parents=True)
    script.write_text(as_script((MOTIONS / f"{name}.json").read_text()))
    page = browser.new_page()
    faults = []
    page.on("pageerror", lambda fault: faults.append(str(fault)))
    page.goto(f"{(tmp_path / 'view.html').as_uri()}?{name}")
    page.wait_for_selector("[data-state=ready]")
    assert page.evaluate("window.msahl.isPlaying")
    assert page.title() == "Four-bar linkage"
    page.close()
    assert faults == []
