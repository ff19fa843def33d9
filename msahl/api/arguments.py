"""The check of the arguments of the Python API, with the words of the options of a run."""

import math
from collections.abc import Iterable, Mapping
from numbers import Real
from typing import Any

from msahl.model.settings import EQUILIBRIUM
from msahl.records import record
from msahl.run.options import Choice, Flag, Integer, Number, OptionError, accepted


@record
class Names:
    """A text, or a list of texts."""


@record
class Numbers:
    """A list of finite numbers: ``count`` of them, or at least ``least``."""

    count: int | None = None
    least: int = 0


@record
class Weights:
    """Numbers by name."""


@record
class Mapped:
    """Texts by name."""


@record
class At:
    """A time from 0 s on, or the word for the equilibrium."""


Kind = Number | Integer | Choice | Flag | Names | Numbers | Weights | Mapped | At
COUNT = Integer(1, 10**9)
NOT_NEGATIVE = Number("", least=0.0)


def require(**given: tuple[Any, Kind]) -> None:
    """Raise ``OptionError`` with what is wrong with arguments: by name their value and its kind."""
    faults = [
        f"{name}: it is {value!r:.200}; it must be {expected}"
        for name, (value, kind) in given.items()
        if (expected := _expected(value, kind))
    ]
    if faults:
        raise OptionError(faults)


def _expected(value: Any, kind: Kind) -> str:
    """Return what a value must be; empty if it is that."""
    match kind:
        case Names():
            texts = not isinstance(value, bytes | Mapping) and all(
                isinstance(text, str) for text in _parts(value)
            )
            return "" if isinstance(value, str) or texts else "a text, or a list of texts"
        case Numbers(count, least):
            numbers = [*map(_is_number, _parts(value))]
            right = len(numbers) == count if count is not None else len(numbers) >= least
            amount = f"{count} " if count is not None else f"{least} or more " if least else ""
            return "" if right and all(numbers) else f"a list of {amount}finite numbers"
        case Weights():
            good = isinstance(value, Mapping) and all(map(_is_number, value.values()))
            return "" if good else "finite numbers by name"
        case Mapped():
            good = isinstance(value, Mapping) and all(
                isinstance(text, str) for pair in value.items() for text in pair
            )
            return "" if good else "texts by name"
        case At():
            is_time = _is_number(value) and value >= 0.0
            good = value == EQUILIBRIUM if isinstance(value, str) else is_time
            return "" if good else f"a time from 0 s on, or '{EQUILIBRIUM}'"
        case _:
            return accepted(kind, value)[1]


def _parts(value: Any) -> Iterable[Any]:
    """Return the parts of a list; one that is nothing where there are none."""
    try:
        return (None,) if isinstance(value, str) else tuple(value)
    except TypeError:
        return (None,)


def _is_number(value: Any) -> bool:
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False
