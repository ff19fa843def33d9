"""Rounds kinds of models up, so that there are few: groups that a model lacks are passed as empty.

Machine code is made for one set of types of arguments, and a group of a system that is None, as it
has no expressions or no contacts, costs it nothing. With n such groups there are 2^n kinds of
models, each with a minute of compiling. So they come in two sets, of which a model has none, one or
both:

    general    forces at points, loads and actuators by expressions, springs in the compliance form
    contact    friction, surfaces and curves of contacts

A kernel of a model that has one group of a set gets the others of it as groups of arrays without
entries. It does with them what it does without them: nothing. Python sees None as before, as do
kernels that run as plain Python.

The types of the groups are in ``optional_groups.json``, which ``python -m tools.optional_groups``
writes from models that have them.
"""

import json
from functools import cache
from importlib.resources import files
from typing import Any

from msahl.jit.arguments import GROUP, NONE, TUPLE, Description

FILE = "optional_groups.json"

Member = tuple[str, str]
"""Name of a group, and of one of its fields."""

GENERAL: frozenset[Member] = frozenset(
    (
        *(("Forces", name) for name in ("point", "compliance", "actuator")),
        *(("Forces", name) for name in ("controlled", "signals")),
        *(("ForcesWorkspace", name) for name in ("controlled", "signals")),
        *((name, "signals") for name in ("StageArrays", "DenseOutput")),
    )
)
CONTACT: frozenset[Member] = frozenset(
    (
        *(("Forces", name) for name in ("sliding", "rubbing")),
        *(("Coordinates", name) for name in ("curves", "ends")),
        ("Products", "surfaces"),
    )
)
OPTIONAL = GENERAL | CONTACT
ALONG_COORDINATES = {("Forces", "compliance"), ("Forces", "actuator")}
"""Those that no system without coordinates has, which is a kind of its own."""


def round_up(arguments: tuple[Description, ...]) -> tuple[Description, ...]:
    """Return the types of arguments of the kind of model that stands for theirs."""
    present: frozenset[Member] = frozenset().union(*map(_present, arguments))
    if not present & OPTIONAL:
        return arguments
    groups = frozenset().union(*(one for one in (GENERAL, CONTACT) if one & present))
    if ("System", "scalar") not in present:
        groups -= ALONG_COORDINATES
    return tuple(_filled(one, groups) for one in arguments)


@cache
def types_of_groups() -> dict[Member, Description]:
    """Return the types of the groups that a model may lack, without those inside of them."""
    text = files("msahl.jit").joinpath(FILE).read_text()
    return {(kind, field): _as_tuples(described) for kind, field, described in json.loads(text)}


def _as_tuples(value: Any) -> Any:
    return tuple(map(_as_tuples, value)) if isinstance(value, list) else value


@cache
def _present(described: Description) -> frozenset[Member]:
    """Return the members of groups in a description that are not None."""
    if isinstance(described, str) or described[0] not in (GROUP, TUPLE):
        return frozenset()
    if described[0] == TUPLE:
        return frozenset().union(*map(_present, described[1]))
    kind, members = described[1:]
    own = frozenset((kind, name) for name, one in members if one != NONE)
    return own.union(*(_present(one) for _, one in members))


@cache
def _filled(described: Description, groups: frozenset[Member]) -> Description:
    """Return a description with all optional ``groups``."""
    if isinstance(described, str) or described[0] not in (GROUP, TUPLE):
        return described
    if described[0] == TUPLE:
        return (TUPLE, tuple(_filled(one, groups) for one in described[1]))
    kind, members = described[1], []
    for name, one in described[2]:
        lacks = one == NONE and (kind, name) in groups
        given = types_of_groups()[kind, name] if lacks else one
        members.append((name, _filled(given, groups)))
    return (GROUP, kind, tuple(members))
