"""The first guess of a step of higher degree: it follows polynomials that are known."""

import math

from msahl.algebra.vector import ZERO, at, axpy, dot, put, scale
from msahl.elements.frames import (
    displacement_node,
    first_multiplier,
    moving_count,
    restrict,
    rotation_node,
)
from msahl.jit.kernel import kernel
from msahl.schemes.collocation import local_rotation
from msahl.schemes.collocation.tableau import Rule
from msahl.schemes.collocation.workspace import Stages
from msahl.system.arrays import State, System, SystemWorkspace


@kernel
def predict(system: System, state: State, start: SystemWorkspace, stages: Stages, h: float) -> None:
    """First guess: velocities and multipliers are those of the known polynomials, of the last step
    or of another that went through here.

    Without any, or for a step far beyond them, the accelerations and multipliers of the ``state``
    stay.
    """
    rule, Z, frames = stages.rule, stages.Z, system.frames
    first, s = first_multiplier(frames), rule.weight.size
    follows = look(stages, state.time[0], h)
    for node in range(first, stages.row.shape[0]):
        for i in range(3):
            force = state.force[node - first, i] * 0.5 * h * h / system.unit[node - first, i]
            for k in range(s):
                # The rows serve as room.
                stages.F[k, node, i] = force
                if follows:
                    stages.F[k, node, i] = 0.0
                    for j in range(s):
                        stages.F[k, node, i] += stages.pushed[k, j] * Z[j, node, i]
            for k in range(s):
                Z[k, node, i] = stages.F[k, node, i]
    for b in range(moving_count(frames)):
        v, W = at(start.frames.v, b), at(start.frames.W, b)
        for i in range(s):
            way = h * rule.acting[i]
            v_i, W_i = axpy(way, at(state.a, b), v), axpy(way, at(state.alpha, b), W)
            if follows:
                v_i, W_i = scale(stages.seen[i, s + 1], v), scale(stages.seen[i, s + 1], W)
                for j in range(s + 1):
                    share, before = stages.seen[i, j], stages.before[j]
                    v_i = axpy(share, at(before, displacement_node(frames, b)), v_i)
                    W_i = axpy(share, at(before, rotation_node(frames, b)), W_i)
            put(stages.rate[i], displacement_node(frames, b), restrict(frames, 0, v_i))
            put(stages.rate[i], rotation_node(frames, b), restrict(frames, 1, W_i))
        _integrate(system, start, stages, h, b)


FAR = 1.5
"""Sizes of a step beyond its end up to which its polynomials are worth following."""


@kernel
def look(stages: Stages, t: float, h: float) -> bool:
    """Set the weights by which a step ``h`` from ``t`` follows the known polynomials, if it can."""
    rule, window = stages.rule, stages.window
    s, size = rule.weight.size, stages.known[1] / h
    if not size > 0.0:
        return False
    begin = (stages.known[0] - t) / h
    if abs(begin + size) < 1e-6:
        begin = -size  # it is the step before, but for round-off
    if 1.0 - (begin + size) > FAR * size:
        return False
    near = stages.near[0]
    if begin == window[0] and size == window[1] and near == window[2]:
        return True
    window[0], window[1], window[2] = begin, size, near
    for i in range(s):
        for j in range(s + 2):
            x, weight = _node(rule, begin, size, near, j), 1.0
            for m in range(s + 2):
                x_m = _node(rule, begin, size, near, m)
                if m != j and not math.isnan(x_m):
                    weight *= (rule.acting[i] - x_m) / (x - x_m)
            stages.seen[i, j] = 0.0 if math.isnan(x) else weight
        for j in range(s):
            x, weight = begin + size * rule.pushing[j], 1.0 / (size * size)
            for m in range(s):
                if m != j:
                    x_m = begin + size * rule.pushing[m]
                    weight *= (rule.pushing[i] - x_m) / (x - x_m)
            stages.pushed[i, j] = weight
    return True


@kernel
def _node(rule: Rule, begin: float, size: float, near: float, j: int) -> float:
    """Where in the present step the ``j``-th of the known velocities is; nan if it tells nothing
    that the last, which are those of the present place, do not tell better.
    """
    s = rule.weight.size
    if j == s + 1:
        return 0.0
    if j == s and (rule.decays or near == 0.0):
        # Velocities jump where such a step begins, or steps are too long to go by more of them.
        return math.nan
    x = begin + (size * rule.acting[j] if j < s else 0.0)
    return x if abs(x) >= 1e-6 else math.nan


SWEEPS = 3
"""Of the guess's turns: each gains a power of the turn over a step."""
WIDEST = 16.0
"""Parameters beyond which a guessed turn is none, 304 degrees: near a whole turn they run away, and
beside a step of their length any residual would be small."""


@kernel
def _integrate(system: System, start: SystemWorkspace, stages: Stages, h: float, b: int) -> None:
    """Set the places z_j of body ``b`` from its velocities at c_i."""
    rule, Z, frames, g = stages.rule, stages.Z, system.frames, system.bodies.gravity
    s, length, gravity = rule.weight.size, frames.length[b], (g[0], g[1], g[2])
    for j in range(s):
        put(Z[j], rotation_node(frames, b), ZERO)
        u = ZERO
        for i in range(s):
            u = axpy(h * rule.integral[j, i], at(stages.rate[i], displacement_node(frames, b)), u)
        if frames.ballistic[b]:
            # That displacement need not be solved for: here it is what the rows would have.
            u = scale(h * rule.closing[j], at(start.frames.v, b))
            for i in range(s):
                u = axpy(-h * h * rule.alpha[j, i], gravity, u)
        put(Z[j], displacement_node(frames, b), u)
    for _ in range(SWEEPS):
        for i in range(s):
            c = ZERO
            for j in range(s):
                c = axpy(rule.value[i, j] / length, at(Z[j], rotation_node(frames, b)), c)
            # The rows serve as room.
            c_dot = local_rotation.parameter_rate(c, at(stages.rate[i], rotation_node(frames, b)))
            put(stages.F[i], displacement_node(frames, b), c_dot)
        for j in range(s):
            c = ZERO
            for i in range(s):
                c_dot = at(stages.F[i], displacement_node(frames, b))
                c = axpy(h * length * rule.integral[j, i], c_dot, c)
            put(Z[j], rotation_node(frames, b), c)
    for j in range(s):
        c = at(Z[j], rotation_node(frames, b))
        if not dot(c, c) <= (WIDEST * length) ** 2:
            put(Z[j], rotation_node(frames, b), ZERO)
