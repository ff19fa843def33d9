"""Prediction of the rates of a step in joint coordinates by the polynomials of the one before."""

import math

import numpy as np

from msahl.algebra.vector import (
    Vector,
    at,
    matrix_at,
    times,
    transpose,
)
from msahl.jit.kernel import kernel
from msahl.jit.lanes import LANES
from msahl.schemes.collocation import predictor as step_predictor
from msahl.schemes.collocation.tree.stages import FROM_TREE, TreeStages
from msahl.schemes.collocation.workspace import StageArrays


@kernel
def predict(tree: TreeStages, stages: StageArrays, R: np.ndarray, t: float, h: float) -> bool:
    """Set the rates at the nodes to the prediction from the step to follow, or to those at the
    start, where the frames have the orientations ``R``; return whether there is one to follow.

    What is extrapolated of a ball is its angular velocity in the parent's axes, as its hinges have
    other axes in each step.
    """
    motion, s = tree.motion, tree.rates.shape[0] - 1
    follows = False
    if tree.figures[FROM_TREE] > 0.0:
        follows = step_predictor.set_weights(stages, t, h)
    _set_start(tree, R)
    for k in range(motion.rate.size):
        for i in range(s):
            value = tree.rates[s, k]
            if follows:
                value = stages.rate_weights[i, s + 1] * value
                for j in range(s + 1):
                    value += stages.rate_weights[i, j] * tree.last_rates[j, k]
            motion.u[k, i] = value
    for b in range(1, tree.tree.frame.size):
        if tree.tree.ball[b] >= 0:
            _to_hinges(tree, R, b, h)
    for k in range(motion.rate.size):
        for i in range(s, LANES):
            motion.u[k, i] = motion.u[k, s - 1]
    return follows


@kernel
def _set_start(tree: TreeStages, R: np.ndarray) -> None:
    """Set the last of ``tree.rates`` to those at the start."""
    motion, s = tree.motion, tree.rates.shape[0] - 1
    for k in range(motion.rate.size):
        tree.rates[s, k] = motion.rate[k]
    for b in range(1, tree.tree.frame.size):
        k = tree.tree.ball[b]
        if k >= 0:
            w = in_parent(tree, R, b, (motion.rate[k], motion.rate[k + 1], motion.rate[k + 2]))
            for c in range(3):
                tree.rates[s, k + c] = w[c]


@kernel
def in_parent(tree: TreeStages, R: np.ndarray, b: int, w: Vector) -> Vector:
    """Vector in the parent's axes, from its components along the hinges of the ball of body ``b``
    at the start of the step.
    """
    axes = axes_of_ball(tree, b)
    parent = matrix_at(R, tree.tree.frame[tree.tree.parent[b]])
    return times(transpose(parent), times(transpose(axes), w))


@kernel
def axes_of_ball(tree: TreeStages, b: int) -> tuple[Vector, Vector, Vector]:
    """Axes of the three hinges of body ``b`` at the start of the step, inertial axes."""
    k, axis = tree.tree.ball[b], tree.motion.axis
    return (at(axis, k), at(axis, k + 1), at(axis, k + 2))


SWEEPS = 3
"""Iterations for the rates of a ball's hinges; each gains a power of the rotation over the step."""


@kernel
def _to_hinges(tree: TreeStages, R: np.ndarray, b: int, h: float) -> None:
    """Replace angular velocities of the ball of body ``b``, in the parent's axes, by the rates of
    its hinges.
    """
    k, u, s = tree.tree.ball[b], tree.motion.u, tree.rates.shape[0] - 1
    axes, parent = axes_of_ball(tree, b), matrix_at(R, tree.tree.frame[tree.tree.parent[b]])
    for i in range(s):
        w = times(axes, times(parent, (u[k, i], u[k + 1, i], u[k + 2, i])))
        for c in range(3):
            tree.rates[i, k + c] = w[c]
    for _ in range(SWEEPS):
        for i in range(s):
            x, y = 0.0, 0.0
            for j in range(s):
                x += h * tree.nodes[j, i] * u[k, j]
                y += h * tree.nodes[j, i] * u[k + 1, j]
            w = hinge_rates(x, y, (tree.rates[i, k], tree.rates[i, k + 1], tree.rates[i, k + 2]))
            for c in range(3):
                tree.motion.y[k + c, i] = w[c]
        for c in range(3):
            for i in range(s):
                u[k + c, i] = tree.motion.y[k + c, i]


@kernel
def hinge_rates(x: float, y: float, w: Vector) -> Vector:
    """Rates of the hinges x, y, z of a ball with an angular velocity ``w`` in the axes that these
    have at the start of the step.
    """
    along = math.cos(x) * w[2] - math.sin(x) * w[1]
    third = along / max(math.cos(y), 0.1)  # a prediction need not be right
    return (
        w[0] - math.sin(y) * third,
        math.cos(x) * w[1] + math.sin(x) * w[2],
        third,
    )


@kernel
def angular_velocity(x: float, y: float, u: Vector) -> Vector:
    """Angular velocity of a ball by the rates ``u`` of its hinges, in the axes that these have at
    the start of the step.
    """
    across = math.cos(y) * u[2]
    return (
        u[0] + math.sin(y) * u[2],
        math.cos(x) * u[1] - math.sin(x) * across,
        math.sin(x) * u[1] + math.cos(x) * across,
    )


@kernel
def save_rates(tree: TreeStages, R: np.ndarray) -> None:
    """Keep the rates of the solved step to predict the next one, see ``predict``."""
    motion, s = tree.motion, tree.nodes.shape[0]
    for k in range(motion.rate.size):
        tree.last_rates[s, k] = tree.rates[s, k]
        for i in range(s):
            tree.last_rates[i, k] = motion.u[k, i]
    for b in range(1, tree.tree.frame.size):
        k = tree.tree.ball[b]
        if k < 0:
            continue
        for i in range(s):
            rates = (motion.u[k, i], motion.u[k + 1, i], motion.u[k + 2, i])
            w = angular_velocity(motion.q[k, i], motion.q[k + 1, i], rates)
            w = in_parent(tree, R, b, w)
            for c in range(3):
                tree.last_rates[i, k + c] = w[c]
