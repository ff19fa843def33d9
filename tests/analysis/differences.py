"""Derivatives of a model's rates and columns by differences of its nonlinear equations.

A state beside the point satisfies all constraints, and its accelerations and multipliers are solved
for, as a run does; the columns of tables there are those of a run. Differences are of order 4.
"""

import numpy as np

from msahl.algebra.rotation import compose, matrix, to_axis_angle
from msahl.algebra.rotation import inverse as opposite
from msahl.algebra.vector import at
from msahl.analysis.linear_models.columns import (
    BODIES,
    RATES,
    WORK,
    columns_by_table,
    force_rows,
    headers,
    motion_rows,
    motions_of,
)
from msahl.analysis.linearised.coefficients import coefficients
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.projection import close, move, prepared
from msahl.elements.signals.group import use_reactions
from msahl.model import SignalState
from msahl.ports import forces
from msahl.start.velocities import make_consistent, solve_accelerations
from msahl.system.arrays import new_tables, node_count
from msahl.system.names import signal_columns

FOURTH = ((1, 2 / 3), (2, -1 / 12))
STEP = 3e-4


def beside(point, dq, dv, ds):
    """The point displaced by ``dq`` and ``dv`` (n,), made consistent, with its accelerations."""
    system, state, unknowns = point.system, point.state, point.unknowns
    numbers = coefficients(system, state).coordinate
    place, rate = np.zeros((2, node_count(system), 3))
    place.reshape(-1)[numbers], rate.reshape(-1)[numbers] = dq, dv
    names = ("force", "a", "alpha", "reaction")
    moved = move(system, state._replace(**{n: getattr(state, n).copy() for n in names}), place)
    moved = close(system, moved, unknowns)
    v, w = state.v.copy(), moved.w.copy()
    for f in range(len(v) - 1):
        v[f] += rate[system.frames.displacement[f]]
        w[f] += np.array(matrix(at(moved.p, f))).T @ rate[system.frames.rotation[f]]
    moved = moved._replace(v=v, w=w, auxiliary=state.auxiliary + ds)
    make_consistent(system, moved, unknowns.free, "massWeighted")
    group = system.forces.signals
    # Until reactions that expressions depend on are those that follow.
    for _ in range(30 if group is not None and use_reactions(group) else 1):
        solve_accelerations(system, moved, unknowns)
    return Point(point.model, system, moved, unknowns)


def values(point, origin):
    """All columns at a point by name, rotations relative to the ``origin``, and rates of auxiliary
    states under their names and "Rate".
    """
    model, system, state = point.model, point.system, point.state
    found = {}
    tables, heads = force_rows(point, [state]), headers(model)
    tables |= motion_rows(point, motions_of(point, [state]), tables[WORK])
    # Of two columns of one name that of the first table is meant.
    for name in reversed([*columns_by_table(model), BODIES, RATES]):
        if name in tables:
            found |= zip(heads[name], tables[name][0].tolist(), strict=True)
    if system.forces.signals is not None:
        table, start = new_tables(system, state, 1).signals, prepared(system, state)
        forces.publish_signals(
            system.forces.signals, system.forces.actuator, start.forces, system.scalar, table, 0
        )
        found |= dict(zip(signal_columns(model)[1:], table[0].tolist(), strict=True))
        names = [s.name for s in model.signals if isinstance(s, SignalState)]
        rates = coefficients(system, state).state_rate.tolist()
        found |= {f"{name} rate": rate for name, rate in zip(names, rates, strict=True)}
    for b, body in enumerate(model.bodies):
        for i, level in enumerate(rotation(system, state, origin.state, b)):
            found |= {
                f"{body.name}.r{axis}{('', 'Rate', 'Acceleration')[i]}": float(x)
                for axis, x in zip("xyz", level, strict=True)
            }
    return found


def rotation(system, state, origin, b):
    """Rotation vector of a body from that at the ``origin``, which moves on, with its derivatives;
    to first order.
    """
    f = int(system.bodies.frame[b])
    axis, angle = to_axis_angle(compose(at(state.p, f), opposite(at(origin.p, f))))
    phi, W0 = angle * np.array(axis), np.array(matrix(at(origin.p, f))) @ origin.w[f]
    dW = np.array(matrix(at(state.p, f))) @ state.w[f] - W0
    rate = dW + np.cross(W0, phi)
    rise = state.alpha[f] - origin.alpha[f] + np.cross(origin.alpha[f], phi) + np.cross(W0, rate)
    return phi, rate, rise


def slopes(point, changes, y, step=STEP):
    """Derivatives of all ``values`` along the columns ``y`` of the changes."""
    found = {}
    for k, weight in FOURTH:
        for sign in (1.0, -1.0):
            z = sign * k * step * y
            own = slice(0, y.size)
            other = beside(
                point,
                changes.places[:, own] @ z,
                changes.rates[:, own] @ z,
                changes.states[:, own] @ z,
            )
            for name, value in values(other, point).items():
                found[name] = found.get(name, 0.0) + sign * weight / step * value
    return found
