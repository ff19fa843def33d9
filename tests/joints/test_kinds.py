"""What a kind of joint says of itself, and that no other part of the program says it."""

import ast
import re

from msahl.joints.kind_properties import glyph
from msahl.joints.registry import KINDS
from tests.support.models import ROOT

PACKAGE = ROOT / "msahl"
NOT_A_JOINT = {
    "deck/markers.py": {"distance"},
    "deck/read.py": {"distance"},
    "deck/write_model.py": {"distance"},
    "check/markers.py": {"distance"},
    "system/names.py": {"distance"},
    "post/scene/glyphs.py": {"distance"},
    "run/column_units.py": {"distance"},
    "system/topology.py": {"rigid"},
    "formulations/tree/table.py": {"screw"},
}
"""Files with the name of a kind as the name of something else: the distance of two markers, strains
of beams that cannot change, and motions as spatial vectors."""


NAMING = ("joints", "importers")
"""Folders whose subject are kinds: joints, and the translation of other formats' names to them."""


def names_of_kinds():
    """Names of kinds that stand as strings outside the folders ``NAMING``, by file."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text()
        own = any(path.is_relative_to(PACKAGE / folder) for folder in NAMING)
        if own or not any(kind in text for kind in KINDS):
            continue
        nodes = ast.walk(ast.parse(text))
        texts = {n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)}
        if named := texts & set(KINDS):
            found[str(path.relative_to(PACKAGE))] = named
    return found


def test_no_module_outside_joints_names_a_kind():
    others = {
        file: names - NOT_A_JOINT.get(file, set()) for file, names in names_of_kinds().items()
    }
    assert not {file: names for file, names in others.items() if names}


def test_no_script_of_the_viewer_names_a_kind():
    for path in sorted((PACKAGE / "post" / "web").glob("*.js")):
        if not path.name.endswith(".min.js"):
            words = re.findall(r'"(\w+)"|^ *(\w+):', path.read_text(), flags=re.M)
            assert not {text or key for text, key in words} & set(KINDS), path.name


def test_glyphs_are_drawn_by_the_viewer():
    script = (PACKAGE / "post" / "web" / "glyphs.js").read_text()
    drawn = script.partition("const DRAWN = {")[2]
    for kind in KINDS.values():
        assert glyph(kind) == "roll" or f"\n  {glyph(kind)}: (" in drawn, kind.name
