"""Cells of the stability table: a family's deck with one value, one scheme, one step, run as a
user would run it, in two processes, and none for longer than a bound.
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
from extreme import DECKS, FAMILIES, Family
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
from msahl.run.verdict import ENERGY_SPOILT
from msahl.schemes.collocation import newton, predictor, scipy_root
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.schemes.fixed_stepper import FixedStepper
from msahl.schemes.midpoint import equations, free_equations
from msahl.schemes.midpoint.workspace import Workspace
from msahl.start.velocities import StartError
from msahl.study.reference import choose_reference
from msahl.study.runs import run_in_memory, with_step
from msahl.system.build import build_system

COMPARED = (*ORDER_TWO, *(f"{name}{DEGREE}" for name in COLLOCATION))
"""Schemes of the table: those of order 2, and those of higher order with the degree they have where
none is given."""
STEPS = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
SPAN = 10.0
"""Runs go on for so long [s] if their steps are not too many, for ``FEWEST`` steps at least."""
FEWEST = 10
ROWS = 100
"""About how many rows a run writes up to the time at which it is compared."""
BOUND = 4.0
"""Processor seconds after which a run is asked to stop, and after as many again told to: most take
a hundredth of them. Families of long runs have a bound of their own."""
REFERENCE_BOUND = 20.0
LARGEST = 600
"""Most unknowns with which the condition number is taken: its matrix is dense."""
KEPT = 1e-9
"""Energy error over the largest kinetic energy, and gap over the scene's arm, asked of a run."""
KEPT_NEARLY = ENERGY_SPOILT
"""The former asked of schemes of higher order: what they keep nearly, or take, is as wrong as the
positions are, and beyond this a run's own verdict calls the motion spoilt."""
ROUND_OFF = 1e-14
"""Energy error over the energy at the start that is round-off, where hardly anything moves yet."""

GOOD, COARSE, BOUNDED, DOUBTFUL, FAILED, REFUSED, LATE = (
    "good",
    "coarse",
    "bounded",
    "doubtful",
    "failed",
    "refused",
    "out of time",
)
HELD = (GOOD, COARSE, BOUNDED)


@dataclass(frozen=True)
class Cell:
    """What came of one run; None where there is no such figure."""

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
    rescues: int | None
    energy: float | None
    gap: float | None
    violation_rate: float | None
    condition: float | None
    seconds: float | None
    reference: str
    compared: float | None
    error: float | None
    turned: float | None
    tolerance: float
    rows: int
    rows_found: int
    message: str
    verdict: str | None = None
    reasons: str | None = None
    judged: str | None = None
    judged_by: str | None = None


@dataclass(frozen=True)
class Run:
    """What a cell is to run: ``n`` steps, every ``every``th written, compared up to step ``k``."""

    dt: float
    n: int
    k: int
    every: int

    @property
    def t_final(self) -> float:
        """End [s]."""
        return self.n * self.dt

    @property
    def compared(self) -> float:
        """Time up to which there is a comparison [s]."""
        return self.k * self.dt

    @property
    def times(self) -> np.ndarray:
        """Those of the rows that are compared [s]."""
        return self.dt * np.arange(self.every, self.k + 1, self.every)


def plan(dt: float, horizon: float, most: int, exact: bool = False) -> Run:
    """The run of a step ``dt``: to the bound on its steps or time, compared at the last row before
    the ``horizon``, or at its first step."""
    n = most if exact else min(most, max(FEWEST, round(SPAN / dt)))
    k = max(1, min(n, int(horizon / dt * (1.0 + 1e-9))))
    every = ceil(k / ROWS)
    return Run(dt, n, k // every * every, every)


def plan_of(family: Family, x: float, dt: float) -> Run:
    """The run of a family's cell."""
    return plan(dt, family.horizon(x), family.steps(x), family.exact_steps)


# Time bounds -------------------------------------------------------------------------------------


class ExpiredError(Exception):
    """More seconds than a computation may take."""


def _expire(number: int, frame: Any) -> None:
    raise ExpiredError


def _ask_to_stop(number: int, frame: Any) -> None:
    os.kill(os.getpid(), signal.SIGTERM)


@contextmanager
def bounded(seconds: float, handler: Callable[[int, Any], None] = _expire) -> Iterator[None]:
    """Call ``handler`` after so many seconds of this processor, and after as many again."""
    before = signal.signal(signal.SIGPROF, handler)
    signal.setitimer(signal.ITIMER_PROF, seconds, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


# One run -----------------------------------------------------------------------------------------


def run_deck(
    deck: Path,
    folder: Path,
    scheme: str,
    run: Run,
    bound: float = BOUND,
    shadow: float | None = None,
) -> dict[str, Any]:
    """Run ``deck`` by the command, with one at half the step for an accuracy ``shadow`` [m]; its
    run.json, or what it said instead.

    ``rows_found`` counts the whole rows of states.csv, finished or not.
    """
    words: list[Any] = ["run", deck, "-o", folder, "--scheme", scheme, "--every", run.every, "-q"]
    words += ["--dt", repr(run.dt), "--t-final", repr(run.t_final)]
    words += ["--shadow", shadow] if shadow else []
    with bounded(bound, _ask_to_stop):
        result = CliRunner().invoke(main, [str(word) for word in words])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    path = folder / "run.json"
    if not path.exists():
        if result.exit_code != BAD_INPUT:
            told = f"did not stop within {bound:g} s of being asked to, in its last steps"
            return {"status": LATE, "message": told}
        return {"status": REFUSED, "message": result.output.strip().replace(str(deck), deck.name)}
    info: dict[str, Any] = json.loads(path.read_text())
    tables = [folder / "states.csv", folder / "states.csv.part"]
    lines = next(table for table in tables if table.exists()).read_bytes()
    info["rows_found"] = lines.count(b"\n") - 1
    return info


def states(folder: Path, run: Run, bodies: int) -> np.ndarray | None:
    """(m, n, 12) the rows of a run that are compared; None if it did not get there."""
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
    """The outcome in a word; ``arm`` [m] is what a gap is compared with, ``kept`` the energy error
    over the largest kinetic energy that is asked for.
    """
    status = info["status"]
    if status in (LATE, REFUSED):
        return str(status)
    if status == "interrupted":
        return LATE
    if status != "completed" or info["outputTimes"] != info["rows_found"]:
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
    """Energy error over the largest kinetic energy that is asked of a ``scheme``."""
    return KEPT if scheme in ORDER_TWO else KEPT_NEARLY


def cell(
    family: str,
    value: float | str,
    scheme: str,
    run: Run,
    info: dict[str, Any],
    truth: "Truth",
    found: "Errors",
    tolerance: float,
    arm: float,
    condition: float | None,
) -> Cell:
    """A run's figures."""
    extremes, steps = info.get("extremes", {}), info.get("steps", 0)
    seconds, verdict = info.get("seconds", {}), info.get("verdict") or {}
    rescues = info.get("scipySteps")
    return Cell(
        family=family,
        value=value,
        scheme=scheme,
        dt=run.dt,
        t_final=run.t_final,
        outcome=judge(info, found.position, tolerance, arm, energy_asked(scheme)),
        steps=steps,
        time=info.get("time", 0.0),
        iterations=info["iterations"] / steps if steps else None,
        subdivisions=info.get("subdivisions"),
        # Every island's first step is taken by root as a matter of course.
        rescues=None if rescues is None else max(0, rescues - info["subsystems"]),
        energy=_finite(extremes.get("energyErrorMaxRelative")),
        gap=_finite(extremes.get("constraintViolationMax")),
        violation_rate=_finite(extremes.get("constraintViolationRateMax")),
        condition=condition,
        seconds=seconds.get("loop"),
        reference="" if found.position is None else truth.kind,
        compared=None if found.position is None else run.compared,
        error=found.position,
        turned=found.turn,
        tolerance=tolerance,
        rows=info.get("outputTimes", 0),
        rows_found=info.get("rows_found", 0),
        message=_what_happened(info.get("message", "")),
        verdict=verdict.get("word"),
        reasons="; ".join(verdict.get("reasons", ())) or None,
    )


def _what_happened(message: str) -> str:
    """A message without the command that goes on with a run, which is in a folder of the moment."""
    return re.split("; (?:go on|begin anew)", message)[0]


def _finite(number: float | None) -> float | None:
    return number if number is not None and isfinite(number) else None


class Errors(NamedTuple):
    """Largest errors over the rows compared [m]: of positions, and of turns times lengths."""

    position: float | None
    turn: float | None


UNKNOWN = Errors(None, None)


def errors(ours: np.ndarray | None, true: np.ndarray, lengths: np.ndarray) -> Errors:
    """Of rows (m, n, 12), where the true ones are known, that of the last row among them."""
    if ours is None or not np.isfinite(true[-1:]).all() or not len(true):
        return UNKNOWN
    known = np.isfinite(true).all(axis=(1, 2))
    a, b = ours[known], true[known]
    ways = np.sqrt(((a[..., :3] - b[..., :3]) ** 2).sum(axis=-1))
    turns = angles(a[..., 3:6], b[..., 3:6]) * lengths
    return Errors(_finite(float(ways.max())), _finite(float(turns.max())))


def condition(model: Model, dt: float, scheme: str) -> float | None:
    """Condition number of the scaled Jacobian of the first step by a ``scheme``, of the largest
    island; None where that is too large or there is no start.
    """
    try:
        integrator = SubsystemIntegrator(with_step(model, dt, scheme=scheme), "newton", False, 1)
    except StartError:
        return None
    scene, stepper = integrator.workspace, integrator.stepper
    assert isinstance(stepper, FixedStepper)
    high_steps = getattr(stepper.method, "subsystem", None)
    free = scene.unknowns.free
    if free.size * (high_steps.y.shape[1] if high_steps else 1) > LARGEST:
        return None
    with np.errstate(all="ignore"):
        A = _high_jacobian(high_steps, dt) if high_steps else _jacobian(scene, dt)
        return _finite(float(np.linalg.cond(A)))


def _jacobian(scene: Workspace, dt: float) -> np.ndarray:
    """(f, f) at the first guess."""
    free = scene.unknowns.free
    equations.predict(scene.system, scene.state, scene.start, dt, scene.Z)
    z, A = scene.Z.reshape(-1)[free].copy(), np.zeros(free.size**2)
    free_equations.jacobian(scene, dt, z, A)
    return A.reshape(free.size, free.size)


def _high_jacobian(island: CollocationWorkspace, dt: float) -> np.ndarray:
    """(f s, f s) likewise, of higher degree s; an unknown's stages stand together."""
    scene, stages, (f, s) = island.scene, island.stages, island.y.shape
    predictor.predict(scene.system, scene.state, scene.start, stages, dt)
    z = stages.Z.reshape(s, -1)[:, scene.unknowns.free].T
    newton.probe(island, dt, z, np.empty((f, s)), True)
    return scipy_root.jacobian(island)


# References --------------------------------------------------------------------------------------


FINER = 10
"""Steps of the finer run in one of the finest run that is compared at a time."""


class Truth:
    """True states of a scene at the rows of ``runs``: by a closed form or the independent
    solution, else by the default scheme at a step ``FINER`` times as small as the smallest."""

    def __init__(self, deck: Path, model: Model, runs: Sequence[Run], accuracy: float) -> None:
        self.kind = "none"
        self.bodies = len(model.bodies) if model else 0
        self.times, self.table = np.zeros(0), np.zeros((0, self.bodies, 12))
        if not runs:
            return
        times = np.unique(np.concatenate([run.times for run in runs]))
        try:
            with bounded(REFERENCE_BOUND):
                found = choose_reference("auto", model, times, accuracy)
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
        """(m, n, 12) at these times; nan where it is not known."""
        found = np.full((len(times), self.bodies, 12), np.nan)
        if self.times.size:
            near = np.abs(self.times[:, None] - times).argmin(axis=0)
            known = np.abs(self.times[near] - times) <= 1e-9 * times
            found[known] = self.table[near[known]]
        return found


# Groups of cells ---------------------------------------------------------------------------------


def run_group(name: str, x: float, schemes: Iterable[str], steps: Iterable[float]) -> list[Cell]:
    """All cells of a value of the family ``name``."""
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
        # A first step longer than the horizon is compared with nothing.
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
                figures = truth, found, tolerance, family.arm(x), known
                made = cell(name, x, scheme, run, info, *figures)
                if found.position is not None:
                    short = replace(run, n=run.k)
                    made = judged(made, run_deck(deck, out, scheme, short, family.bound, tolerance))
                cells.append(made)
    return cells


def judged(made: Cell, info: dict[str, Any]) -> Cell:
    """The cell with the verdict on a run up to where it is compared, asked for its tolerance."""
    verdict = info.get("verdict")
    if info["status"] != "completed" or not verdict:
        return made
    told = "; ".join(verdict["reasons"]) or None
    return replace(made, judged=verdict["word"], judged_by=told)


# Restarts ----------------------------------------------------------------------------------------

RESTART = "restart"
RESTARTED = {
    "extreme/mass_ratio": "a chain of heavy and light links, halfway down",
    "extreme/inverted": "a pendulum on its way from the top",
    "extreme/spin": "a top of 1e4 rad/s",
    "extreme/drift": "a chain far away and fast",
    "extreme/stiff_pendulum": "a bob that bounces on a stiff spring",
    "extreme/toggle": "a slider-crank wherever it is",
    "extreme/taut_chain": "a chain between two pins",
    "basics/torque_free": "a body that has turned over many times",
    "joints/rolling_disk": "a disk that rolls",
}
"""Decks whose runs are stopped halfway and go on as decks of their own, and what is special."""
RESTART_HORIZON = 2.0


def restarted(deck: bytes, folder: Path) -> bytes:
    """``deck`` with the bodies as the last row of the run in ``folder`` has them."""
    run = read_run(folder)
    root = etree.fromstring(deck)
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
        axis, angle = to_axis_angle(tuple(float(last[f"{name}.P{k}"]) for k in (1, 2, 3)))
        _add_vector(start, "position", "x y z", x, ground)
        turn = etree.SubElement(etree.SubElement(start, "orientation"), "eulerRotation")
        etree.SubElement(turn, "phi", units="rad").text = repr(angle)
        for tag, number in zip(("u1", "u2", "u3"), axis, strict=True):
            etree.SubElement(turn, tag).text = repr(number)
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
    """A deck run to half its time, and on from there by a deck of its last row."""
    cells = []
    tolerance = 1e-3
    with TemporaryDirectory() as folder:
        home = Path(folder)
        deck = DECKS / f"{name}.xml"
        model = read_deck(deck)
        halves = {dt: half(dt) for dt in steps}
        wholes = {dt: Run(dt, 2 * run.n, 2 * run.n, run.every) for dt, run in halves.items()}
        lengths = build_system(model).frames.length[:-1]
        near = [run for run in wholes.values() if run.compared <= RESTART_HORIZON]
        truth = Truth(deck, model, near, 1e-2 * tolerance)
        for dt, run in halves.items():
            for scheme in schemes:
                first, second = home / f"{dt:g}-{scheme}-1", home / f"{dt:g}-{scheme}-2"
                info = run_deck(deck, first, scheme, run)
                ours, whole = None, wholes[dt]
                if info["status"] == "completed":
                    on = home / "on.xml"
                    on.write_bytes(restarted(deck.read_bytes(), first))
                    info = run_deck(on, second, scheme, run)
                    ours = states(second, run, len(model.bodies))
                found = errors(ours, truth.at(whole.times[len(run.times) :]), lengths)
                figures = truth, found, tolerance, 1.0, None
                cells.append(cell(RESTART, Path(name).stem, scheme, whole, info, *figures))
    return cells


def half(dt: float) -> Run:
    """Half of a run up to the horizon, or of ten steps."""
    n = max(5, min(5000, round(0.5 * RESTART_HORIZON / dt)))
    every = ceil(n / ROWS)
    n = n // every * every
    return Run(dt, n, n, every)


COSTLY = ("long_chain", "long_run")
"""Families whose runs begin first, so that none is left over at the end."""

# All of them -------------------------------------------------------------------------------------


def warm_runs(schemes: Iterable[str] = COMPARED) -> None:
    """Compile what runs need, the rescue of hard steps too, so that no cell's seconds are a
    compiler's.
    """
    for name in ("long_run", "stiff_spring"):
        model = read_deck(FAMILIES[name].path)
        for scheme in schemes:
            for solver in ("auto", "root"):
                run_in_memory(with_step(model, 1e-3, 1e-2, scheme), Options(solver=solver))


def warm_references() -> None:
    """Likewise what the independent solution needs."""
    for name in ("mass_ratio", "bushing_loop"):
        choose_reference("independent", read_deck(FAMILIES[name].path), np.array([1e-3]), 1e-6)


ALL = (*FAMILIES, RESTART)


def run_all(names: Sequence[str], schemes: Sequence[str]) -> Iterator[tuple[str, list[Cell]]]:
    """Every cell of the families ``names`` by the ``schemes``, in two processes: those of one value
    after the other as they are done, with words of which they are.
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
    """All cells of a value of a family, or of a scene that is restarted."""
    if isinstance(x, str):
        return run_restarts(x, schemes, steps)
    return run_group(name, x, schemes, steps)


def values_of(name: str) -> tuple[float | str, ...]:
    """The values of a family."""
    return FAMILIES[name].values if name in FAMILIES else tuple(RESTARTED)


def show_value(value: float | str) -> str:
    """A value as a reader sees it."""
    return value.replace("_", " ") if isinstance(value, str) else f"{value:.4g}"


def place(cell: Cell) -> tuple[str, float | str, str, float]:
    """Where a cell stands in the table."""
    return cell.family, cell.value, cell.scheme, cell.dt


def in_order(cells: Iterable[Cell]) -> list[Cell]:
    """The cells in the order of the families, their values, the schemes and the steps."""

    def rank(cell: Cell) -> tuple[int, int, int, float]:
        values = [Path(x).stem if isinstance(x, str) else x for x in values_of(cell.family)]
        where = ALL.index(cell.family), values.index(cell.value), COMPARED.index(cell.scheme)
        return *where, cell.dt

    return sorted(cells, key=rank)
