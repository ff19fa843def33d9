"""Places and velocities of bodies that follow from the coordinates of their joints.

Joints that carry a body from one whose place is known form a tree; each of the other joints closes
a loop. Coordinates of the tree that are not given are changed by the Gauss-Newton method until the
loops are closed:

    dq = -J^+ g ,    g(q) equations of the joints that close loops,  J = dg/dq

with the pseudoinverse, so redundant equations and free coordinates do no harm. Given coordinates
and given bodies stay exactly as they are. Velocities follow in the same way from rates, in one
linear step.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, from_increment, inverse
from msahl.algebra.rotation_arrays import parameters, rotations
from msahl.algebra.vector import Vector
from msahl.elements.constraints.coordinate_kinds import RADIUS, ROUND, SKEW
from msahl.elements.constraints.products import DOT
from msahl.joints import coordinates
from msahl.joints.coordinates import ORIENTATION, Motion
from msahl.joints.joint import CHILD, PARENT, Coincide, Coordinate, Equation
from msahl.joints.registry import KINDS
from msahl.joints.tree import Branch, JointStart
from msahl.model.joints import Joint

MAX_ITERATIONS = 60
MOST_TRIALS = 12
LARGEST_STEP = 0.6
"""Largest change of an angle [rad], or of a slide by the size of the model, in an iteration."""
INDEPENDENT = 1e-9
"""Singular value, relative to the largest, below which an equation counts as redundant."""
INFLUENCE = 1e-14
"""Velocities by unit rates [m/s, rad/s] up to this are round-off, in models of a hundred metres."""
CLOSED = 1e-10
"""Constraint violation, relative to the size of the model, that counts as closed. Iterations go on
until round-off ends them."""
COMPLEX_STEP = 1e-30
"""Share of a velocity that is added as imaginary part: derivatives without differences."""


class Place(NamedTuple):
    """Point B of a body [m] and its axes, body to inertial."""

    x: np.ndarray  # (3,) or (c, 3)
    R: np.ndarray  # (3, 3) or (c, 3, 3)


class Rates(NamedTuple):
    """Velocities of a body at unit rates of c coordinates, inertial axes."""

    v: np.ndarray  # (c, 3) of point B
    w: np.ndarray  # (c, 3)


ColumnRates = dict[tuple[int, int], np.ndarray]
"""Rates (c,) by branch and number of the column of rates."""


class Relation(NamedTuple):
    """An equation between rates: sum of coefficients times rates of joints' coordinates = value."""

    terms: tuple[tuple[Joint, str, float], ...]  # joint, column of rates, coefficient
    value: float = 0.0


class Linkage:
    """Bodies that the joints of a tree place, or have placed: ``places`` of all bodies by name, of
    which those of the tree's roots are kept; ``length`` [m] is the size of the model."""

    def __init__(
        self,
        places: dict[str, Place],
        branches: Sequence[Branch],
        loops: Sequence[JointStart],
        length: float,
    ) -> None:
        self.places, self.branches, self.loops, self.length = places, branches, loops, length
        self.values = [{**b.start.guesses, **b.start.values} for b in branches]
        self.P = [b.start.P for b in branches]

    def place(self) -> None:
        """Place every body by the present coordinates of the tree."""
        for k, branch in enumerate(self.branches):
            joint = branch.start.joint
            D, R = coordinates.pose(joint, self.values[k], self.P[k])
            arm, s_b = np.array(joint.parent_point) + D, np.array(joint.child_point)
            if branch.forward:
                x_a, R_a = self.places[joint.parent]
                R_b = R_a @ R
                self.places[joint.child] = Place(x_a + R_a @ arm - R_b @ s_b, R_b)
            else:
                x_b, R_b = self.places[joint.child]
                R_a = R_b @ R.T
                self.places[joint.parent] = Place(x_b + R_b @ s_b - R_a @ arm, R_a)

    def columns(self) -> list[tuple[int, int]]:
        """Return branch and number of the column of rates of every coordinate of the tree."""
        return [
            (k, column)
            for k, branch in enumerate(self.branches)
            for column in range(len(coordinates.columns(branch.start.joint, 1)))
        ]

    def name(self, column: tuple[int, int]) -> str:
        """Return the name of a column of rates."""
        k, number = column
        return coordinates.columns(self.branches[k].start.joint, 1)[number]

    def _is_given(self, column: tuple[int, int]) -> bool:
        """Return whether the coordinate of a column of rates is given."""
        k, number = column
        start, is_spatial = self.branches[k].start, self.name(column) in coordinates.SPATIAL[1]
        name = ORIENTATION if is_spatial else coordinates.columns(start.joint, 0)[number]
        return name in start.values

    def velocities(self, rates: "ColumnRates", fixed: dict[str, Rates], count: int) -> "Field":
        """Return the velocities of all bodies by the ``rates`` (count,) of columns of the tree, and
        those ``fixed`` of its roots."""
        field = Field(dict(fixed), count)
        of_branch: dict[int, list[tuple[int, np.ndarray]]] = {}
        for (k, column), rate in rates.items():
            of_branch.setdefault(k, []).append((column, rate))
        for k, branch in enumerate(self.branches):
            joint = branch.start.joint
            R_a = self.places[joint.parent].R
            x_b, R_b = self.places[joint.child]
            point = x_b + R_b @ np.array(joint.child_point)
            v, w = np.zeros((2, count, 3))
            units = coordinates.directions(joint, R_a.T @ R_b) if k in of_branch else []
            for column, rate in of_branch.get(k, ()):
                v = v + rate[:, None] * (R_a @ units[column][0])
                w = w + rate[:, None] * (R_a @ units[column][1])
            known, other, sign = joint.parent, joint.child, 1.0
            if not branch.forward:
                known, other, sign = other, known, -1.0
            v0, w0 = field.of(known)
            w1 = w0 + sign * w
            # At the child's point: the material point of the parent there, and what slides by it.
            at_point = v0 + np.cross(w0, point - self.places[known].x) + sign * v
            field.rates[other] = Rates(at_point - np.cross(w1, point - self.places[other].x), w1)
        return field

    def unit_velocities(self, chosen: Sequence[tuple[int, int]]) -> "Field":
        """Return the velocities at a unit rate of each of the ``chosen`` columns."""
        count = len(chosen)
        return self.velocities(dict(zip(chosen, np.eye(count), strict=True)), {}, count)

    def equations(self, field: "Field | None" = None) -> tuple[np.ndarray, np.ndarray, list[int]]:
        """Return the loops' violations (g,) [m], their rates (c, g) in the velocities ``field``,
        and the loop that each belongs to; radians count by ``length``."""
        g, G, owner = [], [], []
        field = field or Field({}, 0)
        for index, start in enumerate(self.loops):
            for value, rate in self._of_loop(start, field):
                g.append(value)
                G.append(rate)
                owner.append(index)
        return np.array(g), np.array(G).reshape(len(g), field.count).T, owner

    def _of_loop(self, start: JointStart, field: "Field") -> list[tuple[float, np.ndarray]]:
        """Return violation and rates of every equation of a joint that closes a loop."""
        joint = start.joint
        found: list[tuple[float, np.ndarray]] = []
        here, there = self.places[joint.parent], self.places[joint.child]
        moved = _moved(here, field.of(joint.parent)), _moved(there, field.of(joint.child))
        for equation in KINDS[joint.kind].equations(joint):
            values = _violations(joint, equation, here, there, self.length)
            rates = _violations(joint, equation, *moved, self.length)
            for value, rate in zip(values, rates, strict=True):
                found.append((float(value.real), np.asarray(rate.imag / COMPLEX_STEP)))
        if start.values:
            found += self._of_given(start, field)
        return found

    def _of_given(self, start: JointStart, field: "Field") -> list[tuple[float, np.ndarray]]:
        """Return the differences from given coordinates of a joint that closes a loop."""
        joint, names = start.joint, coordinates.columns(start.joint, 0)
        values, rates = coordinates.values_and_rates(joint, self.relative(joint, field))
        found: list[tuple[int, float, float]] = []  # column, difference, length by which it counts
        for name, given in start.values.items():
            if name == ORIENTATION:
                first = names.index(coordinates.SPATIAL[0][0])
                x, y, z = values[0, first : first + 3].tolist()
                apart = compose(inverse(start.P), (x, y, z))  # in the child's axes
                found += [(first + i, apart[i], self.length) for i in range(3)]
            elif coordinates.is_angle(name):
                apart_1 = math.remainder(values[0, names.index(name)] - given, 2.0 * math.pi)
                found.append((names.index(name), apart_1, self.length))
            else:
                found.append((names.index(name), values[0, names.index(name)] - given, 1.0))
        none = np.zeros(0)
        return [(c * d, c * rates[:, k] if field.count else none) for k, d, c in found]

    def relative(self, joint: Joint, field: "Field") -> coordinates.Relative:
        """Return the relative motion of a joint's bodies, one row for each velocity of ``field``;
        one row at rest if there is none."""
        m = max(1, field.count)

        def motion(name: str) -> Motion:
            x, R = self.places[name]
            v, w = field.of(name) if field.count else Rates(*np.zeros((2, 1, 3)))
            return Motion(
                np.broadcast_to(x, (m, 3)), np.broadcast_to(R, (m, 3, 3)), v + 0.0, w + 0.0
            )

        return coordinates.relative(joint, motion(joint.parent), motion(joint.child))

    def close(self) -> tuple[float, JointStart | None]:
        """Change the coordinates that are not given until the loops are closed; return the largest
        violation left [m] and, unless it is round-off, the joint that has it."""
        self.place()
        chosen = [column for column in self.columns() if not self._is_given(column)]
        g, _, _ = self.equations()
        for _ in range(MAX_ITERATIONS):
            if not g.size or not chosen or np.abs(g).max() == 0.0:
                break
            _, G, _ = self.equations(self.unit_velocities(chosen))
            if not (np.isfinite(g).all() and np.isfinite(G).all()):
                break
            scale = np.array([self._unit(column) for column in chosen])
            step = np.linalg.lstsq((G * scale[:, None]).T, -g, rcond=INDEPENDENT)[0]
            step *= min(1.0, LARGEST_STEP / max(np.abs(step).max(), 1e-300))
            before = self.values, self.P, g
            for _ in range(MOST_TRIALS):
                self._change(chosen, scale * step)
                g, _, _ = self.equations()
                if np.linalg.norm(g) < np.linalg.norm(before[2]):
                    break
                self.values, self.P, g = before
                step = 0.5 * step
            else:
                self.place()
                break
        g, _, owner = self.equations()
        # Written so that a nan is a violation.
        if not g.size or bool(np.abs(g).max() <= CLOSED * self.length):
            return float(np.abs(g).max(initial=0.0)), None
        worst = int(np.argmax(np.abs(g)))
        return float(np.abs(g[worst])), self.loops[owner[worst]]

    def _unit(self, column: tuple[int, int]) -> float:
        """Return the size of a unit step: 1 rad, or the size of the model."""
        return self.length if self.name(column).startswith("slide") else 1.0

    def _change(self, chosen: Sequence[tuple[int, int]], change: np.ndarray) -> None:
        """Change the coordinates of the ``chosen`` columns, and place the bodies."""
        self.values, self.P = [dict(values) for values in self.values], list(self.P)
        increments: dict[int, list[float]] = {}
        for (k, number), amount in zip(chosen, change.tolist(), strict=True):
            joint = self.branches[k].start.joint
            names = coordinates.columns(joint, 1)
            if names[number] in coordinates.SPATIAL[1]:
                increments.setdefault(k, []).append(amount)
            else:
                name = coordinates.columns(joint, 0)[number]
                self.values[k][name] = self.values[k].get(name, 0.0) + amount
        for k, (x, y, z) in increments.items():
            self.P[k] = compose(self.P[k], from_increment((x, y, z)))
        self.place()

    def solve_rates(
        self, chosen: Sequence[tuple[int, int]], known: "Field", relations: Sequence[Relation]
    ) -> tuple[np.ndarray, float, str]:
        """Return the rates of the ``chosen`` columns that, added to the velocities ``known``, keep
        the loops closed and satisfy the ``relations``; the largest violation rate left [m/s], and
        the name of its joint."""
        field = self.unit_velocities(chosen)
        _, given, owner = self.equations(known)
        _, G, _ = self.equations(field)
        aims = np.array([relation.value for relation in relations])
        given = np.append(given[0], self._relations(relations, known)[0] - aims)
        G = np.concatenate([G, self._relations(relations, field)], axis=1).T
        if not given.size:
            return np.zeros(len(chosen)), 0.0, ""
        rates = np.zeros(len(chosen))
        # What is round-off alone determines no rate: all that matter are given.
        matters = np.abs(G).max(initial=0.0) > INFLUENCE
        if matters and np.isfinite(G).all() and np.isfinite(given).all():
            rates = np.linalg.lstsq(G, -given, rcond=INDEPENDENT)[0]
        left = np.abs(G @ rates + given)
        worst = int(np.argmax(left))
        names = [self.loops[index].joint.name for index in owner]
        names += [relation.terms[0][0].name for relation in relations]
        return rates, float(left[worst]), names[worst]

    def _relations(self, relations: Sequence[Relation], field: "Field") -> np.ndarray:
        """(c, k) left-hand sides of relations between rates."""
        found = np.zeros((field.count, len(relations)))
        for r, relation in enumerate(relations):
            for joint, column, coefficient in relation.terms:
                _, rates = coordinates.values_and_rates(joint, self.relative(joint, field))
                number = coordinates.columns(joint, 1).index(column)
                found[:, r] += coefficient * rates[:, number]
        return found


class Field:
    """Velocities of bodies by name, c at once; bodies that are not named are at rest."""

    def __init__(self, rates: dict[str, Rates], count: int) -> None:
        self.rates, self.count = rates, count

    def of(self, name: str) -> Rates:
        """Return the velocities of a body."""
        return self.rates.get(name) or Rates(*np.zeros((2, self.count, 3)))


def _moved(place: Place, rates: Rates) -> Place:
    """Return a place moved by an imaginary multiple of its velocities."""
    spin = np.cross(rates.w[:, None, :], np.swapaxes(place.R, -1, -2)[None])
    return Place(
        place.x + 1j * COMPLEX_STEP * rates.v,
        place.R + 1j * COMPLEX_STEP * np.swapaxes(spin, -1, -2),
    )


def _violations(
    joint: Joint, equation: Equation | Coincide, here: Place, there: Place, length: float
) -> list[np.ndarray]:
    """Return the violations of an equation [m] at places, which may be complex; [] if it has no
    value of its own."""
    D = there.x + there.R @ np.array(joint.child_point)
    D = D - here.x - here.R @ np.array(joint.parent_point)
    if isinstance(equation, Coincide):
        return [D[..., i] for i in range(3)]
    if equation.rate or equation.value is None or equation.second is not None:
        return []
    value = _value(equation.first, D, here, there) - equation.value
    return [value * length if equation.first.angular else value]


def _value(coordinate: Coordinate, D: np.ndarray, here: Place, there: Place) -> np.ndarray:
    """Return a coordinate of an equation, by ``elements.constraints.coordinate_kinds``."""
    axes = {PARENT: here.R, CHILD: there.R}
    m = []
    for product in coordinate.products:
        n = np.array(product.n)
        n = axes[product.owner] @ n if product.owner in axes else n
        e = there.R @ np.array(product.e) if product.kind == DOT else D
        m.append((n * e).sum(axis=-1))
    if coordinate.kind == RADIUS:
        return np.asarray(np.sqrt(sum(part * part for part in m)))
    if coordinate.kind == ROUND:
        return np.asarray(m[0] - coordinate.radius * np.sqrt(1.0 - m[1] * m[1]))
    if coordinate.kind == SKEW:
        x, y, z, a, b, s = m
        square = x * x + y * y + z * z - coordinate.radius**2
        total = square * (1.0 - s * s) - a * a - b * b + 2.0 * s * a * b
        return np.asarray(total / (2.0 * coordinate.radius))
    return np.asarray(m[0])


def place_of(position: Vector, P: Vector) -> Place:
    """Return the place of a body by its position [m] and Wiener-Milenkovic parameters."""
    return Place(np.array(position), rotations(np.array(P)))


def orientation_of(place: Place) -> Vector:
    """Return the Wiener-Milenkovic parameters of a place."""
    x, y, z = parameters(place.R).tolist()
    return (x, y, z)
