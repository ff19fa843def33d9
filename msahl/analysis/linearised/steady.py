"""Whether a motion is steady, and in which axes: at rest, straight on, or about a fixed axis.

A motion is steady if there are axes, rotating with a constant angular velocity w, in which nothing
about it changes but places that do not matter:

    a = w x v ,  alpha = w x W        of all frames                                     (1)
    M, K, D, G in these axes are the same after some time                               (2)

w is the least that satisfies (1) best, weighted by mass, or, where (2) fails for it, the angular
velocity of one of the bodies (an unsymmetric body that spins freely about a principal axis). The
residual of (1), M (a - w x v), is the force by which the motion is not in equilibrium.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import compose, from_axis_angle, matrix
from msahl.algebra.vector import at
from msahl.analysis.linearised.coefficients import Coefficients, coefficients, skews
from msahl.analysis.linearised.point import Point, complete
from msahl.formulations.absolute.frames import first_multiplier
from msahl.start.velocities import solve_at_rest
from msahl.system.arrays import State, node_count

STEADY = 1e-8
"""Residual over the forces, and change of coefficients over their size, that is round-off."""
ROUND_OFF = 1e-14
"""Residual over the largest force that is nothing but rounding errors of the forces' sums."""
SMALL_TRAVEL = 1e-6
"""Displacement, over a length of a body, whose force counts where forces at one body cancel each
other."""
MOST_AXES = 4
"""Angular velocities of bodies that are tried."""
MOTIONS = 3
"""Random motions for which coefficients are compared."""
ANGLE = 0.7
"""Angle [rad] by which the fastest body rotates until the coefficients are compared."""


class Equilibrium(NamedTuple):
    """How far a motion is from a steady one."""

    axes: np.ndarray  # (3,) angular velocity w of the axes in which it is seen [rad/s]
    residual: float  # largest force that is not balanced [N], moments over a length
    relative: float  # over the largest force or weight
    coordinate: int  # where that is
    constant: bool  # whether the coefficients are constant
    at_rest: bool  # whether nothing moves

    @property
    def holds(self) -> bool:
        """Whether the motion is an equilibrium or a steady motion."""
        return self.relative <= STEADY and self.constant


def residual_in_words(residual: float, relative: float) -> str:
    """Return a ``residual`` [N] and its size beside the largest force; 0 where it is round-off."""
    if relative <= ROUND_OFF:
        return "0 N to round-off of the largest force"
    return f"{residual:.3g} N ({relative:.1e} of the largest force)"


def equilibrium(point: Point, found: Coefficients) -> Equilibrium:
    """Return how far the motion at a ``point`` is from a steady one."""
    if not found.velocity.any():
        return residual_in(found, np.zeros(3), constant=True)
    tried = [np.zeros(3)]
    if not residual_in(found, tried[0], constant=False).relative <= STEADY:
        tried.append(_best_axes(found))
    for W in spins_of(point):
        if not any(np.allclose(W, other, rtol=1e-9, atol=1e-12) for other in tried):
            tried.append(W)
        if len(tried) > MOST_AXES:
            break
    nearest = None
    for axes in tried:
        result = residual_in(found, axes, constant=False)
        if result.relative <= STEADY and _is_constant(point, found, axes):
            return result._replace(constant=True)
        if nearest is None or result.relative < nearest.relative:
            nearest = result
    assert nearest is not None
    return nearest._replace(axes=np.zeros(3))


def spins_of(point: Point) -> np.ndarray:
    """(b, 3) angular velocities of all bodies, inertial axes."""
    return np.array(
        [np.array(matrix(at(point.state.p, b))) @ w for b, w in enumerate(point.state.w[:-1])]
    )


def _best_axes(found: Coefficients) -> np.ndarray:
    """(3,) the least angular velocity w with a = w x v and alpha = w x W as nearly as possible."""
    C = -skews(found.velocity.reshape(-1, 3)).reshape(-1, 3)
    weighted = found.mass @ C
    left, right = C.T @ weighted, weighted.T @ found.acceleration
    values, vectors = np.linalg.eigh(left)
    kept = values > 1e-12 * max(float(values.max(initial=0.0)), 1e-300)
    axes = vectors[:, kept] @ ((vectors[:, kept].T @ right) / values[kept])
    largest = np.abs(found.velocity).max(initial=0.0)
    small = np.linalg.norm(C @ axes) <= 1e-13 * largest * np.linalg.norm(axes)
    return np.zeros(3) if small else axes


def residual_in(found: Coefficients, axes: np.ndarray, constant: bool = True) -> Equilibrium:
    """Return the residual of equation (1) for one w."""
    carried = np.cross(axes, found.velocity.reshape(-1, 3)).reshape(-1)
    force = (found.mass @ (found.acceleration - carried)) / found.length
    largest = max(
        float(np.abs(found.force / found.length).max(initial=0.0)),
        float(np.abs((found.mass @ found.acceleration) / found.length).max(initial=0.0)),
        found.weight,
        stiffest(found),
    )
    where = int(np.argmax(np.abs(force))) if force.size else 0
    residual = float(np.abs(force[where])) if force.size else 0.0
    return Equilibrium(
        axes=axes,
        residual=residual,
        relative=residual / largest if largest > 0.0 else 0.0,
        coordinate=where,
        constant=constant,
        at_rest=not found.velocity.any(),
    )


def stiffest(found: Coefficients) -> float:
    """Largest force [N] by which the model reacts to a small displacement or rotation."""
    typical = float(np.mean(found.length[found.rotational]))
    travel = np.where(found.rotational, 1.0, typical)
    rows = abs(found.by_place) @ travel / found.length
    return SMALL_TRAVEL * float(rows.max(initial=0.0))


def _is_constant(point: Point, found: Coefficients, axes: np.ndarray) -> bool:
    """Return whether the coefficients are the same, in axes that rotate, after a while.

    They are compared for some random motions that the joints allow, since equations of joints may
    be written in other axes.
    """
    spin = np.linalg.norm(spins_of(point), axis=1).max(initial=0.0)
    speed = np.abs(point.state.v).max(initial=0.0)
    tau = ANGLE / spin if spin > 0.0 else point.system.frames.length.max() / speed
    later = complete(point.model, point.system, _later(point, axes, tau), point.unknowns)
    after = coefficients(point.system, later.state)
    motions = _allowed_motions(point, found)
    R = np.array(matrix(_rotation(axes, tau)))
    carried = np.einsum("ij,bjk->bik", R, motions.reshape(-1, 3, MOTIONS)).reshape(motions.shape)
    broken = after.constraint @ carried
    size = np.abs(after.constraint) @ np.abs(carried)
    if np.abs(broken).max(initial=0.0) > STEADY * max(float(size.max(initial=0.0)), 1e-300):
        return False
    inertia = np.abs(motions).T @ (abs(found.mass) @ np.abs(motions))
    for now, then, rate in (
        (found.mass, after.mass, 1.0),
        (found.by_place, after.by_place, 1.0 / tau**2),
        (found.by_rate, after.by_rate, 1.0 / tau),
    ):
        before = motions.T @ (now @ motions)
        change = carried.T @ (then @ carried) - before
        size = np.abs(motions).T @ (abs(now) @ np.abs(motions)) + rate * inertia
        if np.abs(change).max() > STEADY * max(float(size.max()), 1e-300):
            return False
    return True


def _allowed_motions(point: Point, found: Coefficients) -> np.ndarray:
    """(n, ``MOTIONS``) random displacements and rotations that violate no constraint."""
    system, rng = point.system, np.random.default_rng(0)
    first = first_multiplier(system.frames)
    motions = np.zeros((found.coordinate.size, MOTIONS))
    for k in range(MOTIONS):
        rows = np.zeros((node_count(system), 3))
        rows[:first] = rng.normal(size=(first, 3))
        moved = solve_at_rest(system, point.state, rows, point.unknowns)
        motions[:, k] = moved.reshape(-1)[found.coordinate] / found.length
    return motions


def _rotation(W: np.ndarray, tau: float) -> tuple[float, float, float]:
    """Parameters of the rotation with the angular velocity ``W`` over the time ``tau``."""
    size = float(np.linalg.norm(W))
    x, y, z = W.tolist()
    return from_axis_angle((x, y, z), size * tau) if size > 0.0 else (0.0, 0.0, 0.0)


def _later(point: Point, axes: np.ndarray, tau: float) -> State:
    """Return the state after the time ``tau`` [s] of a steady motion."""
    state, w = point.state, float(np.linalg.norm(axes))
    p_axes = _rotation(axes, tau)
    R, K = np.array(matrix(p_axes)), skews(axes[None])[0]
    travel = tau * np.eye(3)
    if w > 0.0:
        theta = w * tau
        travel += (1.0 - np.cos(theta)) / w**2 * K + (theta - np.sin(theta)) / w**3 * K @ K
    x, p, v, force = state.x.copy(), state.p.copy(), state.v.copy(), state.force.copy()
    for b in range(len(x) - 1):
        own = np.array(matrix(at(state.p, b)))
        step = _rotation(own @ state.w[b] - axes, tau)
        p[b] = compose(p_axes, compose(step, at(state.p, b)))
        x[b] = state.x[b] + travel @ state.v[b]
        v[b] = R @ state.v[b]
    points = point.system.coincide.a.size
    force[:points] = force[:points] @ R.T
    return state._replace(
        time=state.time + tau,
        x=x,
        p=p,
        v=v,
        force=force,
        a=state.a @ R.T,
        alpha=state.alpha @ R.T,
        angle=state.angle.copy(),
        reaction=state.reaction.copy(),
        w=_body_axes(p, state, R),
    )


def _body_axes(p: np.ndarray, state: State, R: np.ndarray) -> np.ndarray:
    """(f, 3) angular velocities in the axes of the bodies at ``p``, which are R W."""
    w = state.w.copy()
    for b in range(len(w) - 1):
        W = R @ np.array(matrix(at(state.p, b))) @ state.w[b]
        w[b] = np.array(matrix(at(p, b))).T @ W
    return w
