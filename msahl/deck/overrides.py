"""Change numbers of a deck that the option ``--set`` names.

    L=80 cm             the parameter L
    Bob.mass=3          a child of an element, by the tags of its path
    Bob.position.z=2 m  tags between may be omitted: initialConditions here
    simulation.deltaT=0.01
    simulation.stop.when=Crank.angle > 2*pi

A number without unit is in the units that the deck has there. An expression of parameters in braces
may stand in place of a number. What the schema makes a number can be changed, if the deck has it.
"""

import re
from collections.abc import Iterator, Sequence
from copy import deepcopy
from itertools import islice
from typing import NamedTuple, cast

from lxml import etree
from lxml.etree import SubElement

from msahl.algebra.many import Many, Unlike
from msahl.deck.faults import Element, Faults, attribute, text
from msahl.deck.includes import unit_message
from msahl.deck.parameters import evaluate_parameters, unknown_unit
from msahl.deck.schema_types import NUMBERS, types
from msahl.deck.units import parse_unit
from msahl.expressions.dimensions import PURE
from msahl.expressions.syntax import inside_braces, nearest

FORM = re.compile(
    r"\s*(?P<path>[^=]*[^=\s])\s*="
    r"\s*(?P<number>[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|\{[^{}]*\})"
    r"\s*(?P<units>.*?)\s*"
)
STOP_WHEN = "simulation.stop.when="
"""What the condition at which a run stops follows."""
MOST_LISTED = 8
"""Places that a message lists."""
MOST_SEARCHED = 20_000
"""Places that are compared with an unknown one."""


class Varied(NamedTuple):
    """A setting that many models have with numbers of their own: that of the first model, and the
    numbers of all.
    """

    first: str
    numbers: Many


Setting = str | Varied


def varied(settings: Sequence[str]) -> Setting:
    """Return the one setting that stands for those of many models.

    Raises ``Unlike`` if they differ in more than a number.
    """
    if len(set(settings)) == 1:
        return settings[0]
    parts = [FORM.fullmatch(setting) for setting in settings]
    words = {part and (part["path"], part["units"]) for part in parts}
    texts = [part["number"] for part in parts if part and not part["number"].startswith("{")]
    if len(words) != 1 or len(texts) != len(settings):
        raise Unlike
    return Varied(settings[0], Many(map(float, texts)))


class _Number(NamedTuple):
    """A number of the deck: its element, the attribute that holds it ("": the text), the name of
    its record or its first tags, and the tags that follow."""

    element: Element
    attribute: str
    head: str
    tags: tuple[str, ...]

    def __str__(self) -> str:
        return ".".join(filter(None, (self.head, *self.tags)))


def apply_settings(root: Element, settings: Sequence[Setting], faults: Faults) -> None:
    """Change the numbers that ``settings`` name; those that are wrong become faults."""
    for setting in settings:
        text, numbers = setting if isinstance(setting, Varied) else (setting, None)
        message = _apply(root, text, numbers, faults)
        if message:
            faults.add_beside(f"{faults.word}{text}", message)


def _apply(root: Element, setting: str, numbers: Many | None, faults: Faults) -> str:
    """Change one number, to ``numbers`` of many models if these are given, or the condition; return
    what is wrong with the setting. Faults of what it changed name the option, not a line of the
    deck."""
    if setting.startswith(STOP_WHEN):
        _stop_when(root, setting.removeprefix(STOP_WHEN), faults)
        return ""
    match = FORM.fullmatch(setting)
    if match is None or not setting.isprintable():
        return 'write NAME=VALUE, as in L=0.8, "L=80 cm" or Bob.mass=3'
    path, number, units = match["path"], match["number"], match["units"]
    for parameter in root.iterfind("parameters/parameter"):
        if attribute(parameter, "name") == path:
            own = _units(root, parameter)
            if own and not units and not number.startswith("{"):
                units = own
            message = unit_message(units, own)
            found = [_Number(parameter, "", path, ())]
            break
    else:
        message, found = "", list(_found(root, path))
    if len(found) == 1:
        message = message or _write(found[0], number, units)
        if not message:
            faults.options[found[0].element] = f"{faults.word}{setting}"
            if numbers is not None:
                _set_many(found[0], numbers, faults)
        return message
    if not found:
        return _unknown(root, path)
    shown = ", ".join(map(str, found[:MOST_LISTED]))
    more = ", ..." if len(found) > MOST_LISTED else ""
    return f"there are {len(found)} such numbers: {shown}{more}; name one of them"


def _stop_when(root: Element, condition: str, faults: Faults) -> None:
    """Let the run end where a condition becomes true, instead of the deck's own."""
    for simulation in root.iterfind("simulation"):
        stop = simulation.find("stop")
        if stop is None:
            stop = SubElement(simulation, "stop")
        stop.set("when", condition)
        faults.options[stop] = f"{'--stop-when' if faults.word else 'stop_when'} {condition}"


def _units(root: Element, parameter: Element) -> str:
    """Return the units of a parameter: those that the deck gives, or the SI unit of its expression;
    empty for a pure number, or if that is not known for some fault."""
    given = attribute(parameter, "units")
    if given or inside_braces(parameter.text or "") is None:
        return given
    copy = etree.Element("data")
    copy.extend(deepcopy(group) for group in root.iterfind("parameters"))
    has = evaluate_parameters(copy, Faults("")).dimensions.get(attribute(parameter, "name"), PURE)
    return "" if has == PURE else str(has)


def _write(place: _Number, number: str, units: str) -> str:
    """Write a number into its place; return why that is not possible."""
    element = place.element
    if place.attribute:
        if units:
            return "it is a plain number; omit the unit"
        element.set(place.attribute, number)
        return ""
    if units:
        allowed = types().content(element).units
        if allowed and units not in allowed:
            return f"'{units}' is no unit of it; expected one of {', '.join(allowed)}"
        if not allowed and element.tag != "parameter":
            return "it is a plain number; omit the unit"
        if parse_unit(units) is None:
            return unknown_unit(units)
        element.set("units", units)
    element.text = number
    return ""


def _set_many(place: _Number, numbers: Many, faults: Faults) -> None:
    """Give a number its values in many models."""
    if place.attribute:
        raise Unlike
    faults.set_many(place.element, numbers)


def _found(root: Element, path: str) -> Iterator[_Number]:
    """Yield the numbers that a path names."""
    last = path.rpartition(".")[2]
    for number in _numbers(root, last):
        head = f"{number.head}." if number.head else ""
        if path.startswith(head) and _is_part(path[len(head) :].split("."), number.tags):
            yield number


def _is_part(some: Sequence[str], all_tags: Sequence[str]) -> bool:
    """Return whether tags are among others in the same order, the last of both being the same."""
    rest = iter(all_tags)
    return some[-1:] == list(all_tags[-1:]) and all(tag in rest for tag in some)


def _numbers(root: Element, last: str = "") -> Iterator[_Number]:
    """Yield the numbers of a deck outside its parameters; only those whose last tag, or attribute,
    is ``last`` if that is given."""
    if last and not re.fullmatch(r"[A-Za-z_]\w*", last):
        return
    for element in root.iter(last or "*"):
        if types().content(element).is_number and element.tag != "parameter":
            head, tags = _path(element)
            yield _Number(element, "", head, tags)
    for element in cast(list[Element], root.xpath(f"//*[@{last or '*'}]")):
        kinds = types().content(element).attributes
        for name in map(str, element.attrib):
            if kinds.get(name) in NUMBERS and name == (last or name):
                head, tags = _path(element)
                yield _Number(element, name, head, (*tags, name))


def _path(element: Element) -> tuple[str, tuple[str, ...]]:
    """Return the name of the record that an element belongs to and the tags from there; without a
    record "" and the tags from the root."""
    chain = [element, *element.iterancestors()][-2::-1]  # from the child of the root to the element
    tags = tuple(str(step.tag) for step in chain)
    if len(chain) > 2 and tags[0] == "system":
        name = text(chain[2].find("name")) or attribute(chain[2], "name")
        if name:
            return name, tags[3:]
    return "", tags


def _unknown(root: Element, path: str) -> str:
    """Return the message for a path that names no number."""
    numbers = list(islice(_numbers(root), MOST_SEARCHED))
    parameters = [attribute(e, "name") for e in root.iterfind("parameters/parameter")]
    of_one = [str(n) for n in numbers if n.head and f"{path}.".startswith(f"{n.head}.")]
    if of_one:
        shown = nearest(path, of_one)
        return f"the deck has no such number{shown}"
    heads = dict.fromkeys(n.head or n.tags[0] for n in numbers)
    near = nearest(path, [*parameters, *map(str, numbers)])
    if "did you mean" in near:
        return f"the deck has no such number or parameter{near}"
    first = path.partition(".")[0]
    return f"the deck has no element or parameter '{first}'{nearest(first, [*parameters, *heads])}"


class FoundNumber(NamedTuple):
    """A number of an expanded deck: where it is, its value, its unit as the deck gives it ("" if it
    gives none), and as a reader needs it: "SI" if the deck gives none of a number that has one."""

    path: str
    value: float
    units: str
    shown: str


def find_number(root: Element, path: str) -> FoundNumber:
    """Return the number of an expanded deck that ``path`` names, as ``--set`` names it.

    Raises ``LookupError`` with what there is instead.
    """
    for parameter in root.iterfind("parameters/parameter"):
        if attribute(parameter, "name") == path:
            units = attribute(parameter, "units")
            units = "" if units == "1" else units
            return FoundNumber(path, float(parameter.text or ""), units, units)
    found = list(_found(root, path))
    if not found:
        raise LookupError(_unknown(root, path))
    if len(found) > 1:
        shown = ", ".join(map(str, found[:MOST_LISTED]))
        raise LookupError(f"there are {len(found)} such numbers: {shown}; name one of them")
    place = found[0]
    value = place.element.get(place.attribute) if place.attribute else place.element.text
    units = "" if place.attribute else attribute(place.element, "units")
    has_units = not place.attribute and bool(types().content(place.element).units)
    shown = units or ("SI" if has_units else "")
    return FoundNumber(str(place), float(value or ""), units, shown)
