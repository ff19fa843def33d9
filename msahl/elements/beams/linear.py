"""Beams linearised at one configuration, without a step.

    dF     = d(G^T lam)/dq dq + G^T dlam                    forces on the nodes, G = w J d(eps)/dq
    rows   G dq                                             strains, times w J
    rates  w J d(eps')/dq dq + G dv                         with eps' = d(eps)/dt

Rows of rigid strains are constraints; to elastic ones the caller adds damping and w J C dlam.
"""

import numpy as np

from msahl.elements.beams.group import COMPONENTS, Beams, BeamsWorkspace
from msahl.elements.beams.instant import point_at
from msahl.elements.beams.rows import add_equations, multipliers, row_scale
from msahl.elements.beams.stage import add_rate_slopes
from msahl.elements.beams.stiffness import add_stiffness, collect
from msahl.elements.beams.strain import set_tangents
from msahl.formulations.absolute.frames import Frames, FramesWorkspace
from msahl.jit.kernel import optional


@optional()
def add_derivatives(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    at_rest: np.ndarray,
    by_place: np.ndarray,
    rates_by_place: np.ndarray,
) -> None:
    """Add to ``by_place`` the derivatives of the accelerations, at the multipliers by mass in
    ``at_rest``, and of all strains by the places, and to ``rates_by_place`` those of the rates of
    the strains, all scaled as in ``rows``.
    """
    set_tangents(group, start, frames, at_rest)
    for g in range(group.element.size):
        for i in range(COMPONENTS):
            start.factor[g, i] = row_scale(group, g, i)
        here, lam = point_at(start, g), multipliers(group, frames, at_rest, g)
        collect(group, start, g, lam, here)
        add_equations(group, start, g, here, by_place)
        add_rate_slopes(group, start, motion, g, rates_by_place)
    add_stiffness(group, start, frames, 1.0, 1.0, by_place)
