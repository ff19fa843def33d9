"""Choose the graphs of a run: what the deck defines, motion, reactions, energies and errors.

There is one group of each kind. A group without graphs has the reason in its note.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from msahl.joints.coordinates import ORIENTATION, SUFFIXES, coordinates, is_angle
from msahl.post.defined_graphs import (
    amplitude_graphs,
    drive_graphs,
    group_graphs,
    marker_graphs,
    signal_graphs,
    zero_note,
)
from msahl.post.graph_data import Graph, Group
from msahl.post.metrics import Metrics
from msahl.post.view.happenings import marks
from msahl.records import record
from msahl.results.read import ResultError, Run
from msahl.run.tables import JOINTS

AXES = "xyz"
NEGLIGIBLE = 1e-9
"""A component below this fraction of the largest has no graph; a note says so."""

Curves = tuple[tuple[str, np.ndarray], ...]


@record
class Choice:
    """What to draw: a ``plane`` (two of x, y, z; empty: the one with the widest paths), and the
    names of ``bodies`` (empty: all; of a beam its node that moves farthest) and ``joints`` (empty:
    all)."""

    plane: str = ""
    bodies: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()


def chosen_bodies(run: Run, choice: Choice) -> list[str]:
    """Return the names of the bodies to draw. Raises ``ResultError`` if one is not in the model."""
    names = tuple(body.name for body in run.model.shown_bodies)
    inner = set() if choice.bodies else _inner_nodes(run)
    picked = _pick("body", names, choice.bodies)
    return [names[i] for i in picked if names[i] not in inner]


def _inner_nodes(run: Run) -> set[str]:
    """Return the nodes of beams but that of each which moves farthest: a deck defines none."""
    inner: set[str] = set()
    for beam in run.model.beams:
        columns = [f"{node}.{axis}" for node in beam.nodes for axis in AXES]
        spans = np.ptp(run.states[columns].to_numpy(), axis=0).reshape(-1, 3)
        farthest = beam.nodes[int(np.argmax(np.linalg.norm(spans, axis=1)))]
        inner |= set(beam.nodes) - {farthest}
    return inner


def chosen_elements(metrics: Metrics, choice: Choice) -> list[int]:
    """Return the indices of the joints, couplings and motions to draw. Raises ``ResultError`` if
    one is not in the model."""
    return _pick("joint", metrics.constraints.names, choice.joints)


def _pick(kind: str, names: tuple[str, ...], wanted: tuple[str, ...]) -> list[int]:
    """Return the indices of the wanted names; of all names if none is wanted."""
    for name in wanted:
        if name not in names:
            listed = ", ".join(names) or "none"
            raise ResultError(f"no {kind} '{name}' in the model (it has: {listed})")
    return [i for i, name in enumerate(names) if not wanted or name in wanted]


def _named(names: Sequence[str], values: np.ndarray) -> Curves:
    """Return the columns of ``values`` (m, k) with their names; without those that are all nan."""
    pairs = zip(names, values.T, strict=True)
    return tuple((name, column) for name, column in pairs if not np.isnan(column).all())


def _components(
    time: np.ndarray, names: Sequence[str], titles: Sequence[str], vectors: np.ndarray
) -> tuple[list[Graph], list[str]]:
    """Return the graphs of the components of ``vectors`` (m, k, 3) that are not negligible, and the
    titles of the others; nothing if there are no vectors."""
    sizes = np.nan_to_num(np.abs(vectors)).max(axis=(0, 1), initial=0.0)
    shown = [axis for axis in range(3) if sizes[axis] > NEGLIGIBLE * sizes.max()]
    graphs = [Graph(titles[axis], time, _named(names, vectors[:, :, axis])) for axis in shown]
    known = not np.isnan(vectors).all()
    zeros = [titles[a].partition(" ")[0] for a in range(3) if a not in shown] if known else []
    return graphs, zeros


def _positions(run: Run, metrics: Metrics, choice: Choice) -> Group:
    names = chosen_bodies(run, choice)
    points = [run.states[[f"{name}.{axis}" for name in names]].to_numpy() for axis in AXES]
    titles = [f"{axis} [m]" for axis in AXES]
    graphs, zeros = _components(run.time, names, titles, np.stack(points, axis=2))
    return Group("Positions of reference points", tuple(graphs), zero_note(zeros))


def _defined(
    title: str, graphs_of: Callable[[Run], tuple[list[Graph], str]]
) -> Callable[[Run, Metrics, Choice], Group]:
    """Return the function that makes a group of the graphs of what a deck defines."""

    def group(run: Run, metrics: Metrics, choice: Choice) -> Group:
        found, note = graphs_of(run)
        return Group(title, tuple(found), note)

    return group


def _joints(run: Run, metrics: Metrics, choice: Choice) -> Group:
    """Return the coordinates of joints and their rates, by unit; orientations have no graph."""
    table = run.others.get(JOINTS)
    found: dict[str, list[str]] = {}
    for joint in run.model.joints if table is not None else ():
        for name in coordinates(joint):
            if name != ORIENTATION and (not choice.joints or joint.name in choice.joints):
                unit = "rad" if is_angle(name) else "m"
                found.setdefault(unit, []).append(f"{joint.name}.{name}")
    graphs = []
    for unit, names in found.items():
        assert table is not None
        what = "angle" if unit == "rad" else "displacement"
        for title, end in ((f"{what} [{unit}]", ""), (f"rate of {what} [{unit}/s]", SUFFIXES[1])):
            values = table[[name + end for name in names]].to_numpy()
            graphs.append(Graph(title, run.time, _named(names, values)))
    lacks = "" if graphs else "joints.csv has no angle and no displacement"
    return Group("Coordinates of joints", tuple(graphs), lacks)


def _reactions(run: Run, metrics: Metrics, choice: Choice) -> Group:
    found, picked = metrics.reactions, chosen_elements(metrics, choice)
    names = [found.names[e] for e in picked]
    graphs: list[Graph] = []
    zeros: list[str] = []
    for what, letter, unit, every in (
        ("force", "F", "N", found.force),
        ("moment", "M", "N m", found.moment),
    ):
        vectors = every[:, picked]
        titles = [f"{letter}{axis} [{unit}]" for axis in AXES]
        parts, zero = _components(run.time, names, titles, vectors)
        zeros += zero
        # A force that is zero has a graph, so that a reader sees that it is.
        if parts or (unit == "N" and zero):
            norm = np.hypot(np.hypot(vectors[:, :, 0], vectors[:, :, 1]), vectors[:, :, 2])
            graphs.append(Graph(f"{what}, magnitude [{unit}]", run.time, _named(names, norm)))
        graphs += parts
    for unit, load in zip(("N", "N m"), np.moveaxis(found.load[:, picked], 2, 0), strict=True):
        if curves := _named(names, load):
            graphs.append(Graph(f"load [{unit}]", run.time, curves))
    when = "at the output times" if run.instantaneous else "mean over each step"
    loads = ", and loads of motions" if np.isfinite(found.load[:, picked]).any() else ""
    note = " ".join(filter(None, (_not_unique(metrics, picked), zero_note(zeros))))
    if not graphs:
        note = "the model has no joints"
    return Group(f"Reactions of joints on the child, {when}{loads}", tuple(graphs), note)


def _not_unique(metrics: Metrics, picked: Sequence[int]) -> str:
    found = metrics.reactions
    listed = [f"{found.names[e]} ({', '.join(c)})" for e in picked if (c := found.not_unique[e])]
    return f"Not unique, because joints are redundant: {'; '.join(listed)}." if listed else ""


def _energy(run: Run, metrics: Metrics, choice: Choice) -> Group:
    energy, largest = metrics.energy, metrics.energy.largest_kinetic
    curves = [("kinetic", energy.kinetic), ("potential", energy.potential.sum(axis=1))]
    if energy.elastic.any():
        curves.append(("elastic", energy.elastic))
    curves.append(("total", energy.total))
    if metrics.loads.names:
        curves += [("work on the system", energy.work), ("total - work", energy.balance)]
    title = "|balance error| over max KE [-]" if largest else "|balance error| [J]"
    error = (("balance error", energy.error / (largest or 1.0)),)
    graphs = (
        Graph("energy [J]", energy.time, tuple(curves), broken=True),
        Graph(title, energy.time, error, log=True),
    )
    return Group("Energies", graphs)


def _error(run: Run, metrics: Metrics, choice: Choice) -> Group:
    title = "Estimated global error, largest of all bodies"
    if run.errors is None or len(run.errors) < 2:
        return Group(title, (), "the error of the run was not estimated")
    names = ("position", "orientation (angle times length)")
    curves = _named(names, run.errors.to_numpy()[:, 1 : 1 + len(names)])
    graph = Graph("estimated error [m]", run.errors["time"].to_numpy(), curves, log=True)
    return Group(title, (graph,))


def _constraints(run: Run, metrics: Metrics, choice: Choice) -> Group:
    found, picked = metrics.constraints, chosen_elements(metrics, choice)
    names = [found.names[e] for e in picked]
    graphs = tuple(
        Graph(f"{words} [{unit}]", found.time, curves, log=True)
        for words, values, units in (
            ("position level", found.violation, ("m", "rad")),
            ("velocity level", found.rate, ("m/s", "rad/s")),
        )
        for unit, series in zip(units, np.moveaxis(values[:, picked], 2, 0), strict=True)
        if (curves := _named(names, series))
    )
    return Group("Constraint violation", graphs, "" if graphs else "the model has no joints")


def _work(run: Run, metrics: Metrics, choice: Choice) -> Group:
    title, work = "Virtual work of joints over each step", metrics.work
    picked = [k for k in chosen_elements(metrics, choice) if k < metrics.joints]
    if not metrics.joints:
        return Group(title, (), "the model has no joints")
    if work is None:
        return Group(title, (), "virtual work needs the states and mean reactions of every step")
    if not picked:
        return Group(title, (), "couplings and motions have no virtual work")
    names = [work.joints[k] for k in picked]
    graphs = [
        Graph(label, work.time, _named(names, values[:, picked]), log=log)
        for label, values, log in (
            ("Hainge's virtual work [J]", work.hainge, False),
            ("|work of the reaction| [J]", work.reaction, True),
        )
    ]
    return Group(title, tuple(graphs))


GRAPHS: dict[str, Callable[[Run, Metrics, Choice], Group]] = {
    "drives": _defined("Loads of the drives", drive_graphs),
    "signals": _defined("Actuators and signals", signal_graphs),
    "markers": _defined("Markers", marker_graphs),
    "groups": _defined("Groups of bodies", group_graphs),
    "amplitudes": _defined("Amplitudes of elastic bodies", amplitude_graphs),
    "joints": _joints,
    "positions": _positions,
    "reactions": _reactions,
    "energy": _energy,
    "error": _error,
    "constraints": _constraints,
    "work": _work,
}
"""The groups of graphs by their kind, which is the name of their picture: first what the deck
defines."""


def groups(
    run: Run, metrics: Metrics, kinds: Sequence[str], choice: Choice | None = None
) -> Iterator[Group]:
    """Yield the groups of ``kinds`` that have graphs."""
    for kind in kinds:
        group = GRAPHS[kind](run, metrics, choice or Choice())
        if group.graphs:
            graphs = tuple(_marked(graph, run) for graph in group.graphs)
            yield Group(group.title, graphs, group.note, kind)


def _marked(graph: Graph, run: Run) -> Graph:
    """Return a graph over time with the times of events."""
    over_time = graph.x_title == "time [s]" and run.events is not None
    return replace(graph, marks=tuple(marks(run.events))) if over_time else graph
