"""Packages import only packages below them, modules import in no circle, each says what it does."""

import ast
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.support.models import ROOT

PACKAGE = ROOT / "msahl"
LEAVES = (
    "msahl.command_process",
    "msahl.locks",
    "msahl.records",
    "msahl.terminal",
    "msahl.input_files",
    "msahl.printable",
    "msahl.resources",
    "msahl.subprocesses",
    "msahl.version",
)
"""Modules outside the packages that everything may import."""
ORDER = (
    "jit",
    "algebra",
    "linalg",
    "expressions",
    "laws",
    "model",
    "formulations",
    "elements",
    "ports",
    "joints",
    "check",
    "beams",
    "reduction",
    "deck",
    "system",
    "events",
    "start",
    "contact",
    "switching",
    "schemes",
    "run",
    "results",
    "analysis",
    "post",
    "study",
    "importers",
    "api",
    "fmu",
    "sweep",
    "serve",
    "cli",
    "entry",
)
"""Packages from the bottom to the top: each may import those before it."""


@cache
def sources():
    """Every module of the package and its syntax tree."""
    return {name_of(path): ast.parse(path.read_text()) for path in sorted(PACKAGE.rglob("*.py"))}


def name_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported_by(tree):
    """The modules of the package that a module imports, also those within functions."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = (name.name for name in node.names)
            yield from (name for name in names if name.split(".")[0] == "msahl")
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "msahl":
            assert node.level == 0
            for name in node.names:
                module = f"{node.module}.{name.name}"
                yield module if module in sources() else node.module


@cache
def imports():
    return {name: set(imported_by(tree)) - {name} for name, tree in sources().items()}


def rank(module):
    """The place of a module's package in the order; leaves are below and the public API above."""
    if module in LEAVES:
        return -1
    return len(ORDER) if module == "msahl" else ORDER.index(module.split(".")[1])


def test_every_package_has_a_place_in_the_order():
    found = {module.split(".")[1] for module in sources() if module not in ("msahl", *LEAVES)}
    assert found == set(ORDER)


def test_no_module_imports_from_a_package_above_its_own():
    upward = {
        f"{module} -> {imported}"
        for module, all_imported in imports().items()
        for imported in all_imported
        if rank(imported) > rank(module)
    }
    assert not upward


def test_leaves_import_nothing_but_leaves():
    for leaf in LEAVES:
        assert set(LEAVES) >= imports()[leaf]


def test_no_modules_import_each_other_in_a_circle():
    try:
        TopologicalSorter(imports()).prepare()
    except CycleError as circle:
        pytest.fail(" -> ".join(circle.args[1]))


def test_every_modules_docstring_begins_with_a_sentence_on_one_line():
    first_lines = {
        module: (ast.get_docstring(tree) or "").split("\n")[0] for module, tree in sources().items()
    }
    broken = {
        module for module, line in first_lines.items() if not line.endswith(".") or "TODO" in line
    }
    assert not broken
