"""Define the arrays of a system: constant data, state, workspace, tables of results.

Unknowns and equations stand in nodes of three numbers: those of the frames first (``Frames``), then
the multipliers and constraint equations, three to a node. The Jacobian is a list of 3 x 3 blocks,
one after the other in one array; block 0 takes what belongs to the ground and is never read.
"""

from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.functions import Laws
from msahl.elements.beams.group import Beams, BeamsWorkspace
from msahl.elements.beams.group import new_workspace as new_beams_workspace
from msahl.elements.constraints.coincide import Coincide, CoincideWorkspace
from msahl.elements.constraints.coordinate_kinds import MOST, Coordinates, CoordinatesWorkspace
from msahl.elements.constraints.equations import is_active
from msahl.elements.constraints.products import ProductsWorkspace
from msahl.elements.constraints.scalar import ScalarConstraints, ScalarWorkspace
from msahl.elements.reactions import Reactions, Shown
from msahl.formulations.absolute.frames import Frames, FramesWorkspace, first_multiplier
from msahl.formulations.absolute.rigid_body import (
    ACCELERATION_SIZE,
    STATE_SIZE,
    RigidBodies,
    RigidBodiesWorkspace,
)
from msahl.model.scheme import Decay
from msahl.ports.forces import (
    Forces,
    ForcesWorkspace,
    energy_columns,
    loads_of_contacts,
    signal_values,
)
from msahl.ports.forces import new_workspace as new_forces_workspace


class Multipliers(NamedTuple):
    """The multipliers' nodes, for the order of elimination."""

    node: np.ndarray  # (k,)
    element: np.ndarray  # (k,) joint, coupling, motion, element of a beam or spring it belongs to
    rotational: np.ndarray  # (k,) whether its equations depend on rotations only
    bodies: np.ndarray  # (k, 4 or more) frames its equations depend on; the ground fills up
    of_beam: np.ndarray  # (k,) whether the element is one of a beam


class System(NamedTuple):
    """Constant data of an assembled system; array fields are read-only by convention."""

    frames: Frames
    bodies: RigidBodies
    coincide: Coincide
    scalar: ScalarConstraints | None
    beams: Beams | None
    reactions: Reactions
    laws: Laws
    forces: Forces
    shown: Shown
    unit: np.ndarray  # (k, 3) multiplier over its unknown, times h^2/2 [kg or kg m]
    multipliers: Multipliers
    decay: Decay  # of the scheme
    relaxation: float  # on the multipliers' diagonal; 0 unless joints are redundant
    blocks: np.ndarray  # (m, 2) row node and column node of each block; block 0 is (0, 0)
    pattern: np.ndarray  # (9 m,) which entries of the blocks are not zero for ever
    constant: np.ndarray  # (9 m,) the part of the Jacobian that never changes


class State(NamedTuple):
    """What one step hands to the next; bodies as (n+1, 3), the ground last."""

    time: np.ndarray  # (1,) [s]
    x: np.ndarray  # mass centre, inertial axes [m]
    x_low: np.ndarray  # the part of x below its last digit (compensated summation) [m]
    p: np.ndarray  # Wiener-Milenkovic parameters
    v: np.ndarray  # of the mass centre, inertial axes [m/s]
    w: np.ndarray  # body axes [rad/s]
    a: np.ndarray  # acceleration of the mass centre over the last step, inertial axes [m/s^2]
    alpha: np.ndarray  # likewise the angular acceleration, inertial axes [rad/s^2]
    force: np.ndarray  # (k, 3) multipliers, by their nodes, over the last step [N or N m]
    a_trend: np.ndarray  # (3, n+1, 3) changes of a from step to step, the last one first
    alpha_trend: np.ndarray  # likewise of alpha
    force_trend: np.ndarray  # (3, k, 3) likewise of force
    mean_v: np.ndarray  # displacement over the last step by its size, inertial axes [m/s]
    mean_w: np.ndarray  # likewise the rotation increment [rad/s]
    prediction: np.ndarray  # (1,) what predicts a step: see ``midpoint.equations``
    violation: np.ndarray  # (k, 3) violation that the last solution left, by increments [m]
    angle: np.ndarray  # (q,) coordinates' values; angles are counted here [m or rad]
    reaction: np.ndarray  # (j, 6) of the joints over the last step, inertial axes [N, N m]
    reaction_trend: np.ndarray  # likewise its change
    work: np.ndarray  # (w,) since t = 0 [J]; a decaying scheme's own last
    v_rise: np.ndarray  # smoothed change of v over a step, of a decaying scheme [m/s]
    w_rise: np.ndarray  # likewise w [rad/s]
    stretch: np.ndarray  # (s,) likewise the springs' coordinates
    auxiliary: np.ndarray  # (n,) auxiliary states of the laws of the motion
    strain: np.ndarray  # (g, 6) of beams at their Gauss points, by increments [-, 1/m]
    strain_rise: np.ndarray  # (g, 6) their smoothed changes, of a decaying scheme
    elongation: np.ndarray  # (c,) of springs in the compliance form, by increments [m or rad]
    held: np.ndarray  # (s,) held values of switches of expressions; the tape's own array


class Tables(NamedTuple):
    """Rows of results: columns of ``system.names`` without the time."""

    states: np.ndarray  # (rows, 12 n)
    reactions: np.ndarray  # (rows, ...) [N, N m, W]
    work: np.ndarray  # (rows, ...) [J]
    accelerations: np.ndarray  # (rows, 6 n) or, if they are not wanted, (rows, 0)
    signals: np.ndarray  # (rows, k) signals, auxiliary states, and loads of actuators
    resultants: np.ndarray  # (rows, 6 g) n and m of beams at their Gauss points [N, N m]


class SystemWorkspace(NamedTuple):
    """What the step's equations need of its start, in inertial axes; made by ``prepare``."""

    frames: FramesWorkspace
    bodies: RigidBodiesWorkspace
    coincide: CoincideWorkspace
    scalar: ScalarWorkspace  # None where the system's is
    beams: BeamsWorkspace  # likewise
    forces: ForcesWorkspace
    reaction_arms: np.ndarray  # (j, 3) from the children's mass centres to the joints [m]


def node_count(system: System) -> int:
    """Number of nodes: two a body (the ground included) and those of the multipliers."""
    return first_multiplier(system.frames) + int(system.multipliers.node.size)


def multiplier_count(system: System) -> int:
    """Number of constraint equations: of joints, and of the rigid strains of beams."""
    rigid = int(np.count_nonzero(system.beams.rigid)) if system.beams else 0
    return 3 * int(system.coincide.a.size) + equation_count(system) + rigid


def coordinate_count(system: System) -> int:
    """Return the number of coordinates."""
    return int(system.scalar.coordinates.kind.size) if system.scalar else 0


def product_count(system: System) -> int:
    """Return the number of scalar products that coordinates are made of."""
    return int(system.scalar.coordinates.products.kind.size) if system.scalar else 0


def equation_count(system: System) -> int:
    """Return the number of scalar constraint equations, without those of coinciding points and of
    open contacts.
    """
    return int(np.count_nonzero(is_active(system.scalar.equations))) if system.scalar else 0


def new_coordinates_workspace(group: Coordinates, nodes: int = 0) -> CoordinatesWorkspace:
    """Return the workspace of coordinates and their products."""
    m, q = group.products.kind.size, group.kind.size
    products = ProductsWorkspace(
        *(np.zeros((m, 3)) for _ in range(5)),
        *(np.zeros(m) for _ in range(2)),
        *(np.zeros((m, 3)) for _ in range(6)),
    )
    return CoordinatesWorkspace(
        products=products,
        value=np.zeros(q),
        change=np.zeros(q),
        weights=np.zeros((q, MOST)),
        slopes=np.zeros((q, MOST)),
        curves=np.zeros((q, MOST, MOST)),
        force=np.zeros((q, 4, 3)),
        slope=np.zeros((q, 4, 3)),
        load=np.zeros(q),
        size=np.zeros(q),
        term_size=np.zeros(nodes),
        partial=np.zeros(1, dtype=bool),
    )


def new_system_workspace(system: System, state: State) -> SystemWorkspace:
    """Return the workspace of a system; violation, stretch, strain and elongation are the state's
    own.
    """
    vectors, matrices = state.x.shape, (*state.x.shape, 3)
    k = system.coincide.a.size
    scalar: Any = system.scalar and ScalarWorkspace(
        coordinates=new_coordinates_workspace(system.scalar.coordinates, node_count(system)),
        rate=np.zeros(system.scalar.coordinates.kind.size),
    )
    beams: Any = system.beams and new_beams_workspace(system.beams, state.strain, state.strain_rise)
    frames = FramesWorkspace(np.zeros(matrices), *(np.zeros(vectors) for _ in range(6)))
    return SystemWorkspace(
        frames=frames,
        bodies=RigidBodiesWorkspace(np.zeros_like(system.bodies.inertia)),
        coincide=CoincideWorkspace(np.zeros((k, 3)), np.zeros((k, 3)), state.violation),
        scalar=scalar,
        beams=beams,
        forces=new_forces_workspace(
            system.forces, frames, scalar, state.reaction, state.stretch, state.elongation
        ),
        reaction_arms=np.zeros((system.reactions.child.size, 3)),
    )


def new_tables(system: System, state: State, rows: int, accelerations: bool = False) -> Tables:
    """Return tables for ``rows`` output times, with those of ``accelerations`` if wanted."""
    states, shown = STATE_SIZE * system.bodies.frame.size, system.shown
    reactions = int(np.where(shown.moment, 6, 3).sum()) + shown.load_equation.size
    reactions += loads_of_contacts(system.forces)
    if system.scalar:
        reactions += int(np.count_nonzero(system.scalar.equations.law[shown.load_equation] >= 0))
    beams = system.beams.column.size if system.beams else 0
    work = state.work.size + energy_columns(system.forces) + beams
    moved = ACCELERATION_SIZE * system.bodies.frame.size if accelerations else 0
    shown_signals = signal_values(system.forces)
    resultants = 6 * system.beams.element.size if system.beams else 0
    widths = (states, reactions, work, moved, shown_signals, resultants)
    return Tables(*(np.zeros((rows, width)) for width in widths))
