"""Equilibria: places at which all forces are balanced, at rest or rotating steadily about an axis.

With v = w x (x - c) and W = w of all bodies (w = 0: at rest) the unbalanced accelerations, in
coordinates weighted by mass as in ``reduced``, and the rates of auxiliary states are

    r(eta, s) = ( N^T L^T (a - w x v) , s' ) = 0 ,         J = dr/d(eta, s)  from the linearisation

Two methods solve it, one step of which is to move by (eta, s), to close the joints again, and to
set velocities, accelerations and multipliers:

    descent    (1/tau - J) d = r       1/tau above all eigenvalues of J, so that each step goes
                                       downhill; towards zero where J is negative: a stable one
    Newton           - J  d = r        with a line search on |r|: the nearest one of any kind

The first follows the forces, like a strongly damped motion, and ends as Newton's method.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Law, build_laws, evaluate
from msahl.analysis.constant_inputs import with_constant_inputs
from msahl.analysis.equilibria.static_equations import Spin, with_rates
from msahl.analysis.linearised.coefficients import Coefficients, coefficients, skews
from msahl.analysis.linearised.plain_units import equation_scale
from msahl.analysis.linearised.point import Point, at_start, closed, placed, settled
from msahl.analysis.linearised.projection import move
from msahl.analysis.linearised.rate_gradients import rates_by_place
from msahl.analysis.linearised.reduced import LinearSystem, linear_system, stiffness_weight
from msahl.analysis.linearised.steady import Equilibrium, residual_in
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.model import Model
from msahl.start.velocities import StartError
from msahl.system.arrays import State, System, node_count
from msahl.system.names import describe_row

DESCENT, NEWTON = "descent", "Newton's method"
MOST_ITERATIONS = 200
MOST_WAITING = 60
"""Iterations without a smaller residual after which a search ends."""
MOST_WHILE_TOUCHING = 12
"""Likewise, where contacts touch: on a slope forces stay the same for ever, but for round-off."""
PROGRESS = 1.0 - 1e-6
"""Residual over the smallest one that is smaller by more than round-off."""
LARGEST_ROTATION = 0.4
"""Of a body in one step [rad]; displacements likewise, over the length of the system."""
BALANCED = 1e-9
"""Force that is not balanced, over the largest force, of an equilibrium."""
ROUND_OFF = 1e-15
"""Step, over the size of the system, that changes nothing."""
LEAST_STIFF = 1e-8
"""Stiffness, relative to the largest, that the descent gives to directions without any."""
IDLE = 1e-9
"""Force, over all forces, that moves nothing along a direction without stiffness."""
FLAT = 1e-9
"""Singular value of J, over the largest, of a direction in which nothing changes."""
CANCELLED = 100.0 * float(np.finfo(float).eps)
"""Part of the terms of a stiffness or force that may remain where they cancel each other."""
SHORTEST = 1.0 / 64.0
"""Part of a Newton step that is tried last."""


class Place(NamedTuple):
    """A configuration with its linearisation, seen in axes that rotate with the model."""

    point: Point
    found: Coefficients
    linear: LinearSystem
    residual: np.ndarray  # (r + s,)
    jacobian: np.ndarray  # (r + s, d + s)
    balance: Equilibrium


class Where(NamedTuple):
    """A configuration of a larger model, without dense matrices."""

    point: Point
    balance: Equilibrium


class Solution(NamedTuple):
    """An equilibrium, if it ``converged``."""

    place: Place | Where
    iterations: int
    converged: bool
    flat: int | None  # directions in which it has no stiffness; None of a larger model
    method: str


def search_start(model: Model) -> Point:
    """Return the model where the deck places it, with prescribed motions held where they begin.

    Models with beams, whose equilibria are those of the unloaded model with growing loads, need no
    accelerations. Raises ``StartError`` if there is no consistent state.
    """
    held = Law("constant", (0.0,))
    model = with_constant_inputs(model)
    model = replace(model, motions=tuple(replace(m, law=held) for m in model.motions))
    return placed(model) if model.beams else at_start(model)


def held_motions(model: Model) -> list[str]:
    """Return the names of prescribed motions that move at t = 0, although the search holds them."""
    rates = [evaluate(build_laws([motion.law]), 0, 0.0)[1] for motion in model.motions]
    return [motion.name for motion, rate in zip(model.motions, rates, strict=True) if rate]


def solve(point: Point, spin: np.ndarray, stable: bool = True) -> Solution:
    """Return the equilibrium that is reached from a ``point``, of a model that rotates with
    ``spin`` (3,) [rad/s]: a stable one, or the nearest of any kind. Raises ``StartError`` where
    joints cannot be closed.
    """
    place = evaluated(point, spin, axis_point(point, spin))
    smallest, waited, iterations, last = place, 0, 0, 0
    for _ in range(MOST_ITERATIONS):
        step = _descent(place) if stable else _newton(place)
        size = float(np.linalg.norm(_lengths(place, step)))
        if size <= ROUND_OFF * size_of(place.point) or waited > 3:
            break
        if iterations > last + _patience(place.point):
            break
        following = _line_search(place, step, spin, stable)
        if following is None:
            break
        place, iterations = following, iterations + 1
        better = np.linalg.norm(place.residual) < 0.5 * np.linalg.norm(smallest.residual)
        # At round-off the residual stops falling.
        waited = 0 if better or smallest.balance.relative > BALANCED else waited + 1
        now, least = (float(np.linalg.norm(of.residual)) for of in (place, smallest))
        if now < least:
            last = iterations if now < PROGRESS * least or point.touching is None else last
            smallest = place
    converged = smallest.balance.relative <= BALANCED and states_rest(smallest)
    method = DESCENT if stable else NEWTON
    return Solution(smallest, iterations, converged, _flat_directions(smallest), method)


def _patience(point: Point) -> int:
    """Return the number of iterations without a smaller residual after which a search ends."""
    touches = point.touching is not None and bool(point.touching.touches.any())
    return MOST_WHILE_TOUCHING if touches else MOST_WAITING


def balance_at(point: Point, spin: np.ndarray) -> Equilibrium:
    """Return how far a ``point`` is from an equilibrium, whatever its velocities are."""
    there = settled(point, _rotating(point.state, spin, axis_point(point, spin)))
    return residual_in(coefficients(there.system, there.state), spin)


def evaluated(point: Point, spin: np.ndarray, centre: np.ndarray) -> Place:
    """Evaluate a configuration with the velocities of the steady rotation."""
    point = settled(point, _rotating(point.state, spin, centre))
    found = coefficients(point.system, point.state)
    moving = bool(spin.any())
    B = (
        rates_by_place(point.system, point.state)
        if moving
        else np.zeros((len(found.holonomic), found.coordinate.size))
    )
    linear = linear_system(found, B, spin)
    n, d, r = found.coordinate.size, linear.degrees_of_freedom, linear.rate_degrees_of_freedom
    carried = np.cross(spin, found.velocity.reshape(-1, 3)).reshape(-1)
    rates = linear.into[d : d + r, n : 2 * n]
    residual = np.concatenate([rates @ (found.acceleration - carried), found.state_rate])
    rotation = np.kron(np.eye(n // 3), skews(spin[None])[0])
    drift = found.drift @ linear.places[:, :d] - rotation @ linear.places[:, :d]
    follow = -rates @ drift
    A = linear.A
    by_place = A[d:, :d] + A[d:, d : d + r] @ follow
    jacobian = np.concatenate([by_place, A[d:, d + r :]], axis=1)
    balance = residual_in(found, spin)
    return Place(point, found, linear, residual, jacobian, balance)


def _rotating(state: State, spin: np.ndarray, centre: np.ndarray) -> State:
    """Return the state with the velocities of a steady rotation, and zero accelerations."""
    changed = ("a", "alpha", "force", "reaction")
    unchanged = {name: np.zeros_like(getattr(state, name)) for name in changed}
    moving = with_rates(state, Spin(spin, centre))
    return moving._replace(auxiliary=state.auxiliary.copy(), **unchanged)


def axis_point(point: Point, spin: np.ndarray) -> np.ndarray:
    """(3,) a point of the axis about which the constraints let the model rotate with ``spin``.
    Raises ``StartError`` if they do not, or if the model has contacts.
    """
    if not spin.any():
        return np.zeros(3)
    if point.touching is not None:
        raise StartError(
            "the model has rigid contacts, which steady rotations do not know; look for an "
            "equilibrium at rest, or give contacts a <stiffness>"
        )
    system, state = point.system, point.state
    found = coefficients(system, _rotating(state, spin, np.zeros(3)))
    G = found.constraint.toarray()
    is_place = _place_columns(system, found)
    moved = np.zeros((found.coordinate.size, 3))
    for k in range(3):
        moved[is_place[:, k], k] = 1.0
    # v = w x x - w x c
    rates = G @ found.velocity
    by_centre = -G @ moved @ skews(spin[None])[0]
    centre: np.ndarray = np.linalg.lstsq(by_centre, -rates, rcond=1e-9)[0]
    left = np.abs(rates + by_centre @ centre)
    largest = max(float(np.abs(found.velocity).max()), float(np.abs(spin).max()))
    if left.max(initial=0.0) > 1e-9 * largest:
        worst = int(np.argmax(left))
        number = int(found.equation[worst])
        where = describe_row(point.model, system, 3 * first_multiplier(system.frames) + number)
        unit = "m/s" if equation_scale(system).reshape(-1)[number] == 1.0 else "rad/s"
        raise StartError(
            "the joints do not let the model rotate steadily with this angular velocity: "
            f"{where}, would be violated at a rate of {left[worst]:.3g} {unit}; choose an axis "
            "about which the model can rotate, and omit motors about it, which are held"
        )
    return centre


def _place_columns(system: System, found: Coefficients) -> np.ndarray:
    """(b, 3) numbers of the coordinates that are displacements."""
    place = np.full(3 * node_count(system), -1)
    place[found.coordinate] = np.arange(found.coordinate.size)
    nodes = system.frames.displacement[: moving_count(system.frames)]
    columns: np.ndarray = place[3 * nodes[:, None] + np.arange(3)]
    return columns


def _lengths(place: Place, step: np.ndarray) -> np.ndarray:
    """(n,) what a step displaces and, times lengths, rotates [m]."""
    d = place.linear.degrees_of_freedom
    lengths: np.ndarray = place.found.length * (place.linear.places[:, :d] @ step[:d])
    return lengths


def _newton(place: Place) -> np.ndarray:
    """The step of Newton's method, the least one where J is singular."""
    step: np.ndarray = np.linalg.lstsq(place.jacobian, -place.residual, rcond=FLAT)[0]
    return limited(place, step)


def _descent(place: Place) -> np.ndarray:
    """The step that follows the forces, as far as they fall."""
    J, d = place.jacobian, place.linear.degrees_of_freedom
    r = place.linear.rate_degrees_of_freedom
    if d != r:
        return _newton(place)
    R = _lengths_by_coordinates(place)
    back = np.linalg.inv(R)
    stiffness = back.T @ J[:d, :d] @ back
    values, vectors = np.linalg.eigh(0.5 * (stiffness + stiffness.T))
    terms = (
        float(
            np.linalg.norm(
                stiffness_weight(place.found, place.linear, place.point.pressing) @ back, 2
            )
        )
        ** 2
    )
    # Where nothing has any stiffness, as in a level pendulum, the forces alone say what is little.
    force = float(np.linalg.norm(back.T @ place.residual[:d])) / size_of(place.point)
    largest = max(float(np.abs(values).max(initial=0.0)), force)
    flat = max(LEAST_STIFF * largest, CANCELLED * terms)
    # Uphill directions are taken by the size of their stiffness, as if they were downhill.
    stiff = np.maximum(np.abs(values), flat)
    # A rod that may spin about itself, or a door under its weight, must not move by round-off.
    along = np.abs(vectors.T @ (back.T @ place.residual[:d]))
    least = max(IDLE * float(np.linalg.norm(along)), CANCELLED * size_of(place.point) * terms)
    idle = (np.abs(values) <= flat) & (along <= least)
    lift = np.where(values > -flat, values + np.where(idle, max(largest, terms), stiff), 0.0)
    shifted = J.copy()
    shifted[:d, :d] -= R.T @ (vectors * lift) @ vectors.T @ R
    step: np.ndarray = np.linalg.lstsq(shifted, -place.residual, rcond=FLAT * 1e-6)[0]
    return limited(place, step)


def _lengths_by_coordinates(place: Place) -> np.ndarray:
    """(d, d) R that makes coordinates weighted by mass lengths: a slender rod, or a node of a
    slender beam, has so little inertia that some of its stiffness seems none by mass.
    """
    d = place.linear.degrees_of_freedom
    lengths = place.found.length[:, None] * place.linear.places[:, :d]
    return np.asarray(np.linalg.qr(lengths, mode="r"))


def limited(place: Place, step: np.ndarray) -> np.ndarray:
    """The step, shortened where it rotates or displaces a body too far."""
    d = place.linear.degrees_of_freedom
    dq = place.linear.places[:, :d] @ step[:d]
    rotation = np.abs(dq[place.found.rotational]).max(initial=0.0)
    travel = np.abs(place.found.length * dq).max(initial=0.0) / size_of(place.point)
    largest = max(float(rotation), float(travel)) / LARGEST_ROTATION
    return step / largest if largest > 1.0 else step


def _line_search(place: Place, step: np.ndarray, spin: np.ndarray, stable: bool) -> Place | None:
    """The configuration after the step, or after a part of it that makes the residual smaller; None
    if there is none. A descent may pass where the residual grows.
    """
    centre, share = axis_point(place.point, spin), 1.0
    while share >= SHORTEST:
        try:
            after = evaluated(moved(place, share * step), spin, centre)
        except StartError:
            share *= 0.5
            continue
        if stable or np.linalg.norm(after.residual) < np.linalg.norm(place.residual):
            return after
        if place.balance.relative <= BALANCED:
            return after
        share *= 0.5
    return None


def moved(place: Place, step: np.ndarray) -> Point:
    """The point after a step, with its joints closed."""
    point, d = place.point, place.linear.degrees_of_freedom
    dq = np.zeros((node_count(point.system), 3))
    dq.reshape(-1)[place.found.coordinate] = place.linear.places[:, :d] @ step[:d]
    state = move(point.system, point.state, dq)
    state = state._replace(auxiliary=state.auxiliary + step[d:])
    return closed(point, state)


def size_of(point: Point) -> float:
    """Size of the model [m]: its extent, or the largest length of a body."""
    x = point.state.x[:-1]
    extent = float(np.linalg.norm(x.max(axis=0) - x.min(axis=0))) if len(x) else 0.0
    return max(extent, float(point.system.frames.length.max()))


def states_rest(place: Place) -> bool:
    """Return whether the auxiliary states do not change."""
    rate = place.found.state_rate
    if not rate.size:
        return True
    speed = np.abs(np.diag(place.found.state_by_state)) * np.abs(place.point.state.auxiliary)
    return bool(np.abs(rate).max() <= 1e-8 * max(float(speed.max()), 1.0))


def _flat_directions(place: Place) -> int:
    """Number of directions in which the equilibrium has no stiffness."""
    d = place.linear.degrees_of_freedom
    if not d:
        return 0
    _, values, right = np.linalg.svd(place.jacobian, full_matrices=False)
    weight = stiffness_weight(place.found, place.linear, place.point.pressing)
    terms = np.sum((weight @ right[:, :d].T) ** 2, axis=0)
    cancelled = int(np.count_nonzero(values <= CANCELLED * terms))
    by_lengths = np.linalg.svd(_by_lengths(place), compute_uv=False)
    small = min(
        int(np.count_nonzero(sizes <= FLAT * sizes.max(initial=0.0)))
        for sizes in (values, by_lengths)
    )
    return max(cancelled, small) + max(d - place.linear.rate_degrees_of_freedom, 0)


def _by_lengths(place: Place) -> np.ndarray:
    """The Jacobian by lengths instead of the coordinates weighted by mass."""
    J, d = place.jacobian.copy(), place.linear.degrees_of_freedom
    r = place.linear.rate_degrees_of_freedom
    if d != r:
        return J
    back = np.linalg.inv(_lengths_by_coordinates(place))
    J[:d] = back.T @ J[:d]
    J[:, :d] = J[:, :d] @ back
    return J
