"""Arrays of all beams of a system.

Multipliers of a Gauss point are those of its six strains, in two nodes of three: lam = -n [N] and
lam = -m [N m], the opposite of the stress resultants, because constraint forces are G^T lam. Their
unknowns are lam dt2/mass and lam dt2/(mass length). Equations are multiplied by w J, those of kappa
by a length as well, so that all are lengths.
"""

from typing import NamedTuple

import numpy as np

COMPONENTS = 6
"""Strains and stress resultants at a Gauss point."""
U_STRETCH, Q_STRETCH, Q_BEND, STRETCH_U, STRETCH_Q, BEND_Q = range(6)
"""Blocks of a node and the multipliers of a Gauss point: row and column."""
U_BY_Q, Q_BY_U, Q_BY_Q = range(3)
"""Blocks of two nodes of an element."""


class Plane(NamedTuple):
    """The plane of beams, and what their strains are in it."""

    axes: np.ndarray  # (3,) inertial axes i, j in the plane and k along its normal, cyclic
    shear: np.ndarray  # (g,) number of the strain Gamma_s: 1 or 2
    bend: np.ndarray  # (g,) number of the strain kappa_n: 5 or 4
    shear_sign: np.ndarray  # (g,) c
    bend_sign: np.ndarray  # (g,) b


class Beams(NamedTuple):
    """All beams: nodes, elements, Gauss points."""

    frame: np.ndarray  # (m,) of each node
    arm: np.ndarray  # (m, 3) reference line from the node's mass centre, its axes [m]
    first: np.ndarray  # (e + 1,) place in ``node`` of the first node of each element
    node: np.ndarray  # (.,) nodes of the elements
    element: np.ndarray  # (g,) element of each Gauss point
    value: np.ndarray  # (g, P) shape functions of the element's nodes
    slope: np.ndarray  # (g, P) their derivatives by arc length [1/m]
    weight: np.ndarray  # (g,) w J [m]
    reference: np.ndarray  # (g, 6) strains of the unstressed beam [-, 1/m]
    compliance: np.ndarray  # (g, 6, 6) C
    stiffness: np.ndarray  # (g, 6, 6) inverse of C; zero for rigid components
    rigid: np.ndarray  # (g, 6) whether a component's row of C is zero
    damping: np.ndarray  # (g, 6) tau [s]
    place: np.ndarray  # (g,) which of the multipliers' nodes has lam = -n; the next has -m
    mass: np.ndarray  # (g,) that scales the multipliers [kg]
    length: np.ndarray  # (g,) likewise those of kappa [m]
    load_block: np.ndarray  # (g, P, 6) starts of the blocks of nodes and multipliers
    pair_block: np.ndarray  # (e, P, P, 3) of two nodes
    compliance_block: np.ndarray  # (g, 2, 2) of the multipliers' own
    beam: np.ndarray  # (g,) number of the beam
    column: np.ndarray  # (b,) of the table of work, of each beam; -1 without damping
    plane: Plane | None  # in which all of them stay, if there is one


class BeamsWorkspace(NamedTuple):
    """Configuration at the start of the step, inertial axes, and what the step changes of it.

    Rows of (3, 3) arrays are the directors d_i. ``strain`` and ``rise`` are the state's own arrays.
    """

    d: np.ndarray  # (m, 3, 3) of the nodes
    arm: np.ndarray  # (m, 3) [m]
    r_slope: np.ndarray  # (g, 3) r' at the Gauss points
    director: np.ndarray  # (g, 3, 3) d_i there
    d_slope: np.ndarray  # (g, 3, 3) d_i' [1/m]
    d_change: np.ndarray  # (m, 3, 3) changes over the step
    arm_change: np.ndarray  # (m, 3) [m]
    moved: np.ndarray  # (m, 3) displacements of the reference line at the nodes [m]
    tangent: np.ndarray  # (m, 3, 3) rotation at the end of the step by the unknown l Q [1/m]
    lam: np.ndarray  # (g, 6) multipliers [N, N m], for the stiffness
    load: np.ndarray  # (., 3, 3) g_i of the nodes of the elements, likewise (``stiffness``)
    force: np.ndarray  # (., 3) and their f
    change: np.ndarray  # (g, 6) changes of the strains over the step
    factor: np.ndarray  # (g, 6) of the equations in the derivatives
    strain: np.ndarray  # (g, 6) at the start of the step, less the reference
    rise: np.ndarray  # (g, 6) smoothed changes of the strains, of a decaying scheme


def new_workspace(group: Beams, strain: np.ndarray, rise: np.ndarray) -> BeamsWorkspace:
    """Return the workspace of ``group``; ``strain`` and ``rise`` (g, 6) are those of the state."""
    m, g = group.frame.size, group.element.size
    return BeamsWorkspace(
        d=np.zeros((m, 3, 3)),
        arm=np.zeros((m, 3)),
        r_slope=np.zeros((g, 3)),
        director=np.zeros((g, 3, 3)),
        d_slope=np.zeros((g, 3, 3)),
        d_change=np.zeros((m, 3, 3)),
        arm_change=np.zeros((m, 3)),
        moved=np.zeros((m, 3)),
        tangent=np.zeros((m, 3, 3)),
        lam=np.zeros((g, COMPONENTS)),
        load=np.zeros((group.node.size, 3, 3)),
        force=np.zeros((group.node.size, 3)),
        change=np.zeros((g, COMPONENTS)),
        factor=np.zeros((g, COMPONENTS)),
        strain=strain,
        rise=rise,
    )
