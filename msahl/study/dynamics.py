"""A model as an ordinary differential equation, and the results of its states.

    x_dot = v     e_dot = e o (0, w)/2     v_dot = a(x, e, v, w)     w_dot = R^T alpha

with Euler parameters e in place of the engine's own and accelerations from the index-1 problem of
``schemes.common.accelerations``. No equation of a step is used.
A vector y holds x (3), e (4), v (3), w (3) of every body, one body after the other, and after them
the auxiliary states of the laws of the motion.
"""

from dataclasses import replace

import numpy as np

from msahl.algebra.rotation import compose, from_increment
from msahl.algebra.vector import add, at, matrix_at, put, scale, times, transpose
from msahl.elements.constraints import scalar
from msahl.elements.signals import states
from msahl.formulations.absolute import rigid_body
from msahl.formulations.absolute.frames import (
    displacement,
    first_multiplier,
    moving_count,
    rotation_increment,
)
from msahl.jit.compiled import compiled
from msahl.jit.kernel import kernel
from msahl.model import Model
from msahl.model.scheme import AUTO_FAMILY, EXPLICIT
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.common import accelerations
from msahl.schemes.common.accelerations import Instant, new_instant, solve_least
from msahl.start.redundancy import is_regular
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace
from msahl.system.build import build_system

SIZE = 13
"""Numbers of a body in y."""


@kernel
def _unpack(y: np.ndarray, state: State) -> None:
    bodies = state.x.shape[0] - 1
    for k in range(state.auxiliary.size):
        state.auxiliary[k] = y[SIZE * bodies + k]
    for b in range(bodies):
        k = SIZE * b
        e0, e = y[k + 3], (y[k + 4], y[k + 5], y[k + 6])
        length = np.sqrt(e0 * e0 + e[0] * e[0] + e[1] * e[1] + e[2] * e[2])
        # 4 tan(phi/4) = 4 sin(phi/2) / (1 + cos(phi/2)); the sign of e picks
        # the smaller of the two sets of parameters.
        p = scale((4.0 if e0 >= 0.0 else -4.0) / (length + abs(e0)), e)
        put(state.x, b, (y[k], y[k + 1], y[k + 2]))
        put(state.p, b, p)
        put(state.v, b, (y[k + 7], y[k + 8], y[k + 9]))
        put(state.w, b, (y[k + 10], y[k + 11], y[k + 12]))


@kernel
def _pack(state: State, y: np.ndarray) -> None:
    bodies = state.x.shape[0] - 1
    for k in range(state.auxiliary.size):
        y[SIZE * bodies + k] = state.auxiliary[k]
    for b in range(bodies):
        k = SIZE * b
        p, x, v, w = at(state.p, b), at(state.x, b), at(state.v, b), at(state.w, b)
        square = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) / 16.0
        e0, c = (1.0 - square) / (1.0 + square), 0.5 / (1.0 + square)
        # Of e and -e the one that y held before: an integrator must not see a jump.
        old = y[k + 3] * e0 + c * (y[k + 4] * p[0] + y[k + 5] * p[1] + y[k + 6] * p[2])
        sign = -1.0 if old < 0.0 else 1.0
        y[k + 3] = sign * e0
        for i in range(3):
            y[k + i], y[k + 4 + i] = x[i], sign * c * p[i]
            y[k + 7 + i], y[k + 10 + i] = v[i], w[i]


@kernel
def _prepare(system: System, state: State, start: SystemWorkspace) -> None:
    """As the scheme does, and with the angles counted on to where the state is."""
    evaluate.prepare(system, state, start)
    scalar.count_rotations(system.scalar, start.scalar, state.angle)


@kernel
def _free(
    system: System, state: State, start: SystemWorkspace, instant: Instant, y: np.ndarray
) -> None:
    _unpack(y, state)
    _prepare(system, state, start)
    accelerations.assemble(system, state, start, instant, False)


@kernel
def _rates(
    system: System, start: SystemWorkspace, instant: Instant, y: np.ndarray, dy: np.ndarray
) -> None:
    """Set ``dy`` from the accelerations in ``instant``."""
    bodies = moving_count(system.frames)
    states.set_rates(system.forces.signals, start.forces.signals, dy, SIZE * bodies)
    for b in range(bodies):
        k = SIZE * b
        e0, e1, e2, e3 = y[k + 3], y[k + 4], y[k + 5], y[k + 6]
        w1, w2, w3 = y[k + 10], y[k + 11], y[k + 12]
        rotation = rotation_increment(system.frames, instant.solution, b)
        alpha = times(transpose(matrix_at(start.frames.R, b)), rotation)
        a = displacement(system.frames, instant.solution, b)
        dy[k + 3] = -0.5 * (e1 * w1 + e2 * w2 + e3 * w3)
        dy[k + 4] = 0.5 * (e0 * w1 + e2 * w3 - e3 * w2)
        dy[k + 5] = 0.5 * (e0 * w2 + e3 * w1 - e1 * w3)
        dy[k + 6] = 0.5 * (e0 * w3 + e1 * w2 - e2 * w1)
        for i in range(3):
            dy[k + i] = y[k + 7 + i]
            dy[k + 7 + i], dy[k + 10 + i] = a[i], alpha[i]


@kernel
def _all_rates(
    system: System,
    state: State,
    start: SystemWorkspace,
    instant: Instant,
    y: np.ndarray,
    dy: np.ndarray,
) -> None:
    _unpack(y, state)
    _prepare(system, state, start)
    accelerations.accelerate(system, state, start, instant)
    _rates(system, start, instant, y, dy)


@kernel
def _open(
    system: System,
    state: State,
    start: SystemWorkspace,
    instant: Instant,
    violation: np.ndarray,
    rate: np.ndarray,
    scale_of: np.ndarray,
    level: int,
) -> None:
    """Set the rows to minus the violations (``level`` 0) or their rates (1); factor the matrix."""
    _prepare(system, state, start)
    accelerations.assemble(system, state, start, instant, False)
    evaluate.observe(system, state, start, violation, rate)
    first = first_multiplier(system.frames)
    for node in range(instant.rows.shape[0]):
        for i in range(3):
            if node < first:
                instant.rows[node, i] = 0.0
            else:
                open_by = violation[node - first, i] if level == 0 else rate[node - first, i]
                instant.rows[node, i] = -open_by * scale_of[node - first, i]


@kernel
def _move(system: System, state: State, instant: Instant) -> None:
    """Displace and rotate the frames by the solution."""
    for b in range(moving_count(system.frames)):
        rotation = rotation_increment(system.frames, instant.solution, b)
        put(state.x, b, add(at(state.x, b), displacement(system.frames, instant.solution, b)))
        put(state.p, b, compose(from_increment(rotation), at(state.p, b)))


@kernel
def _push(system: System, state: State, start: SystemWorkspace, instant: Instant) -> None:
    """Change the velocities by the solution."""
    for b in range(moving_count(system.frames)):
        rotation = rotation_increment(system.frames, instant.solution, b)
        put(state.v, b, add(at(state.v, b), displacement(system.frames, instant.solution, b)))
        spin = times(transpose(matrix_at(start.frames.R, b)), rotation)
        put(state.w, b, add(at(state.w, b), spin))


@kernel
def _publish_rows(
    system: System, state: State, start: SystemWorkspace, ys: np.ndarray, table: np.ndarray
) -> None:
    """Write the states ``ys`` into the rows of ``table``, in the columns of ``states.csv``."""
    for row in range(ys.shape[0]):
        _unpack(ys[row], state)
        evaluate.prepare(system, state, start)
        rigid_body.write_states(system.bodies, state.x, state.p, start.frames, state.w, table, row)


@kernel
def _recall(
    system: System,
    state: State,
    start: SystemWorkspace,
    instant: Instant,
    times: np.ndarray,
    table: np.ndarray,
    forces: np.ndarray,
) -> None:
    """Set ``forces`` (m, j, 3) to the joints' forces of the published states in ``table``."""
    for row in range(times.size):
        state.time[0] = times[row]
        rigid_body.read_states(system.bodies, table, row, state.x, state.p, state.v, state.w)
        _prepare(system, state, start)
        accelerations.accelerate(system, state, start, instant)
        for j in range(forces.shape[1]):
            for i in range(3):
                forces[row, j, i] = state.reaction[j, i]


def first_state(model: Model) -> tuple[System, State]:
    """The system of ``model``, and its state at t = 0, made consistent as the deck wishes."""
    given = model.simulation
    # Explicit schemes have no complete equations; the state at t = 0 is that of any scheme.
    if given.scheme in EXPLICIT:
        given = replace(given, scheme=AUTO_FAMILY)
    start = replace(model, simulation=given)
    integrator = SubsystemIntegrator(start, "newton", full=True, chunk=1)
    # The runner's own system may be relaxed, which is not what the equations say.
    return build_system(model), integrator.workspace.state


class Dynamics:
    """The equation of one model, starting from the state its runs start from."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.system, self.state = first_state(model)
        self.start = new_system_workspace(self.system, self.state)
        self.instant = new_instant(self.system)
        self.joints = len(model.joints)
        self.regular = is_regular(self.system, self.state, self.instant.unknowns)
        self.violation, self.rate = (
            np.zeros_like(self.state.violation),
            np.zeros_like(self.state.violation),
        )
        self.scale = np.ones_like(self.state.violation)
        if self.system.scalar:
            # Equations in radians are multiplied by a length in the matrix.
            rows = self.system.scalar.equations
            self.scale[rows.place[:, 0], rows.place[:, 1]] = rows.scale
        self.first_angle = self.state.angle.copy()
        self.first = np.zeros(SIZE * len(model.bodies) + self.state.auxiliary.size)
        self.first[3 : SIZE * len(model.bodies) : SIZE] = 1.0
        _pack(self.state, self.first)
        self.table = self.publish(self.first[None, :])

    @property
    def parts(self) -> tuple[System, State, SystemWorkspace, Instant]:
        """What the kernels take first."""
        return self.system, self.state, self.start, self.instant

    def restart(self) -> None:
        """Count angles from those at t = 0 again."""
        self.state.angle[:] = self.first_angle

    def rates(self, t: float, y: np.ndarray) -> np.ndarray:
        """dy/dt."""
        dy = np.empty_like(y)
        self.state.time[0] = t
        if self.regular:
            _compiled_rates(*self.parts, y, dy)
        else:
            with np.errstate(all="ignore"):
                _compiled_free(*self.parts, y)
            solve_least(self.instant)
            _compiled_react(*self.parts)
            _rates(self.system, self.start, self.instant, y, dy)
        return dy

    def projected(self, t: float, y: np.ndarray) -> np.ndarray:
        """``y`` with the joints closed, in position and in velocity, by the least change by mass.

        Angles are counted on, from where they were asked for last.
        """
        y = y.copy()
        self.state.time[0] = t
        _compiled_unpack(y, self.state)
        if self.violation.size:
            self._close(0)
            _compiled_move(self.system, self.state, self.instant)
            self._close(1)
            _compiled_push(self.system, self.state, self.start, self.instant)
            _compiled_pack(self.state, y)
        return y

    def _close(self, level: int) -> None:
        with np.errstate(all="ignore"):
            _compiled_open(*self.parts, self.violation, self.rate, self.scale, level)
        if self.regular:
            _compiled_solve(self.instant)
        else:
            solve_least(self.instant)

    def publish(self, ys: np.ndarray) -> np.ndarray:
        """(m, 12 n) the columns of ``states.csv`` of the states ``ys`` (m, ...)."""
        table = np.zeros((len(ys), rigid_body.STATE_SIZE * len(self.model.bodies)))
        ys = np.ascontiguousarray(ys)
        _compiled_publish(self.system, self.state, self.start, ys, table)
        return table

    def forces(self, times: np.ndarray, table: np.ndarray) -> np.ndarray:
        """(m, 3 k) joint forces [N] of the published states ``table`` (m, 12 n), at their times.

        Of joints that are not independent the least forces. Times increase, and no angle changes by
        half a revolution from one to the next.
        """
        self.restart()
        out = np.zeros((len(table), self.joints, 3))
        table, times = np.ascontiguousarray(table), np.asarray(times, dtype=float)
        rows = 1 if not self.regular else max(1, len(times))
        for k in range(0, len(times), rows):
            part = slice(k, k + rows)
            with np.errstate(all="ignore"):
                _compiled_recall(*self.parts, times[part], table[part], out[part])
            if not self.regular:
                solve_least(self.instant)
                _compiled_react(*self.parts)
                out[k] = self.state.reaction[: self.joints, :3]
        return out.reshape(len(table), -1)


_compiled_unpack = compiled(_unpack)
_compiled_pack = compiled(_pack)
_compiled_solve = compiled(accelerations.solve)
_compiled_react = compiled(accelerations.set_reactions)
_compiled_rates = compiled(_all_rates)
_compiled_free = compiled(_free)
_compiled_open = compiled(_open)
_compiled_move = compiled(_move)
_compiled_push = compiled(_push)
_compiled_recall = compiled(_recall)
_compiled_publish = compiled(_publish_rows)
