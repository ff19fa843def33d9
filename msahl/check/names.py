"""Rules about names: they are unique, can head a column of results, and resolve."""

from collections.abc import Callable, Collection, Iterator, Sequence

from msahl.check.faults import listed
from msahl.model.scheme import WORKER

FORBIDDEN = frozenset(",;\"'")
"""Characters that no name may contain, since names head CSV columns; nor any that do not print."""


def name_messages(
    names: Sequence[str], describe: Callable[[int], str], reserved: Collection[str] = ()
) -> Iterator[tuple[int, str, int | None]]:
    """Yield (index, message, index of the first) for names that are wrong or taken.

    ``describe`` says where the element of an index is. Empty names are not looked at.
    """
    taken: dict[str, int] = {}
    for index, name in enumerate(names):
        if not name:
            continue
        first = taken.setdefault(name, index)
        if first != index:
            yield index, f"the name is taken by {describe(first)}; choose another", first
        if name in reserved:
            message = "the name is that of the scheme's own column in work.csv; choose another"
            yield index, message, None
        if name.isprintable() and FORBIDDEN.isdisjoint(name):
            continue
        bad = sorted({c for c in name if c in FORBIDDEN or not c.isprintable()})
        characters = " ".join(ascii(c)[1:-1] for c in bad)
        yield index, f"a name must not contain {characters} (names head columns of results)", None


RESERVED = frozenset((WORKER,))
"""Names that no load, motion or joint may have."""

COLUMNS_OF_LOADS = ("load", "power", "factor")
"""Values of loads that are columns of signals.csv, beside the signals."""


def signal_name_messages(
    names: Sequence[str], values: Collection[str], loads: Collection[str]
) -> Iterator[tuple[int, str]]:
    """Yield (index, message) for names of signals that mean another column or value already.

    ``values`` are the names in expressions that are none of signals, ``loads`` the names of loads.
    """
    for index, name in enumerate(names):
        element, _, value = name.rpartition(".")
        if name == "time":
            yield index, "'time' is the first column of signals.csv; choose another name"
        elif element and (name in values or (value in COLUMNS_OF_LOADS and element in loads)):
            yield index, f"'{name}' is the {value} of '{element}'; choose another name"


def unresolved(role: str, name: str, kind: str, known: Collection[str]) -> str:
    """Return the message for a reference to a body or joint (``kind``) that does not exist."""
    group = {"body": "bodies", "joint": "joints"}[kind]
    there = listed(known) or "none"
    return f"{role} '{name}' is not a {kind} of this model ({group}: {there})"
