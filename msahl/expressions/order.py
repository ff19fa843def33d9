"""The order in which named expressions can be evaluated, and circles among them."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from graphlib import CycleError, TopologicalSorter

MOST_SHOWN = 10
"""Names of a circle that a message lists."""


def in_order(graph: Mapping[str, set[str]]) -> tuple[list[str], list[list[str]]]:
    """Return the names that lead to no circle, each after those it depends on, and the circles: one
    that each other name leads to. ``graph`` has for each name those it depends on. The first name
    of a circle is its last as well.
    """
    sorter, order = TopologicalSorter(graph), list[str]()
    with suppress(CycleError):  # what leads to no circle is found nevertheless
        sorter.prepare()
    while sorter.is_active():
        ready = sorter.get_ready()
        order += ready
        sorter.done(*ready)
    rest = graph.keys() - set(order)
    return order, list(_circles({name: graph[name] & rest for name in graph if name in rest}))


def shown_circle(circle: list[str]) -> str:
    """Return a circle for a message."""
    return " -> ".join(circle[:MOST_SHOWN]) + (" -> ..." if len(circle) > MOST_SHOWN else "")


def _circles(graph: Mapping[str, set[str]]) -> Iterator[list[str]]:
    """Yield circles of a graph in which every node has a successor."""
    seen: set[str] = set()
    for start in graph:
        path: dict[str, None] = {}
        node = start
        while node not in seen:
            seen.add(node)
            path[node] = None
            node = min(graph[node])
        if node in path:
            names = list(path)
            yield [*names[names.index(node) :], node]
