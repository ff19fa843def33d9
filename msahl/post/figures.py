"""Draw a run: linkage, paths, error, energy, virtual work, constraint violation, reactions."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from msahl.joints.coordinates import ORIENTATION, SUFFIXES, coordinates, is_angle
from msahl.post.draw import absolute_curves, curves, legend, new_figure
from msahl.post.linkage.draw import lacks_motion, picture
from msahl.post.metrics import Metrics
from msahl.post.paths import lacks_space, paths, paths_in_space
from msahl.results.read import ResultError, Run
from msahl.run.tables import JOINTS

AXES = "xyz"
WORK = "work done on\nthe system"
NEGLIGIBLE = 1e-9
"""A force component below this fraction of the largest has no panel; the title says so."""
MANY = 5
"""From this number of panels on, each is drawn less high."""


@dataclass(frozen=True, slots=True)
class Choice:
    """What to draw: a ``plane`` (two of x, y, z; empty: the one with the widest paths), and the
    names of ``bodies`` and ``joints`` (empty: all)."""

    plane: str = ""
    bodies: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()


def figures(
    run: Run, metrics: Metrics, choice: Choice, kinds: Sequence[str] = ()
) -> Iterator[tuple[str, Figure]]:
    """Yield name and figure of each of ``kinds``, or of all kinds for which the run has data.

    Raises ``ResultError`` if a requested kind has no data, or the model lacks a requested name.
    """
    chosen_bodies(run, choice)
    _pick("joint", metrics.constraints.names, choice.joints)
    for kind in kinds or tuple(KINDS):
        # A linkage that hardly moves is no picture worth having, but one that can be asked for.
        always = bool(kinds) and kind == "linkage"
        lacks = "" if always else _lacks(kind, run, metrics, choice)
        if lacks and kinds:
            raise ResultError(f"{run.folder}: no picture of {kind}: {lacks}")
        if not lacks:
            yield KINDS[kind](run, metrics, choice)


def comparisons(
    runs: Sequence[Run], choice: Choice, kinds: Sequence[str] = ()
) -> Iterator[tuple[str, Figure]]:
    """Yield name and figure of each of ``kinds`` that several runs can share; by default of their
    paths. Raises ``ResultError`` for another kind, or a body that a run lacks."""
    bodies = chosen_bodies(runs[0], choice)
    for kind in kinds or ("path",):
        if kind == "path":
            yield paths(runs, bodies, choice.plane)
        elif kind == "path3d":
            yield paths_in_space(runs, bodies)
        else:
            raise ResultError(
                f"a picture of {kind} shows one run only; several runs can be compared by "
                "--columns, --phase, path and path3d"
            )


def _lacks(kind: str, run: Run, metrics: Metrics, choice: Choice) -> str:
    """Say why there is nothing to draw; empty if there is something."""
    if kind == "linkage":
        return lacks_motion(run)
    if kind == "path3d":
        return lacks_space([run], chosen_bodies(run, choice))
    if kind == "error" and (run.errors is None or len(run.errors) < 2):
        return "the error of the run was not estimated"
    if kind == "joints" and not _coordinates(run, choice):
        return "joints.csv has no angle and no slide"
    if kind in ("constraints", "reactions") and not metrics.constraints.names:
        return "the model has no joints"
    if kind == "work" and not metrics.joints:
        return "the model has no joints"
    if kind == "work" and metrics.work is None:
        return "virtual work needs the states and mean reactions of every step"
    if kind == "work" and not any(k < metrics.joints for k in _elements(metrics, choice)):
        return "couplings and motions have no virtual work"
    return ""


def _elements(metrics: Metrics, choice: Choice) -> list[int]:
    """Return the indices of the joints, couplings and motions to draw."""
    return _pick("joint", metrics.constraints.names, choice.joints)


def _pick(kind: str, names: tuple[str, ...], wanted: tuple[str, ...]) -> list[int]:
    """Return the indices of the wanted names; of all names if none is wanted."""
    for name in wanted:
        if name not in names:
            listed = ", ".join(names) or "none"
            raise ResultError(f"no {kind} '{name}' in the model (it has: {listed})")
    return [i for i, name in enumerate(names) if not wanted or name in wanted]


def _path(run: Run, metrics: Metrics, choice: Choice) -> tuple[str, Figure]:
    return paths([run], chosen_bodies(run, choice), choice.plane)


def _path3d(run: Run, metrics: Metrics, choice: Choice) -> tuple[str, Figure]:
    return paths_in_space([run], chosen_bodies(run, choice))


def chosen_bodies(run: Run, choice: Choice) -> list[str]:
    """Return the names of the bodies to draw. Raises ``ResultError`` if one is not in the model."""
    names = tuple(body.name for body in run.model.bodies)
    return [names[i] for i in _pick("body", names, choice.bodies)]


def _error(run: Run, metrics: Metrics, choice: Choice) -> tuple[str, Figure]:
    """Draw the estimated global errors of positions and orientations against time."""
    assert run.errors is not None
    title = _title(run, "estimated global error, largest of all bodies")
    figure, (axes,) = new_figure(1, 3.4, title)
    names = ["position", "orientation\n(angle times length)"]
    absolute_curves(axes, run.errors["time"].to_numpy(), run.errors.to_numpy()[:, 1:], names)
    axes.set(xlabel="time [s]", ylabel="estimated error [m]")
    legend(figure, axes)
    return "error", figure


def _energy(run: Run, metrics: Metrics, choice: Choice) -> tuple[str, Figure]:
    energy = metrics.energy
    figure, (parts, error) = new_figure(2, title=_title(run, "energy"))
    drawn = [("kinetic", energy.kinetic, "-"), ("potential", energy.potential.sum(axis=1), "-")]
    if energy.elastic.any():
        drawn.append(("elastic", energy.elastic, "-"))
    # Total and work often coincide with another curve: broken lines leave it visible.
    drawn.append(("total", energy.total, "--"))
    if run.work is not None:
        drawn.append((WORK, energy.work, ":"))
        drawn.append(("total - work", energy.balance, "-."))
    names, series, lines = zip(*drawn, strict=True)
    curves(parts, energy.time, series, names, lines=lines)
    parts.set_ylabel("energy [J]")
    largest = energy.largest_kinetic
    absolute_curves(error, energy.time, energy.error[:, None] / (largest or 1.0), ["error"])
    error.set_ylabel("|balance error|\nover max KE [-]" if largest else "|balance error| [J]")
    error.set_xlabel("time [s]")
    legend(figure, parts)
    return "energy", figure


def _work(run: Run, metrics: Metrics, choice: Choice) -> tuple[str, Figure]:
    assert metrics.work is not None
    work = metrics.work
    picked = [k for k in _elements(metrics, choice) if k < metrics.joints]
    names = [work.joints[k] for k in picked]
    figure, (hainge, reaction) = new_figure(2, title=_title(run, "virtual work over each step"))
    curves(hainge, work.time, work.hainge[:, picked], names)
    hainge.set_ylabel("Hainge's\nvirtual work [J]")
    absolute_curves(reaction, work.time, work.reaction[:, picked], names)
    reaction.set(ylabel="|work of the\nreaction| [J]", xlabel="time [s]")
    legend(figure, hainge)
    return "work", figure


def _constraints(run: Run, metrics: Metrics, choice: Choice) -> tuple[str, Figure]:
    found = metrics.constraints
    picked = _elements(metrics, choice)
    names = [found.names[e] for e in picked]
    panels = [
        (f"{words} [{unit}]", series)
        for words, values, units in (
            ("violation", found.violation, ("m", "rad")),
            ("violation rate", found.rate, ("m/s", "rad/s")),
        )
        for unit, series in zip(units, np.moveaxis(values[:, picked], 2, 0), strict=True)
        if not np.isnan(series).all()
    ]
    title = _title(run, "constraint violation at position and velocity level")
    figure, all_axes = new_figure(len(panels), title=title)
    for axes, (label, series) in zip(all_axes, panels, strict=True):
        absolute_curves(axes, found.time, series, names)
        axes.set_ylabel(label)
    all_axes[-1].set_xlabel("time [s]")
    legend(figure, all_axes[0])
    return "constraints", figure


def _coordinates(run: Run, choice: Choice) -> dict[str, list[str]]:
    """Return the columns of the joints to draw, by the unit of their coordinate; orientations have
    no picture."""
    table, found = run.others.get(JOINTS), dict[str, list[str]]()
    for joint in run.model.joints if table is not None else ():
        for name in coordinates(joint):
            if name != ORIENTATION and (not choice.joints or joint.name in choice.joints):
                unit = "rad" if is_angle(name) else "m"
                found.setdefault(unit, []).append(f"{joint.name}.{name}")
    return found


def _joints(run: Run, metrics: Metrics, choice: Choice) -> tuple[str, Figure]:
    """Draw the angles and slides of joints and their rates against time."""
    table, panels = run.others[JOINTS], []
    for unit, names in _coordinates(run, choice).items():
        what = "angle" if unit == "rad" else "slide"
        panels.append((f"{what} [{unit}]", names, names))
        panels.append((f"its rate [{unit}/s]", names, [f"{name}{SUFFIXES[1]}" for name in names]))
    title = _title(run, "coordinates of joints")
    figure, all_axes = new_figure(len(panels), 2.4 if len(panels) < MANY else 1.7, title)
    for axes, (label, names, columns) in zip(all_axes, panels, strict=True):
        curves(axes, run.time, table[columns].to_numpy(), names)
        axes.set_ylabel(label)
    all_axes[-1].set_xlabel("time [s]")
    legend(figure, all_axes[0])
    for axes in all_axes[2:3]:  # other joints, or other coordinates of the same
        axes.legend(loc="best", fontsize=8)
    return "joints", figure


def _reaction_label(name: str, not_unique: tuple[str, ...]) -> str:
    """Return the name of a joint, and below it its reaction's components that are not unique."""
    return f"{name}\n({', '.join(not_unique)} not unique)" if not_unique else name


def _reactions(run: Run, metrics: Metrics, choice: Choice) -> tuple[str, Figure]:
    reactions, picked = metrics.reactions, _elements(metrics, choice)
    names = [_reaction_label(reactions.names[e], reactions.not_unique[e]) for e in picked]
    panels, zeros = [], []
    for letter, unit, vectors in (("F", "N", reactions.force), ("M", "N m", reactions.moment)):
        more, zero = _components(letter, unit, vectors[:, picked])
        panels += more
        zeros += zero
    for unit, load in zip(("N", "N m"), np.moveaxis(reactions.load[:, picked], 2, 0), strict=True):
        if not np.isnan(load).all():
            panels.append((f"load [{unit}]", load))
    if not panels:  # all reactions are zero: the picture shows that
        panels = [("|F| [N]", np.abs(reactions.force[:, picked]).max(axis=2))]
    note = f"\n({', '.join(zeros)}: zero up to rounding)" if zeros else ""
    of = "at the output times" if run.instantaneous else "mean over each step"
    title = _title(run, f"reactions on the child, {of}{note}")
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
    """Return label and series (m, k) of the components of ``vectors`` (m, k, 3) that are not
    negligible, and the names of the others; nothing if no joint has such a vector.
    """
    if np.isnan(vectors).all():
        return [], []
    highest, lowest = np.nanmax(vectors, axis=(0, 1)), np.nanmin(vectors, axis=(0, 1))
    largest = np.maximum(highest, -lowest)
    shown = [axis for axis in range(3) if largest[axis] > NEGLIGIBLE * largest.max()]
    zero = [f"{letter}{AXES[axis]}" for axis in range(3) if axis not in shown]
    panels = [(f"{letter}{AXES[axis]} [{unit}]", vectors[:, :, axis]) for axis in shown]
    return panels, zero


def _title(run: Run, what: str) -> str:
    return f"{run.model.simulation.title or run.folder.name}: {what}"


def _linkage(run: Run, metrics: Metrics, choice: Choice) -> tuple[str, Figure]:
    return picture(run, choice.bodies, choice.plane)


KINDS: dict[str, Callable[[Run, Metrics, Choice], tuple[str, Figure]]] = {
    "linkage": _linkage,
    "path": _path,
    "path3d": _path3d,
    "error": _error,
    "energy": _energy,
    "work": _work,
    "joints": _joints,
    "constraints": _constraints,
    "reactions": _reactions,
}
