"""A ratio asked for, and what came of it."""

from collections.abc import Iterable
from typing import NamedTuple


class Verdict(NamedTuple):
    what: str
    asked: str
    measured: str
    met: bool


def table_of_verdicts(verdicts: Iterable[Verdict]) -> str:
    lines = ["| what | asked | measured | met? |", "|---|---|---|---|"]
    for v in verdicts:
        met = "yes" if v.met else "**no**"
        lines.append(f"| {v.what} | {v.asked} | {v.measured} | {met} |")
    return "\n".join(lines)
