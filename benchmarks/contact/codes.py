"""The codes that are measured on scenes with contact, and where their runs are kept."""

from collections.abc import Iterator

from benchmarks import ours
from benchmarks.contact.peers import PEERS
from benchmarks.curves import LARGEST_ORDER, Code
from benchmarks.mechanisms.store import Kept, Refused, codes_of
from benchmarks.problems import Problem
from msahl.model.scheme import order_of

SCHEMES = ("preserving", "gauss2", "gauss3")
"""Of msahl, beside the one that takes a tolerance."""


def codes(problem: Problem) -> Iterator[Code | Refused]:
    """Every code, in the order in which they are measured."""
    for scheme in SCHEMES:
        yield Code(f"msahl {scheme}", ours, order_of(scheme))
    for name in ours.BY_TOLERANCE:
        yield Code(name, ours, LARGEST_ORDER, controlled=True)
    yield from codes_of(PEERS.values(), problem)


KEPT = Kept("contact", "scene", codes)
