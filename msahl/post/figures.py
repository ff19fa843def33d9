"""The pictures of a run: paths, estimated error, energy, virtual work, constraints, reactions."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from msahl.post.draw import curves, legend, looks, new_figure, plain, sizes
from msahl.post.metrics import Measures
from msahl.results.read import ResultError, Run

AXES = "xyz"
WORK = "work done on\nthe scene"
NEGLIGIBLE = 1e-9
"""A force component below this part of the largest is not worth a panel; the title says so."""
MANY = 5
"""Panels from which on they are drawn less high."""


@dataclass(frozen=True, slots=True)
class Choice:
    """What to draw: a ``plane`` (two of x, y, z; none: the one that shows most), and which
    ``bodies`` and ``joints`` by name (none: all)."""

    plane: str = ""
    bodies: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()


def figures(
    run: Run, measures: Measures, choice: Choice, kinds: Sequence[str] = ()
) -> Iterator[tuple[str, Figure]]:
    """Name and picture of each of ``kinds``, or of all kinds the run has data for.

    Raises ``ResultError`` for a kind asked for without data, or a name the scene does not have.
    """
    _pick("body", tuple(body.name for body in run.model.bodies), choice.bodies)
    _pick("joint", measures.constraints.names, choice.joints)
    for kind in kinds or tuple(KINDS):
        lacks = _lacks(kind, run, measures, choice)
        if lacks and kinds:
            raise ResultError(f"{run.folder}: no picture of {kind}: {lacks}")
        if not lacks:
            yield KINDS[kind](run, measures, choice)


def _lacks(kind: str, run: Run, measures: Measures, choice: Choice) -> str:
    """Why there is nothing to draw; empty if there is something."""
    if kind == "error" and (run.errors is None or len(run.errors) < 2):
        return "the error of the run was not estimated"
    if kind in ("constraints", "reactions") and not measures.constraints.names:
        return "the scene has no joints"
    if kind == "work" and not measures.joints:
        return "the scene has no joints"
    if kind == "work" and measures.work is None:
        return (
            "virtual work takes every step's row and its mean reactions, and the run has not both"
        )
    if kind == "work" and not any(k < measures.joints for k in _elements(measures, choice)):
        return "couplings and motions have no virtual work"
    return ""


def _elements(measures: Measures, choice: Choice) -> list[int]:
    """Which joints, couplings and motions to draw."""
    return _pick("joint", measures.constraints.names, choice.joints)


def _pick(kind: str, names: tuple[str, ...], wanted: tuple[str, ...]) -> list[int]:
    """Indices of the wanted names, all of them if none is wanted."""
    for name in wanted:
        if name not in names:
            raise ResultError(f"no {kind} '{name}' (there are: {', '.join(names) or 'none'})")
    return [i for i, name in enumerate(names) if not wanted or name in wanted]


def _path(run: Run, measures: Measures, choice: Choice) -> tuple[str, Figure]:
    """Paths of the reference points B in a plane, equal scales; down is where gravity points."""
    picked = _pick("body", measures.energy.bodies, choice.bodies)
    names = [measures.energy.bodies[i] for i in picked]
    points = np.stack([run.states[[f"{n}.{c}" for c in AXES]].to_numpy() for n in names], axis=1)
    plane = choice.plane or _widest_plane(points)
    i, j = map(AXES.index, plane)
    figure, (axes,) = new_figure(1, 5.4, _title(run, f"paths in the {plane} plane, from the dots"))
    for track, name, look in zip(points.swapaxes(0, 1), names, looks(), strict=False):
        (line,) = axes.plot(track[:, i], track[:, j], label=plain(name), **look)
        axes.plot(*track[0, [i, j]], "o", color=line.get_color(), markersize=5)
    axes.set(xlabel=f"{plane[0]} [m]", ylabel=f"{plane[1]} [m]", aspect="equal")
    axes.set_adjustable("datalim")
    axes.margins(0.06)
    if run.model.gravity[j] > 0.0:
        axes.invert_yaxis()
    legend(figure, axes)
    return f"path-{plane}", figure


def _widest_plane(points: np.ndarray) -> str:
    """The two axes along which ``points`` (m, n, 3) reach farthest, in alphabetical order."""
    spans = np.ptp(points.reshape(-1, 3), axis=0)
    # Ties (a scene at rest, a motion along one line) go to x and z, the pendulum's plane.
    order = sorted(range(3), key=lambda axis: (-spans[axis], axis == 1))
    return "".join(AXES[axis] for axis in sorted(order[:2]))


def _error(run: Run, measures: Measures, choice: Choice) -> tuple[str, Figure]:
    """Estimated global errors of positions and orientations against time."""
    assert run.errors is not None
    figure, (axes,) = new_figure(1, 3.4, _title(run, "estimated error, largest of all bodies"))
    names = ["positions", "orientations\n(angle times length)"]
    sizes(axes, run.errors["time"].to_numpy(), run.errors.to_numpy()[:, 1:], names)
    axes.set(xlabel="time [s]", ylabel="error [m]")
    legend(figure, axes)
    return "error", figure


def _energy(run: Run, measures: Measures, choice: Choice) -> tuple[str, Figure]:
    energy = measures.energy
    figure, (parts, error) = new_figure(2, title=_title(run, "energy"))
    drawn = [("kinetic", energy.kinetic, "-"), ("potential", energy.potential.sum(axis=1), "-")]
    if energy.elastic.any():
        drawn.append(("elastic", energy.elastic, "-"))
    # Total and work often lie on another curve: broken lines let it show.
    drawn.append(("total", energy.total, "--"))
    if run.work is not None:
        drawn.append((WORK, energy.work, ":"))
        drawn.append(("total - work", energy.balance, "-."))
    names, series, lines = zip(*drawn, strict=True)
    curves(parts, energy.time, np.stack(series, axis=1), names, lines=lines)
    parts.set_ylabel("energy [J]")
    largest = energy.largest_kinetic
    sizes(error, energy.time, energy.error[:, None] / (largest or 1.0), ["error"])
    error.set_ylabel("|balance error|\nover largest KE" if largest else "|balance error| [J]")
    error.set_xlabel("time [s]")
    legend(figure, parts)
    return "energy", figure


def _work(run: Run, measures: Measures, choice: Choice) -> tuple[str, Figure]:
    assert measures.work is not None
    work = measures.work
    picked = [k for k in _elements(measures, choice) if k < measures.joints]
    names = [work.joints[k] for k in picked]
    figure, (hainge, sharp) = new_figure(2, title=_title(run, "virtual work over each step"))
    curves(hainge, work.time, work.hainge[:, picked], names)
    hainge.set_ylabel("Hainge's measure [J]")
    sizes(sharp, work.time, work.sharp[:, picked], names)
    sharp.set(ylabel="|work of the reaction| [J]", xlabel="time [s]")
    legend(figure, hainge)
    return "work", figure


def _constraints(run: Run, measures: Measures, choice: Choice) -> tuple[str, Figure]:
    found = measures.constraints
    picked = _elements(measures, choice)
    names = [found.names[e] for e in picked]
    panels = [
        (f"{words} [{unit}]", series)
        for words, values, units in (
            ("gap", found.violation, ("m", "rad")),
            ("gap rate", found.rate, ("m/s", "rad/s")),
        )
        for unit, series in zip(units, np.moveaxis(values[:, picked], 2, 0), strict=True)
        if not np.isnan(series).all()
    ]
    figure, all_axes = new_figure(len(panels), title=_title(run, "how far the joints open"))
    for axes, (label, series) in zip(all_axes, panels, strict=True):
        sizes(axes, found.time, series, names)
        axes.set_ylabel(label)
    all_axes[-1].set_xlabel("time [s]")
    legend(figure, all_axes[0])
    return "constraints", figure


def _with_shared(name: str, shared: tuple[str, ...]) -> str:
    """The name of a joint, with the components of its reaction that are not unique."""
    return f"{name} ({', '.join(shared)} not unique)" if shared else name


def _reactions(run: Run, measures: Measures, choice: Choice) -> tuple[str, Figure]:
    reactions, picked = measures.reactions, _elements(measures, choice)
    names = [_with_shared(reactions.names[e], reactions.shared[e]) for e in picked]
    panels, zeros = [], []
    for letter, unit, vectors in (("F", "N", reactions.force), ("M", "N m", reactions.moment)):
        more, zero = _components(letter, unit, vectors[:, picked])
        panels += more
        zeros += zero
    for unit, load in zip(("N", "N m"), np.moveaxis(reactions.load[:, picked], 2, 0), strict=True):
        if not np.isnan(load).all():
            panels.append((f"load [{unit}]", load))
    if not panels:  # nothing is borne: the picture shows just that
        panels = [("|F| [N]", np.abs(reactions.force[:, picked]).max(axis=2))]
    note = f"\n({', '.join(zeros)} as good as zero throughout)" if zeros else ""
    title = _title(run, f"reactions on the child, mean over each step{note}")
    figure, all_axes = new_figure(len(panels), 2.4 if len(panels) < MANY else 1.7, title)
    for axes, (label, series) in zip(all_axes, panels, strict=True):
        curves(axes, run.time, series, names)
        axes.set_ylabel(label)
    all_axes[-1].set_xlabel("time [s]")
    legend(figure, all_axes[0])
    return "reactions", figure


def _components(
    letter: str, unit: str, vectors: np.ndarray
) -> tuple[list[tuple[str, np.ndarray]], list[str]]:
    """Label and series (m, k) of the components of ``vectors`` (m, k, 3) that are worth a panel,
    and names of the others; none of either if no joint has such a vector.
    """
    if np.isnan(vectors).all():
        return [], []
    largest = np.nanmax(np.abs(vectors), axis=(0, 1))
    shown = [axis for axis in range(3) if largest[axis] > NEGLIGIBLE * largest.max()]
    zero = [f"{letter}{AXES[axis]}" for axis in range(3) if axis not in shown]
    panels = [(f"{letter}{AXES[axis]} [{unit}]", vectors[:, :, axis]) for axis in shown]
    return panels, zero


def _title(run: Run, what: str) -> str:
    return f"{run.model.simulation.title or run.folder.name}: {what}"


KINDS: dict[str, Callable[[Run, Measures, Choice], tuple[str, Figure]]] = {
    "path": _path,
    "error": _error,
    "energy": _energy,
    "work": _work,
    "constraints": _constraints,
    "reactions": _reactions,
}
