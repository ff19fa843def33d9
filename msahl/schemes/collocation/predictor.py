"""Predicts the unknowns of a collocation step by extrapolating the polynomials of an earlier step.

Velocities at c_i are extrapolated by Lagrange polynomials through those of the earlier step and the
present one, multipliers by those of the earlier step; positions and rotations follow by integration
(``Tableau.integral``).
"""

import math

from msahl.algebra.vector import ZERO, at, axpy, dot, put, scale
from msahl.formulations.absolute import local_rotation
from msahl.formulations.absolute.frames import (
    displacement_node,
    first_multiplier,
    moving_count,
    restrict,
    rotation_node,
)
from msahl.jit.kernel import kernel
from msahl.ports import forces
from msahl.schemes.collocation.tableau import Tableau
from msahl.schemes.collocation.workspace import StageArrays
from msahl.system.arrays import State, System, SystemWorkspace


@kernel
def predict(
    system: System, state: State, start: SystemWorkspace, stages: StageArrays, h: float
) -> None:
    """Set ``stages.Z`` to the prediction of a step ``h``: by the polynomials of the step to follow,
    the last one or another that went through the same time.

    Without one, or for a step far beyond it, accelerations and multipliers stay those of the
    ``state``. What signals are at the start of the step is saved as well.
    """
    forces.begin_stages(system.forces.signals, start.forces, system.scalar, stages.signals)
    tableau, Z, frames = stages.tableau, stages.Z, system.frames
    first, s = first_multiplier(frames), tableau.force_weight.size
    follows = set_weights(stages, state.time[0], h)
    for node in range(first, stages.accelerations.shape[0]):
        for i in range(3):
            force = state.force[node - first, i] * 0.5 * h * h / system.unit[node - first, i]
            for k in range(s):
                # The equations serve as work array.
                stages.F[k, node, i] = force
                if follows:
                    stages.F[k, node, i] = 0.0
                    for j in range(s):
                        stages.F[k, node, i] += stages.multiplier_weights[k, j] * Z[j, node, i]
            for k in range(s):
                Z[k, node, i] = stages.F[k, node, i]
    for b in range(moving_count(frames)):
        v, W = at(start.frames.v, b), at(start.frames.W, b)
        for i in range(s):
            way = h * tableau.force_time[i]
            v_i, W_i = axpy(way, at(state.a, b), v), axpy(way, at(state.alpha, b), W)
            if follows:
                v_i, W_i = (
                    scale(stages.rate_weights[i, s + 1], v),
                    scale(stages.rate_weights[i, s + 1], W),
                )
                for j in range(s + 1):
                    share, before = stages.rate_weights[i, j], stages.last_rates[j]
                    v_i = axpy(share, at(before, displacement_node(frames, b)), v_i)
                    W_i = axpy(share, at(before, rotation_node(frames, b)), W_i)
            put(stages.rate[i], displacement_node(frames, b), restrict(frames, 0, v_i))
            put(stages.rate[i], rotation_node(frames, b), restrict(frames, 1, W_i))
        _integrate(system, start, stages, h, b)


MAX_DISTANCE = 1.5
"""Distance beyond the end of a step, in sizes of it, up to which its polynomials are followed."""


@kernel
def set_weights(stages: StageArrays, t: float, h: float) -> bool:
    """Set the extrapolation weights of a step ``h`` from ``t``; return whether there are any."""
    tableau, window = stages.tableau, stages.prediction_window
    s, size = tableau.force_weight.size, stages.last_step[1] / h
    if not size > 0.0:
        return False
    begin = (stages.last_step[0] - t) / h
    if abs(begin + size) < 1e-6:
        begin = -size  # it is the step before, except for rounding errors
    if 1.0 - (begin + size) > MAX_DISTANCE * size:
        return False
    near = stages.predicted_well[0]
    if begin == window[0] and size == window[1] and near == window[2]:
        return True
    window[0], window[1], window[2] = begin, size, near
    for i in range(s):
        for j in range(s + 2):
            x, weight = _rate_time(tableau, begin, size, near, j), 1.0
            for m in range(s + 2):
                x_m = _rate_time(tableau, begin, size, near, m)
                if m != j and not math.isnan(x_m):
                    weight *= (tableau.force_time[i] - x_m) / (x - x_m)
            stages.rate_weights[i, j] = 0.0 if math.isnan(x) else weight
        for j in range(s):
            x, weight = begin + size * tableau.multiplier_time[j], 1.0 / (size * size)
            for m in range(s):
                if m != j:
                    x_m = begin + size * tableau.multiplier_time[m]
                    weight *= (tableau.multiplier_time[i] - x_m) / (x - x_m)
            stages.multiplier_weights[i, j] = weight
    return True


@kernel
def _rate_time(tableau: Tableau, begin: float, size: float, near: float, j: int) -> float:
    """Time of the ``j``-th of the known velocities as a fraction of the present step; nan if it is
    not to be used. The last one is the present velocity.
    """
    s = tableau.force_weight.size
    if j == s + 1:
        return 0.0
    if j == s and (tableau.decays or near == 0.0):
        # Velocities jump at the start of such a step, or steps are too long to use more of them.
        return math.nan
    x = begin + (size * tableau.force_time[j] if j < s else 0.0)
    return x if abs(x) >= 1e-6 else math.nan


SWEEPS = 3
"""Iterations for the predicted rotations; each gains a power of the rotation over the step."""
MAX_PARAMETERS = 16.0
"""Largest predicted rotation parameters, at 304 degrees. Near a full revolution they tend to
infinity, and relative to a step of such a length any residual would be small."""


@kernel
def _integrate(
    system: System, start: SystemWorkspace, stages: StageArrays, h: float, b: int
) -> None:
    """Set the unknowns z_j of frame ``b`` by integrating its velocities at c_i."""
    tableau, Z, frames, g = stages.tableau, stages.Z, system.frames, system.bodies.gravity
    s, length, gravity = tableau.force_weight.size, frames.length[b], (g[0], g[1], g[2])
    for j in range(s):
        put(Z[j], rotation_node(frames, b), ZERO)
        u = ZERO
        for i in range(s):
            u = axpy(
                h * tableau.integral[j, i], at(stages.rate[i], displacement_node(frames, b)), u
            )
        if frames.ballistic[b]:
            # That displacement is not solved for: here it satisfies its equation.
            u = scale(h * tableau.constraint_time[j], at(start.frames.v, b))
            for i in range(s):
                u = axpy(-h * h * tableau.alpha[j, i], gravity, u)
        put(Z[j], displacement_node(frames, b), u)
    for _ in range(SWEEPS):
        for i in range(s):
            c = ZERO
            for j in range(s):
                c = axpy(tableau.basis[i, j] / length, at(Z[j], rotation_node(frames, b)), c)
            # The equations serve as work array.
            c_dot = local_rotation.parameter_rate(c, at(stages.rate[i], rotation_node(frames, b)))
            put(stages.F[i], displacement_node(frames, b), c_dot)
        for j in range(s):
            c = ZERO
            for i in range(s):
                c_dot = at(stages.F[i], displacement_node(frames, b))
                c = axpy(h * length * tableau.integral[j, i], c_dot, c)
            put(Z[j], rotation_node(frames, b), c)
    for j in range(s):
        c = at(Z[j], rotation_node(frames, b))
        if not dot(c, c) <= (MAX_PARAMETERS * length) ** 2:
            put(Z[j], rotation_node(frames, b), ZERO)
