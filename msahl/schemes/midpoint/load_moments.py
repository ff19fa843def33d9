"""What a load of the lowest order's step does beyond its mean: see ``forces.concentrated``."""

from msahl.algebra.vector import ZERO, at, put, scale
from msahl.elements import rigid_body
from msahl.elements.forces import concentrated
from msahl.jit.kernel import apart, kernel
from msahl.linalg import dense, sparse_lu
from msahl.schemes.midpoint import equations
from msahl.schemes.midpoint.workspace import Scene

NO_STEP = 1e-100
"""Step size for the limit in which the Jacobian holds masses and joints alone; its square is still
a normal number."""


@kernel
def load(scene: Scene, h: float) -> None:
    """Size the loads for a step ``h`` from the prepared state; before its first guess."""
    if equations.load(scene.system, scene.state, scene.start, h):
        _solve(scene)
        _enter(scene, h)
    else:
        for b in range(scene.system.bodies.inverse_mass.size - 1):
            rigid_body.offset(scene.start.bodies, b, ZERO, ZERO)


@apart
def _solve(scene: Scene) -> None:
    """Set ``Z`` to the accelerations by the loads' first moments, joints kept closed."""
    system, start, Z, F = scene.system, scene.start, scene.Z, scene.F
    order = scene.unknowns.elimination.order
    for node in range(Z.shape[0]):
        put(Z, node, ZERO)
    equations.residual(system, scene.state, start, NO_STEP, Z, F)
    equations.joint_jacobian(system, start, NO_STEP, Z, scene.values)
    sparse_lu.factor(scene.unknowns.elimination, scene.values, scene.factor)
    for node in range(F.shape[0]):
        put(F, node, ZERO)
    for k in range(system.loads.body.size):
        concentrated.enter_first(system.loads, start.loads, system.bodies, k, F)
    dense.gather(order, F, scene.y)
    sparse_lu.solve(scene.unknowns.elimination, scene.factor, scene.y)
    dense.spread(order, scene.y, Z)


@kernel
def _enter(scene: Scene, h: float) -> None:
    """Set the bodies' offsets by the accelerations in ``Z``."""
    bodies = scene.system.bodies
    for b in range(bodies.inverse_mass.size - 1):
        dv = scale(h, at(scene.Z, 2 * b))
        dW = scale(h / bodies.length[b], at(scene.Z, 2 * b + 1))
        rigid_body.offset(scene.start.bodies, b, dv, dW)
