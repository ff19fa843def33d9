"""Records of beams, in SI units.

A beam is a chain of elements of degree p. An element has p + 1 nodes at the Gauss-Lobatto points of
its arc length, of which neighbours share those at their ends, and p Gauss points, where strains are
measured. Every node is a rigid body of the model, with the axes d_1 (along the line), d_2 and d_3;
its reference point B lies on the beam's reference line. So joints, loads and markers attach to it.

Strains are those of Reissner's and Simo's beam, in the axes d_i, less those of the unstressed beam:

    Gamma_1   stretch                     kappa_1   torsion
    Gamma_2, Gamma_3   shears             kappa_2, kappa_3   bendings about d_2, d_3   [1/m]
"""

from msahl.algebra.vector import Vector
from msahl.records import record

HIGHEST_DEGREE = 8
"""Of elements, as the schema of decks has it."""
STRAINS = 6
"""Components of strain, and of the stress resultants n (forces) and m (moments): Gamma, kappa."""

Six = tuple[float, float, float, float, float, float]
Compliance = tuple[Six, Six, Six, Six, Six, Six]


@record
class Beam:
    """A beam through the rigid bodies ``nodes``, named in their order along it.

    ``degree`` p of its elements, of which there are as many as ``lengths`` [m], of their arcs;
    ``stations`` arc length [m] of each node. For each Gauss point, element by element:
    ``compliance``, strain by stress resultant, symmetric, where a row and column of zeros is a
    strain that cannot change; ``strain``, that of the unstressed beam, as the interpolation of its
    nodes has it (1, 0, 0 and curvatures, nearly). ``damping`` [s]: times tau of Kelvin and Voigt,
    by component: strain + tau d(strain)/dt is the compliance times the resultants.
    """

    name: str
    degree: int
    nodes: tuple[str, ...]
    lengths: tuple[float, ...]
    stations: tuple[float, ...]
    compliance: tuple[Compliance, ...]
    strain: tuple[Six, ...]
    damping: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def is_damped(beam: Beam) -> bool:
    """Return whether a beam takes energy, which a column of the table of work has."""
    return any(beam.damping)


@record
class Section:
    """A cross-section: its compliance, and its mass by length.

    ``compliance``: see ``Beam``, [1/N, 1/(N m), 1/(N m^2)]; ``mass`` [kg/m]; ``inertia`` [kg m] by
    length about the mass centre, axes d_i; ``center`` [m], the mass centre from the reference line,
    axes d_i.
    """

    compliance: Compliance
    mass: float
    inertia: tuple[Vector, Vector, Vector]
    center: Vector = (0.0, 0.0, 0.0)
