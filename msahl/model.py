"""The model: what the deck says, complete, in SI units, with every basis resolved.

Vectors are tuples, so two models compare with ``==``. Frames: I, the inertial axes, which are every
ground's; B, a body's own axes at its reference point B. Records of bodies, joints and loads stand
in their elements' modules.
"""

from dataclasses import dataclass

from msahl.bodies.ground import Ground
from msahl.bodies.rigid import RigidBody
from msahl.forces.concentrated import ConcentratedLoad
from msahl.joints.spherical import Spherical
from msahl.vector import Vector

__all__ = ["ConcentratedLoad", "Ground", "Model", "RigidBody", "Simulation", "Spherical"]


@dataclass(frozen=True, slots=True)
class Simulation:
    """How the scene is run: step ``dt`` and end ``t_final`` [s]."""

    title: str
    dt: float
    t_final: float


@dataclass(frozen=True, slots=True)
class Model:
    """A whole deck. ``gravity`` [m/s^2] in I; names are unique across bodies and grounds, across
    joints, and across loads; ``unit_system`` names the units the deck speaks by default."""

    gravity: Vector
    grounds: tuple[Ground, ...]
    bodies: tuple[RigidBody, ...]
    joints: tuple[Spherical, ...]
    loads: tuple[ConcentratedLoad, ...]
    simulation: Simulation
    unit_system: str = "SI"
