"""Inverse dynamics: the drive loads that produce a given motion, with reactions, power and work.

    table -> ``splines`` -> positions, velocities, accelerations (``motion``) -> ``loads``

The motion is followed at the times of the table. Its rates and accelerations are computed in
several ways (``splines``), with each of them the loads are computed, and how far these
differ is the error bar of the loads.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from msahl.analysis.inverse.drives import Drive, InverseError, results_of, with_drives
from msahl.analysis.inverse.given import Measures
from msahl.analysis.inverse.loads import Drives, Loads
from msahl.analysis.inverse.motion import Follower, Frame
from msahl.analysis.inverse.run_error import raised_by
from msahl.analysis.inverse.splines import Smooth, derived
from msahl.analysis.inverse.states import advance
from msahl.analysis.inverse.table import LEAST_ROWS, GivenMotion, Track, spins
from msahl.analysis.kinematics.configuration import copied, copy_to, new_equations, predict
from msahl.analysis.linearised.point import at_start
from msahl.analysis.no_contacts import require_no_contacts
from msahl.formulations.absolute.rigid_body import write_accelerations
from msahl.jit.by_size import compiled_once
from msahl.joints.coordinates import ORIENTATION
from msahl.model import Model
from msahl.ports import forces
from msahl.records import record
from msahl.schemes.common.workspace import write_configuration
from msahl.system import evaluate
from msahl.system.arrays import State, Tables, new_tables

NEIGHBOURS = 3
"""Rows to each side whose largest difference is the error bar: differences pass through zero."""
SAFETY = 2.0
"""Factor of the error bar: repetitions differ by about the error, and sometimes by less."""
LONG = 600
"""Rows of a table times bodies for which compiled functions are used."""
SAME_TIME = 1e-9
"""Difference of two times that are one, over the last time."""
SHARED = 1e-6
"""Part in a unit vector of the null space that is not round-off."""


class Rows(NamedTuple):
    """What the balance of forces gives at the m times of the table; k drives, y given values."""

    loads: np.ndarray  # (m, k) [N or N m]
    error: np.ndarray  # (m, k) error bars
    power: np.ndarray  # (m, k) [W]
    misfit: np.ndarray  # (m, y) given values less those of the motion [m]
    missing: np.ndarray  # (m,) largest force that no drive produces [N]
    largest: np.ndarray  # (m,) largest force of the balance [N]
    missing_error: np.ndarray  # (m,) error bar of the missing force [N]
    energy: np.ndarray  # (m,) kinetic and potential energy [J]


@record(slots=False)
class Solution:
    """The loads of a motion. ``driven`` is the model in which the drives have no law; ``tables``
    have its columns, without times.
    """

    model: Model
    driven: Model
    drives: tuple[Drive, ...]
    motion: GivenMotion
    measures: Measures
    rows: Rows
    tables: Tables
    rank: int  # degrees of freedom that the drives act on, the least of all times
    degrees_of_freedom: int
    unique: np.ndarray  # (k,) whether each load is unique
    non_unique_reactions: dict[str, list[str]]  # columns, by joint, coupling and motion
    undriven: tuple[str, ...]  # bodies that move where no drive acts
    redundant: int  # constraint equations that follow from others
    noise: float
    weights: np.ndarray  # (k,) of the least norm
    companion: str = ""  # source of the table whose loads are part of the error bars

    @property
    def size(self) -> float:
        """Size of the model [m]: its extent, or the largest distance of a body from the origin."""
        x = self.tables.states.reshape(len(self.tables.states), -1, 12)[..., :3]
        extent = float(np.abs(x).max(initial=0.0))
        return extent if extent > 0.0 else 1.0


def inverse(
    model: Model,
    motion: GivenMotion,
    loads: Sequence[str] = (),
    weights: Mapping[str, float] | None = None,
    noise: float = 0.0,
    progress: Callable[[int], Any] = lambda rows: None,
) -> Solution:
    """Return the loads of the drives named, by default of all actuators and prescribed motions, or
    of motors at the coordinates of joints that the table has, that produce the ``motion``;
    ``weights`` of the least norm by the drives' names, ``noise`` the standard deviation of the
    table. ``progress`` receives the number of rows done. Raises ``InverseError`` or ``StartError``.
    """
    if model.beams:
        raise InverseError(
            "the model has beams, whose deformation a table of motion does not give; prescribe the "
            "motion by <jointMotion> and run the deck with msahl run: reactions.csv has the loads"
        )
    require_no_contacts(model)
    driven, drives = with_drives(model, loads, motion.joint_coordinates)
    point = at_start(driven)
    call = (
        (lambda kernel, *given: compiled_once(kernel)(*given)) if _is_long(model, motion) else None
    )
    follower = Follower(
        new_equations(point.system, point.state, call),
        Measures(driven, point.system, motion.tracks),
    )
    balance = Drives(follower, results_of(driven, drives), _weights(drives, weights or {}))
    try:
        with np.errstate(all="ignore"):
            work = _Work(follower, balance, motion, noise, copied(point.state))
            found = work.solution(model, driven, drives, progress)
    except InverseError:
        raise
    except (np.linalg.LinAlgError, OverflowError, ValueError) as error:  # of nan and infinity
        raise _too_large(motion) from error
    if not np.isfinite(found.rows.loads).all():
        raise _too_large(motion)
    return found


def _too_large(motion: GivenMotion) -> InverseError:
    """Return the fault of a table whose numbers overflow."""
    return InverseError(
        f"{motion.source}: the motion cannot be followed, since numbers become infinite; check the "
        "sizes of times and values"
    )


def compared(solution: Solution, other: Solution) -> Solution:
    """Return the ``solution`` with how far the loads of the ``other`` differ added to the error
    bars: of the same motion as another run, with another step, or another measurement has it.
    Raises ``InverseError`` if the tables have hardly a time in common.
    """
    time, others = solution.motion.time, other.motion.time
    near = np.clip(np.searchsorted(others, time), 1, others.size - 1)
    near -= time - others[near - 1] < others[near] - time
    common = np.flatnonzero(np.abs(others[near] - time) <= SAME_TIME * time[-1])
    if common.size < LEAST_ROWS or time[common[-1]] < others[near][-1] * (1.0 - SAME_TIME):
        raise InverseError(
            f"{other.motion.source}: {common.size} of the times of {solution.motion.source}; give "
            "a table with the same times, or with every second of them"
        )
    apart = np.abs(solution.rows.loads[common] - other.rows.loads[near[common]])
    spread = np.stack(
        [np.interp(time, time[common], each) for each in _largest_nearby(apart).T], axis=1
    )
    rows = solution.rows._replace(error=solution.rows.error + SAFETY * spread)
    return replace(solution, rows=rows, companion=other.motion.source)


def with_run_error(solution: Solution) -> Solution:
    """Return the ``solution`` with the error that the run estimated, whose motion is given, added
    to the error bars of the loads.
    """
    error, rows = solution.motion.error, solution.rows
    if error is None or not error.is_known:
        return solution
    used = _ways(solution.motion, solution.measures, solution.noise)[0]
    more = raised_by(
        error,
        *(used.rates, used.accelerations, solution.motion.time),
        *(float(rows.largest.max()), solution.size),
        [drive.rotates for drive in solution.drives],
    )
    return replace(solution, rows=rows._replace(error=rows.error + more))


def _is_long(model: Model, motion: GivenMotion) -> bool:
    """Return whether compiled functions save more time than it takes to load them."""
    return motion.time.size * len(model.bodies) >= LONG


def _weights(drives: Sequence[Drive], weights: Mapping[str, float]) -> np.ndarray:
    """(k,) weights of the drives."""
    names = [drive.name for drive in drives]
    for name, weight in weights.items():
        if name not in names:
            raise InverseError(f"weight of '{name}': not one of the drives {', '.join(names)}")
        if not 0.0 < weight < np.inf:
            raise InverseError(f"weight of '{name}': {weight:g} is not a number above zero")
    return np.array([weights.get(name, 1.0) for name in names])


class _Found(NamedTuple):
    """What is kept of the loads of m rows by w ways; k drives. A table may have a million rows."""

    loads: np.ndarray  # (m, w, k)
    missing: np.ndarray  # (m,) largest missing force
    change: np.ndarray  # (m,) largest difference of missing forces between ways
    power: np.ndarray  # (m, k)
    largest: np.ndarray  # (m,)
    rank: np.ndarray  # (m,)
    shared: np.ndarray  # (k,) largest of all rows

    @classmethod
    def of(cls, m: int, w: int, k: int) -> "_Found":
        """Return the arrays."""
        loads, power, shared = np.zeros((m, w, k)), np.zeros((m, k)), np.zeros(k)
        return cls(loads, np.zeros(m), np.zeros(m), power, np.zeros(m), np.zeros(m, int), shared)

    def keep(self, row: int, way: int, loads: Loads, first: Loads) -> None:
        """Keep the ``loads`` of a row by one way; ``first`` are those of the first way."""
        self.loads[row, way] = loads.loads
        self.change[row] = max(self.change[row], _size(loads.missing - first.missing))
        if way == 0:
            self.missing[row] = _size(loads.missing)
            self.power[row], self.largest[row] = loads.power, loads.largest
            self.rank[row] = loads.rank
            np.maximum(self.shared, loads.shared, out=self.shared)

    def rows(self, misfit: np.ndarray, energy: np.ndarray) -> Rows:
        """Return the rows with their error bars."""
        apart = np.abs(self.loads[:, 1:] - self.loads[:, :1]).max(axis=1)
        return Rows(
            loads=self.loads[:, 0],
            error=SAFETY * _largest_nearby(apart),
            power=self.power,
            misfit=misfit,
            missing=self.missing,
            largest=self.largest,
            missing_error=SAFETY * _largest_nearby(self.change[:, None])[:, 0],
            energy=energy,
        )


class _Work:
    """The computation, row by row."""

    def __init__(
        self, follower: Follower, balance: Drives, motion: GivenMotion, noise: float, state: State
    ) -> None:
        self.follower, self.balance, self.state = follower, balance, state
        self.before, self.other = copied(state), copied(state)
        self.motion, self.noise = motion, noise
        self.ways = _ways(motion, follower.measures, noise)
        system, m = follower.equations.system, motion.time.size
        self.tables = new_tables(system, state, m, accelerations=True)
        self.frames: dict[int, tuple[State, Frame]] = {}  # where uniqueness is examined
        self.energy = np.zeros(m)
        self.found = _Found.of(m, len(self.ways), len(balance.results))

    def solution(
        self,
        model: Model,
        driven: Model,
        drives: tuple[Drive, ...],
        progress: Callable[[int], Any],
    ) -> Solution:
        """Return what all rows give."""
        m = self.motion.time.size
        examined = {0, m // 2, m - 1}
        misfit = []
        for row in range(m):
            left, frame = self._row(row)
            misfit.append(left)
            if row in examined:
                self.frames[row] = copied(self.state), frame
            progress(row + 1)
        state, frame = self.frames[0]
        undriven = self.balance.undriven(state, frame)
        return Solution(
            model=model,
            driven=driven,
            drives=drives,
            motion=self.motion,
            measures=self.follower.measures,
            rows=self.found.rows(np.array(misfit), self.energy),
            tables=self.tables,
            rank=int(self.found.rank.min()),
            degrees_of_freedom=frame.N.shape[1],
            unique=self.found.shared <= SHARED,
            non_unique_reactions=self._non_unique(driven),
            undriven=tuple(self.follower.moving_bodies(undriven)) if undriven.shape[1] else (),
            redundant=len(frame.G) - (len(frame.M) - frame.N.shape[1]),
            noise=self.noise,
            weights=self.balance.weights,
        )

    def _row(self, row: int) -> tuple[np.ndarray, Frame]:
        """Follow the motion to a row, and keep its loads by all ways; return what remains of the
        given values, and the constraints.
        """
        time, state = self.motion.time, self.state
        before = copy_to(self.before, state)
        if row:
            predict(self.follower.equations, state, float(time[row] - time[row - 1]))
        left = self.follower.settle(state, self.ways[0].values[row], float(time[row]))
        frame = self.follower.frame(state)
        velocity, acceleration = self._motion(state, frame, 0, row)
        if row:
            advance(self.follower.equations, before, state, self.other)
        first = self.balance.solve(state, frame, velocity, acceleration)
        self.found.keep(row, 0, first, first)
        self._write(state, row)
        for way in range(1, len(self.ways)):
            other = copy_to(self.other, state)
            moved = self._motion(other, frame, way, row)
            self.found.keep(row, way, self.balance.solve(other, frame, *moved), first)
        return left, frame

    def _motion(
        self, state: State, frame: Frame, way: int, row: int
    ) -> tuple[np.ndarray, np.ndarray]:
        """Set velocities and accelerations of ``state``; return them (n,)."""
        given = self.ways[way]
        velocity = self.follower.velocities(state, frame, given.rates[row])
        second = self.balance.second_derivatives(state)
        return velocity, self.follower.accelerations(state, frame, given.accelerations[row], second)

    def _write(self, state: State, row: int) -> None:
        """Write the solved state to a row of all tables."""
        equations, tables = self.follower.equations, self.tables
        system, start = equations.system, equations.start
        write_accelerations(
            *(system.bodies, start.frames, state.w, state.a, state.alpha),
            *(tables.accelerations, row),
        )
        power = np.zeros_like(state.work)
        forces.add_power(system.forces, start.forces, system.scalar, state.reaction, 1.0, power)
        tables.work[row, : power.size] = power
        zeros = np.zeros_like(state.violation)
        self.energy[row] = sum(
            equations.call(evaluate.observe, system, state, start, zeros, zeros.copy())
        )
        loads = state.force, state.reaction, float(state.time[0])
        write_configuration(system, state, start, loads, tables, row)

    def _non_unique(self, driven: Model) -> dict[str, list[str]]:
        """Return the columns of reactions that are not unique at the first, middle or last row."""
        elements = (*driven.joints, *driven.couplings, *driven.motions)
        found: dict[str, set[str]] = {}
        for state, frame in self.frames.values():
            for e, columns in self.balance.non_unique(state, frame).items():
                found.setdefault(elements[e].name, set()).update(columns)
        return {name: sorted(columns) for name, columns in found.items()}


def _size(vector: np.ndarray) -> float:
    return float(np.abs(vector).max(initial=0.0))


def _largest_nearby(values: np.ndarray) -> np.ndarray:
    """(m, k) the largest of each column within some rows."""
    from scipy.ndimage import maximum_filter1d

    return np.asarray(maximum_filter1d(values, 2 * NEIGHBOURS + 1, axis=0, mode="nearest"))


def _ways(motion: GivenMotion, measures: Measures, noise: float) -> list[Smooth]:
    """Return the given values, and their rates and accelerations in metres, by each way: as used,
    without the highest derivatives, and by every second row.
    """
    by_track = [derived(motion.time, track, noise, k) for k, track in enumerate(motion.tracks)]
    number = max(len(each) for each in by_track)
    found = []
    for way in range(number):
        chosen = [each[min(way, len(each) - 1)] for each in by_track]
        values = np.concatenate([each[0].values for each in by_track], axis=1)
        rates, changes = [], []
        for track, smooth in zip(motion.tracks, chosen, strict=True):
            first, second = _rates(track, smooth)
            rates.append(first)
            changes.append(second)
        found.append(
            Smooth(
                values,
                np.concatenate(rates, axis=1) * measures.scale,
                np.concatenate(changes, axis=1) * measures.scale,
            )
        )
    return found


def _rates(track: Track, smooth: Smooth) -> tuple[np.ndarray, np.ndarray]:
    """Rates and accelerations of a track, of an orientation as angular ones."""
    if track.coordinate == ORIENTATION:
        return spins(smooth.values, smooth.rates, smooth.accelerations)
    return smooth.rates, smooth.accelerations
