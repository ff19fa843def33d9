"""Put interactive graphs into a page: many small ones, drawn by uPlot from thinned data."""

from base64 import b64encode
from collections.abc import Sequence

import numpy as np

from msahl.post.graph_data import MOST_DECADES, Graph, Group, thinned
from msahl.post.page.markup import Markup, element, join
from msahl.post.page.parts import Part

MOST_CURVES = 8
"""Curves of a graph; of more the ones that vary most are drawn."""
LARGEST = 3e38
"""Values are stored in single precision: this is the largest."""
LOOKS = 7
"""Colours of curves (``--series-1`` to ``--series-7``); then they repeat with another dash."""
DATA = "graphs"


def graphs(groups: Sequence[Group], data: str = DATA) -> Part:
    """Return groups of graphs as a part of a page; ``data`` is the id of their data.

    All graphs over time share the cursor and the zoom.
    """
    records: list[dict[str, object]] = []
    markup = [_group(group, data, records) for group in groups if group.graphs]
    if not markup:
        return Part(Markup(""))
    return Part(
        join(markup), ("uplot.min.css", "graphs.css"), ("graphs.js",), ("uplot",), {data: records}
    )


def _group(group: Group, data: str, records: list[dict[str, object]]) -> Markup:
    shown = [_chosen(graph) for graph in group.graphs]
    names = [tuple(name for name, _ in curves) for curves, _ in shown]
    shared = len(set(names)) == 1
    places = []
    for graph, (curves, more), listed in zip(group.graphs, shown, names, strict=True):
        is_titled = len(listed) == 1 and graph.title.startswith(listed[0])
        legend = [] if shared or is_titled else [_legend(listed, more)]
        place = element(
            "div",
            class_="plot",
            role="img",
            aria_label=f"Graph: {graph.title} over {graph.x_title} of {', '.join(listed)}",
            data_graphs=data,
            data_graph=len(records),
        )
        places.append(element("div", element("h4", graph.title), legend, place, class_="graph"))
        records.append(_record(graph, curves))
    heading = [element("h3", group.title)]
    if shared:
        heading.append(_legend(names[0], shown[0][1]))
    note = [element("p", group.note, class_="note")] if group.note else []
    return element(
        "section",
        element("div", heading, class_="history-head"),
        note,
        element("div", places, class_="graphs pairs" if len(places) == 4 else "graphs"),
        class_="graph-group",
    )


def _legend(names: Sequence[str], more: int) -> Markup:
    """Return the legend: buttons that hide and show a curve."""
    if len(names) < 2 and not more:
        return element("ul", element("li", names[0]), class_="legend") if names else Markup("")
    items = [
        element(
            "li",
            element(
                "button",
                element("span", class_=f"swatch look-{i % LOOKS + 1} dash-{i // LOOKS}"),
                name,
                type="button",
                data_curve=i,
                aria_pressed="true",
            ),
        )
        for i, name in enumerate(names)
    ]
    if more:
        items.append(element("li", f"and {more} more that vary less"))
    return element("ul", items, class_="legend")


def _chosen(graph: Graph) -> tuple[list[tuple[str, np.ndarray]], int]:
    """Return the curves to draw in their order, and the number of the others."""
    more = len(graph.curves) - MOST_CURVES
    if more <= 0:
        return list(graph.curves), 0
    spans = [_span(values) for _, values in graph.curves]
    kept = sorted(range(len(spans)), key=lambda i: -spans[i])[:MOST_CURVES]
    return [graph.curves[i] for i in sorted(kept)], more


def _span(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if finite.size else 0.0


def _record(graph: Graph, curves: Sequence[tuple[str, np.ndarray]]) -> dict[str, object]:
    """Return what ``graphs.js`` draws."""
    few = [thinned(graph.x, np.abs(series) if graph.log else series) for _, series in curves]
    x, values = few[0][0], np.array([series for _, series in few], dtype=float)
    values[~np.isfinite(values)] = np.nan
    log = graph.log and bool((values > 0.0).any())
    if log:
        least = max(float(values[values > 0.0].min()), float(np.nanmax(values)) / 10**MOST_DECADES)
        values = np.fmax(values, least) + 0.0 * values  # nan stays
    return {
        "x": _packed(x),
        "xTitle": graph.x_title,
        "log": log,
        "curves": [
            {"name": name, "values": _packed(series)}
            for (name, _), series in zip(curves, values, strict=True)
        ],
    } | ({"marks": [{"time": t, "name": name} for t, name in graph.marks]} if graph.marks else {})


def _packed(values: np.ndarray) -> str:
    """Return values in single precision as base64."""
    single = np.clip(values, -LARGEST, LARGEST).astype("<f4")
    return b64encode(single.tobytes()).decode()
