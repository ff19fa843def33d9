"""The model: what the deck says, complete, in SI units, with every basis resolved.

Vectors are tuples, so two models compare with ``==``. Frames: I, the inertial axes, which are every
ground's; B, a body's own axes at its reference point B. Records of bodies, joints, motions and
loads stand with their elements.
"""

from dataclasses import dataclass

from msahl.algebra.vector import Vector
from msahl.model.bodies import Ground, RigidBody
from msahl.model.couplings import Coupling
from msahl.model.joints import Joint
from msahl.model.loads import (
    Load,
)
from msahl.model.motions import JointMotion, PointMotion
from msahl.model.scheme import (
    AUTO,
    CAYLEY,
    CHOSEN,
    DAMPING,
    DEFAULT,
    DEGREE,
    EXPONENTIAL,
    HIGHER,
    SCHEMES,
    TOLERANCE,
    Decay,
    decaying,
)

MEAN, INSTANTANEOUS = "mean", "instantaneous"
"""What published reactions are: means over the steps, or those at the rows' own times."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What the deck asks of a run's figures; None leaves it to ``msahl.run.verdict``.

    ``accuracy`` [m] of positions, judged by a second run at half the step; ``energy`` relative to
    the largest kinetic energy; ``gap`` [m] of the joints.
    """

    accuracy: float | None = None
    energy: float | None = None
    violation: float | None = None


@dataclass(frozen=True, slots=True)
class Simulation:
    """How the scene is run: step ``dt`` and end ``t_final`` [s], scheme and, if it is one that
    decays, its damping at infinite frequency: 0 none, 1 all in one step; the ``rotation_update``
    by which the mean angular velocity of a step rotates a body; what ``reactions`` are;
    what is asked of the result; the ``degree`` of the scheme, if it is one that has any; the
    ``interval`` [s] of rows where it is not the step; the ``tolerance`` [m] of the global error of
    positions, or the ``local_tolerance`` [m] of the sum of the steps' own errors, by which steps
    are chosen, if they are: ``dt`` is then the first one tried.
    """

    title: str
    dt: float
    t_final: float
    scheme: str = DEFAULT
    damping: float = DAMPING
    rotation_update: str = CAYLEY
    reactions: str = MEAN
    limits: Limits = Limits()
    degree: int = DEGREE
    interval: float | None = None
    tolerance: float | None = None
    local_tolerance: float | None = None


@dataclass(frozen=True, slots=True)
class Model:
    """A whole deck. ``gravity`` [m/s^2] in I; names are unique across bodies and grounds, across
    joints, couplings and motions, and across loads; ``unit_system`` names the units the deck speaks
    by default. ``position`` and ``velocity`` say how the start is made consistent.
    """

    gravity: Vector
    grounds: tuple[Ground, ...]
    bodies: tuple[RigidBody, ...]
    joints: tuple[Joint, ...]
    loads: tuple[Load, ...]
    simulation: Simulation
    unit_system: str = "SI"
    couplings: tuple[Coupling, ...] = ()
    motions: tuple[JointMotion | PointMotion, ...] = ()
    position: str = "check"  # or "project": close the joints by Newton's method
    velocity: str = "keepAngular"  # or "massWeighted", "asGiven", "refuse"


def decay_of(model: Model) -> Decay:
    """How the model's scheme decays; one of a higher degree does in no such way."""
    if degree_of(model):
        return decaying(0.0)
    return SCHEMES[model.simulation.scheme](model.simulation.damping)


def is_exponential(model: Model) -> bool:
    """Whether the mean angular velocity of a step tells the angle of its turn, not its tangent."""
    return model.simulation.rotation_update == EXPONENTIAL and not degree_of(model)


def reactions_of(model: Model) -> str:
    """What published reactions are: those of a scheme of higher degree have no means."""
    return INSTANTANEOUS if degree_of(model) else model.simulation.reactions


def scheme_of(model: Model) -> str:
    """The model's scheme, or the one whose steps and degree are chosen."""
    return CHOSEN if model.simulation.scheme == AUTO else model.simulation.scheme


def degree_of(model: Model) -> int:
    """Degree of the model's scheme, the largest if it is chosen; 0 if it is of the lowest order."""
    if model.simulation.scheme == AUTO:
        return HIGHER[CHOSEN].highest
    return model.simulation.degree if model.simulation.scheme in HIGHER else 0


def order_of(model: Model) -> int:
    """Order of the model's scheme in states."""
    higher = HIGHER.get(scheme_of(model))
    return higher.order(degree_of(model)) if higher else 2


def tolerance_of(model: Model) -> float | None:
    """Global error [m] that the run must not exceed; None if no such is asked for."""
    simulation = model.simulation
    if simulation.local_tolerance is not None or not degree_of(model):
        return None
    return simulation.tolerance or (TOLERANCE if simulation.scheme == AUTO else None)


def local_tolerance_of(model: Model) -> float | None:
    """Bound [m] of the sum of the steps' own errors by which the run chooses its steps; None if
    they are the deck's own.
    """
    if not degree_of(model):
        return None
    return model.simulation.local_tolerance or tolerance_of(model)


def decays(model: Model) -> bool:
    """Whether the model's scheme takes energy from it."""
    higher = HIGHER.get(scheme_of(model))
    return higher.decays if higher else decay_of(model).chi > 0.0
