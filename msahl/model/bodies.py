"""Records of bodies and grounds, in SI units."""

from msahl.algebra.vector import Matrix, Vector
from msahl.records import record


@record
class Ground:
    """A name of the inertial frame; a model may have several."""

    name: str


@record
class RigidBody:
    """A rigid body with axes of its own at its reference point B.

    ``mass`` [kg]; ``r_BG`` [m] from B to the mass centre G, in B; ``inertia`` [kg m^2] about G, in
    B, a symmetric tensor; ``position`` [m] of point B, in I; ``orientation``, Wiener-Milenkovic
    parameters of B relative to I, rescaled; ``velocity`` [m/s] of point B and ``angular_velocity``
    [rad/s], both relative to I and in B.
    """

    name: str
    mass: float
    r_BG: Vector
    inertia: Matrix
    position: Vector
    orientation: Vector
    velocity: Vector
    angular_velocity: Vector
