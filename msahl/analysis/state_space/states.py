"""Which numbers are the states of a linearised model.

    coordinates    coordinates of joints and of bodies and their rates, chosen so that they describe
                   all motions: x' = A x + B w is then exact at any point of a motion
    nullspace      eta, zeta of ``reduced``: orthonormal by mass

Coordinates are taken in the order of the deck, those of joints before those of bodies. The next one
is the first of which at least ``ENOUGH`` of the most that any offers is not described by those
before.
"""

from typing import NamedTuple

import numpy as np

from msahl.analysis.linearised.variations import Variations
from msahl.analysis.state_space.columns import BODIES, BODY_COORDINATES, LEVELS, Column, Columns
from msahl.joints.coordinates import coordinates, is_angle
from msahl.model import Model
from msahl.run.tables import JOINTS

COORDINATES, NULLSPACE = CHOICES = ("coordinates", "nullspace")
ENOUGH = 0.1
WORTH = 0.01
"""Least part of the most that any coordinate offers, for which one of a joint is taken before those
of bodies."""
PARTS = 3
"""Largest parts of a state of the null space that are named."""


class States(NamedTuple):
    """Names and units of m states, and how they and their rates change in k columns."""

    names: list[str]
    units: list[str]
    value: np.ndarray  # (m,) at the configuration
    rate: np.ndarray  # (m,)
    slope: np.ndarray  # (m, k)
    rate_slope: np.ndarray  # (m, k)
    own: list[int]  # the m columns of the states
    inertial: tuple[str, ...] = ()  # names of coordinates of bodies, along inertial axes
    error: float = 0.0  # of the slopes, relative to the largest numbers of their tables


class Coordinate(NamedTuple):
    """A coordinate by name, with its rate and its acceleration."""

    name: str
    unit: str
    levels: tuple[Column, ...]


def candidates(model: Model, columns: Columns) -> tuple[list[Coordinate], list[Coordinate]]:
    """Return the coordinates of joints and those of bodies, in the order of the deck."""
    joints = [
        _coordinate(columns.table(JOINTS), f"{joint.name}.{c}", is_angle(c))
        for joint in model.joints
        for c in coordinates(joint)
        if c != "orientation"
    ]
    bodies = [
        _coordinate(columns.table(BODIES), f"{body.name}.{c}", c.startswith("r"))
        for body in model.bodies
        for c in BODY_COORDINATES
    ]
    return joints, bodies


def _coordinate(table: dict[str, Column], name: str, rotates: bool) -> Coordinate:
    levels = tuple(table[name + level] for level in LEVELS)
    return Coordinate(name, "rad" if rotates else "m", levels)


def by_coordinates(model: Model, columns: Columns, changes: Variations, length: float) -> States:
    """Return coordinates and rates as states; ``length`` [m] compares angles with displacements."""
    joints, bodies = candidates(model, columns)
    d, r = changes.degrees_of_freedom, changes.rate_degrees_of_freedom
    places = _chosen([joints, bodies], 0, slice(0, d), length)
    again = [places, joints, bodies]
    moving = places if d == r else _chosen(again, 1, slice(d, d + r), length)
    rows = [(c, 0) for c in places] + [(c, 1) for c in moving]
    found = _stacked(
        [c.name + LEVELS[level] for c, level in rows],
        [c.unit + ("/s" if level else "") for c, level in rows],
        [c.levels[level] for c, level in rows],
        [c.levels[level + 1] for c, level in rows],
        changes,
    )
    names = {c.name for c in (*places, *moving)}
    return found._replace(inertial=tuple(c.name for c in bodies if c.name in names))


def _stacked(
    names: list[str],
    units: list[str],
    values: list[Column],
    rates: list[Column],
    changes: Variations,
) -> States:
    k = changes.places.shape[1]
    return States(
        names,
        units,
        np.array([c.value for c in values]),
        np.array([c.value for c in rates]),
        np.array([c.slope for c in values]).reshape(len(values), k),
        np.array([c.slope for c in rates]).reshape(len(rates), k),
        list(range(len(names))),
        error=max((c.error for c in (*values, *rates)), default=0.0),
    )


def _chosen(
    groups: list[list[Coordinate]], level: int, part: slice, length: float
) -> list[Coordinate]:
    """Return as many coordinates as ``part`` has columns, whose values, or rates (``level`` 1),
    describe all of them.
    """
    wanted = part.stop - part.start
    every = [c for group in groups for c in group]
    number = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    rows = np.array([c.levels[level].slope[part] for c in every]).reshape(len(every), wanted)
    rows = rows * np.array([length if c.unit == "rad" else 1.0 for c in every])[:, None]
    found = list[Coordinate]()
    for _ in range(wanted):
        sizes = np.linalg.norm(rows, axis=1)
        most = [float(sizes[number == g].max(initial=0.0)) for g in range(len(groups))]
        group = next(g for g, size in enumerate(most) if size >= WORTH * max(most))
        next_one = int(np.argmax((number == group) & (sizes >= ENOUGH * most[group])))
        found.append(every[next_one])
        along = rows[next_one] / sizes[next_one]
        rows = rows - np.outer(rows @ along, along)
    return found


def by_null_space(
    model: Model, columns: Columns, changes: Variations, length: float, axes: np.ndarray
) -> States:
    """Return eta and zeta as states, seen in axes that rotate with the angular velocity ``axes``
    (3,) [rad/s]; names have the largest parts of what they move.
    """
    d, r = changes.degrees_of_freedom, changes.rate_degrees_of_freedom
    k = changes.places.shape[1]
    joints, bodies = candidates(model, columns)
    named = [*joints, *bodies]
    names = [f"eta{i + 1}: {_parts(named, 0, i, length)}" for i in range(d)]
    names += [f"zeta{i + 1}: {_parts(named, 1, d + i, length)}" for i in range(r)]
    m = d + r
    slope = np.eye(m, k)
    return States(
        names,
        ["m kg^(1/2)"] * d + ["m/s kg^(1/2)"] * r,
        np.zeros(m),
        np.zeros(m),
        slope,
        (changes.into @ changes.relative_rates(axes))[:m],
        list(range(m)),
    )


def _parts(named: list[Coordinate], level: int, column: int, length: float) -> str:
    """Return the largest parts of a state of the null space."""
    sizes = np.array([c.levels[level].slope[column] for c in named])
    sizes = sizes * np.array([length if c.unit == "rad" else 1.0 for c in named])
    largest = float(np.abs(sizes).max(initial=0.0)) or 1.0
    order = np.argsort(-np.abs(sizes), kind="stable")[:PARTS]
    return ", ".join(f"{named[k].name}{LEVELS[level]} {sizes[k] / largest:.2f}" for k in order)


def with_others(states: States, model: Model, changes: Variations, found: "Others") -> States:
    """Return the ``states`` with auxiliary ones and those of prescribed motions."""
    d, r = changes.degrees_of_freedom, changes.rate_degrees_of_freedom
    k, s, total = changes.places.shape[1], found.states.size, len(changes.states)
    names = [s.name for s in model.states][:s]
    moved = range(d + r + total, changes.inputs)
    columns = np.zeros((s, k))
    columns[np.arange(s), d + r + np.arange(s)] = 1.0
    motions = [f"{motion}.motion{level}" for level in LEVELS[:2] for motion in found.names]
    return States(
        [*states.names, *names, *motions],
        [*states.units, *["SI"] * s, *found.units, *(f"{unit}/s" for unit in found.units)],
        np.concatenate([states.value, found.states, found.laws[0], found.laws[1]]),
        np.concatenate([states.rate, found.state_rates, found.laws[1], found.laws[2]]),
        np.concatenate([states.slope, columns, changes.motion.u, changes.motion.u_dot]),
        np.concatenate(
            [states.rate_slope, changes.state_rates[:s], changes.motion.u_dot, found.driven]
        ),
        [*range(d + r + s), *moved],
        states.inertial,
        states.error,
    )


class Others(NamedTuple):
    """Auxiliary states, and p prescribed motions that are inputs."""

    states: np.ndarray  # (s,)
    state_rates: np.ndarray  # (s,)
    names: list[str]  # of the motions
    units: list[str]  # of their laws
    laws: np.ndarray  # (3, p) the laws and their derivatives
    driven: np.ndarray  # (p, k) u'' by the columns
