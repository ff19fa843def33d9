"""Docstrings of modules in pages: laws are stated beside the code, and pages take them from there.

A line ``<!-- docstrings of PATH PATH ... -->`` becomes what the docstrings of these modules of
msahl say; ``joints`` are the modules of all kinds of joint.
"""

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "msahl"
MARK = re.compile(r"^<!-- docstrings of (.*) -->$", re.MULTILINE)


def insert_docstrings(page: str) -> str:
    """Return the Markdown of a page with the docstrings that it asks for."""
    return MARK.sub(lambda match: "\n".join(map(_block, modules(match[1]))), page)


def modules(asked: str) -> Iterator[Path]:
    """Yield the modules of a list of paths."""
    for place in asked.split():
        if place == "joints":
            from msahl.joints.registry import KINDS

            yield from (Path(inspect.getfile(kind.equations)) for kind in KINDS.values())
        else:
            yield PACKAGE / place


def _block(path: Path) -> str:
    """Return the docstring of a module under its path."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    return f"`{path.relative_to(PACKAGE).as_posix()}`\n\n```text\n{text}\n```\n"
