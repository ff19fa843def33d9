"""Rows of a run's tables for instants of a prescribed motion: states, loads, and works.

Reactions and loads of motions follow from the accelerations, by the index-1 problem (inverse
dynamics). Works are the only integrals over time: of the powers at the output times, by polynomials
of degree 5 through six of them.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from msahl.analysis.kinematics.configuration import Equations, copied
from msahl.analysis.kinematics.follow import Instant
from msahl.elements.constraints import scalar
from msahl.formulations.absolute.rigid_body import write_accelerations
from msahl.model import Model
from msahl.ports import forces
from msahl.run.observed import ObservedTables
from msahl.run.output import CHUNK_NUMBERS
from msahl.run.tables import WORK, Sink, column_counts
from msahl.schemes.common.accelerations import accelerate, new_instant
from msahl.schemes.common.workspace import new_workspace, record_step
from msahl.start.redundancy import is_regular, non_unique_reactions
from msahl.start.velocities import solve_accelerations
from msahl.system import evaluate
from msahl.system.arrays import State
from msahl.system.diagnostics import BALANCE, KINETIC
from msahl.system.unknowns import Unknowns

MOST_ROWS = 512
"""Rows that are kept before they go to the sink."""
WINDOW = 6
"""Output times whose powers are integrated together."""


class Recorder:
    """Makes rows of the tables of a run from instants, and hands them to a sink.

    ``powers`` are those of loads and motions, ``energy`` the sum of all energies, ``kinetic`` the
    largest kinetic energy, all at the instants so far. ``shared`` are the columns of reactions that
    are not unique, by the numbers of joints, couplings and motions.
    """

    def __init__(self, model: Model, equations: Equations, unknowns: Unknowns, sink: Sink) -> None:
        """``equations`` calls kernels in its own manner: plain, or compiled for many rows."""
        self.sink, self.unknowns, self.call = sink, unknowns, equations.call
        system, state = equations.system, copied(equations.seen)
        widths = column_counts(model)
        self.widths = {name: width for name, width in widths.items() if width}
        self.rows = max(1, min(MOST_ROWS, CHUNK_NUMBERS // sum(widths.values())))
        accelerations = "accelerations" in self.widths
        self.workspace = new_workspace(system, unknowns, state, self.rows, accelerations)
        # A matrix that is regular once is so but for singular positions, which have no rows.
        regular = is_regular(system, state, unknowns)
        self.instant = new_instant(system, unknowns) if regular else None
        self.observed = ObservedTables(model)
        self.times: list[float] = []
        self.powers: list[np.ndarray] = []
        self.energy: list[float] = []
        self.elastic: list[np.ndarray] = []
        self.kinetic = 0.0
        self.shared: dict[int, list[str]] = {}
        self.pending = 0

    def add(self, instant: Instant) -> None:
        """Add the row of an ``instant``."""
        workspace, state = self.workspace, self.workspace.state
        self._set_state(instant.state)
        workspace.mean_force[:], workspace.mean_reaction[:] = state.force, state.reaction
        self.call(record_step, workspace, 0.0, 0, self.pending)
        tables = workspace.tables
        if tables.accelerations.shape[1]:
            self.call(
                write_accelerations,
                workspace.system.bodies,
                workspace.start.frames,
                state.w,
                state.a,
                state.alpha,
                tables.accelerations,
                self.pending,
            )
        figures = workspace.monitor.rows[0]
        self.kinetic = max(self.kinetic, float(figures[KINETIC]))
        self.energy.append(float(figures[BALANCE]))
        self.powers.append(self._powers())
        self.elastic.append(tables.work[self.pending, state.work.size :].copy())
        self.times.append(instant.time)
        self.pending += 1
        if self.pending == self.rows:
            self.flush()

    def _set_state(self, source: State) -> None:
        """Take over positions, velocities and accelerations, and find the reactions."""
        workspace, state = self.workspace, self.workspace.state
        for name in ("time", "x", "p", "v", "w", "angle"):
            getattr(state, name)[:] = getattr(source, name)
        system, start = workspace.system, workspace.start
        self.call(evaluate.prepare, system, state, start)
        if self.instant is None:
            solve_accelerations(system, state, self.unknowns)
        else:
            self.call(accelerate, system, state, start, self.instant)
        # From the constraint equations alone, without the round-off of masses and forces.
        state.a[:], state.alpha[:] = source.a, source.alpha
        self.call(evaluate.prepare, system, state, start)

    def _powers(self) -> np.ndarray:
        """(w,) power of each load and motion [W]."""
        workspace, power = self.workspace, np.zeros_like(self.workspace.state.work)
        system, state, start = workspace.system, workspace.state, workspace.start
        Z, rows = workspace.Z, workspace.F
        Z[:] = rows[:] = 0.0
        self.call(evaluate.free_acceleration, system, state, start, Z, rows)
        forces.add_power(system.forces, start.forces, system.scalar, state.reaction, 1.0, power)
        Z[len(Z) - len(state.force) :] = np.divide(
            state.force, system.unit, out=np.zeros_like(state.force), where=system.unit != 0.0
        )
        scalar.motion_work(system.scalar, system.frames, float(state.time[0]), 1.0, Z, power)
        return power

    def review_reactions(self) -> None:
        """Find the reactions that are not unique in the present state, besides those found."""
        found = non_unique_reactions(self.workspace.system, self.workspace.state)
        for element, columns in found.items():
            self.shared[element] = sorted({*self.shared.get(element, []), *columns})

    def flush(self) -> None:
        """Hand the rows over that are pending, without works."""
        if not self.pending:
            return
        times = np.array(self.times[-self.pending :])
        tables = {}
        for name in self.widths:
            part = getattr(self.workspace.tables, name)[: self.pending]
            tables[name] = np.concatenate([times[:, None], part], axis=1)
        # Observed tables read the energies of springs from the table of works.
        if self.sink.takes_observed:
            tables |= self.observed.rows(tables)
        tables.pop(WORK, None)
        self.sink.write(tables)
        self.pending = 0

    def finish(self) -> float:
        """Hand over the last rows and the table of works; returns the largest error of the energy
        balance [J].
        """
        self.flush()
        times, powers = np.array(self.times), np.array(self.powers)
        works = integrals(times, powers)
        if WORK in self.widths:
            table = np.concatenate([times[:, None], works, np.array(self.elastic)], axis=1)
            self.sink.write({WORK: table})
        energy = np.array(self.energy)
        return float(np.abs(energy - energy[0] - works.sum(axis=1)).max(initial=0.0))


def integrals(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(m, w) integrals of ``values`` (m, w) from the first of the ``times`` (m,) on, by polynomials
    through ``WINDOW`` of them.
    """
    m, found = len(times), np.zeros_like(values)
    count = min(WINDOW, m)
    if m < 2:
        return found
    begin = np.clip(np.arange(m - 1) - (count - 1) // 2, 0, m - count)
    chosen = begin[:, None] + np.arange(count)
    h = np.diff(times)
    x = (times[chosen] - times[:-1, None]) / h[:, None]  # the interval is that from 0 to 1
    powers = np.arange(count)
    vandermonde = x[:, None, :] ** powers[:, None]
    right = np.broadcast_to(1.0 / (powers + 1.0), (m - 1, count))[..., None]
    weights = np.linalg.solve(vandermonde, right)[..., 0]
    found[1:] = np.cumsum(np.einsum("ij,ijk->ik", weights, values[chosen]) * h[:, None], axis=0)
    return found


def element_names(model: Model, shared: Mapping[int, Sequence[str]]) -> dict[str, list[str]]:
    """Return columns by the names of joints, couplings and motions."""
    elements = [*model.joints, *model.couplings, *model.motions]
    return {elements[e].name: list(columns) for e, columns in sorted(shared.items())}
