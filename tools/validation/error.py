"""The error estimate against the truth: docs/validation/error.md and error.csv.

python tools/validation/error.py                 run all models, keep the cells, write the page
python tools/validation/error.py planet "top 1"  run these alone, keep the cells of the others
python tools/validation/error.py --page          write the page from the kept cells

A cell is one run: a model by a scheme at a fixed step size, or by a tolerance. Its true error is
taken from ``reference``, at all output times, which the cells of a model have in common.
"""

import csv
import hashlib
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from multiprocessing import get_context
from pathlib import Path
from typing import get_type_hints

import numpy as np
import platformdirs
import reference
from error_scenes import REFINEMENTS, SCENES, Scene
from measured import OUT

from msahl.algebra.rotation_arrays import angles
from msahl.model import Model, Options, resolve
from msahl.model.scheme import AUTO, choices, split
from msahl.run.loop import run
from msahl.run.tables import STATES, MemorySink
from msahl.system.build import build_system

CSV = OUT / "error.csv"
SCHEMES = tuple(word for word in choices() if word != AUTO)
TOLERANCES = (1e-3, 1e-6, 1e-9)
PROCESSES = 2
ROUND_OFF = 2e-13
"""Smallest true error that counts, over the size of the model: a thousand machine epsilons, since
runs have a thousand steps or so."""
CLEAR = 3.0
"""Times its floor that a true error must be to be compared with an estimate."""
REPEATS = 4
"""Runs of each cell whose seconds are compared."""
QUANTITIES = ("position", "orientation", "velocity")
LOCAL, GLOBAL = "local", "global"


@dataclass(frozen=True)
class Cell:
    """One run. Errors are the largest of all bodies and output times: of position and velocity [m,
    m/s] of the reference points, of orientation as angle times the body's length [m], each with the
    run's own estimate and a floor below which neither the reference nor round-off permits to tell.
    ``step`` [s] belongs to runs at fixed steps, ``tolerance`` [m] to the others, of the ``kind`` of
    error that it bounds. None: no figure.
    """

    scene: str
    scheme: str
    step: float | None
    tolerance: float | None
    kind: str
    status: str
    verdict: str
    accuracy: str
    steps: int
    seconds: float
    position: float | None
    position_estimate: float | None
    position_floor: float
    orientation: float | None
    orientation_estimate: float | None
    orientation_floor: float
    velocity: float | None
    velocity_estimate: float | None
    velocity_floor: float


@dataclass(frozen=True)
class Comparison:
    """An estimate and the true error of one quantity in one cell."""

    cell: Cell
    quantity: str
    estimate: float
    true: float
    floor: float

    @property
    def clear(self) -> bool:
        """Whether the true error is known well enough."""
        return self.true > CLEAR * self.floor

    @property
    def ratio(self) -> float:
        """Estimated over true error; over the floor where the true error is below it."""
        return self.estimate / max(self.true, CLEAR * self.floor)


def comparisons(cells: Iterable[Cell]) -> Iterator[Comparison]:
    """Those of all completed cells, of quantities that move."""
    for cell in cells:
        for quantity in QUANTITIES:
            true = getattr(cell, quantity)
            estimate = getattr(cell, f"{quantity}_estimate")
            floor = getattr(cell, f"{quantity}_floor")
            if true is not None and estimate is not None:
                yield Comparison(cell, quantity, estimate, true, floor)


# Running.


def at_steps(scene: Scene, word: str, per_row: int) -> tuple[Model, Options]:
    """The model by a scheme at so many steps from row to row."""
    name, degree = split(word)
    given = scene.model.simulation
    simulation = replace(
        given,
        dt=scene.t_final / (scene.rows * per_row),
        t_final=scene.t_final,
        scheme=name,
        degree=degree or given.degree,
        tolerance=None,
        output_interval=None,
    )
    return replace(scene.model, simulation=simulation), Options(every=per_row)


def by_tolerance(scene: Scene, tolerance: float, kind: str) -> tuple[Model, Options]:
    """The model with steps and degree chosen by a tolerance."""
    simulation = replace(
        scene.model.simulation,
        dt=scene.t_final / scene.rows,
        output_interval=scene.t_final / scene.rows,
        t_final=scene.t_final,
        scheme=AUTO,
        tolerance=tolerance if kind == GLOBAL else None,
        local_tolerance=tolerance if kind == LOCAL else None,
    )
    return replace(scene.model, simulation=simulation), Options()


def first_row(scene: Scene) -> np.ndarray:
    """(12 n,) published states at t = 0, made consistent as every run has them."""
    memory = MemorySink(only=(STATES,))
    model, _ = at_steps(scene, SCHEMES[0], 1)
    run(replace(model, simulation=replace(model.simulation, t_final=1e-9)), Options(), memory)
    return np.array(memory.table(STATES)[0, 1:])


def truth_of(scene: Scene) -> reference.Truth:
    """The reference solution, kept in the user's cache by model, times and its own equations."""
    key = hashlib.sha256(Path(reference.__file__).read_bytes())
    key.update(repr(replace(scene.model, simulation=None)).encode())  # type: ignore[arg-type]
    key.update(scene.times.tobytes())
    folder = Path(platformdirs.user_cache_dir("msahl", appauthor=False)) / "references"
    path = folder / f"truth-{key.hexdigest()[:32]}.npz"
    if path.is_file():
        with np.load(path) as kept:
            tables = kept["states"], kept["other"]
            return reference.Truth(scene.times, *tables, *map(float, kept["opened"]))
    truth = reference.truth(scene.model, first_row(scene), scene.times)
    folder.mkdir(parents=True, exist_ok=True)
    opened = (truth.opened, truth.opened_rate)
    np.savez(path, states=truth.states, other=truth.other, opened=opened)
    return truth


def apart(rows: np.ndarray, others: np.ndarray, lengths: np.ndarray) -> dict[str, float]:
    """Largest differences of published states (m, 12 n), by quantity."""
    a, b = (table.reshape(len(table), len(lengths), 4, 3) for table in (rows, others))
    way = np.linalg.norm(a - b, axis=3).max(axis=(0, 1))
    turn = (angles(a[:, :, 1], b[:, :, 1]) * lengths).max()
    return {"position": float(way[0]), "orientation": float(turn), "velocity": float(way[2])}


def floors_of(truth: reference.Truth, lengths: np.ndarray) -> dict[str, float]:
    """What errors are not known below, by quantity."""
    states = truth.states.reshape(len(truth.states), -1, 4, 3)
    size = float(np.abs(states[:, :, 0] - states[0, :, 0]).max() + lengths.max())
    speed = float((np.abs(states[:, :, 2]) + lengths[:, None] * np.abs(states[:, :, 3])).max())
    sizes = {"position": size, "orientation": size, "velocity": speed}
    own = apart(truth.states, truth.other, lengths)
    # What a rate that the start leaves open moves until the stabilisation has closed it.
    way = truth.opened + truth.opened_rate / reference.STABILISATION
    opened = {"position": way, "orientation": way, "velocity": truth.opened_rate}
    return {q: max(own[q], ROUND_OFF * sizes[q], opened[q]) for q in QUANTITIES}


def measure(
    scene: Scene, only: Sequence[str] = SCHEMES, tolerances: Sequence[float] = TOLERANCES
) -> list[Cell]:
    """All cells of a model."""
    truth = truth_of(scene)
    lengths = build_system(scene.model).frames.length[:-1]
    floors = floors_of(truth, lengths)
    cells = []
    for word in only:
        for per_row in REFINEMENTS:
            model, options = at_steps(scene, word, per_row)
            cell = _cell(scene, word, model, options, truth, lengths, floors)
            cells.append(replace(cell, step=model.simulation.dt))
    for tolerance in tolerances:
        for kind in (LOCAL, GLOBAL):
            given = by_tolerance(scene, tolerance, kind)
            # The first run may compile; of the others the fastest counts.
            runs = [_cell(scene, AUTO, *given, truth, lengths, floors) for _ in range(REPEATS)]
            seconds = min(cell.seconds for cell in runs[1:])
            cells.append(replace(runs[0], tolerance=tolerance, kind=kind, seconds=seconds))
    return cells


def _cell(
    scene: Scene,
    word: str,
    model: Model,
    options: Options,
    truth: reference.Truth,
    lengths: np.ndarray,
    floors: dict[str, float],
) -> Cell:
    memory = MemorySink(only=(STATES,))
    report = run(model, options, memory)
    rows = memory.table(STATES)
    true: dict[str, float] = {}
    if report.status == "completed" and len(rows) == len(truth.times):
        true = apart(rows[:, 1:], truth.states, lengths)
    # An estimate up to some time says nothing about the rows after it.
    estimated = report.error if true and report.error and report.error["complete"] else {}
    errors = {
        name: value
        for q in QUANTITIES
        for name, value in (
            (q, true.get(q)),
            (f"{q}_estimate", estimated.get(q)),
            (f"{q}_floor", floors[q]),
        )
    }
    seconds = report.seconds["loop"]
    if resolve(model.simulation).tolerance is not None:
        seconds += report.seconds.get("companion", 0.0)
    return Cell(
        scene=scene.name,
        scheme=word,
        step=None,
        tolerance=None,
        kind="",
        status=report.status,
        verdict=report.verdict["word"],
        accuracy=report.verdict["checks"].get("accuracy", {}).get("word", ""),
        steps=report.steps,
        seconds=seconds,
        **errors,
    )


def run_scene(name: str) -> tuple[str, list[Cell]]:
    """The cells of the model of this name."""
    return name, measure(scene_of(name))


def scene_of(name: str) -> Scene:
    """The model of this name."""
    (scene,) = (scene for scene in SCENES if scene.name == name)
    return scene


def keep_reference(name: str) -> str:
    """See to it that the reference solution of the model of this name is kept; the name."""
    truth_of(scene_of(name))
    return name


def run_all(names: Sequence[str]) -> Iterator[tuple[str, list[Cell]]]:
    """The cells of these models, as they come, by a few processes."""
    if len(names) == 1:
        yield run_scene(names[0])
        return
    with get_context("spawn").Pool(PROCESSES) as pool:
        # References first: what both processes compile they would compile at the same time.
        for done, name in enumerate(pool.imap_unordered(keep_reference, names), start=1):
            print(f"reference {done}/{len(names)} {name}", flush=True)
        yield from pool.imap_unordered(run_scene, names)


# Keeping.


def write_cells(path: Path, cells: Iterable[Cell]) -> None:
    """A line a cell; what is not known is empty."""
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(field.name for field in fields(Cell))
        for cell in cells:
            writer.writerow(_written(value) for value in asdict(cell).values())


def _written(value: str | float | None) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def read_cells(path: Path) -> list[Cell]:
    """The cells of a file of ``write_cells``."""
    hints = get_type_hints(Cell)
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return [Cell(**{key: _read(hints[key], text) for key, text in row.items()}) for row in rows]


def _read(kind: object, text: str) -> str | float | int | None:
    if text == "" and kind is not str:
        return None
    return int(text) if kind is int else float(text) if kind is not str else text


def main(arguments: list[str]) -> None:
    """Run what is to be run, keep it and write the page."""
    from error_page import write_page

    names = [scene.name for scene in SCENES]
    unknown = sorted(set(arguments) - {"--page", *names})
    if unknown:
        sys.exit(f"no model {', '.join(unknown)}; there are: {', '.join(names)}")
    if "--page" not in arguments:
        wanted = [name for name in names if name in arguments] or names
        kept = {name: [] for name in names}
        for cell in read_cells(CSV) if arguments else ():
            kept[cell.scene].append(cell)
        for done, (name, cells) in enumerate(run_all(wanted), start=1):
            kept[name] = cells
            print(f"{done}/{len(wanted)} {name}: {_words(cells)}", flush=True)
            write_cells(CSV, (cell for cells in kept.values() for cell in cells))
    write_page(read_cells(CSV))


def _words(cells: Sequence[Cell]) -> str:
    clear = [c.ratio for c in comparisons(cells) if c.clear]
    failed = sum(cell.status != "completed" for cell in cells)
    span = f"estimated/true {min(clear):.2g} to {max(clear):.2g}" if clear else "all at the floor"
    return f"{len(cells)} runs, {failed} not completed, {span}"


if __name__ == "__main__":
    main(sys.argv[1:])
