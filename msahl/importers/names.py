"""Names of a deck made from those of a file: printable, without , ; and quotes, each used once."""

from collections.abc import Collection

from msahl.check.names import FORBIDDEN, RESERVED
from msahl.expressions.syntax import RESERVED as WORDS
from msahl.printable import printable

LONGEST = 200
"""Characters of a name."""


class Names:
    """The names of one space of a deck."""

    def __init__(self, taken: Collection[str] = ()) -> None:
        self._taken = {*RESERVED, *WORDS, *taken}

    def unique(self, wanted: str) -> str:
        """Return ``wanted`` as a name that is not taken yet, with a number if it is."""
        text = printable(" ".join(wanted.split()))
        name = base = "".join("_" if c in FORBIDDEN else c for c in text)[:LONGEST] or "unnamed"
        number = 2
        while name in self._taken:
            name, number = f"{base} {number}", number + 1
        self._taken.add(name)
        return name
