"""Reads ``run.json`` and checks the types of its fields, so that readers can rely on them.

Fields that are not listed here may hold anything.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import orjson

from msahl.printable import printable, shown_path
from msahl.records import record
from msahl.results.folder import find
from msahl.results.write import INFO
from msahl.run.verdict import WORDS

AGAIN = "run the deck again: msahl run"
"""The remedy for files that were changed after the run."""

LARGEST = 1e100
"""Largest size, as in a deck: it can be divided by any other."""


class ResultError(Exception):
    """A folder that does not hold a run; the message names the file and the remedy."""


class NoColumnError(ResultError, KeyError):
    """A column that there is not; mappings raise ``KeyError``, from which it is derived as well."""

    def __str__(self) -> str:
        return str(self.args[0])


@record
class Leaf:
    """A value without parts: its ``name`` in messages, and a test of it."""

    name: str
    fits: Callable[[Any], bool]


@record
class Many:
    """A list, or an object with any keys (``container``), whose values have one shape."""

    container: type
    of: "Shape"


@record
class Fields:
    """An object: shapes of some of its keys, and those that are ``required``."""

    of: Mapping[str, "Shape"]
    required: tuple[str, ...] = ()


Shape = Leaf | Many | Fields


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_count(value: Any, least: int = 0) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= least


def _is_size(value: Any) -> bool:
    return value is None or (_is_number(value) and 0.0 < value <= LARGEST)


TEXT = Leaf("a text", lambda value: isinstance(value, str))
NUMBER = Leaf("a number", _is_number)
FIGURE = Leaf("a number or null", lambda value: value is None or _is_number(value))
SIZE = Leaf(f"null or a number above zero, up to {LARGEST:g}", _is_size)
FLAG = Leaf("true or false", lambda value: isinstance(value, bool))
INTEGER = Leaf("an integer", lambda v: isinstance(v, int) and not isinstance(v, bool))
COUNT = Leaf("an integer from 0", _is_count)
FIRST = Leaf("an integer from 1", lambda value: _is_count(value, 1))
WORD = Leaf(f"one of {', '.join(WORDS)}", lambda value: value in WORDS)
CHECK = Fields({"word": WORD, "text": TEXT}, ("word", "text"))

SHAPE = Fields({
    **dict.fromkeys(("msahl", "python", "numba", "numpy", "scipy"), TEXT),
    **dict.fromkeys(("status", "message", "command"), TEXT),
    **dict.fromkeys(("outputTimes", "steps", "joints", "unknowns"), COUNT),
    **dict.fromkeys(("subsystems", "planarSubsystems", "treeSubsystems"), COUNT),
    **dict.fromkeys(("iterations", "factorisations"), COUNT),
    **dict.fromkeys(("scipySteps", "pathSteps", "subdivisions"), COUNT),
    "time": NUMBER,
    "deck": Fields({"path": TEXT, "digest": TEXT}),
    "options": Fields({
        **dict.fromkeys(("scheme", "solver", "reactions"), TEXT),
        **dict.fromkeys(("dt", "tFinal", "outputInterval"), SIZE),
        "every": FIRST,
    }),
    "degreesOfFreedom": Many(dict, INTEGER),
    "checksums": Many(dict, TEXT),
    "nonUniqueReactions": Many(dict, Many(list, TEXT)),
    "warnings": Many(list, TEXT),
    "resumed": Many(list, NUMBER),
    "seconds": Many(dict, NUMBER),
    "extremes": Many(dict, FIGURE),
    "verdict": Fields(
        {"word": WORD, "reasons": Many(list, TEXT), "checks": Many(dict, CHECK)},
        ("word", "reasons", "checks"),
    ),
})  # fmt: skip
"""The shape of ``run.json``, as far as it is read; without ``error``, which may be null."""
ERROR = Fields({
    **dict.fromkeys(("position", "orientation", "until"), NUMBER),
    "trustHorizon": FIGURE,
    "companion": TEXT,
    "complete": FLAG,
})  # fmt: skip


def read_info(folder: Path) -> dict[str, Any]:
    """The content of ``run.json``, empty if the run was killed. Raises ``ResultError``."""
    path = find(folder, INFO)
    if path is None or path.name != INFO:
        return {}
    try:
        info: Any = orjson.loads(path.read_bytes())
    except ValueError as error:
        raise ResultError(f"{shown_path(path)}: not JSON: {error}; {AGAIN}") from error
    faults = list(shape_faults(info, SHAPE))
    if not faults and info.get("error") is not None:
        faults += shape_faults(info["error"], ERROR, "error")
    if faults:
        raise ResultError(f"{shown_path(path)}: {printable(faults[0])}; {AGAIN}")
    return dict(info)


def shape_faults(value: Any, shape: Shape, place: str = "") -> Iterator[str]:
    """Yield the faults of a JSON value at a ``place`` of its file, and of its parts."""
    match shape:
        case Leaf(name, fits):
            if not fits(value):
                yield f"{place} is {_kind(value)}, not {name}"
        case Many(container, of):
            if not isinstance(value, container):
                yield f"{place} is {_kind(value)}, not {_NAMES[container]}"
                return
            parts: Any = value
            for key in parts if container is dict else range(len(parts)):
                yield from shape_faults(parts[key], of, f"{place}.{key}")
        case Fields(of, required):
            if not isinstance(value, dict):
                yield f"{place or 'the file'} is {_kind(value)}, not {_NAMES[dict]}"
                return
            yield from (f"{place} has no {key}" for key in required if key not in value)
            for key in of.keys() & value.keys():
                yield from shape_faults(value[key], of[key], f"{place}.{key}".lstrip("."))


_NAMES = {dict: "an object", list: "a list", str: "a text", type(None): "null"}


def _kind(value: Any) -> str:
    """A JSON value for a message."""
    if isinstance(value, bool):
        return str(value).lower()
    return _NAMES.get(type(value)) or f"the number {value:g}"
