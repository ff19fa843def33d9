"""Write msahl/jit/optional_groups.json: the types of the groups that a model may lack.

python -m tools.optional_groups

They are those of models that have them (``DECKS``). A model that lacks a group has no arrays that
tell its types.
"""

import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from msahl.cli.kernels import VARIANTS, calls_of_run
from msahl.deck import read_deck
from msahl.jit.arguments import GROUP, NONE, TUPLE, Description, describe
from msahl.jit.compiled import Compiled
from msahl.jit.general import FILE, OPTIONAL, Member
from msahl.start.velocities import StartError

ROOT = Path(__file__).parent.parent
DECKS = (
    *("forces/drag", "forces/spring_compliance", "forces/actuator_motor"),
    *("contact/rolling_coin", "contact/cam_lift_off", "contact/crossed_rods"),
    *("contact/ball_on_a_plank", "contact/spinning_ball"),
)
"""Decks that together have all optional groups."""


def find_types() -> dict[Member, Description]:
    """Return the types of the optional groups; raise ValueError where two models differ."""
    found: dict[Member, Description] = {}
    for name in DECKS:
        for described in _types_of_calls(ROOT / "decks" / f"{name}.xml"):
            for member, one in _members(described):
                if member in OPTIONAL and one != NONE:
                    own = _without_optional(one)
                    if found.setdefault(member, own) != own:
                        raise ValueError(f"{member} has several types")
    missing = set(OPTIONAL) - set(found)
    if missing:
        raise ValueError(f"no deck has {missing}")
    return found


def _types_of_calls(path: Path) -> Iterator[Description]:
    model = read_deck(path)
    for changes, options in VARIANTS:
        changed = replace(model, simulation=replace(model.simulation, **changes))
        with suppress(StartError):
            for function, arguments in calls_of_run(changed, options):
                if isinstance(function, Compiled):
                    yield from map(describe, arguments)


def _members(described: Description) -> Iterator[tuple[Member, Description]]:
    """Yield the members of a description and, before each, those inside of it."""
    if isinstance(described, tuple) and described[0] in (GROUP, TUPLE):
        fields: Any = described[2] if described[0] == GROUP else [("", p) for p in described[1]]
        for name, one in fields:
            yield from _members(one)
            yield (described[1] if described[0] == GROUP else "", name), one


def _without_optional(described: Description) -> Description:
    """Return the description of a group without the optional ones inside."""
    if isinstance(described, tuple) and described[0] == GROUP:
        kind, fields = described[1:]
        left = [
            (name, NONE if (kind, name) in OPTIONAL else _without_optional(one))
            for name, one in fields
        ]
        return (GROUP, kind, tuple(left))
    if isinstance(described, tuple) and described[0] == TUPLE:
        return (TUPLE, tuple(map(_without_optional, described[1])))
    return described


def as_text(types: dict[Member, Description]) -> str:
    """Return the content of the file: a line for each group."""
    lines = [json.dumps([*member, types[member]]) for member in sorted(OPTIONAL)]
    return "[\n" + ",\n".join(lines) + "\n]\n"


if __name__ == "__main__":
    (ROOT / "msahl" / "jit" / FILE).write_text(as_text(find_types()))
