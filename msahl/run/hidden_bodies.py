"""The bodies that tables do not show: those that carry amplitudes and mass of elastic bodies.

Steps and all that is computed from them have every body. Tables that users get have the frame and
the nodes of the interface of an elastic body, and its amplitudes, from which the others follow:

    x_k = x_0 + R_0 (x_k0 + sum_j phi_kj a_j)     P_k = P_0     w_k = w_0
    v_k = v_0 + w_0 x (x_k0 + sum_j phi_kj a_j) + sum_j phi_kj da_j/dt      in the axes of the frame

with the squares behind the amplitudes, see ``model.elastic``.
"""

from collections.abc import Mapping

import numpy as np

from msahl.algebra.rotation_arrays import cross, rotated, rotations
from msahl.formulations.absolute.rigid_body import ACCELERATION_SIZE, STATE_SIZE
from msahl.model import ElasticBody, Model
from msahl.run.tables import ACCELERATIONS, STATES, tables_of_model

WIDTHS = {STATES: STATE_SIZE, ACCELERATIONS: ACCELERATION_SIZE}
"""Columns of each body in the tables that have bodies."""


def shown_tables(model: Model) -> dict[str, list[str]]:
    """Return the tables of a run as users get them, with their columns."""
    columns = tables_of_model(model)
    if not model.hidden:
        return columns
    return {
        name: [head[i] for i in _shown(model, name, len(head))] for name, head in columns.items()
    }


def without_hidden(model: Model, tables: Mapping[str, np.ndarray]) -> Mapping[str, np.ndarray]:
    """Return tables (m, columns) without the columns of hidden bodies, if they have them."""
    if not model.hidden:
        return tables
    return {name: _without_hidden(model, name, rows) for name, rows in tables.items()}


def _without_hidden(model: Model, name: str, rows: np.ndarray) -> np.ndarray:
    complete = 1 + WIDTHS.get(name, 0) * len(model.bodies)
    if name not in WIDTHS or rows.shape[1] != complete:
        return rows
    shown: np.ndarray = rows[:, _shown(model, name, complete)]
    return shown


def _shown(model: Model, name: str, count: int) -> np.ndarray:
    """Return the numbers of the columns of a table, of ``count``, that are shown."""
    if name not in WIDTHS:
        return np.arange(count)
    width = WIDTHS[name]
    columns = 1 + width * shown_numbers(model)[:, None] + np.arange(width)
    return np.r_[0, columns.ravel()]


def shown_numbers(model: Model) -> np.ndarray:
    """Return the numbers of the bodies that tables show."""
    hidden = model.hidden
    return np.flatnonzero([body.name not in hidden for body in model.bodies])


def with_hidden(model: Model, states: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    """Return the complete table of states (m, columns) of that without hidden bodies, and of the
    amplitudes at the same times."""
    result = np.zeros((len(states), 1 + STATE_SIZE * len(model.bodies)))
    result[:, _shown(model, STATES, result.shape[1])] = states
    place = {body.name: 1 + STATE_SIZE * b for b, body in enumerate(model.bodies)}
    column = 1
    for body in model.elastic_bodies:
        q = len(body.stiffness)
        own = amplitudes[:, column : column + 2 * q].reshape(-1, q, 2)
        column += 2 * q
        first = place[body.name]
        rows = _hidden_rows(body, result[:, first : first + STATE_SIZE], own)
        for k, follower in enumerate(body.hidden):
            first = place[follower.body]
            result[:, first : first + STATE_SIZE] = rows[:, k]
    return result


def _hidden_rows(body: ElasticBody, frame: np.ndarray, amplitudes: np.ndarray) -> np.ndarray:
    """Return the states (m, k, 12) of the hidden bodies of one elastic body, by those of its frame
    (m, 12), and its amplitudes with their rates (m, q, 2)."""
    values = _with_squares(body, amplitudes)
    shape = np.array([one.shape for one in body.hidden]).reshape(-1, 3, values.shape[1])
    place = np.array([one.place for one in body.hidden]).reshape(-1, 3)
    moved = np.einsum("kij,mjs->smki", shape, values)
    x, P, v, w = (frame[:, None, 3 * i : 3 * i + 3] for i in range(4))
    away = place + moved[0]
    result = np.zeros((len(frame), len(place), STATE_SIZE))
    result[..., 0:3] = x + rotated(rotations(P), away)
    result[..., 3:6] = P
    result[..., 6:9] = v + cross(w, away) + moved[1]
    result[..., 9:12] = w
    return result


def _with_squares(body: ElasticBody, amplitudes: np.ndarray) -> np.ndarray:
    """Return the amplitudes, and behind them the squares, with their rates (m, q + l, 2)."""
    if not body.squares:
        return amplitudes
    q = amplitudes.shape[1]
    sums = body.followers[body.carriers + body.square_carriers :]
    rows = np.array([*np.eye(q), *(row[:q] for one in sums for row in one.shape)])
    rows = rows[[one.argument for one in body.squares]]
    factor = np.array([one.factor for one in body.squares])
    value, rate = np.moveaxis(np.einsum("lj,mjs->mls", rows, amplitudes), 2, 0)
    squares = np.stack([factor * value**2, 2.0 * factor * value * rate], axis=2)
    return np.concatenate([amplitudes, squares], axis=1)
