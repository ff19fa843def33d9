"""Graphs of what the user of a deck has defined: drives, actuators, signals, markers and groups.

Columns of one quantity share a graph, components of vectors one for each axis. Signals, which may
differ much in size, share one only if their names differ by nothing but a number.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from msahl.post.graph_data import Graph
from msahl.results.read import Run
from msahl.run.column_units import QUANTITIES, SIGNAL, Quantity, quantity
from msahl.run.tables import AMPLITUDES, MARKERS, SIGNALS, SYSTEM
from msahl.system.names import AMPLITUDE

AXES = "xyz"
MOST_GRAPHS = 12
"""Most graphs of one table."""
NEGLIGIBLE = 1e-9
"""A component below this fraction of the largest of its vectors has no graph."""
HIDDEN = ("q0", "q1", "q2", "q3")
"""Endings of columns that no graph makes plain."""


def drive_graphs(run: Run) -> tuple[list[Graph], str]:
    """Return the graphs of the loads that produce a given motion, with their error bars."""
    if run.drives is None:
        return [], "msahl inverse writes loads of drives, and this is the folder of a run"
    names, missing = list(run.drives.columns[1:]), "missingForce"
    loads = [name for name in names if name.endswith(".load")]
    if _largest(run.drives[missing].to_numpy()) <= NEGLIGIBLE * _largest(
        run.drives[loads].to_numpy()
    ):
        names.remove(missing)
    return _graphs(run, run.drives, names)


def signal_graphs(run: Run) -> tuple[list[Graph], str]:
    """Return the graphs of the loads of actuators, and of signals and auxiliary states."""
    table = run.others.get(SIGNALS)
    if table is None:
        return [], "the model has no signals and no actuators"
    known = set() if run.drives is None else set(run.drives.columns)
    names = [name for name in table.columns[1:] if name not in known]
    # Loads are what signals are made for, and a table has them last.
    return _graphs(run, table, sorted(names, key=lambda name: "." not in name))


def marker_graphs(run: Run) -> tuple[list[Graph], str]:
    """Return the graphs of markers, and of the distances and angles between them."""
    table = run.others.get(MARKERS)
    if table is None:
        return [], "the model has no markers"
    return _graphs(run, table, list(table.columns[1:]))


def amplitude_graphs(run: Run) -> tuple[list[Graph], str]:
    """Return the graphs of the amplitudes of elastic bodies."""
    table = run.others.get(AMPLITUDES)
    if table is None:
        return [], "the model has no reduced elastic bodies"
    return _graphs(run, table, [name for name in table.columns if name.endswith(AMPLITUDE)])


def group_graphs(run: Run) -> tuple[list[Graph], str]:
    """Return the graphs of groups of bodies."""
    table = run.others.get(SYSTEM)
    if table is None:
        return [], "the model has no groups of bodies"
    return _graphs(run, table, list(table.columns[1:]))


def _graphs(run: Run, table: pd.DataFrame, names: Sequence[str]) -> tuple[list[Graph], str]:
    """Return the graphs of columns of a table, and which columns have none."""
    found: dict[tuple[Quantity, str], list[str]] = {}
    for name in names:
        key = _key(name, quantity(name, run.model))
        if key[1] not in HIDDEN:
            found.setdefault(key, []).append(name)
    sizes = {key: _largest(table[group].to_numpy()) for key, group in found.items()}
    zeros = _negligible(sizes)
    for key in zeros:
        del found[key]
    shown = list(found)[:MOST_GRAPHS]
    graphs = [Graph(_title(*key), run.time, _curves(table, found[key])) for key in shown]
    note = zero_note([component for _, component in zeros])
    if len(shown) < len(found):
        more = sum(len(group) for group in found.values()) - sum(len(found[key]) for key in shown)
        note += f" {more} more columns can be drawn by msahl-post plot RUN --columns NAME,..."
    return graphs, note.strip()


def _key(name: str, found: Quantity) -> tuple[Quantity, str]:
    """Return what columns have in common that share a graph: the quantity, and the component of a
    vector; of a signal its name without its number."""
    if found.word == SIGNAL.word:
        return found, name.rstrip("0123456789")
    ending = name.rpartition(".")[2]
    is_component = ending in HIDDEN or (ending[-1] in AXES and QUANTITIES.get(ending) == found)
    return found, ending if is_component else ""


def _title(found: Quantity, part: str) -> str:
    if found == SIGNAL:  # the deck states no unit
        return part
    return f"{part} [{found.unit}]" if part else str(found)


def _curves(table: pd.DataFrame, names: Sequence[str]) -> tuple[tuple[str, np.ndarray], ...]:
    """Return columns under the names of their elements, if that distinguishes them."""
    short = [name.rpartition(".")[0] or name for name in names]
    labels = short if len(set(short)) == len(short) else names
    return tuple((label, table[name].to_numpy()) for label, name in zip(labels, names, strict=True))


def _largest(values: np.ndarray) -> float:
    return float(np.abs(values).max(initial=0.0))


def _negligible(sizes: dict[tuple[Quantity, str], float]) -> list[tuple[Quantity, str]]:
    """Return the components of vectors that are negligible beside the others; of vectors that are
    zero all but the first."""
    vectors: dict[Quantity, dict[str, float]] = {}
    for (found, part), size in sizes.items():
        if part and found.word != SIGNAL.word:
            vectors.setdefault(found, {})[part] = size
    return [
        (found, part)
        for found, parts in vectors.items()
        for part, size in parts.items()
        if size <= NEGLIGIBLE * max(parts.values())
        and (any(parts.values()) or part != next(iter(parts)))
    ]


def zero_note(parts: Sequence[str]) -> str:
    """Say which components are zero; empty if there are none."""
    verb = "is" if len(parts) == 1 else "are"
    listed = ", ".join(parts[:-1]) + " and " * bool(parts[1:]) + "".join(parts[-1:])
    return f"{listed} {verb} zero up to rounding." if parts else ""
