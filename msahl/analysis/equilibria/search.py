"""Searches for equilibria: several methods, from one configuration or from many.

    descent        follows the forces, down to a stable equilibrium           ``equilibrium``
    Newton         the nearest one of any kind                                ``equilibrium``
    multipliers    Newton's method on places and multipliers, sparse          ``static_newton``
    continuation   gravity and loads grow from zero to their size             ``load_path``

Small models are searched by the first two, others by the third; the rest come in where these fail.
Of small models the last two end as Newton's method by the configuration alone.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from msahl.algebra.rotation import compose, to_axis_angle
from msahl.algebra.rotation import inverse as opposite
from msahl.algebra.vector import at
from msahl.analysis.equilibria.equilibrium import (
    BALANCED,
    FLAT,
    LARGEST_ROTATION,
    Solution,
    Where,
    axis_point,
    evaluated,
    limited,
    moved,
    size_of,
    solve,
)
from msahl.analysis.equilibria.flips import Hinge, flipped, hinges_of
from msahl.analysis.equilibria.load_path import grown
from msahl.analysis.equilibria.one_sided import trials
from msahl.analysis.equilibria.stability import is_stable
from msahl.analysis.equilibria.static_equations import Spin, Statics, with_rates
from msahl.analysis.equilibria.static_newton import Rest, newton
from msahl.analysis.linearised.coefficients import coefficients
from msahl.analysis.linearised.plain_units import coordinate_numbers
from msahl.analysis.linearised.point import Point, complete
from msahl.analysis.linearised.projection import close, move
from msahl.analysis.linearised.steady import Equilibrium, residual_in
from msahl.analysis.modes.solution import coordinate_count, is_large
from msahl.formulations.absolute.frames import first_multiplier
from msahl.start.velocities import StartError, solve_at_rest
from msahl.system.arrays import State, node_count
from msahl.system.names import describe_row

MULTIPLIERS = "Newton's method with multipliers"
CONTINUATION = "continuation of the loads"
QUICK = 120
"""Most coordinates (six a body) of a model that is searched by dense matrices first."""
SAME = 1e-6
"""Distance of two equilibria, over the size of the system, that are one."""

UNRESISTED = 1e-3
"""Share of the forces that nothing resists, of a model that has no equilibrium."""


def find(point: Point, spin: np.ndarray) -> Solution | None:
    """Return the equilibrium to which a ``point`` leads, by the first method that finds one, of a
    larger model a stable one if there is one; None if there is none.

    Raises ``StartError`` if the joints do not let the model rotate with ``spin``.
    """
    axis_point(point, spin)
    first = None
    for solution in _reached(point, spin):
        if coordinate_count(point) <= QUICK or is_stable(solution.place.point):
            return solution
        first = first or solution
    return first


def unresisted(point: Point, spin: np.ndarray) -> str:
    """Return the body on which a force acts along a motion that nothing resists, in words; empty if
    there is none, or the model is large.
    """
    if is_large(point):
        return ""
    place = evaluated(point, spin, axis_point(point, spin))
    if not place.jacobian.size:
        return ""
    left, values, _ = np.linalg.svd(place.jacobian)
    rank = int(np.count_nonzero(values > FLAT * values.max()))
    force = left[:, rank:].T @ place.residual
    if not np.linalg.norm(force) > UNRESISTED * np.linalg.norm(place.residual):
        return ""
    d = place.linear.degrees_of_freedom
    motion = place.linear.places[:, :d] @ (left[:, rank:] @ force)[:d]
    worst = int(np.argmax(np.abs(place.found.length * motion)))
    return describe_row(point.model, point.system, int(place.found.coordinate[worst]))


def all_equilibria(point: Point, spin: np.ndarray, starts: int) -> list[Solution]:
    """Return the different equilibria reached from the ``point`` by all methods, and from
    ``starts`` - 1 other configurations: alternately those found with a joint rotated by half a
    revolution, and others drawn at random. The one that the first leads to is first. Raises
    ``StartError`` if the joints do not let the model rotate with ``spin``.
    """
    axis_point(point, spin)
    rng, found = np.random.default_rng(0), list[Solution]()
    waiting, hinges = list[tuple[Point, Hinge]](), hinges_of(point)
    for number in range(starts):
        try:
            if number % 2 and waiting:
                solutions = _nearest_to(flipped(*waiting.pop(0)), spin)
            else:
                solutions = _reached(displaced(point, spin, rng) if number else point, spin)
            for solution in solutions:
                if not any(_is_same(solution, other) for other in found):
                    found.append(solution)
                    waiting += [(solution.place.point, hinge) for hinge in hinges]
        except StartError:
            continue
    return found


def _nearest_to(point: Point, spin: np.ndarray) -> Iterator[Solution]:
    """Yield the equilibrium nearest to a ``point``, if there is one."""
    try:
        solution = solve(point, spin, stable=False)
    except np.linalg.LinAlgError:
        return
    if solution.converged:
        yield solution


def _reached(point: Point, spin: np.ndarray) -> Iterator[Solution]:
    """Yield the equilibria that are reached from a ``point``, by one group of methods after the
    other until one finds an equilibrium, of a larger model a stable one.
    """
    for group in _methods(point, spin):
        enough = False
        for method in group:
            try:
                solution = method()
            except (StartError, np.linalg.LinAlgError):
                continue
            if solution.converged:
                enough |= coordinate_count(point) <= QUICK or is_stable(solution.place.point)
                yield solution
        if enough:
            return


def _methods(point: Point, spin: np.ndarray) -> list[list[Callable[[], Solution]]]:
    """The groups of methods by which a model is searched."""
    dense = [lambda: solve(point, spin, True), lambda: solve(point, spin, False)]
    if point.touching is not None:
        return [[lambda: _with_contacts(point, spin)]] if point.model.beams else [dense]
    sparse = [lambda: by_multipliers(point, spin)]
    last = [lambda: by_continuation(point, spin)]
    if point.model.beams:
        return [last, sparse]
    if is_large(point):
        return [sparse, last]
    return [sparse, dense, last] if coordinate_count(point) > QUICK else [dense, sparse, last]


def _with_contacts(point: Point, spin: np.ndarray) -> Solution:
    """Return the equilibrium of beams with contacts; raises ``StartError``."""

    def first(start: Point) -> Solution:
        try:
            return by_continuation(start, spin)
        except StartError:
            return by_multipliers(start, spin)

    return trials(point, first, lambda trial: by_multipliers(trial, spin))


def by_multipliers(point: Point, spin: np.ndarray) -> Solution:
    """Return where Newton's method on places and multipliers leads; raises ``StartError`` if it
    does not converge.
    """
    steady = Spin(spin, axis_point(point, spin))
    statics = Statics(point.system, point.state, steady)
    rest = newton(statics, point.state)
    if not rest.converged:
        raise StartError("Newton's method does not converge")
    return _ended(point, statics, rest, MULTIPLIERS)


def by_continuation(point: Point, spin: np.ndarray) -> Solution:
    """Return the equilibrium to which those under growing loads lead; raises ``StartError`` where
    they end.
    """
    steady, reduced = Spin(spin, axis_point(point, spin)), bool(point.model.beams)
    statics = Statics(point.system, point.state, steady, reduced and point.touching is None)
    rest = grown(statics, point.state)
    if not rest.converged:
        raise StartError("the loads cannot grow to their size")
    return _ended(point, statics, rest, CONTINUATION)


def _ended(point: Point, statics: Statics, rest: Rest, method: str) -> Solution:
    """The equilibrium in which Newton's method ended.

    Of beams the resultants are unknowns of their own: forces by their strains would have the
    round-off of positions times a large stiffness.
    """
    spin = statics.spin
    if not point.model.beams or point.state.auxiliary.size:
        return _closed(point, rest.state, spin, rest.iterations, method)
    state, now = with_rates(rest.state, spin), rest.balance
    state = state._replace(reaction=statics.reactions(state))
    where = int(np.argmax(np.abs(now.force)))
    worst = now.layout.coordinate[where]
    left = Equilibrium(
        axes=spin.rate,
        residual=float(abs(now.force[where])),
        relative=now.relative,
        coordinate=int(np.searchsorted(coordinate_numbers(point.system), worst)),
        constant=True,
        at_rest=not spin.rate.any(),
    )
    there = Where(replace(point, state=state), left)
    return Solution(there, rest.iterations, rest.converged, None, method)


def _closed(point: Point, state: State, spin: Spin, iterations: int, method: str) -> Solution:
    """The equilibrium at a ``state`` with its joints closed, of a small model improved to the last
    digits.
    """
    state = close(point.system, with_rates(state, spin), point.unknowns)
    there = complete(point.model, point.system, state, point.unknowns)
    there = replace(there, touching=point.touching)
    if coordinate_count(point) <= QUICK and point.touching is None:
        solution = solve(there, spin.rate, stable=False)
        return solution._replace(iterations=iterations + solution.iterations, method=method)
    found = coefficients(there.system, there.state)
    left = residual_in(found, spin.rate)
    converged = left.relative <= BALANCED and not found.state_rate.any()
    return Solution(Where(there, left), iterations, converged, None, method)


def displaced(point: Point, spin: np.ndarray, rng: np.random.Generator) -> Point:
    """A configuration that is reached by random motions of up to half a revolution."""
    if is_large(point):
        return _displaced_large(point, rng)
    centre = axis_point(point, spin)
    parts = int(rng.integers(2, 9))
    weight = None
    for _ in range(parts):
        place = evaluated(point, spin, centre)
        d = place.linear.degrees_of_freedom
        if weight is None or weight.size != d:
            weight = rng.normal(size=d)
        step = np.zeros(place.jacobian.shape[1])
        step[:d] = 1e6 * weight
        point = moved(place, limited(place, step))
    return point


def _displaced_large(point: Point, rng: np.random.Generator) -> Point:
    """Likewise of a model too large for dense matrices, by one random motion of its bodies that
    the joints leave.
    """
    system, frames = point.system, point.system.frames
    first = first_multiplier(frames)
    rows = np.zeros((node_count(system), 3))
    rows[:first] = rng.normal(size=(first, 3))
    for _ in range(int(rng.integers(2, 9))):
        step = solve_at_rest(system, point.state, rows, point.unknowns)
        step[frames.rotation] /= frames.length[:, None]
        largest = max(
            float(np.abs(step[frames.rotation]).max()),
            float(np.abs(step[frames.displacement]).max()) / size_of(point),
        )
        state = move(system, point.state, LARGEST_ROTATION / largest * step)
        point = replace(point, state=close(system, state, point.unknowns))
    return point


def _is_same(one: Solution, other: Solution) -> bool:
    """Return whether two equilibria are one configuration or, if they have directions without
    stiffness, of one family: with equal heights of all mass centres and distances between them.
    """
    a, b = one.place.point, other.place.point
    size = SAME * size_of(a)
    if one.flat != 0 or other.flat != 0:
        return bool(one.flat == other.flat and np.abs(_figures(a) - _figures(b)).max() <= size)
    lengths = a.system.frames.length[:-1]
    apart = float(np.abs(a.state.x - b.state.x).max(initial=0.0))
    for f in range(len(lengths)):
        angle = to_axis_angle(compose(at(a.state.p, f), opposite(at(b.state.p, f))))[1]
        apart = max(apart, float(lengths[f]) * angle)
    return apart <= size


def _figures(point: Point) -> np.ndarray:
    """Heights of mass centres along gravity, and distances between neighbours and from the first
    [m].
    """
    x, g = point.state.x[:-1], np.array(point.model.gravity)
    down = g / np.linalg.norm(g) if g.any() else np.zeros(3)
    parts = [x @ down, np.linalg.norm(x - x[:1], axis=1)]
    return np.concatenate([*parts, np.linalg.norm(np.diff(x, axis=0), axis=1)])
