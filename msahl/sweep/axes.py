"""Axes of a sweep: what is varied, from the texts of ``--set`` and ``--over``.

    Bob.mass=1,2,5           values of a list
    L=60:100:5 cm            5 values from 60 to 100 cm, both ends included
    k=1e2:1e6:5:log          5 values in geometric progression
    L={a/2},{a}              expressions of the deck's parameters
    L~uniform(4,6)           a distribution that samples are drawn from
    dt=0.1,0.01              (--over) values of an option of msahl run

A unit behind the last value of a list belongs to all its values that have none of their own.
Numbers without unit are in the units that the deck has there, as for ``msahl run --set``.
"""

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

from msahl.deck.overrides import STOP_WHEN
from msahl.records import record
from msahl.run.options import OPTIONS, Choice, Flag, Integer, Number, Option
from msahl.sweep.faults import PlanError

NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
VALUE = re.compile(rf"(?P<number>{NUMBER}|\{{[^{{}}]*\}})\s*(?P<unit>[^\s,:{{}}][^,:{{}}]*)?")
RANGE = re.compile(
    rf"(?P<first>{NUMBER}):(?P<last>{NUMBER}):(?P<count>[0-9]+)(?P<log>:log)?"
    r"\s*(?P<unit>[^\s,:{}][^,:{}]*)?"
)
DRAWN = re.compile(r"(?P<kind>\w+)\((?P<numbers>[^()]*)\)\s*(?P<unit>.*)")
ONE_NUMBER = re.compile(NUMBER)
EVEN_DIGITS, ROUND_OFF = 13, 4.0 * 2.0**-52
"""Digits of a number that somebody would write, and how far a range may miss it, relative to it."""
MOST_VALUES = 10_000_000
"""Most values of a range."""
DISTRIBUTIONS = {
    "uniform": ("least", "most"),
    "loguniform": ("least", "most"),
    "normal": ("mean", "standard deviation"),
    "truncnormal": ("mean", "standard deviation", "least", "most"),
    "lognormal": ("mean of the logarithm", "standard deviation of the logarithm"),
    "triangular": ("least", "most frequent", "most"),
}
"""Distributions, with the meaning of their numbers."""
BY_NAME = {option.name: option for option in OPTIONS}


@record
class Distribution:
    """A distribution of one number: its ``kind`` (see ``DISTRIBUTIONS``) and its numbers."""

    kind: str
    numbers: tuple[float, ...]

    def __str__(self) -> str:
        return f"{self.kind}({', '.join(map(number_text, self.numbers))})"


@record
class Column:
    """A column of a plan: a number of the deck, or with ``option`` an option of a run.

    ``unit`` is that of all cells; cells have their own where it is empty.
    """

    name: str
    unit: str = ""
    option: bool = False

    @property
    def head(self) -> str:
        """The head of the column in ``plan.csv`` and ``runs.csv``, such as ``L [cm]``, ``--dt``."""
        if self.option:
            return BY_NAME[self.name].flag
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    @classmethod
    def of_head(cls, head: str) -> "Column":
        """Return the column with this head; raises ``PlanError`` if there is no such option."""
        head = head.strip()
        if head.startswith("--"):
            return cls(option_named(head.removeprefix("--")).name, option=True)
        match = re.fullmatch(r"(.*\S)\s*\[\s*([^][]+?)\s*\]", head)
        return cls(match[1], match[2]) if match else cls(head)

    def fault(self, cell: str) -> str:
        """Return what is wrong with the text of a cell; empty if nothing is. An empty cell leaves
        the deck's value, or the option's default."""
        if not cell:
            return ""
        if self.option:
            return option_fault(BY_NAME[self.name], cell)
        if self.is_condition:
            return ""
        match = VALUE.fullmatch(cell)
        if match is None:
            return f"{self.head}: '{cell}' is not a number"
        if match["unit"] and self.unit:
            return f"{self.head}: '{cell}' has a unit, and so has its column; omit one of them"
        return ""

    @property
    def is_condition(self) -> bool:
        """Whether cells are conditions of the motion at which a run ends."""
        return not self.option and f"{self.name}=" == STOP_WHEN

    def setting(self, cell: str) -> str:
        """Return a cell as ``msahl run --set`` takes it."""
        return f"{self.name}={cell}{' ' if self.unit else ''}{self.unit}"

    def option_value(self, cell: str) -> Any:
        """Return a cell as the value of its option."""
        kind = BY_NAME[self.name].kind
        if isinstance(kind, Number):
            return float(cell)
        if isinstance(kind, Integer):
            return int(float(cell))
        return cell == "yes" if isinstance(kind, Flag) else cell


@record
class Axis:
    """What is varied: a column, with the cells of a list or with a distribution."""

    column: Column
    cells: tuple[str, ...] = ()
    distribution: Distribution | None = None

    def __str__(self) -> str:
        name = f"--{self.column.name}" if self.column.option else self.column.name
        unit = f" {self.column.unit}" if self.column.unit else ""
        if self.distribution:
            return f"{name} ~ {self.distribution}{unit}"
        count = len(self.cells)
        listed = self.cells if count <= 12 else (*self.cells[:6], "...", *self.cells[-3:])
        values = "1 value" if count == 1 else f"{count} values"
        return f"{name} = {', '.join(listed)}{unit} ({values})"


def number_text(value: float) -> str:
    """Return the shortest text of a number that reads back to the same double."""
    text = repr(float(value))
    return text.removesuffix(".0")


def even_text(value: float) -> str:
    """Return the text of a number of a range: 0.3 in place of 0.30000000000000004, which differs
    from it by the round-off of the division into steps."""
    even = float(f"{value:.{EVEN_DIGITS}g}")
    return number_text(even if abs(even - value) <= ROUND_OFF * abs(value) else value)


def parse_set(text: str) -> Axis:
    """Return the axis that ``--set`` describes; raises ``PlanError``."""
    name, sign, rest = _split(text, "--set")
    if sign == "~":
        distribution, unit = _distribution(rest, f"--set {text}")
        return Axis(Column(name, unit), distribution=distribution)
    if f"{name}=" == STOP_WHEN:
        return Axis(Column(name), (rest,))
    cells, unit = _values(rest, f"--set {text}")
    return Axis(Column(name, unit), cells)


def parse_over(text: str) -> Axis:
    """Return the axis that ``--over`` describes; raises ``PlanError``."""
    name, sign, rest = _split(text, "--over")
    option = option_named(name.removeprefix("--"))
    where = f"--over {text}"
    column = Column(option.name, option=True)
    if sign == "~":
        if not isinstance(option.kind, Number):
            raise PlanError(f"{where}: only numbers have distributions")
        distribution, unit = _distribution(rest, where)
        _require(not unit, f"{where}: omit the unit; {option.flag} is in {option.kind.unit}")
        return Axis(column, distribution=distribution)
    if isinstance(option.kind, Number | Integer):
        cells, unit = _values(rest, where)
        _require(not unit, f"{where}: omit the unit '{unit}'")
    else:
        cells = tuple(part.strip() for part in rest.split(","))
    faults = [f"{where}: {fault}" for cell in cells if (fault := option_fault(option, cell))]
    if faults:
        raise PlanError(*faults)
    return Axis(column, cells)


def option_named(name: str) -> Option:
    """Return the option of a run with this name; raises ``PlanError`` if there is none."""
    option = BY_NAME.get(name.strip().replace("-", "_"))
    if option is None:
        known = ", ".join(option.flag for option in OPTIONS)
        raise PlanError(f"there is no option '--{name}' of a run; expected one of {known}")
    return option


def option_fault(option: Option, cell: str) -> str:
    """Return why a text is no value of an option; empty if it is one."""
    kind = option.kind
    if isinstance(kind, Choice):
        words: Sequence[str] = kind.words
    elif isinstance(kind, Flag):
        words = ("yes", "no")
    else:
        return _number_fault(option, cell)
    return "" if cell in words else f"{option.flag}: '{cell}' is not one of {', '.join(words)}"


def _number_fault(option: Option, cell: str) -> str:
    if not ONE_NUMBER.fullmatch(cell):
        return f"{option.flag}: '{cell}' is not a number"
    value, kind = float(cell), option.kind
    if not math.isfinite(value):
        return f"{option.flag}: {cell} is not a finite number"
    if isinstance(kind, Integer):
        if value != int(value) or not kind.least <= value <= kind.most:
            return f"{option.flag}: {cell} is not an integer from {kind.least} to {kind.most}"
    elif isinstance(kind, Number):
        low = kind.least is not None and (
            value <= kind.least if kind.positive else value < kind.least
        )
        if low or (kind.most is not None and value > kind.most):
            return f"{option.flag}: {cell} is out of range"
    return ""


def _split(text: str, option: str) -> tuple[str, str, str]:
    """Return the name, the sign (= or ~) and what follows it."""
    match = re.fullmatch(r"\s*([^=~]*[^=~\s])\s*([=~])\s*(.*?)\s*", text)
    if match is None or not match[3] or not text.isprintable():
        example = "dt=0.1,0.01" if option == "--over" else "L=0.5,1,2 or L=1:10:5 or L~uniform(4,6)"
        raise PlanError(f"{option} {text}: write NAME=VALUES, such as {example}")
    return match[1], match[2], match[3]


def _values(text: str, where: str) -> tuple[tuple[str, ...], str]:
    """Return the cells of a list and the unit that all of them have; if their units differ, they
    stand in the cells."""
    parts = list(_parts(text))
    found: list[tuple[list[str], str]] = []
    for part in parts:
        ranged, single = RANGE.fullmatch(part), VALUE.fullmatch(part)
        if ranged:
            found.append((_range(ranged, where), (ranged["unit"] or "").strip()))
        elif single:
            number = single["number"]
            if not number.startswith("{"):
                _require(math.isfinite(float(number)), f"{where}: {number} is too large")
                number = number_text(float(number))
            found.append(([number], (single["unit"] or "").strip()))
        else:
            raise PlanError(
                f"{where}: '{part}' is not a value; write a number, with its unit if it has one, a "
                "range such as 1:10:5 (first:last:count), or an expression in braces"
            )
    last = found[-1][1]
    units = {unit or last for _, unit in found}
    if len(units) == 1:
        return tuple(cell for cells, _ in found for cell in cells), last
    return tuple(f"{cell} {unit or last}".strip() for cells, unit in found for cell in cells), ""


def _parts(text: str) -> Iterator[str]:
    """Yield the parts of a list between commas that are not in braces."""
    for part in re.split(r",(?![^{]*\})", text):
        yield part.strip()


def _range(match: re.Match[str], where: str) -> list[str]:
    first, last, count = float(match["first"]), float(match["last"]), int(match["count"])
    _require(count >= 1, f"{where}: a range has at least one value; write first:last:count")
    _require(count > 1 or first == last, f"{where}: a range of one value has no two ends")
    _require(count <= MOST_VALUES, f"{where}: more than {MOST_VALUES} values")
    _require(math.isfinite(first) and math.isfinite(last), f"{where}: a number is too large")
    import numpy as np  # which the start of other commands does without

    if match["log"]:
        _require(first > 0.0 and last > 0.0, f"{where}: the ends of a :log range are positive")
        values = np.geomspace(first, last, count)
    else:
        values = np.linspace(first, last, count)
    return [even_text(float(value)) for value in values]


def _distribution(text: str, where: str) -> tuple[Distribution, str]:
    """Return the distribution that a text such as ``normal(2, 0.1) kg`` names, and its unit."""
    match = DRAWN.fullmatch(text)
    listed = ", ".join(DISTRIBUTIONS)
    if match is None or match["kind"] not in DISTRIBUTIONS:
        raise PlanError(f"{where}: '{text}' is no distribution; expected one of {listed}")
    kind, names = match["kind"], DISTRIBUTIONS[match["kind"]]
    texts = [part.strip() for part in match["numbers"].split(",")]
    if len(texts) != len(names) or not all(map(ONE_NUMBER.fullmatch, texts)):
        raise PlanError(f"{where}: {kind} takes {len(names)} numbers: {', '.join(names)}")
    numbers = tuple(map(float, texts))
    fault = _distribution_fault(kind, numbers)
    if fault:
        raise PlanError(f"{where}: {fault}")
    return Distribution(kind, numbers), match["unit"].strip()


def _distribution_fault(kind: str, numbers: tuple[float, ...]) -> str:
    if not all(map(math.isfinite, numbers)):
        return "a number is too large"
    if kind in ("normal", "truncnormal", "lognormal") and numbers[1] <= 0.0:
        return "the standard deviation is positive"
    ends = {"truncnormal": numbers[2:], "triangular": numbers[::2]}.get(kind, numbers)
    if kind not in ("normal", "lognormal") and not ends[0] < ends[1]:
        return "the least value is smaller than the most"
    if kind == "loguniform" and numbers[0] <= 0.0:
        return "the least value of loguniform is positive"
    if kind == "triangular" and not numbers[0] <= numbers[1] <= numbers[2]:
        return "the most frequent value is between the least and the most"
    return ""


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise PlanError(message)
