"""Run the cells of the stability table, each by the command line and within a time limit.

A cell is a run of a family's deck with one value of its parameter, one scheme and one step size.
Cells are run in two processes.
"""

import json
import os
import re
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import ceil, isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from click.testing import CliRunner
from lxml import etree

from msahl.algebra.rotation import to_axis_angle
from msahl.algebra.rotation_arrays import angles
from msahl.cli.console import BAD_INPUT
from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.model import Model, Options
from msahl.model.scheme import COLLOCATION, DEFAULT, DEGREE, ORDER_TWO
from msahl.results.read import ResultError, read_run
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.verdict import ENERGY_FAIL, PASS
from msahl.schemes.collocation import newton, predictor, scipy_root
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.fixed_stepper import FixedStepper
from msahl.schemes.midpoint import equations, free_equations
from msahl.start.velocities import StartError
from msahl.study.independent import independent
from msahl.study.reference import Reference
from msahl.study.runs import run_in_memory, with_step
from msahl.system.build import build_system
from tests.support.closed_forms import recognise
from tools.validation.extreme_families import DECKS, FAMILIES, Family

COMPARED = (*ORDER_TWO, *(f"{name}{DEGREE}" for name in COLLOCATION))
"""Schemes of the table: those of order 2, and those of higher order with their default degree."""
STEPS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
SPAN = 10.0
"""Duration of a run [s], unless it has too many steps or fewer than ``FEWEST``."""
FEWEST = 10
ROWS = 100
"""Approximate number of output times up to the time of comparison."""
BOUND = 4.0
"""Processor seconds after which a run is interrupted, and after twice as many ended: most runs take
a hundredth of them. Families of long runs have a limit of their own."""
REFERENCE_BOUND = 20.0
LARGEST = 600
"""Largest number of unknowns for which the condition number is computed: its matrix is dense."""
KEPT = 1e-9
"""Largest accepted energy balance error over the largest kinetic energy, and largest accepted
constraint violation over the model's arm."""
KEPT_NEARLY = ENERGY_FAIL
"""Largest accepted energy balance error of schemes of higher order, which conserve or dissipate
energy only as accurately as positions; above it a run's own verdict is FAIL."""
ROUND_OFF = 1e-14
"""Energy balance error over the energy at the start that is rounding error, if hardly anything has
moved yet."""

GOOD, COARSE, BOUNDED, DOUBTFUL, FAILED, REFUSED, LATE = (
    "good",
    "coarse",
    "bounded",
    "doubtful",
    "failed",
    "refused",
    "out of time",
)
STABLE = (GOOD, COARSE, BOUNDED)


@dataclass(frozen=True)
class Cell:
    """The results of one run; None if a number is not available.

    ``error`` and ``rotation_error`` [m] are the largest errors of positions, and of orientations
    times lengths, up to the time ``compared`` [s]. ``verdict`` is the run's own, ``failed_checks``
    are the checks that were not PASS; ``accuracy_verdict`` and ``accuracy_failures`` are those of a
    run to the time of comparison with --accuracy ``tolerance``.
    """

    family: str
    value: float | str
    scheme: str
    dt: float
    t_final: float
    outcome: str
    steps: int
    time: float
    iterations: float | None
    subdivisions: int | None
    scipy_steps: int | None
    energy: float | None
    violation: float | None
    violation_rate: float | None
    condition: float | None
    reference: str
    compared: float | None
    error: float | None
    rotation_error: float | None
    tolerance: float
    output_times: int
    output_times_found: int
    message: str
    verdict: str | None = None
    failed_checks: str | None = None
    accuracy_verdict: str | None = None
    accuracy_failures: str | None = None


@dataclass(frozen=True)
class Run:
    """A run of ``n`` steps, one of ``every`` written, compared up to step ``k``."""

    dt: float
    n: int
    k: int
    every: int

    @property
    def t_final(self) -> float:
        """Return the end time [s]."""
        return self.n * self.dt

    @property
    def compared(self) -> float:
        """Return the time up to which the run is compared [s]."""
        return self.k * self.dt

    @property
    def times(self) -> np.ndarray:
        """Return the output times that are compared [s]."""
        return self.dt * np.arange(self.every, self.k + 1, self.every)


def plan(dt: float, horizon: float, most: int, exact: bool = False) -> Run:
    """Return the run with step size ``dt`` to the limit of its steps or time, compared at the last
    output time before the ``horizon``, or at its first step."""
    n = most if exact else min(most, max(FEWEST, round(SPAN / dt)))
    k = max(1, min(n, int(horizon / dt * (1.0 + 1e-9))))
    every = ceil(k / ROWS)
    return Run(dt, n, k // every * every, every)


def plan_of(family: Family, x: float, dt: float) -> Run:
    """Return the run of a family's cell."""
    return plan(dt, family.horizon(x), family.steps(x), family.exact_steps)


class ExpiredError(Exception):
    """A computation takes more seconds than it may."""


def _expire(number: int, frame: Any) -> None:
    raise ExpiredError


def _ask_to_stop(number: int, frame: Any) -> None:
    os.kill(os.getpid(), signal.SIGTERM)


@contextmanager
def bounded(seconds: float, handler: Callable[[int, Any], None] = _expire) -> Iterator[None]:
    """Call ``handler`` after every ``seconds`` of processor time."""
    before = signal.signal(signal.SIGPROF, handler)
    signal.setitimer(signal.ITIMER_PROF, seconds, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def run_deck(
    deck: Path,
    folder: Path,
    scheme: str,
    run: Run,
    bound: float = BOUND,
    accuracy: float | None = None,
) -> dict[str, Any]:
    """Run ``deck`` by the command line, with --accuracy ``accuracy`` [m] if it is given; return its
    run.json, or a status and the message.

    ``output_times_found`` counts the complete rows of states.csv.
    """
    words: list[Any] = ["run", deck, "-o", folder, "--scheme", scheme, "--every", run.every, "-q"]
    words += ["--dt", repr(run.dt), "--t-final", repr(run.t_final)]
    words += ["--accuracy", accuracy] if accuracy else []
    with bounded(bound, _ask_to_stop):
        result = CliRunner().invoke(main, [str(word) for word in words])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    path = folder / "run.json"
    if not path.exists():
        if result.exit_code != BAD_INPUT:
            message = f"did not stop within {bound:g} s after it was interrupted"
            return {"status": LATE, "message": message}
        return {"status": REFUSED, "message": result.output.strip().replace(str(deck), deck.name)}
    info: dict[str, Any] = json.loads(path.read_text())
    tables = [folder / "states.csv", folder / "states.csv.part"]
    lines = next(table for table in tables if table.exists()).read_bytes()
    info["output_times_found"] = lines.count(b"\n") - 1
    return info


def states(folder: Path, run: Run, bodies: int) -> np.ndarray | None:
    """Return the states (m, n, 12) of a run that are compared; None if it did not get there."""
    tables = [folder / "states.csv", folder / "states.csv.part"]
    table = next((table for table in tables if table.exists()), None)
    if table is None:
        return None
    count = len(run.times)
    rows = pd.read_csv(table, skiprows=[1], nrows=count)
    return rows.to_numpy()[:, 1:].reshape(count, bodies, 12) if len(rows) == count else None


def judge(
    info: dict[str, Any], error: float | None, tolerance: float, arm: float, kept: float = KEPT
) -> str:
    """Return the outcome in a word. The constraint violation is compared with ``arm`` [m]; ``kept``
    is the accepted energy balance error over the largest kinetic energy.
    """
    status = info["status"]
    if status in (LATE, REFUSED):
        return str(status)
    if status == "interrupted":
        return LATE
    if status != "completed" or info["outputTimes"] != info["output_times_found"]:
        return FAILED
    extremes = info["extremes"]
    round_off = ROUND_OFF * abs(extremes["energyAtStart"])
    allowed = max(kept * extremes["largestKineticEnergy"], round_off)
    if extremes["energyErrorMax"] > allowed or extremes["constraintViolationMax"] > KEPT * arm:
        return DOUBTFUL
    if error is None:
        return BOUNDED
    return GOOD if error <= tolerance else COARSE


def energy_asked(scheme: str) -> float:
    """Return the accepted energy balance error of a ``scheme`` over the largest kinetic energy."""
    return KEPT if scheme in ORDER_TWO else KEPT_NEARLY


class Task(NamedTuple):
    """A cell to be run: its place in the table, and the tolerance and arm [m] of its family."""

    family: str
    value: float | str
    scheme: str
    run: Run
    tolerance: float
    arm: float


def cell(
    task: Task, info: dict[str, Any], kind: str, found: "Errors", condition: float | None
) -> Cell:
    """Return the cell of a run from its run.json; ``kind`` is that of the reference."""
    run = task.run
    extremes, steps = info.get("extremes", {}), info.get("steps", 0)
    verdict = info.get("verdict") or {}
    scipy_steps = info.get("scipySteps")
    return Cell(
        family=task.family,
        value=task.value,
        scheme=task.scheme,
        dt=run.dt,
        t_final=run.t_final,
        outcome=judge(info, found.position, task.tolerance, task.arm, energy_asked(task.scheme)),
        steps=steps,
        time=info.get("time", 0.0),
        iterations=info["iterations"] / steps if steps else None,
        subdivisions=info.get("subdivisions"),
        # The first step of every subsystem is always solved by scipy.
        scipy_steps=None if scipy_steps is None else max(0, scipy_steps - info["subsystems"]),
        energy=_finite(extremes.get("energyErrorMaxRelative")),
        violation=_finite(extremes.get("constraintViolationMax")),
        violation_rate=_finite(extremes.get("constraintViolationRateMax")),
        condition=condition,
        reference="" if found.position is None else kind,
        compared=None if found.position is None else run.compared,
        error=found.position,
        rotation_error=found.rotation,
        tolerance=task.tolerance,
        output_times=info.get("outputTimes", 0),
        output_times_found=info.get("output_times_found", 0),
        message=_what_happened(info.get("message", "")),
        verdict=verdict.get("word"),
        failed_checks=_failed(verdict),
    )


def _failed(verdict: dict[str, Any]) -> str | None:
    """Return the names of the checks of a verdict that are not PASS."""
    checks = verdict.get("checks", {}).items()
    return " ".join(name for name, check in checks if check["word"] != PASS) or None


def _what_happened(message: str) -> str:
    """Return a message without the command that continues a run, which names a temporary folder."""
    return re.split("; (?:go on|begin anew|continue|start)", message)[0]


def _finite(number: float | None) -> float | None:
    return number if number is not None and isfinite(number) else None


class Errors(NamedTuple):
    """Largest errors at the times compared [m]: of positions, and of rotations times lengths."""

    position: float | None
    rotation: float | None


UNKNOWN = Errors(None, None)


def errors(ours: np.ndarray | None, true: np.ndarray, lengths: np.ndarray) -> Errors:
    """Return the errors of states (m, n, 12) where the reference is known; it must be known at the
    last output time."""
    if ours is None or not np.isfinite(true[-1:]).all() or not len(true):
        return UNKNOWN
    known = np.isfinite(true).all(axis=(1, 2))
    a, b = ours[known], true[known]
    distances = np.sqrt(((a[..., :3] - b[..., :3]) ** 2).sum(axis=-1))
    rotations = angles(a[..., 3:6], b[..., 3:6]) * lengths
    return Errors(_finite(float(distances.max())), _finite(float(rotations.max())))


def condition(model: Model, dt: float, scheme: str) -> float | None:
    """Return the condition number of the scaled Jacobian of the first step by a ``scheme``, of the
    largest subsystem; None if that is too large or there are no consistent initial conditions.
    """
    try:
        integrator = SubsystemIntegrator(with_step(model, dt, scheme=scheme), "newton", False, 1)
    except StartError:
        return None
    workspace, stepper = integrator.workspace, integrator.stepper
    assert isinstance(stepper, FixedStepper)
    high_steps = getattr(stepper.method, "subsystem", None)
    free = workspace.unknowns.free
    if free.size * (high_steps.y.shape[1] if high_steps else 1) > LARGEST:
        return None
    with np.errstate(all="ignore"):
        A = _high_jacobian(high_steps, dt) if high_steps else _jacobian(workspace, dt)
        return _finite(float(np.linalg.cond(A)))


def _jacobian(workspace: Workspace, dt: float) -> np.ndarray:
    """Return the Jacobian (f, f) at the predicted unknowns."""
    free = workspace.unknowns.free
    equations.predict(workspace.system, workspace.state, workspace.start, dt, workspace.Z)
    z, A = workspace.Z.reshape(-1)[free].copy(), np.zeros(free.size**2)
    free_equations.jacobian(workspace, dt, z, A)
    return A.reshape(free.size, free.size)


def _high_jacobian(subsystem: CollocationWorkspace, dt: float) -> np.ndarray:
    """Return the Jacobian (f s, f s) for degree s; the stages of an unknown are adjacent."""
    workspace, stages, (f, s) = subsystem.workspace, subsystem.stages, subsystem.y.shape
    predictor.predict(workspace.system, workspace.state, workspace.start, stages, dt)
    z = stages.Z.reshape(s, -1)[:, workspace.unknowns.free].T
    newton.evaluate_free(subsystem, dt, z, np.empty((f, s)), True)
    return scipy_root.jacobian(subsystem)


FINER = 10
"""Number of steps of a reference run per step of the finest run that it is compared with."""


class Truth:
    """Reference states of a model at the output times of ``runs``: from a closed form, else from
    the independent solution, else from the default scheme at a step ``FINER`` times smaller."""

    def __init__(self, deck: Path, model: Model, runs: Sequence[Run], accuracy: float) -> None:
        self.kind = "none"
        self.bodies = len(model.bodies) if model else 0
        self.times, self.table = np.zeros(0), np.zeros((0, self.bodies, 12))
        if not runs:
            return
        times = np.unique(np.concatenate([run.times for run in runs]))
        try:
            with bounded(REFERENCE_BOUND):
                found: Reference = recognise(model) or independent(model, times, accuracy)
                table = found.states(times)
        except (ExpiredError, ResultError, StartError, np.linalg.LinAlgError, AssertionError):
            self._run_finer(deck, runs)
            return
        self.kind = "exact" if np.isinf(found.horizon) else "independent"
        known = times <= found.horizon
        self.times, self.table = times[known], table.reshape(len(times), -1, 12)[known]

    def _run_finer(self, deck: Path, runs: Sequence[Run]) -> None:
        self.kind = "finer"
        finest: dict[float, Run] = {}
        for run in sorted(runs, key=lambda run: -run.dt):
            finest[run.compared] = run
        for run in finest.values():
            n, folder = FINER * run.k, deck.parent / f"finer-{run.dt:g}"
            finer = Run(run.dt / FINER, n, n, FINER * run.every)
            info = run_deck(deck, folder, DEFAULT, finer)
            table = states(folder, finer, self.bodies)
            if info["status"] == "completed" and table is not None:
                self._add(run.times, table)

    def _add(self, times: np.ndarray, table: np.ndarray) -> None:
        order = np.argsort(np.concatenate([self.times, times]), kind="stable")
        self.times = np.concatenate([self.times, times])[order]
        self.table = np.concatenate([self.table, table])[order]

    def at(self, times: np.ndarray) -> np.ndarray:
        """Return the states (m, n, 12) at these times; nan where they are not known."""
        found = np.full((len(times), self.bodies, 12), np.nan)
        if self.times.size:
            near = np.abs(self.times[:, None] - times).argmin(axis=0)
            known = np.abs(self.times[near] - times) <= 1e-9 * times
            found[known] = self.table[near[known]]
        return found


def run_group(name: str, x: float, schemes: Iterable[str], steps: Iterable[float]) -> list[Cell]:
    """Run all cells of a value of the family ``name``."""
    family = FAMILIES[name]
    tolerance = family.good * family.size(x)
    cells = []
    with TemporaryDirectory() as folder:
        home = Path(folder)
        deck = home / f"{name}.xml"
        deck.write_bytes(family.with_value(x))
        model = read_deck(deck)
        runs = [plan_of(family, x, dt) for dt in steps]
        lengths = build_system(model).frames.length[:-1]
        # A run whose first step is longer than the horizon is not compared.
        near = [run for run in runs if run.compared <= family.horizon(x) * (1.0 + 1e-9)]
        compared = near if family.known else []
        truth = Truth(deck, family.model(model, x), compared, 1e-2 * tolerance)
        for run in runs:
            true = truth.at(run.times)
            for scheme in schemes:
                known = condition(model, run.dt, DEFAULT if scheme in ORDER_TWO else scheme)
                out = home / f"{run.dt:g}-{scheme}"
                info = run_deck(deck, out, scheme, run, family.bound)
                found = errors(states(out, run, len(model.bodies)), true, lengths)
                task = Task(name, x, scheme, run, tolerance, family.arm(x))
                made = cell(task, info, truth.kind, found, known)
                if found.position is not None:
                    short = replace(run, n=run.k)
                    info = run_deck(deck, out, scheme, short, family.bound, tolerance)
                    made = with_accuracy_verdict(made, info)
                cells.append(made)
    return cells


def with_accuracy_verdict(made: Cell, info: dict[str, Any]) -> Cell:
    """Return the cell with the verdict on a run with --accuracy up to the time of comparison."""
    verdict = info.get("verdict")
    if info["status"] != "completed" or not verdict:
        return made
    failures = _failed(verdict)
    return replace(made, accuracy_verdict=verdict["word"], accuracy_failures=failures)


RESTART = "restart"
RESTARTED = {
    "extreme/mass_ratio": "a chain of heavy and light links, halfway down",
    "extreme/inverted": "a pendulum that falls from the top",
    "extreme/spin": "a top of 1e4 rad/s",
    "extreme/drift": "a chain far away and fast",
    "extreme/stiff_pendulum": "a bob that bounces on a stiff spring",
    "extreme/toggle": "a slider-crank wherever it is",
    "extreme/taut_chain": "a chain between two pins",
    "basics/torque_free": "a body that has rotation_error over many times",
    "joints/rolling_disk": "a disk that rolls",
}
"""Decks whose runs are stopped halfway and continued by a deck of the last state."""
RESTART_HORIZON = 2.0


def restarted(deck: bytes, folder: Path) -> bytes:
    """Return ``deck`` with the bodies in the last state of the run in ``folder``."""
    run = read_run(folder)
    root: Any = etree.fromstring(deck)
    last = run.states.iloc[-1]
    (bodies,) = root.xpath("//bodies")
    if bodies.find("ground") is None:
        etree.SubElement(etree.SubElement(bodies, "ground"), "name").text = "Ground"
    ground = bodies.findtext("ground/name").strip()
    for body in bodies.iterfind("rigidBody"):
        name = body.findtext("name").strip()
        for old in body.findall("initialConditions"):
            body.remove(old)
        start = etree.SubElement(body, "initialConditions")
        x, v, w = (
            [float(last[f"{name}.{letter}"]) for letter in letters.split()]
            for letters in ("x y z", "vx vy vz", "wx wy wz")
        )
        p1, p2, p3 = (float(last[f"{name}.P{k}"]) for k in (1, 2, 3))
        axis, angle = to_axis_angle((p1, p2, p3))
        _add_vector(start, "position", "x y z", x, ground)
        rotation = etree.SubElement(etree.SubElement(start, "orientation"), "eulerRotation")
        etree.SubElement(rotation, "phi", units="rad").text = repr(angle)
        for tag, number in zip(("u1", "u2", "u3"), axis, strict=True):
            etree.SubElement(rotation, tag).text = repr(number)
        _add_vector(start, "velocity", "v1 v2 v3", v, name)
        _add_vector(start, "angularVelocity", "omega1 omega2 omega3", w, name)
    text: bytes = etree.tostring(root.getroottree(), xml_declaration=True, encoding="UTF-8")
    return text


def _add_vector(
    start: etree._Element, tag: str, parts: str, numbers: Iterable[float], basis: str
) -> None:
    vector = etree.SubElement(start, tag, basis=basis)
    for part, number in zip(parts.split(), numbers, strict=True):
        etree.SubElement(vector, part).text = repr(number)


def run_restarts(name: str, schemes: Iterable[str], steps: Iterable[float]) -> list[Cell]:
    """Run a deck to half its time, and from there by a deck of its last state."""
    cells = []
    tolerance = 1e-3
    with TemporaryDirectory() as folder:
        home = Path(folder)
        deck = DECKS / f"{name}.xml"
        model = read_deck(deck)
        first_halves = {dt: half(dt) for dt in steps}
        complete_runs = {
            dt: Run(dt, 2 * run.n, 2 * run.n, run.every) for dt, run in first_halves.items()
        }
        lengths = build_system(model).frames.length[:-1]
        near = [run for run in complete_runs.values() if run.compared <= RESTART_HORIZON]
        truth = Truth(deck, model, near, 1e-2 * tolerance)
        for dt, run in first_halves.items():
            for scheme in schemes:
                first, second = home / f"{dt:g}-{scheme}-1", home / f"{dt:g}-{scheme}-2"
                info = run_deck(deck, first, scheme, run)
                ours, complete = None, complete_runs[dt]
                if info["status"] == "completed":
                    on = home / "on.xml"
                    on.write_bytes(restarted(deck.read_bytes(), first))
                    info = run_deck(on, second, scheme, run)
                    ours = states(second, run, len(model.bodies))
                found = errors(ours, truth.at(complete.times[len(run.times) :]), lengths)
                task = Task(RESTART, Path(name).stem, scheme, complete, tolerance, 1.0)
                cells.append(cell(task, info, truth.kind, found, None))
    return cells


def half(dt: float) -> Run:
    """Return half of a run up to the horizon, or of ten steps."""
    n = max(5, min(5000, round(0.5 * RESTART_HORIZON / dt)))
    every = ceil(n / ROWS)
    n = n // every * every
    return Run(dt, n, n, every)


COSTLY = ("long_chain", "long_run")
"""Families whose runs are started first, because they take longest."""


def warm_runs(schemes: Iterable[str] = COMPARED) -> None:
    """Compile the kernels of all runs, so that no cell's time limit is used up by compilation."""
    for name in ("long_run", "stiff_spring"):
        model = read_deck(FAMILIES[name].path)
        for scheme in schemes:
            for solver in ("auto", "root"):
                run_in_memory(with_step(model, 1e-3, 1e-2, scheme), Options(solver=solver))


def warm_references() -> None:
    """Compile the kernels of the independent solution."""
    for name in ("mass_ratio", "bushing_loop"):
        independent(read_deck(FAMILIES[name].path), np.array([1e-3]), 1e-6)


ALL = (*FAMILIES, RESTART)


def run_all(names: Sequence[str], schemes: Sequence[str]) -> Iterator[tuple[str, list[Cell]]]:
    """Run every cell of the families ``names`` by the ``schemes`` in two processes. Yield the cells
    of one value after the other as they are completed, with a line that names them.
    """
    warm_runs(dict.fromkeys((DEFAULT, *schemes)))
    warm_references()
    began = time.perf_counter()
    with ProcessPoolExecutor(2) as pool:
        groups = {
            pool.submit(run_value, name, x, tuple(schemes), STEPS): f"{name} {show_value(x)}"
            for name in sorted(names, key=lambda name: name not in COSTLY)
            for x in reversed(values_of(name))
        }
        for future in as_completed(groups):
            yield f"{time.perf_counter() - began:6.0f} s  {groups[future]}", future.result()


def run_value(
    name: str, x: float | str, schemes: Iterable[str], steps: Iterable[float]
) -> list[Cell]:
    """Return all cells of a value of a family, or of a deck that is restarted."""
    if isinstance(x, str):
        return run_restarts(x, schemes, steps)
    return run_group(name, x, schemes, steps)


def values_of(name: str) -> tuple[float | str, ...]:
    """Return the values of a family."""
    return FAMILIES[name].values if name in FAMILIES else tuple(RESTARTED)


def show_value(value: float | str) -> str:
    """Return the text of a value."""
    return value.replace("_", " ") if isinstance(value, str) else f"{value:.4g}"


def place(cell: Cell) -> tuple[str, float | str, str, float]:
    """Return the key of a cell in the table."""
    return cell.family, cell.value, cell.scheme, cell.dt


def in_order(cells: Iterable[Cell]) -> list[Cell]:
    """Return the cells in the order of the families, their values, the schemes and the steps."""

    def rank(cell: Cell) -> tuple[int, int, int, float]:
        values = [Path(x).stem if isinstance(x, str) else x for x in values_of(cell.family)]
        where = ALL.index(cell.family), values.index(cell.value), COMPARED.index(cell.scheme)
        return *where, cell.dt

    return sorted(cells, key=rank)
