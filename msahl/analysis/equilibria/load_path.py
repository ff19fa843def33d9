"""Follows equilibria at rest while the loads grow, also through points where they must fall.

Gravity and the concentrated loads of the deck are multiplied by the load factor mu; preloads,
springs, actuators and prescribed motions are not. With z = (q, lam) of ``static_newton``

    F(z, mu) = F_0(z) + mu p(z) = 0             p  gravity and loads as the deck has them
    t . (q - q_p) / L + t_mu (mu - mu_p) = 0    L  size of the model

where t is the tangent of the path at the last point and (q_p, mu_p) lies on it, an arc length
away. So a load need not grow for the path to go on: it is followed through snap-through.

Along the path, directions gain or lose their stiffness: the matrix

    Z^T (-K + E^T C^-1 E) Z         E of elastic strains, Z of motions that violate no constraint

has a negative eigenvalue for each direction in which the equilibrium is unstable. Where their
number changes, the load factor has an extremum (a limit point) or the path has branches (a
bifurcation). Such points are refined until the eigenvalue is zero. Where forces follow bodies, K is
not symmetric and directions are not counted.

Source: E. Riks, An incremental approach to the solution of snapping and buckling problems, Int. J.
Solids Struct. 15 (1979); M. A. Crisfield, A fast incremental/iterative solution procedure that
handles "snap-through", Comput. Struct. 13 (1981).
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import scale
from msahl.analysis.equilibria.static_equations import Balance, Statics
from msahl.analysis.equilibria.static_matrix import (
    Factors,
    directions,
    factorise,
    solve,
    symmetric_eigenvalues,
)
from msahl.analysis.equilibria.static_newton import Rest, Search, newton, shortened, stepped
from msahl.analysis.linearised.point import Point
from msahl.model import ConcentratedLoad, Model
from msahl.start.velocities import StartError
from msahl.system.arrays import State

LONGEST = 0.2
"""Arc length of a step: displacement over the size of the model, and change of the load factor."""
SHORTEST = 1e-6
USUAL = 5
"""Iterations after which the next step is as long as the last one."""
FARTHEST = 1e6
"""Displacement by the loads, over the size of the model, that nothing resists."""
MOST_POINTS = 2000
MOST_CORRECTIONS = 12
LARGEST_INCREMENT = 0.5
"""Rotation of a body [rad], or displacement over the size of the model, by which the loads grow in
one iteration."""
MOST_WHILE_GROWING = 30
"""Iterations after which the loads grow by steps that are equilibria."""
MOST_IN_A_STEP = 15
"""Iterations of Newton's method after which a load step is made smaller."""
SMALLEST_LOAD_STEP = 1.0 / 512.0
SMALLER = 0.8
"""Ratio of the growths of the loads that are tried."""
LARGEST_EIGENPROBLEM = 1600
"""Unknowns up to which the directions without stiffness are counted."""
SOFT = 1e-9
"""Least stiffness of the unloaded model over the largest one below which resultants of strains are
kept as unknowns where directions are counted: their elimination would leave round-off."""
REFINED = 1e-10
"""Arc length to which limit points and bifurcations are found."""
SAME = 1e-8
"""Arc length between two of them that are one: round-off of stiffnesses moves them apart."""


class PathPoint(NamedTuple):
    """An equilibrium under the loads times ``factor``."""

    factor: float
    state: State
    residual: float  # over the largest force
    iterations: int
    stiffness: np.ndarray | None  # eigenvalues beyond c of the matrix; None if not counted
    kind: str = ""  # "limit point" or "bifurcation"

    @property
    def unstable(self) -> int | None:
        """Number of directions in which it is not stable; None if they are not counted."""
        return None if self.stiffness is None else int(np.count_nonzero(self.stiffness < 0.0))


def scaled_loads(model: Model, factor: float) -> Model:
    """Return the ``model`` with gravity and concentrated loads times ``factor``."""
    g = model.gravity
    loads = [
        replace(load, force=scale(factor, load.force), moment=scale(factor, load.moment))
        if isinstance(load, ConcentratedLoad)
        else load
        for load in model.loads
    ]
    return replace(model, gravity=scale(factor, g), loads=tuple(loads))


def grown(statics: Statics, state: State) -> Rest:
    """Return the equilibrium under all loads to which growing loads lead from a ``state``, whose
    multipliers do not count. It is reached if ``converged`` is true.

    Loads grow in every iteration, as far as that rotates and displaces no body much, without
    waiting for an equilibrium. Where this does not converge, they grow from one equilibrium to the
    next, by steps as large as Newton's method allows.
    """
    unloaded = state._replace(force=np.zeros_like(state.force))
    rest = _growing(statics, unloaded)
    if rest.converged:
        return rest
    state, reached, step, iterations = unloaded, 0.0, 0.5, rest.iterations
    while True:
        factor = min(1.0, reached + step)
        rest = newton(statics, state, factor, MOST_IN_A_STEP)
        iterations += rest.iterations
        if not rest.converged:
            step *= 0.5
            if step < SMALLEST_LOAD_STEP:
                return rest._replace(iterations=iterations)
            continue
        if factor == 1.0:
            return rest._replace(iterations=iterations)
        state, reached, step = rest.state, factor, 2.0 * step


def _growing(statics: Statics, state: State) -> Rest:
    """Return where Newton's method leads from an unloaded ``state`` while the loads grow."""
    factor, now, search, iterations = 0.0, statics.balance(state, 0.0), Search(), 0
    while iterations < MOST_WHILE_GROWING:
        factors = factorise(now)
        step, multipliers = solve(factors, -now.force, -now.violation)
        if factor < 1.0:
            loads = statics.loads(state)
            by_load = solve(factors, -loads, np.zeros(now.violation.size))
            grown = _largest_growth(now, step, by_load[0], 1.0 - factor)
            step, multipliers = step + grown * by_load[0], multipliers + grown * by_load[1]
            factor = 1.0 if grown == 1.0 - factor else factor + grown
        if not np.isfinite(step).all():
            break
        share = shortened(now, step, LARGEST_INCREMENT)
        state = stepped(statics.system, state, now, share * step, share * multipliers)
        now, iterations = statics.balance(state, factor), iterations + 1
        if factor == 1.0 and search.ends(state, now, step):
            break
    return search.result(state, now)._replace(iterations=iterations)


def _largest_growth(now: Balance, step: np.ndarray, by_load: np.ndarray, most: float) -> float:
    """Return the growth of the loads, up to ``most``, of which and the ``step`` (n,) the motion is
    small; ``by_load`` (n,) is the motion by all loads.
    """
    grown = most
    while shortened(now, step + grown * by_load, LARGEST_INCREMENT) < 1.0:
        grown *= SMALLER
        if grown < SMALLEST_LOAD_STEP:
            return min(SMALLEST_LOAD_STEP, most)
    return grown


class Tangent(NamedTuple):
    """Direction of the path, by its arc length."""

    step: np.ndarray  # (n,) displacements, rotations times lengths [m]
    multipliers: np.ndarray  # (c,)
    factor: float
    weight: float  # of squared displacements [1/m^2]

    def along(self, step: np.ndarray, factor: float) -> float:
        """Arc length of a change."""
        return float(self.weight * (self.step @ step) + self.factor * factor)


class Path:
    """The path of equilibria of a model, from the unloaded one on."""

    def __init__(self, point: Point) -> None:
        """Raises ``StartError`` for a model with contacts."""
        if point.touching is not None:
            raise StartError(
                "the model has rigid contacts, which may open and close along the path; look for "
                "its equilibrium without --load-path, or give contacts a <stiffness>"
            )
        self.statics = Statics(point.system, point.state)
        # Whether stiffnesses spread too far for resultants to be eliminated.
        self._is_spread: bool | None = None
        unloaded = point.state._replace(force=np.zeros_like(point.state.force))
        self.last = self._at_factor(unloaded, 0.0)

    def to(self, end: float, wanted: Sequence[float] = ()) -> Iterator[PathPoint]:
        """Yield the equilibria up to the load factor ``end``, also those at the factors ``wanted``.

        Raises ``StartError`` where the path cannot be followed.
        """
        here, forward, length = self.last, float(np.sign(end - self.last.factor)), LONGEST / 4.0
        yield here
        tangent = self._tangent(here, None, forward) if forward else None
        for _ in range(MOST_POINTS):
            if tangent is None:
                return
            after, length = self._next(here, tangent, length)
            following = self._tangent(after, tangent, forward)
            if None not in (here.unstable, after.unstable) and here.unstable != after.unstable:
                yield from self._critical(here, after, length, (tangent, following))
            for factor in _between(here.factor, after.factor, (*wanted, end)):
                self.last = self._at_factor(after.state, factor)
                yield self.last
                if factor == end:
                    return
            yield after
            here, self.last, tangent = after, after, following
            length = min(LONGEST, length * min(2.0, max(0.5, USUAL / max(after.iterations, 1))))
        raise StartError(f"the load factor {end:.9g} is not reached in {MOST_POINTS} steps")

    def _next(self, here: PathPoint, tangent: Tangent, length: float) -> tuple[PathPoint, float]:
        """The next equilibrium, at the arc ``length`` or a shorter one, and this length."""
        while length >= SHORTEST:
            after = self._corrected(here, tangent, length)
            if after is not None:
                return after, length
            length *= 0.25
        raise StartError(
            f"the equilibria cannot be followed beyond the load factor {here.factor:.9g}"
        )

    def _at_factor(self, state: State, factor: float) -> PathPoint:
        """The equilibrium at a load ``factor`` nearest to a ``state``."""
        rest = newton(self.statics, state, factor)
        if not rest.converged:
            raise StartError(f"no equilibrium was found at the load factor {factor:.9g}")
        return self._point(factor, rest)

    def _point(self, factor: float, rest: Rest) -> PathPoint:
        """The equilibrium at a load ``factor``, with the directions in which it is unstable."""
        now, stiffness = rest.balance, None
        if now.force.size + now.violation.size <= LARGEST_EIGENPROBLEM:
            stiffness = directions(now, self.statics.system)
            if self._is_spread is None:
                self._is_spread = stiffness is not None and bool((stiffness[:1] < SOFT).all())
            if stiffness is not None and self._is_spread:
                stiffness = symmetric_eigenvalues(now)[now.violation.size :]
        return PathPoint(factor, rest.state, now.relative, rest.iterations, stiffness)

    def _tangent(self, here: PathPoint, before: Tangent | None, forward: float) -> Tangent:
        """The direction in which the path goes on; at the first point ``forward``."""
        loads = self.statics.loads(here.state)
        now = self.statics.balance(here.state, here.factor)
        step, multipliers = solve(factorise(now), -loads, np.zeros(now.violation.size))
        weight = 6.0 / (step.size * now.size**2)
        if not np.abs(step).max(initial=0.0) <= FARTHEST * now.size:
            raise StartError(
                f"at the load factor {here.factor:.9g} the loads act in a direction in which "
                "nothing resists them"
            )
        onwards = forward if before is None else np.sign(before.along(step, 1.0))
        scale = float(onwards) / float(np.sqrt(weight * (step @ step) + 1.0))
        return Tangent(scale * step, scale * multipliers, scale, weight)

    def _corrected(self, here: PathPoint, tangent: Tangent, length: float) -> PathPoint | None:
        """The equilibrium an arc ``length`` further on; None if the iteration does not find it."""
        statics, factor, search = self.statics, here.factor, Search()
        step, multipliers = length * tangent.step, length * tangent.multipliers
        change, now = length * tangent.factor, statics.balance(here.state, factor)
        state, best = here.state, factor
        for _ in range(MOST_CORRECTIONS):
            if not np.isfinite(step).all():
                return None
            state = stepped(statics.system, state, now, step, multipliers)
            factor += change
            now = statics.balance(state, factor)
            ended = search.ends(state, now, step)
            best = factor if search.state is state else best
            if ended:
                break
            loads = statics.loads(state)
            step, multipliers, change = _correction(factorise(now), now, loads, tangent)
            if shortened(now, step) < 1.0:
                return None
        if not search.converged:
            return None
        return self._point(best, search.result(state, now))

    def _critical(
        self, here: PathPoint, after: PathPoint, reach: float, tangents: tuple[Tangent, Tangent]
    ) -> list[PathPoint]:
        """The limit points and bifurcations between two points of the path, an arc length ``reach``
        apart, with their ``tangents``: where an eigenvalue that changes its sign is zero. Those of
        several directions at one load are one point.
        """
        from scipy.optimize import brentq

        found = dict[float, PathPoint]()

        def stiffness(length: float, index: int) -> float:
            if length not in found:
                found[length] = (
                    self._corrected(here, tangents[0], length) if length else here
                ) or here
            values = found[length].stiffness
            assert values is not None
            return float(values[index])

        changed = range(*sorted((here.unstable or 0, after.unstable or 0)))
        lengths = sorted(brentq(stiffness, 0.0, reach, (i,), xtol=REFINED) for i in changed)
        for length in lengths:
            stiffness(length, changed[0])
        kind = "limit point" if tangents[0].factor * tangents[1].factor < 0.0 else "bifurcation"
        apart = [0, *(k for k in range(1, len(lengths)) if lengths[k] - lengths[k - 1] > SAME)]
        return [found[lengths[k]]._replace(kind=kind) for k in apart]


def _correction(
    factors: Factors, now: Balance, loads: np.ndarray, tangent: Tangent
) -> tuple[np.ndarray, np.ndarray, float]:
    """Newton's step at right angles to the ``tangent``: displacements (n,), multipliers (c,) and
    the change of the load factor.
    """
    step, own_multipliers = solve(factors, -now.force, -now.violation)
    by_load, by_load_multipliers = solve(factors, -loads, np.zeros(now.violation.size))
    change = -tangent.along(step, 0.0) / tangent.along(by_load, 1.0)
    return step + change * by_load, own_multipliers + change * by_load_multipliers, change


def _between(first: float, last: float, wanted: Sequence[float]) -> list[float]:
    """The ``wanted`` load factors beyond ``first`` and up to ``last``, in the order of the path."""
    low, high = min(first, last), max(first, last)
    inside = {factor for factor in wanted if low <= factor <= high and factor != first}
    return sorted(inside, reverse=last < first)
