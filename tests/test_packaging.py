"""An installed package has every module, which an editable installation would not miss."""

import tomllib

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
