"""Rules about laws: arguments of tables increase, and a curve through the values exists."""

import warnings
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from msahl.algebra.functions import Law, build_laws
from msahl.check.faults import Finding

FEWEST = {"linear": 2, "cubic": 3, "periodic": 4}
"""Entries that a table needs, by its interpolation."""

LENGTHS = {"constant": 1, "sine": 4, "ramp": 4}
"""Numbers of the kinds of law that always have the same number of them."""

CLOSED = 1e-9
"""Share of its range by which the last value of a periodic table may differ from its first."""


def law_findings(law: Law, argument: str = "the argument") -> Iterator[Finding]:
    """Find what is wrong with a law; ``argument`` is what messages call that of a table."""
    found = list(_shape_findings(law)) or list(_value_findings(law, argument))
    if not found and not _is_drawn(closed(law)):
        message = "no curve can be computed through it; space its entries wider or more evenly"
        found = [Finding("", message)]
    yield from found


def closed(law: Law) -> Law:
    """Return a periodic table with its first value for the last, any other law as it is."""
    if law.kind != "periodic":
        return law
    first = law.numbers[len(law.numbers) // 2]
    return replace(law, numbers=(*law.numbers[:-1], first))


def _shape_findings(law: Law) -> Iterator[Finding]:
    """Find an unknown kind of law, and a wrong number of numbers."""
    kind, count = law.kind, len(law.numbers)
    if kind in FEWEST:
        if count % 2:
            yield Finding("entries", f"a {kind} table has {count} numbers; give pairs of them")
        elif count // 2 < FEWEST[kind]:
            message = f"a {kind} table needs {FEWEST[kind]} entries or more; it has {count // 2}"
            yield Finding("entries", message)
    elif kind == "polynomial":
        if not count:
            yield Finding("", "it has no coefficient; give one or more")
    elif kind not in LENGTHS:
        known = ", ".join((*LENGTHS, "polynomial", *FEWEST))
        yield Finding("kind", f"unknown kind of law '{kind}'; expected one of {known}")
    elif count != LENGTHS[kind]:
        yield Finding("", f"a {kind} law has {LENGTHS[kind]} numbers; it has {count}")


def _value_findings(law: Law, argument: str) -> Iterator[Finding]:
    """Find values that make no law of its kind."""
    if law.kind == "sine" and law.numbers[1] == 0.0:
        yield Finding("frequency", "it is zero; give another frequency, or a constant law")
    elif law.kind == "ramp":
        start, end = law.numbers[2:]
        if not end > start:
            message = f"it ends at {end:g} s, not after its start at {start:g} s; give a later end"
            yield Finding("", message)
    elif law.kind in FEWEST:
        yield from _table_findings(law, argument)


def _table_findings(law: Law, argument: str) -> Iterator[Finding]:
    """Find arguments of a table that do not increase, and a periodic table that does not close."""
    half = len(law.numbers) // 2
    x, y = law.numbers[:half], law.numbers[half:]
    for k, (before, here) in enumerate(pairwise(x), start=2):
        if not here > before:
            message = f"{argument} must increase; {here:g} follows {before:g} (SI)"
            yield Finding(f"entry[{k}]", message)
    if law.kind == "periodic" and abs(y[-1] - y[0]) > CLOSED * (max(y) - min(y)):
        message = (
            f"a periodic table ends with the value it begins with; {y[0]:.9g} and {y[-1]:.9g} "
            "differ, add an entry that closes it"
        )
        yield Finding(f"entry[{half}]", message)


def _is_drawn(law: Law) -> bool:
    """Return whether the curve can be computed: it cannot through entries 1e-90 apart."""
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings(action="error"):
            numbers = build_laws([law]).numbers
    except (np.linalg.LinAlgError, RuntimeWarning, ValueError):  # scipy, where no spline exists
        return False
    return bool(np.isfinite(numbers).all())
