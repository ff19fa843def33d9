"""Small changes of a motion by changes of its states and inputs, to first order.

    dq = N_h eta + G_h^+ u              G dq = u    of the constraints that are prescribed motions
    dv = N zeta + G^+ (u' - B dq)       G dv + B dq = u'
    dq' = dv + T dq
    M da = K dq + D dv + S ds + F w + F_rho drho + G^T dlam                                 (1)
    G da = u'' - G' dv - B' dq - B dq'                                                      (2)

with the symbols of ``coefficients``, ``reduced`` and, for reactions rho on which friction or
expressions depend, ``reaction_feedback``. Columns are those of eta, zeta, ds, of the
displacements u and rates u' of the prescribed motions that are inputs, and of the inputs w; u'' is
the input of such a motion. (2) is the derivative of the constraints' rates along the motion, G' and
B' are those of G and B. All are written along inertial axes, relative to the motion itself.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, from_increment, matrix
from msahl.algebra.vector import at
from msahl.analysis.linearised.coefficients import (
    Coefficients,
    Evaluated,
    coefficients,
    evaluated,
    skews,
)
from msahl.analysis.linearised.plain_units import equation_numbers
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.rate_gradients import rates_by_place
from msahl.analysis.linearised.reaction_feedback import Feedback, feedback, joints_used
from msahl.analysis.linearised.reduced import LinearSystem, linear_system, null_space
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.start.velocities import StartError
from msahl.system.arrays import State, System

FOURTH = ((1.0, 2.0 / 3.0), (2.0, -1.0 / 12.0))
"""Steps and weights of central differences of the order 4."""
TRAVEL = 1e-3
"""Rotation [rad], and displacement over a length, of a step of the differences in time."""
FOLLOWS = 1e-9
"""Share of a prescribed motion that other constraints may prevent by round-off."""


class Inputs(NamedTuple):
    """What i inputs act on; n coordinates, s auxiliary states, p of them prescribed motions."""

    force: np.ndarray  # (n, i) forces and moments [N, N m]
    state_rate: np.ndarray  # (s, i) rates of the auxiliary states
    motion: np.ndarray  # (i,) number of the constraint equation whose law it is, or -1


class Motions(NamedTuple):
    """The p prescribed motions among the inputs, in all k columns."""

    rows: np.ndarray  # (p,) numbers of the constraint equations of these motions
    columns: slice  # of u and u'
    u: np.ndarray  # (p, k)
    u_dot: np.ndarray  # (p, k)
    u_ddot: np.ndarray  # (p, k)


class Variations(NamedTuple):
    """Changes in k columns: eta, zeta, ds, u, u', inputs w."""

    places: np.ndarray  # (n, k) dq [m, rad]
    rates: np.ndarray  # (n, k) dv [m/s, rad/s]
    states: np.ndarray  # (s, k) ds
    place_rates: np.ndarray  # (n, k) dq'
    accelerations: np.ndarray  # (n, k) da [m/s^2, rad/s^2]
    multipliers: np.ndarray  # (c, k) dlam [N, N m]
    state_rates: np.ndarray  # (s, k) ds'
    shown: np.ndarray  # (j, k) of published signals by reactions; (0, k) if nothing depends on them
    motion: Motions
    linear: LinearSystem  # the system without prescribed motions and inputs

    @property
    def into(self) -> np.ndarray:
        """(d + r + s, 2 n + s) eta, zeta, ds of (dq, dv, ds)."""
        return self.linear.into

    @property
    def degrees_of_freedom(self) -> int:
        """Number d of columns of eta."""
        return self.linear.degrees_of_freedom

    @property
    def rate_degrees_of_freedom(self) -> int:
        """Number r of columns of zeta."""
        return self.linear.rate_degrees_of_freedom

    @property
    def inputs(self) -> int:
        """Number of the first column of an input."""
        return self.motion.columns.stop

    def relative_rates(self, axes: np.ndarray) -> np.ndarray:
        """(2 n + s, k) rates of dq, dv, ds in axes that rotate with ``axes`` (3,) [rad/s]."""
        rotation = np.kron(np.eye(len(self.places) // 3), skews(axes[None])[0])
        return np.concatenate(
            [
                self.place_rates - rotation @ self.places,
                self.accelerations - rotation @ self.rates,
                self.state_rates,
            ]
        )


def variations(
    point: Point, evaluated: Evaluated, found: Coefficients, inputs: Inputs
) -> Variations:
    """Return the changes of the motion at a ``point``, whose derivatives are ``evaluated`` and
    ``found``, by its states and by ``inputs``. Raises ``StartError`` if a prescribed motion cannot
    change alone.
    """
    B = rates_by_place(point.system, point.state)
    linear, solve = linear_system(found, B), _Constrained(point, found)
    motion = _motions(inputs, len(linear.A))
    k, moved, given = motion.u.shape[1], motion.columns, slice(motion.columns.stop, None)
    prescribed = np.zeros((len(found.holonomic), len(motion.rows)))
    prescribed[motion.rows, np.arange(len(motion.rows))] = 1.0
    solve.check(prescribed)
    places, rates, states = (
        np.concatenate([part, np.zeros((len(part), k - len(linear.A)))], axis=1)
        for part in (linear.places, linear.rates, linear.states)
    )
    places[:, moved] = solve.place(prescribed @ motion.u[:, moved])
    rates[:, moved] = solve.rate(prescribed @ motion.u_dot[:, moved] - B @ places[:, moved])
    place_rates = rates + found.drift @ places
    forces = found.by_place @ places + found.by_rate @ rates + found.by_state @ states
    forces[:, given] += inputs.force
    state_rates = (
        found.state_by_place @ places + found.state_by_rate @ rates + found.state_by_state @ states
    )
    state_rates[:, given] += inputs.state_rate
    G_dot, B_dot = constraint_trends(point, found, B)
    right = prescribed @ motion.u_ddot - G_dot @ rates - B_dot @ places - B @ place_rates
    reacting = feedback(point, evaluated, places)
    accelerations, multipliers = solve.accelerations(forces, right, reacting)
    shown = np.zeros((0, k))
    if reacting is not None:
        reactions = reacting.by_column + reacting.by_multiplier @ multipliers
        state_rates += reacting.state_rate @ reactions
        shown = reacting.shown @ reactions
    changed = (places, rates, states, place_rates, accelerations, multipliers, state_rates, shown)
    return Variations(*changed, motion, linear)


def _motions(inputs: Inputs, m: int) -> Motions:
    """Return the motions among the inputs, after ``m`` columns of states."""
    which = np.flatnonzero(inputs.motion >= 0)
    p, i = which.size, inputs.motion.size
    u, u_dot, u_ddot = np.zeros((3, p, m + 2 * p + i))
    u[:, m : m + p] = u_dot[:, m + p : m + 2 * p] = np.eye(p)
    u_ddot[np.arange(p), m + 2 * p + which] = 1.0
    return Motions(inputs.motion[which], slice(m, m + 2 * p), u, u_dot, u_ddot)


def with_reactions(
    point: Point, found: Coefficients, linear: LinearSystem, axes: np.ndarray
) -> LinearSystem:
    """Return the ``linear`` system, seen in ``axes`` (3,) [rad/s], with what its forces change by
    reactions of joints.
    """
    if not joints_used(point.system).size:
        return linear
    n, s = found.coordinate.size, found.state_rate.size
    none = Inputs(np.zeros((n, 0)), np.zeros((s, 0)), np.zeros(0, dtype=int))
    changes = variations(point, evaluated(point.system, point.state), found, none)
    return linear._replace(A=changes.into @ changes.relative_rates(axes))


class _Constrained:
    """Solves for motions under the constraints, in coordinates weighted by mass.

    Multipliers are divided by those of a unit acceleration of their bodies; the least ones in this
    unit are taken where constraints are redundant, as a run takes them.
    """

    def __init__(self, point: Point, found: Coefficients) -> None:
        self.back = np.linalg.inv(np.linalg.cholesky(found.mass.toarray())).T
        self.G = found.constraint.toarray() @ self.back
        self.holonomic = found.holonomic
        self.N, self.inverse = null_space(self.G)
        system = point.system
        numbers = equation_numbers(system) - 3 * first_multiplier(system.frames)
        self.unit = system.unit.reshape(-1)[numbers]
        rank = len(self.back) - self.N.shape[1]
        left, size, right = np.linalg.svd(self.G.T * self.unit, full_matrices=False)
        self.left, self.size, self.right = left[:, :rank], size[:rank], right[:rank]

    def place(self, right: np.ndarray) -> np.ndarray:
        """The least dq with G_h dq = ``right``, of the equations between places."""
        if not right.shape[1]:
            return np.zeros((len(self.back), 0))
        G_h = self.G[self.holonomic]
        moved: np.ndarray = self.back @ (null_space(G_h)[1] @ right[self.holonomic])
        return moved

    def rate(self, right: np.ndarray) -> np.ndarray:
        """The least dv with G dv = ``right``."""
        moved: np.ndarray = self.back @ (self.inverse @ right)
        return moved

    def check(self, prescribed: np.ndarray) -> None:
        """Raise ``StartError`` if the right-hand sides ``prescribed`` (c, p) are impossible."""
        left = np.abs(self.G @ (self.inverse @ prescribed) - prescribed).max(initial=0.0)
        if left > FOLLOWS:
            raise StartError(
                "a prescribed motion that is an input cannot change alone, since other joints or "
                "motions determine the same coordinate; choose another input"
            )

    def accelerations(
        self, forces: np.ndarray, right: np.ndarray, reacting: Feedback | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """The da of (1) and (2), and dlam: with G^T unit = U S V^T and a = U b + N c

        (S + U^T P V) mu = S^-1 V^T unit right - U^T f          P   by multipliers, of drho
        a = f + (U S + P V) mu ,  dlam = unit V mu
        """
        f = self.back.T @ forces
        P = np.zeros((len(f), self.unit.size))
        if reacting is not None:
            by_reaction = self.back.T @ reacting.force
            f = f + by_reaction @ reacting.by_column
            P = (by_reaction @ reacting.by_multiplier) * self.unit
        U, S, V = self.left, self.size, self.right.T
        wanted = (V.T @ (self.unit[:, None] * right)) / S[:, None]
        mu = np.linalg.solve(np.diag(S) + U.T @ P @ V, wanted - U.T @ f)
        along = U @ wanted + self.N @ (self.N.T @ (f + P @ V @ mu))
        return self.back @ along, self.unit[:, None] * (V @ mu)


def constraint_trends(
    point: Point, found: Coefficients, B: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(c, n) each: derivatives of G and of ``B`` along the motion [1/s]."""
    system, state = point.system, point.state
    if not len(B):
        return np.zeros_like(B), np.zeros_like(B)
    if not found.velocity.any():
        # B is linear in the velocities, and G changes by them only.
        return np.zeros_like(B), rates_by_place(system, _later(system, state, 0.0, 1.0))
    speed = float(np.abs(found.velocity * np.where(found.rotational, 1.0, 0.0)).max(initial=0.0))
    travel = np.abs(found.velocity[~found.rotational]).max(initial=0.0)
    speed = max(speed, float(travel) / float(system.frames.length.max()))
    tau = TRAVEL / speed
    G_dot, B_dot = np.zeros_like(B), np.zeros_like(B)
    for steps, weight in FOURTH:
        for sign in (1.0, -1.0):
            later = _later(system, state, sign * steps * tau, sign * steps * tau)
            share = sign * weight / tau
            G_dot += share * coefficients(system, later).constraint.toarray()
            B_dot += share * rates_by_place(system, later)
    return G_dot, B_dot


def _later(system: System, state: State, travel: float, time: float) -> State:
    """Return the state displaced by its velocities over the time ``travel`` and accelerated over
    ``time`` [s], to first order.
    """
    x, p, v, w = state.x.copy(), state.p.copy(), state.v.copy(), state.w.copy()
    for f in range(moving_count(system.frames)):
        W = np.array(matrix(at(p, f))) @ w[f]
        x[f] += travel * v[f]
        rotated = travel * W
        p[f] = compose(from_increment((rotated[0], rotated[1], rotated[2])), at(p, f))
        v[f] += time * state.a[f]
        w[f] = np.array(matrix(at(p, f))).T @ (W + time * state.alpha[f])
    return state._replace(x=x, p=p, v=v, w=w, angle=state.angle.copy())
