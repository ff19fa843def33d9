"""Choose the graphs of a run's page: time histories of motion, reactions, energies and errors."""

from collections.abc import Iterator, Sequence

import numpy as np

from msahl.joints.coordinates import ORIENTATION, SUFFIXES, coordinates, is_angle
from msahl.post.metrics import Metrics
from msahl.post.page.graphs import Graph, Group
from msahl.results.read import Run
from msahl.run.tables import JOINTS

AXES = "xyz"
NEGLIGIBLE = 1e-9
"""A component below this fraction of the largest has no graph; a note says so."""

Curves = tuple[tuple[str, np.ndarray], ...]


def histories(run: Run, metrics: Metrics) -> list[Group]:
    """Return the graphs of positions, joint coordinates, reactions, loads and energies."""
    groups = [_positions(run, metrics), _joints(run), _reactions(run, metrics), _energies(metrics)]
    return [group for group in groups if group.graphs]


def diagnostics(run: Run, metrics: Metrics) -> list[Group]:
    """Return the graphs of errors: global error, energy balance, constraint violation, work."""
    groups = [_errors(run, metrics), _violations(metrics), _work(metrics)]
    return [group for group in groups if group.graphs]


def _named(names: Sequence[str], values: np.ndarray) -> Curves:
    """Return the columns of ``values`` (m, k) with their names; without those that are all nan."""
    pairs = zip(names, values.T, strict=True)
    return tuple((name, column) for name, column in pairs if not np.isnan(column).all())


def _positions(run: Run, metrics: Metrics) -> Group:
    names = metrics.energy.bodies
    points = [run.states[[f"{n}.{axis}" for n in names]].to_numpy() for axis in AXES]
    sizes = [float(np.abs(values).max()) for values in points]
    shown = [i for i in range(3) if sizes[i] > NEGLIGIBLE * max(sizes)]
    graphs = tuple(Graph(f"{AXES[i]} [m]", run.time, _named(names, points[i])) for i in shown)
    zero = " and ".join(AXES[i] for i in range(3) if i not in shown)
    note = f"{zero} {'is' if len(zero) == 1 else 'are'} zero up to rounding." if zero else ""
    return Group("Positions of reference points", graphs, note)


def _joints(run: Run) -> Group:
    """Return the coordinates of joints and their rates, by unit; orientations have no graph."""
    table = run.others.get(JOINTS)
    found: dict[str, list[str]] = {}
    for joint in run.model.joints if table is not None else ():
        for name in coordinates(joint):
            if name != ORIENTATION:
                unit = "rad" if is_angle(name) else "m"
                found.setdefault(unit, []).append(f"{joint.name}.{name}")
    graphs = []
    for unit, names in found.items():
        assert table is not None
        what = "angle" if unit == "rad" else "displacement"
        values = table[names].to_numpy()
        rates = table[[f"{name}{SUFFIXES[1]}" for name in names]].to_numpy()
        graphs.append(Graph(f"{what} [{unit}]", run.time, _named(names, values)))
        graphs.append(Graph(f"rate of {what} [{unit}/s]", run.time, _named(names, rates)))
    return Group("Coordinates of joints", tuple(graphs))


def _reactions(run: Run, metrics: Metrics) -> Group:
    found = metrics.reactions
    listed = zip(found.names, found.not_unique, strict=True)
    not_unique = [f"{name} ({', '.join(columns)})" for name, columns in listed if columns]
    note = (
        f"Not unique, because joints are redundant: {'; '.join(not_unique)}." if not_unique else ""
    )
    force, moment = (_norms(part) for part in (found.force, found.moment))
    panels = [
        ("force, magnitude [N]", force),
        ("moment, magnitude [N m]", moment),
        ("load [N]", found.load[:, :, 0]),
        ("load [N m]", found.load[:, :, 1]),
    ]
    graphs = [
        Graph(title, run.time, _named(found.names, values))
        for title, values in panels
        if np.nan_to_num(values).any()
    ]
    of = "at the output times" if run.instantaneous else "mean over each step"
    loads = ", and loads of motions" if np.isfinite(found.load).any() else ""
    return Group(f"Reactions of joints on the child, {of}{loads}", tuple(graphs), note)


def _norms(vectors: np.ndarray) -> np.ndarray:
    """Return the norms (m, k) of vectors (m, k, 3)."""
    x, y, z = np.moveaxis(vectors, 2, 0)
    norms: np.ndarray = np.hypot(np.hypot(x, y), z)
    return norms


def _energies(metrics: Metrics) -> Group:
    energy = metrics.energy
    curves = [("kinetic", energy.kinetic), ("potential", energy.potential.sum(axis=1))]
    if energy.elastic.any():
        curves.append(("elastic", energy.elastic))
    curves.append(("total", energy.total))
    if metrics.loads.names:
        curves.append(("work on the system", energy.work))
    return Group("Energies", (Graph("energy [J]", energy.time, tuple(curves)),))


def _errors(run: Run, metrics: Metrics) -> Group:
    return Group("Errors", tuple(_error_graphs(run, metrics)))


def _error_graphs(run: Run, metrics: Metrics) -> Iterator[Graph]:
    if run.errors is not None and len(run.errors) > 1:
        names = ("position", "orientation (angle times length)")
        curves = _named(names, run.errors.to_numpy()[:, 1:])
        title = "estimated global error, largest of all bodies [m]"
        yield Graph(title, run.errors["time"].to_numpy(), curves, log=True)
    energy, largest = metrics.energy, metrics.energy.largest_kinetic
    title = "|energy balance error| over max KE [-]" if largest else "|energy balance error| [J]"
    yield Graph(title, energy.time, (("energy", energy.error / (largest or 1.0)),), log=True)


def _violations(metrics: Metrics) -> Group:
    found = metrics.constraints
    graphs = [
        Graph(f"{words} [{unit}]", found.time, curves, log=True)
        for words, values, units in (
            ("position level", found.violation, ("m", "rad")),
            ("velocity level", found.rate, ("m/s", "rad/s")),
        )
        for unit, series in zip(units, np.moveaxis(values, 2, 0), strict=True)
        if (curves := _named(found.names, series))
    ]
    return Group("Constraint violation", tuple(graphs))


def _work(metrics: Metrics) -> Group:
    work = metrics.work
    if work is None or not metrics.joints:
        return Group("", ())
    graphs = (
        Graph("Hainge's virtual work [J]", work.time, _named(work.joints, work.hainge)),
        Graph(
            "|work of the reaction| [J]", work.time, _named(work.joints, work.reaction), log=True
        ),
    )
    return Group("Virtual work of joints over each step", graphs)
