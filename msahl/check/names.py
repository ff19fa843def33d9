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


def unresolved(role: str, name: str, kind: str, known: Collection[str]) -> str:
    """Return the message for a reference to a body or joint (``kind``) that does not exist."""
    group = {"body": "bodies", "joint": "joints"}[kind]
    there = listed(known) or "none"
    return f"{role} '{name}' is not a {kind} of this model ({group}: {there})"
