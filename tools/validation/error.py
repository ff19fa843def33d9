"""Write docs/validation/error.md and error.csv: error estimates compared with true errors.

python -m tools.validation.error                 run all models, store the cells, write the page
python -m tools.validation.error planet "top 1"  run these only, keep the cells of the others
python -m tools.validation.error beam kink       run the models of these kinds only
python -m tools.validation.error --page          write the page from the stored cells

A cell is one run: a model by a scheme at a fixed step size, or by a tolerance. Its true error is
the difference from ``reference``, from equations of motion by hand or, of beams, from a fine mesh
at small steps, at all output times, which are the same for all cells of a model.
The times that runs took are stored apart, in error_seconds.csv.
"""

import hashlib
import pickle
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import platformdirs

from msahl.algebra.rotation_arrays import angles
from msahl.model import Model, Options, resolve
from msahl.model.scheme import AUTO, EXPLICIT, choices, split
from msahl.run.loop import run
from msahl.run.report import Report
from msahl.run.tables import SIGNALS, STATES, MemorySink
from msahl.system.build import build_system
from msahl.system.names import signal_columns
from tools.validation import error_beams, error_contacts, error_scenes, pieces, reference
from tools.validation.csv_tables import read_records, write_records
from tools.validation.error_cases import CASES
from tools.validation.error_models import REFINEMENTS, Case
from tools.validation.thesis_runs import OUT

CSV = OUT / "error.csv"
DIGITS = 4
SCHEMES = tuple(word for word in choices() if word != AUTO and word not in EXPLICIT)
"""Those that every model has: the explicit ones take steps in joint coordinates only."""
TOLERANCES = (1e-3, 1e-6, 1e-9)
PROCESSES = 2
ROUND_OFF = 2e-13
"""Smallest true error that counts, over the size of the model: a thousand machine epsilons, because
runs have about a thousand steps."""
CLEAR = 3.0
"""Smallest ratio of a true error and its floor for a comparison with an estimate."""
REPEATS, LONG = 4, 0.5
"""Number of runs of each cell that is timed, two of those that take this long [s]."""
QUANTITIES = ("position", "orientation", "velocity", "signal")
LOCAL, GLOBAL = "local", "global"


@dataclass(frozen=True)
class Cell:
    """One run. Errors are the largest of all bodies and output times: of position and velocity [m,
    m/s] of the reference points, of orientation as angle times the body's length [m], each with the
    run's own estimate and a floor, below which the reference or rounding errors do not resolve it;
    and of the signals that the reference has, over the largest value of each.
    ``step`` [s] is set in runs at fixed steps, ``tolerance`` [m] in the others, with the ``kind``
    of error that it bounds. None: not available.
    """

    model: str
    scheme: str
    step: float | None
    tolerance: float | None
    kind: str
    status: str
    verdict: str
    accuracy: str
    steps: int
    position: float | None
    position_estimate: float | None
    position_floor: float
    orientation: float | None
    orientation_estimate: float | None
    orientation_floor: float
    velocity: float | None
    velocity_estimate: float | None
    velocity_floor: float
    signal: float | None = None
    signal_estimate: float | None = None
    signal_floor: float = 0.0
    seconds: float | None = None


@dataclass(frozen=True)
class Time:
    """The seconds of a run by tolerance, its companion runs included."""

    model: str
    tolerance: float
    kind: str
    seconds: float | None


@dataclass(frozen=True)
class Comparison:
    """An estimate and the true error of one quantity of one cell."""

    cell: Cell
    quantity: str
    estimate: float
    true: float
    floor: float

    @property
    def clear(self) -> bool:
        """Return whether the true error is known well enough."""
        return self.true > CLEAR * self.floor

    @property
    def ratio(self) -> float:
        """Return estimated over true error; over the floor if the true error is below it."""
        return self.estimate / max(self.true, CLEAR * self.floor)


def comparisons(cells: Iterable[Cell]) -> Iterator[Comparison]:
    """Yield the comparisons of all completed cells."""
    for cell in cells:
        for quantity in QUANTITIES:
            true = getattr(cell, quantity)
            estimate = getattr(cell, f"{quantity}_estimate")
            floor = getattr(cell, f"{quantity}_floor")
            if true is not None and estimate is not None:
                yield Comparison(cell, quantity, estimate, true, floor)


def at_steps(case: Case, word: str, per_output: int) -> tuple[Model, Options]:
    """Return the model and options of a run by a scheme at fixed steps per output time."""
    name, degree = split(word)
    given = case.model.simulation
    simulation = replace(
        given,
        dt=case.t_final / (case.outputs * per_output),
        t_final=case.t_final,
        scheme=name,
        degree=degree or given.degree,
        tolerance=None,
        output_interval=None,
    )
    return replace(case.model, simulation=simulation), Options(every=per_output)


def by_tolerance(case: Case, tolerance: float, kind: str) -> tuple[Model, Options]:
    """Return the model and options of a run whose steps and degree are chosen by a tolerance."""
    simulation = replace(
        case.model.simulation,
        dt=case.t_final / case.outputs,
        output_interval=case.t_final / case.outputs,
        t_final=case.t_final,
        scheme=AUTO,
        tolerance=tolerance if kind == GLOBAL else None,
        local_tolerance=tolerance if kind == LOCAL else None,
    )
    return replace(case.model, simulation=simulation), Options()


def first_row(case: Case) -> np.ndarray:
    """Return the published states (12 n,) at t = 0, with the consistent velocities of every run."""
    memory = MemorySink(only=(STATES,))
    model, _ = at_steps(case, SCHEMES[0], 1)
    moment = replace(model.simulation, dt=1e-9, t_final=1e-9)
    run(replace(model, simulation=moment), Options(), memory)
    return np.array(memory.table(STATES)[0, 1:])


def truth_of(case: Case) -> reference.Truth:
    """Return the reference solution, from the cache if model, times and code are the same."""
    modules = [reference, pieces, error_scenes] if case.motion else [reference]
    modules = [error_beams, error_contacts] if case.own_truth else modules
    key = hashlib.sha256()
    for module in modules:
        key.update(Path(str(module.__file__)).read_bytes())
    key.update(repr(replace(case.model, simulation=None)).encode())  # type: ignore[arg-type]
    key.update(case.times.tobytes())
    folder = Path(platformdirs.user_cache_dir("msahl", appauthor=False)) / "references"
    path = folder / f"truth-{key.hexdigest()[:32]}.pickle"
    if path.is_file():
        return pickle.loads(path.read_bytes())  # type: ignore[no-any-return]
    truth = solve_truth(case)
    folder.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(truth))
    return truth


def solve_truth(case: Case) -> reference.Truth:
    """Return the reference solution."""
    if case.own_truth:
        return case.own_truth(case)
    if not case.motion:
        return reference.truth(case.model, first_row(case), case.times)
    motion, finest = case.motion(), reference.FINEST
    ways = ((finest, 0.0), (reference.APART * finest, reference.ROUNDED))
    tables = [pieces.solve(motion, case.times, rtol, change) for rtol, change in ways]
    states, other = (pieces.published(motion, ys) for ys in tables)
    columns, others = (motion.columns(case.times, ys) for ys in tables)
    return reference.Truth(case.times, states, other, columns=columns, other_columns=others)


def largest_differences(
    rows: np.ndarray, others: np.ndarray, lengths: np.ndarray
) -> dict[str, float]:
    """Return the largest differences of published states (m, 12 n), by quantity."""
    a, b = (table.reshape(len(table), len(lengths), 4, 3) for table in (rows, others))
    largest = np.linalg.norm(a - b, axis=3).max(axis=(0, 1))
    rotation = (angles(a[:, :, 1], b[:, :, 1]) * lengths).max()
    return {
        "position": float(largest[0]),
        "orientation": float(rotation),
        "velocity": float(largest[2]),
    }


def largest_distance(points: np.ndarray, others: np.ndarray) -> float:
    """Return the largest distance of points (m, n, 3)."""
    return float(np.linalg.norm(points - others, axis=2).max())


def largest_share(
    columns: dict[str, np.ndarray], others: dict[str, np.ndarray]
) -> dict[str, float]:
    """Return the largest difference of signals, each over its largest value; empty if none."""
    sizes = {name: np.abs(other).max() or 1.0 for name, other in others.items()}
    shares = [np.abs(columns[name] - others[name]).max() / sizes[name] for name in others]
    return {"signal": float(max(shares))} if shares else {}


def true_errors(
    case: Case, memory: MemorySink, truth: reference.Truth, lengths: np.ndarray
) -> dict[str, float]:
    """Return the true errors of a run, by quantity."""
    rows = memory.table(STATES)[:, 1:]
    found = largest_differences(rows, truth.states, lengths)
    if truth.exact is not None and truth.where is not None:
        points = rows.reshape(len(rows), -1, 4, 3)[:, truth.where, 0]
        found["position"] = largest_distance(points, truth.exact)
    if truth.columns:
        names = signal_columns(case.model)
        table = memory.table(SIGNALS)
        columns = {name: table[:, names.index(name)] for name in truth.columns}
        found |= largest_share(columns, truth.columns)
    return found


def estimates(report: Report, truth: reference.Truth) -> dict[str, float]:
    """Return the estimates of a run by quantity, of signals over their largest values."""
    error = report.error
    # An estimate up to some time does not include the output times after it.
    if not error or not error["complete"]:
        return {}
    found = {quantity: error[quantity] for quantity in ("position", "orientation", "velocity")}
    if truth.columns:
        shares = [
            error["signals"][name]["error"] / np.abs(values).max()
            for name, values in truth.columns.items()
        ]
        found["signal"] = float(max(shares))
    return found


def floors_of(truth: reference.Truth, lengths: np.ndarray) -> dict[str, float]:
    """Return the floor of the errors, by quantity."""
    states = truth.states.reshape(len(truth.states), -1, 4, 3)
    size = float(np.abs(states[:, :, 0] - states[0, :, 0]).max() + lengths.max())
    speed = float((np.abs(states[:, :, 2]) + lengths[:, None] * np.abs(states[:, :, 3])).max())
    sizes = {"position": size, "orientation": size, "velocity": speed, "signal": 1.0}
    own = largest_differences(truth.states, truth.other, lengths)
    own |= largest_share(truth.other_columns, truth.columns)
    if truth.exact is not None and truth.exact_other is not None:
        own["position"] = max(own["position"], largest_distance(truth.exact, truth.exact_other))
    # Displacement by the initial violation rate until the stabilisation has removed it.
    drift = truth.opened + truth.opened_rate / reference.STABILISATION
    opened = {"position": drift, "orientation": drift, "velocity": truth.opened_rate}
    return {q: max(own.get(q, 0.0), ROUND_OFF * sizes[q], opened.get(q, 0.0)) for q in QUANTITIES}


def run_cells(
    case: Case, only: Sequence[str] = SCHEMES, tolerances: Sequence[float] = TOLERANCES
) -> list[Cell]:
    """Run all cells of a model."""
    truth = truth_of(case)
    lengths = build_system(case.model).frames.length[:-1]
    floors = floors_of(truth, lengths)
    cells = []
    for word in only:
        for per_output in REFINEMENTS:
            model, options = at_steps(case, word, per_output)
            cell = _cell(case, word, model, options, truth, lengths, floors)
            cells.append(replace(cell, step=model.simulation.dt))
    for tolerance in tolerances:
        for kind in (LOCAL, GLOBAL):
            given = by_tolerance(case, tolerance, kind)
            runs = [_cell(case, AUTO, *given, truth, lengths, floors)]
            # The first run may compile; it is not the only one that counts.
            while len(runs) < 2 or (len(runs) < REPEATS and (runs[-1].seconds or 0.0) < LONG):
                runs.append(_cell(case, AUTO, *given, truth, lengths, floors))
            seconds = min(cell.seconds or 0.0 for cell in runs)
            cells.append(replace(runs[0], tolerance=tolerance, kind=kind, seconds=seconds))
    return cells


def _cell(
    case: Case,
    word: str,
    model: Model,
    options: Options,
    truth: reference.Truth,
    lengths: np.ndarray,
    floors: dict[str, float],
) -> Cell:
    memory = MemorySink(only=(STATES, SIGNALS))
    report = run(model, options, memory, finer=case.finer())
    true: dict[str, float] = {}
    if report.status == "completed" and len(memory.table(STATES)) == len(truth.times):
        true = true_errors(case, memory, truth, lengths)
    estimated = estimates(report, truth) if true else {}
    numbers = {
        name: value
        for quantity in QUANTITIES
        for name, value in (
            (quantity, true.get(quantity)),
            (f"{quantity}_estimate", estimated.get(quantity)),
            (f"{quantity}_floor", floors[quantity]),
        )
    }
    seconds = report.seconds["loop"]
    if resolve(model.simulation).tolerance is not None:
        seconds += report.seconds.get("companion", 0.0)
    return Cell(
        model=case.name,
        scheme=word,
        step=None,
        tolerance=None,
        kind="",
        status=report.status,
        verdict=report.verdict["word"],
        accuracy=report.verdict["checks"].get("accuracy", {}).get("word", ""),
        steps=report.steps,
        seconds=seconds,
        **numbers,  # type: ignore[arg-type]
    )


def run_case(name: str) -> tuple[str, list[Cell]]:
    """Return name and cells of the model of this name."""
    return name, run_cells(case_of(name))


def case_of(name: str) -> Case:
    """Return the model of this name."""
    (case,) = (case for case in CASES if case.name == name)
    return case


def keep_reference(name: str) -> str:
    """Compute the reference solution of the model of this name, if it is not in the cache."""
    truth_of(case_of(name))
    return name


def run_all(names: Sequence[str]) -> Iterator[tuple[str, list[Cell]]]:
    """Yield the cells of these models, in the order in which processes complete them."""
    if len(names) == 1:
        yield run_case(names[0])
        return
    with get_context("spawn").Pool(PROCESSES) as pool:
        # References first: otherwise both processes would compile the same kernels.
        for done, name in enumerate(pool.imap_unordered(keep_reference, names), start=1):
            print(f"reference {done}/{len(names)} {name}", flush=True)
        yield from pool.imap_unordered(run_case, names)


def write_cells(path: Path, cells: Sequence[Cell]) -> None:
    """Write the table of results, and apart from it the seconds of runs by tolerance."""
    write_records(path, Cell, cells, DIGITS, omit=("seconds",))
    times = [
        Time(c.model, c.tolerance, c.kind, c.seconds) for c in cells if c.tolerance is not None
    ]
    write_records(_times_of(path), Time, times, DIGITS)


def read_cells(path: Path) -> list[Cell]:
    """Return the cells of a table, with the seconds of those by tolerance."""
    times = {(t.model, t.tolerance, t.kind): t.seconds for t in read_records(_times_of(path), Time)}
    return [
        replace(cell, seconds=times.get((cell.model, cell.tolerance or 0.0, cell.kind)))
        for cell in read_records(path, Cell)
    ]


def _times_of(path: Path) -> Path:
    return path.with_name(f"{path.stem}_seconds.csv")


def main(arguments: list[str]) -> None:
    """Run the chosen models, store their cells and write the page."""
    from tools.validation.error_page import write_page

    names = [case.name for case in CASES]
    kinds = sorted({case.kind for case in CASES})
    unknown = sorted(set(arguments) - {"--page", *names, *kinds})
    if unknown:
        there = f"there are: {', '.join(names)}; kinds: {', '.join(kinds)}"
        sys.exit(f"no model or kind {', '.join(unknown)}; {there}")
    if "--page" not in arguments:
        chosen = [c.name for c in CASES if c.name in arguments or c.kind in arguments]
        wanted = chosen or names
        kept: dict[str, list[Cell]] = {name: [] for name in names}
        for cell in read_cells(CSV) if arguments else ():
            kept[cell.model].append(cell)
        for done, (name, cells) in enumerate(run_all(wanted), start=1):
            kept[name] = cells
            print(f"{done}/{len(wanted)} {name}: {_words(cells)}", flush=True)
            write_cells(CSV, [cell for cells in kept.values() for cell in cells])
    write_page(read_cells(CSV))


def _words(cells: Sequence[Cell]) -> str:
    clear = [c.ratio for c in comparisons(cells) if c.clear]
    failed = sum(cell.status != "completed" for cell in cells)
    span = f"estimated/true {min(clear):.2g} to {max(clear):.2g}" if clear else "all at the floor"
    return f"{len(cells)} runs, {failed} not completed, {span}"


if __name__ == "__main__":
    main(sys.argv[1:])
