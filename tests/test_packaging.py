"""An installed package has every module, which an editable installation would not miss."""

import shutil
import subprocess
import tomllib

import pytest

from tests.support.models import ROOT

DATA = {"msahl.decks", "msahl.schemas"}
"""Packages without modules: folders at the top of the repository."""


def test_every_package_is_installed():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    listed = project["tool"]["setuptools"]["packages"]
    found = {
        ".".join(path.parent.relative_to(ROOT).parts)
        for path in (ROOT / "msahl").rglob("__init__.py")
    }
    assert sorted(found | DATA) == sorted(listed)


@pytest.mark.skipif(not shutil.which("make"), reason="make is not installed")
def test_the_path_of_a_deck_may_have_spaces():
    command = ["make", "-n", "run", "DECK=my decks/a deck.xml", "PYTHON=true"]
    shown = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert 'msahl run "my decks/a deck.xml" -o "results/a_deck"' in shown
    assert 'msahl-post report "results/a_deck"' in shown
