"""Columns of a run's tables at one configuration, and how they change to first order.

Signals have their own gradients. All other columns are smooth functions of the motion of the bodies
and of the multipliers, and are computed by the functions that write the tables of a run, for the
configuration and for others beside it: their derivatives are central differences of the order 6,
whose error the order 8 estimates.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.rotation_arrays import parameters, rotated, rotations
from msahl.algebra.vector import at
from msahl.analysis.linearised.coefficients import Evaluated, expression_slopes
from msahl.analysis.linearised.plain_units import coordinate_numbers, equation_numbers
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.projection import move, prepared
from msahl.analysis.linearised.variations import Variations
from msahl.elements import reactions
from msahl.elements.beams import instant as beams
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.joints.coordinates import Motion, coordinates, point_motion
from msahl.model import Model
from msahl.ports import forces
from msahl.run.joint_table import JointTable
from msahl.run.marker_table import MarkerTable
from msahl.run.system_table import SystemTable
from msahl.run.tables import (
    ACCELERATIONS,
    JOINTS,
    MARKERS,
    REACTIONS,
    SIGNALS,
    STATES,
    SYSTEM,
    WORK,
)
from msahl.start.redundancy import non_unique_reactions
from msahl.system import evaluate
from msahl.system.arrays import State, new_tables, node_count
from msahl.system.names import (
    ENERGY,
    LOAD_COLUMN,
    POWER_COLUMN,
    acceleration_columns,
    coordinate_columns,
    group_columns,
    marker_columns,
    reaction_columns,
    signal_columns,
    state_columns,
    work_columns,
)

STEP = 3e-3
"""Rotation [rad], or displacement over a length, of the differences."""
EIGHTH = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)
SIXTH = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0, 0.0)
"""Weights of central differences of the orders 8 and 6, by the number of steps."""
SIDES = [sign * steps for steps in (1, 2, 3, 4) for sign in (1, -1)]
NOTHING = 1e-12
"""Numbers of a table [SI] that are round-off of zero."""
BODIES, RATES = "bodies", "rates"
"""Tables of coordinates of bodies along inertial axes, and of rates of actuators' coordinates."""
BODY_COORDINATES = ("x", "y", "z", "rx", "ry", "rz")
LEVELS = ("", "Rate", "Acceleration")


class Column(NamedTuple):
    """A column at the configuration and its derivatives in k columns of variations."""

    value: float
    slope: np.ndarray  # (k,)
    error: float = 0.0  # of the slope, relative to the largest numbers of its table


def columns_by_table(model: Model) -> dict[str, list[str]]:
    """Return the columns that are functions of the motion, by their table."""
    found = {
        STATES: state_columns(model),
        JOINTS: coordinate_columns(model, 3),
        MARKERS: marker_columns(model),
        SIGNALS: signal_columns(model),
        REACTIONS: reaction_columns(model),
        ACCELERATIONS: acceleration_columns(model),
        SYSTEM: group_columns(model),
        WORK: [name for name in work_columns(model) if name.endswith(f".{ENERGY}")],
    }
    return {table: [c for c in columns if c != "time"] for table, columns in found.items()}


class Columns:
    """Columns of tables by name, with their derivatives; computed when a table is asked for."""

    def __init__(
        self, point: Point, found: Evaluated, changes: Variations, fed: dict[str, np.ndarray]
    ) -> None:
        """``fed`` are changes (k,) of signals' columns by inputs that are added to them."""
        self.point, self.found, self.changes, self.fed = point, found, changes, fed
        self._tables: dict[str, dict[str, Column]] = {}

    def table(self, name: str) -> dict[str, Column]:
        """Return the columns of a table by their names."""
        if name not in self._tables:
            if name == SIGNALS:
                self._tables[SIGNALS] = self._signals()
            else:
                by_forces = name in (REACTIONS, WORK, RATES) or (
                    name == SYSTEM and bool(columns_by_table(self.point.model)[WORK])
                )
                self._tables |= self._differences(by_forces)
        return self._tables[name]

    def _differences(self, by_forces: bool) -> dict[str, dict[str, Column]]:
        """Return the tables that follow from the motion, with those ``by_forces`` if wanted."""
        model, k = self.point.model, self.changes.places.shape[1]
        steps = np.array([step_of(self.point, self.changes, j) for j in range(k)])
        shares = np.array([side * steps for side in (0.0, *SIDES)])
        rows: dict[str, np.ndarray] = {}
        if by_forces:
            states = [self.point.state]
            for j in range(k):
                states += [displaced(self.point, self.changes, j, x) for x in shares[1:, j]]
            rows = force_rows(self.point, states)
        motion = displaced_motions(self.point, self.changes, shares)
        rows |= motion_rows(self.point, motion, rows.get(WORK))
        heads = headers(model)
        tables = {name: self._sloped(heads[name], rows[name], steps) for name in rows}
        for b, body in enumerate(model.bodies):
            tables[BODIES] |= self._rotation(body.name, b)
        if by_forces:
            self._add_motion_rates(tables[REACTIONS])
        return tables

    def _sloped(self, names: list[str], rows: np.ndarray, steps: np.ndarray) -> dict[str, Column]:
        """The columns of a table from its ``rows`` (1 + 8 k, ...), without the time."""
        value, k = rows[0], steps.size
        sides = rows[1:].reshape(k, 4, 2, len(value))
        odd = (sides[:, :, 0] - sides[:, :, 1]) / steps[:, None, None]
        eighth, sixth = (np.einsum("kio,i->ok", odd, np.array(w)) for w in (EIGHTH, SIXTH))
        size = max(
            *(float(np.abs(table_rows).max(initial=0.0)) for table_rows in (eighth, rows)), NOTHING
        )
        error = np.abs(eighth - sixth).max(axis=1, initial=0.0) / size
        return {
            name: Column(float(value[o]), eighth[o], float(error[o]))
            for o, name in enumerate(names)
            if name
        }

    def _rotation(self, name: str, b: int) -> dict[str, Column]:
        """Rotation vector of a body, along inertial axes, from the orientation that it has in the
        motion itself, with its rate and acceleration: phi' = dW + W x phi.
        """
        system, state, changes = self.point.system, self.point.state, self.changes
        f = int(system.bodies.frame[b])
        number = np.full(3 * node_count(system), -1)
        number[self.found.coordinate] = np.arange(self.found.coordinate.size)
        rows = number[3 * system.frames.rotation[f] + np.arange(3)]
        W, alpha = np.array(matrix(at(state.p, f))) @ state.w[f], state.alpha[f]
        phi, dW, da = (m[rows].T for m in (changes.places, changes.rates, changes.accelerations))
        rate = dW + np.cross(W, phi)
        rise = da + np.cross(alpha, phi) + np.cross(W, rate)
        levels = ((np.zeros(3), phi), (np.zeros(3), rate), (np.zeros(3), rise))
        return {
            f"{name}.r{'xyz'[i]}{LEVELS[level]}": Column(float(value[i]), slope[:, i])
            for level, (value, slope) in enumerate(levels)
            for i in range(3)
        }

    def _add_motion_rates(self, table: dict[str, Column]) -> None:
        """Add to the power of prescribed motions that are inputs what their rates change."""
        motions = [f"{motion.name}." for motion in self.point.model.motions]
        for name, rate in zip(motions, self._motion_rates(), strict=True):
            load, power = table[name + LOAD_COLUMN], table[name + POWER_COLUMN]
            table[name + POWER_COLUMN] = power._replace(slope=power.slope + load.value * rate)

    def _motion_rates(self) -> list[np.ndarray]:
        """Of each prescribed motion the change of its rate by the columns."""
        scalar = self.point.system.scalar
        rows = np.flatnonzero(scalar.equations.law >= 0).tolist() if scalar else []
        changes, points = self.changes, 3 * self.point.system.coincide.a.size
        still = np.zeros(changes.places.shape[1])
        inputs = {int(row): k for k, row in enumerate(changes.motion.rows.tolist())}
        return [
            changes.motion.u_dot[inputs[points + r]] if points + r in inputs else still
            for r in rows
        ]

    def _signals(self) -> dict[str, Column]:
        """The columns of signals.csv by the gradients of their expressions."""
        point, group = self.point, self.point.system.forces.signals
        if group is None:
            return {}
        signals_start = self.found.start.forces.signals
        names = signal_columns(point.model)[1:]
        table: dict[str, Column] = {}
        for k, name in enumerate(names[: group.shown.size]):
            place = int(group.shown[k])
            value = float(signals_start.values.value[place])
            slope = self._along(*expression_slopes(point.system, self.found, place))
            if len(self.changes.shown):
                slope = slope + self.changes.shown[k]
            table[name] = Column(value, slope + self.fed.get(name, 0.0))
        for load in point.model.actuators:
            rate, column = self.table(RATES)[load.name], table[f"{load.name}.{LOAD_COLUMN}"]
            slope = column.value * rate.slope + column.slope * rate.value
            table[f"{load.name}.{POWER_COLUMN}"] = Column(column.value * rate.value, slope)
        return table

    def _along(self, by_place: np.ndarray, by_rate: np.ndarray, by_state: np.ndarray) -> np.ndarray:
        changes = self.changes
        slope: np.ndarray = (
            by_place @ changes.places + by_rate @ changes.rates + by_state @ changes.states
        )
        return slope


def headers(model: Model) -> dict[str, list[str]]:
    """Return the columns of all tables of ``motion_rows`` and ``force_rows``; "" for what is not
    shown.
    """
    found = columns_by_table(model)
    bodies = [body.name for body in model.bodies]
    found[BODIES] = [
        f"{name}.{c}{level}" for level in LEVELS for name in bodies for c in BODY_COORDINATES[:3]
    ]
    found[WORK] = [c if c.endswith(f".{ENERGY}") else "" for c in work_columns(model)[1:]]
    found[RATES] = [load.name for load in model.actuators]
    del found[SIGNALS]
    return found


def motion_rows(point: Point, motion: Motion, elastic: np.ndarray | None) -> dict[str, np.ndarray]:
    """Return the rows (m, ...) of the tables that follow from the ``motion`` of all bodies (m, b),
    without the time; the table of groups needs the energies ``elastic``, if there are springs.
    """
    model, m = point.model, len(motion.x)
    tables = state_rows(motion)
    time = np.full((m, 1), point.time)
    given = {name: np.concatenate([time, table], axis=1) for name, table in tables.items()}
    assert motion.a is not None
    parts = [part.reshape(m, -1) for part in (motion.x, motion.v, motion.a)]
    tables[BODIES] = np.concatenate(parts, axis=1)
    tables[JOINTS] = tables[MARKERS] = np.zeros((m, 0))
    if any(map(coordinates, model.joints)):
        joints = JointTable(model, 3)
        joints.last_time = point.time
        tables[JOINTS] = joints.rows(given)[:, 1:]
    if model.markers:
        tables[MARKERS] = MarkerTable(model).rows(given)[:, 1:]
    if elastic is not None:
        given[WORK] = np.concatenate([time, elastic], axis=1)
    if not model.groups:
        tables[SYSTEM] = np.zeros((m, 0))
    elif elastic is not None or not columns_by_table(model)[WORK]:
        tables[SYSTEM] = SystemTable(model).rows(given)[:, 1:]
    return tables


def state_rows(motion: Motion) -> dict[str, np.ndarray]:
    """Return the rows of the tables of states and accelerations, without the time."""
    assert motion.a is not None
    assert motion.alpha is not None
    back, m = np.swapaxes(motion.R, -1, -2), len(motion.x)
    v, w, a, alpha = (rotated(back, part) for part in (motion.v, motion.w, motion.a, motion.alpha))
    states = np.concatenate([motion.x, parameters(motion.R), v, w], axis=-1)
    accelerations = np.concatenate([a, alpha], axis=-1)
    return {STATES: states.reshape(m, -1), ACCELERATIONS: accelerations.reshape(m, -1)}


def motions_of(point: Point, states: list[State]) -> Motion:
    """Return the motion (m, b) of the reference points of all bodies at m ``states``."""
    frame = point.system.bodies.frame
    R = rotations(np.array([state.p[frame] for state in states]))
    W = rotated(R, np.array([state.w[frame] for state in states]))
    x, v, a, alpha = (
        np.array([getattr(state, name)[frame] for state in states])
        for name in ("x", "v", "a", "alpha")
    )
    return point_motion(Motion(x, R, v, W, a, alpha), -point.system.bodies.r_BG)


def displaced_motions(point: Point, changes: Variations, shares: np.ndarray) -> Motion:
    """Return the motion of the reference points of all bodies in all columns, changed by ``shares``
    (9, k), of which the first are 0: (1 + 8 k, b), the unchanged one first.
    """
    system, frame = point.system, point.system.bodies.frame
    now = motions_of(point, [point.state])
    now = point_motion(now, system.bodies.r_BG)
    numbers = np.full(3 * node_count(system), -1)
    numbers[coordinate_numbers(system)] = np.arange(len(changes.places))
    share = np.concatenate([[0.0], shares[1:].T.reshape(-1)])[:, None, None]
    column = np.concatenate([[0], np.repeat(np.arange(shares.shape[1]), len(SIDES))])

    def part(array: np.ndarray, nodes: np.ndarray) -> np.ndarray:
        """(1 + 8 k, b, 3) the changes of three coordinates of each body."""
        if not array.shape[1]:
            return np.zeros((1, len(frame), 3))
        rows = numbers[3 * nodes[frame][:, None] + np.arange(3)]
        return np.asarray(share * np.moveaxis(array[rows][..., column], -1, 0))

    u, theta = system.frames.displacement, system.frames.rotation
    Q = part(changes.places, theta)
    P = 2.0 * Q / (1.0 + np.sqrt(1.0 + 0.25 * (Q * Q).sum(axis=-1, keepdims=True)))
    assert now.a is not None
    assert now.alpha is not None
    moved = Motion(
        x=now.x + part(changes.places, u),
        R=rotations(P) @ now.R,
        v=now.v + part(changes.rates, u),
        w=now.w + part(changes.rates, theta),
        a=now.a + part(changes.accelerations, u),
        alpha=now.alpha + part(changes.accelerations, theta),
    )
    return point_motion(moved, -system.bodies.r_BG)


def force_rows(point: Point, states: list[State]) -> dict[str, np.ndarray]:
    """Return the rows (m, ...) of the tables that follow from multipliers and springs at m
    ``states``, without the time, as a step fills them.
    """
    each = [_force_row(point, state) for state in states]
    return {name: np.array([row[name] for row in each]) for name in each[0]}


def _force_row(point: Point, state: State) -> dict[str, np.ndarray]:
    system = point.system
    state = state._replace(strain=state.strain.copy())  # which the workspace shares
    start, tables = prepared(system, state), new_tables(system, state, 1)
    Z, rows = np.zeros((2, node_count(system), 3))
    evaluate.free_acceleration(system, state, start, Z, rows)
    evaluate.set_reactions(system, state, start, Z)
    reactions.write_reactions(
        system.shown,
        system.scalar,
        state.reaction,
        state.force,
        point.time,
        tables.reactions,
        0,
    )
    forces.publish_contacts(system.forces, start.forces, system.scalar, tables.reactions, 0)
    forces.elastic_energy(system.forces, start.forces, system.scalar)
    forces.publish_energy(system.forces, start.forces, state.work.size, tables.work, 0)
    beams.set_strains(system.beams, start.beams)
    beams.publish_energy(system.beams, start.beams, tables.work, 0)
    group = system.forces.actuator
    rates = start.scalar.rate[group.coordinate] if group is not None else np.zeros(0)
    return {REACTIONS: tables.reactions[0], WORK: tables.work[0], RATES: rates}


def step_of(point: Point, changes: Variations, j: int) -> float:
    """Return by how much column ``j`` is multiplied in one step of the differences."""
    system = point.system
    rotational = system.frames.rotates[coordinate_numbers(system) // 3].astype(bool)
    length = float(system.frames.length.max())
    dq = changes.places[:, j]
    size = max(
        float(np.abs(dq[rotational]).max(initial=0.0)),
        float(np.abs(dq[~rotational]).max(initial=0.0)) / length,
    )
    if size > 0.0:
        return STEP / size
    # All is linear in accelerations and multipliers, and quadratic in velocities.
    state = point.state
    sizes = ((state.v, changes.rates), (state.force, changes.multipliers))
    for now, change in (*sizes, (state.a, changes.accelerations)):
        largest = float(np.abs(change[:, j]).max(initial=0.0))
        if largest > 0.0:
            return max(float(np.abs(now).max(initial=0.0)), 1.0) / largest
    return 1.0


def displaced(point: Point, changes: Variations, j: int, share: float) -> State:
    """Return the state changed by ``share`` times column ``j``, to first order."""
    system, state = point.system, point.state
    frames, numbers = system.frames, coordinate_numbers(system)
    dq, dv, da = np.zeros((3, node_count(system), 3))
    for out, part in ((dq, changes.places), (dv, changes.rates), (da, changes.accelerations)):
        out.reshape(-1)[numbers] = share * part[:, j]
    moved = move(system, state, dq)
    v, w, a, alpha = state.v.copy(), moved.w.copy(), state.a.copy(), state.alpha.copy()
    for f in range(moving_count(frames)):
        u, theta = frames.displacement[f], frames.rotation[f]
        v[f], a[f], alpha[f] = v[f] + dv[u], a[f] + da[u], alpha[f] + da[theta]
        w[f] += np.array(matrix(at(moved.p, f))).T @ dv[theta]
    force = state.force.copy()
    places = equation_numbers(system) - 3 * first_multiplier(frames)
    force.reshape(-1)[places] += share * changes.multipliers[:, j]
    return moved._replace(
        v=v,
        w=w,
        a=a,
        alpha=alpha,
        force=force,
        reaction=state.reaction.copy(),
        auxiliary=state.auxiliary + share * changes.states[:, j],
    )


def shared_reactions(point: Point) -> set[str]:
    """Return the columns of reactions that redundant constraints leave open."""
    model = point.model
    elements = (*model.joints, *model.couplings, *model.motions)
    found = non_unique_reactions(point.system, point.state)
    return {f"{elements[e].name}.{c}" for e, columns in found.items() for c in columns}
