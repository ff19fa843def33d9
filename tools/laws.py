"""List every law of physics with the place where its formula stands; exit 1 if one stands twice.

Usage: python tools/laws.py

Laws of forces and joints come from their registries, constraint functions and strains from the
functions that state them, all others are the modules of ``elements/`` and ``ports/`` with the first
line of their docstrings. Two functions state the same formula if
their instructions are the same but for local names.
"""

import ast
import inspect
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from msahl.elements.beams import strain
from msahl.elements.constraints import coincide, coordinate_kinds, products
from msahl.joints.registry import KINDS
from msahl.laws.registry import COORDINATE_LAWS, POINT_LAWS

ROOT = Path(__file__).parents[1]
STATED_IN = ("laws", "joints", "elements", "ports")
"""Packages of ``msahl`` that state laws."""
FUNCTIONS: dict[str, object] = {
    "coinciding points": coincide.violation,
    "scalar products": products.gradient,
    "distance": coordinate_kinds._weigh_radius,
    "angle": coordinate_kinds._weigh_angle,
    "height of a disk's rim": coordinate_kinds._weigh_round,
    "crossed cylinders": coordinate_kinds._weigh_skew,
    "strains of a beam": strain.strain_at,
}
"""Constraint functions and strains, by the functions that state value, change and derivatives."""
FORMULA = 20
"""Syntax nodes of the shortest function that counts as a formula: shorter ones look up a number."""


def main() -> None:
    """Print the list, and what stands twice."""
    for law, place in laws():
        print(f"{law:36} {place}")
    found = stated_twice()
    for places in found:
        print(f"the same formula: {', '.join(places)}")
    sys.exit(1 if found else 0)


def laws() -> Iterator[tuple[str, str]]:
    """Yield every law and where it stands."""
    for point in POINT_LAWS.values():
        yield f"force {point.name}", _place(point.load)
    for along in COORDINATE_LAWS.values():
        stated = along.tension if along.is_elastic else along.resistance
        yield f"force {along.name}", _place(stated)
    for kind in KINDS.values():
        yield f"joint {kind.name}", _place(kind.equations)
    for name, function in FUNCTIONS.items():
        yield f"constraint function {name}", _place(function)
    for package in ("elements", "ports"):
        for path in sorted((ROOT / "msahl" / package).rglob("*.py")):
            first = (ast.get_docstring(ast.parse(path.read_text())) or "").split("\n")[0]
            if path.name != "__init__.py":
                yield str(path.relative_to(ROOT)), first


def _place(function: object) -> str:
    """Return file and line of a function."""
    path = Path(inspect.getsourcefile(function)).relative_to(ROOT)  # type: ignore[arg-type]
    return f"{path}:{inspect.getsourcelines(function)[1]}"  # type: ignore[arg-type]


def stated_twice() -> list[list[str]]:
    """Return the places of each formula that stands in several functions."""
    places = defaultdict[str, list[str]](list)
    for package in STATED_IN:
        for path in sorted((ROOT / "msahl" / package).rglob("*.py")):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.FunctionDef):
                    where = f"{path.relative_to(ROOT)}:{node.lineno} {node.name}"
                    places[shape(node)].append(where)
    return [found for form, found in places.items() if form and len(found) > 1]


def shape(function: ast.FunctionDef) -> str:
    """Return the instructions of a function with its local names numbered; "" for a short one."""
    body = function.body[1:] if ast.get_docstring(function) else function.body
    nodes = [node for statement in body for node in ast.walk(statement)]
    if len(nodes) < FORMULA:
        return ""
    local = {argument.arg for argument in function.args.args}
    local |= {n.id for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
    numbers: dict[str, str] = {}
    for node in nodes:
        if isinstance(node, ast.Name) and node.id in local:
            node.id = numbers.setdefault(node.id, f"x{len(numbers)}")
    return "\n".join(map(ast.dump, body))


if __name__ == "__main__":
    main()
