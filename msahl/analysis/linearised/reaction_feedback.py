"""How friction and expressions of reactions change with the motion: by the joints' reactions.

    dF = F_rho drho ,  ds' = s_rho drho ,  drho = rho_q dq + rho_lam dlam

rho  forces and moments (6 a joint) of those joints on which a friction or an expression depends

Without it derivatives are those at constant reactions. All are differences of order 8 but rho_lam:
reactions are linear in the multipliers.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from msahl.analysis.linearised.coefficients import Evaluated
from msahl.analysis.linearised.plain_units import equation_numbers
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.projection import move, prepared
from msahl.elements.signals.group import REACTION
from msahl.formulations.absolute.frames import first_multiplier
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, node_count

EIGHTH = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)
"""Weights of central differences of the order 8, by the number of steps."""
STEP = 3e-3
"""Of the differences: a rotation [rad], or a change of a reaction over the largest."""


class Feedback(NamedTuple):
    """Derivatives by r components of reactions, and of these; n coordinates, c equations."""

    force: np.ndarray  # (n, r) F_rho
    state_rate: np.ndarray  # (s, r) s_rho
    shown: np.ndarray  # (k, r) of the published values of signals
    by_column: np.ndarray  # (r, columns) rho_q dq
    by_multiplier: np.ndarray  # (r, c) rho_lam


def joints_used(system: System) -> np.ndarray:
    """Return the numbers of the joints whose reactions a friction or an expression depends on."""
    along = system.forces.along.joint
    used = along[along >= 0].tolist()
    group = system.forces.signals
    if group is not None:
        used += group.item[group.kind == REACTION].tolist()
    return np.unique(np.array(used, dtype=int))


def feedback(point: Point, found: Evaluated, places: np.ndarray) -> Feedback | None:
    """Return the derivatives at a ``point`` for columns of displacements ``places`` (n, columns);
    None if nothing depends on reactions.
    """
    joints = joints_used(point.system)
    if not joints.size:
        return None
    values = _by_reactions(point, found, joints)
    n, s = found.coordinate.size, point.state.auxiliary.size
    return Feedback(
        force=values[:n],
        state_rate=values[n : n + s],
        shown=values[n + s :],
        by_column=_by_places(point, found, places, joints),
        by_multiplier=_by_multipliers(point, joints),
    )


def _difference(value: Callable[[float], np.ndarray], step: float) -> np.ndarray:
    """The derivative of a function of one variable at 0."""
    parts = [
        weight * (value(k * step) - value(-k * step)) / step for k, weight in enumerate(EIGHTH, 1)
    ]
    return np.asarray(sum(parts))


def _by_reactions(point: Point, found: Evaluated, joints: np.ndarray) -> np.ndarray:
    """(n + s + k, r) derivatives of forces, rates of auxiliary states and published values."""
    system, state = point.system, point.state
    size = max(float(np.abs(state.reaction).max(initial=0.0)), 1e-6)
    columns = []
    for j in joints.tolist():
        for component in range(6):

            def value(share: float, at: tuple[int, int] = (j, component)) -> np.ndarray:
                reaction = state.reaction.copy()
                reaction[at] += share
                return _values(system, found, state._replace(reaction=reaction))

            columns.append(_difference(value, STEP * size))
    return np.array(columns).T


def _values(system: System, found: Evaluated, state: State) -> np.ndarray:
    """(n + s + k,) forces and moments, rates of auxiliary states and published values."""
    start, rows = _evaluated(system, state)
    force = (rows.reshape(-1) * found.force_scale)[found.coordinate]
    group = system.forces.signals
    if group is None:
        return np.asarray(force)
    value = start.forces.signals.values.value
    return np.concatenate([force, value[group.rate], value[group.shown]])


def _evaluated(system: System, state: State) -> tuple[SystemWorkspace, np.ndarray]:
    """The workspace, and the right-hand side of the index-1 problem."""
    start = prepared(system, state)
    Z, rows = np.zeros((2, node_count(system), 3))
    evaluate.free_acceleration(system, state, start, Z, rows)
    return start, rows


def _by_places(
    point: Point, found: Evaluated, places: np.ndarray, joints: np.ndarray
) -> np.ndarray:
    """(r, columns) rho_q dq at constant multipliers."""
    system, state = point.system, point.state
    Z = np.zeros((node_count(system), 3))
    rotational = system.frames.rotates[found.coordinate // 3].astype(bool)
    lengths = np.where(rotational, 1.0, 1.0 / float(system.frames.length.max()))
    by_column = np.zeros((6 * joints.size, places.shape[1]))
    for k, column in enumerate(places.T):
        size = float(np.abs(lengths * column).max(initial=0.0))

        def value(share: float, along: np.ndarray = column) -> np.ndarray:
            dq = np.zeros((node_count(system), 3))
            dq.reshape(-1)[found.coordinate] = share * along
            moved = move(system, state, dq)._replace(reaction=state.reaction.copy())
            start, _ = _evaluated(system, moved)
            evaluate.set_reactions(system, moved, start, Z)
            return moved.reaction[joints].reshape(-1)

        if size > 0.0:
            by_column[:, k] = _difference(value, STEP / size)
    return by_column


def _by_multipliers(point: Point, joints: np.ndarray) -> np.ndarray:
    """(r, c) rho_lam."""
    system, Z = point.system, np.zeros((node_count(point.system), 3))
    start, _ = _evaluated(system, point.state)
    places = equation_numbers(system) - 3 * first_multiplier(system.frames)
    by_multiplier = np.zeros((6 * joints.size, places.size))
    for c, place in enumerate(places.tolist()):
        force = np.zeros_like(point.state.force)
        force.reshape(-1)[place] = 1.0
        changed = point.state._replace(force=force, reaction=np.zeros_like(point.state.reaction))
        evaluate.set_reactions(system, changed, start, Z)
        by_multiplier[:, c] = changed.reaction[joints].reshape(-1)
    return by_multiplier
