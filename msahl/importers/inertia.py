"""The inertia doctor: which links have an inertia that no body has, and the nearest possible one.

A link's inertia is impossible if a principal moment is not positive or exceeds the sum of the other
two; it is doubtful if its largest radius of gyration

    k = sqrt(max s_i / m) ,    s_i second moments,

is larger than the distance of the farthest point of its shapes from its mass centre, which no body
within them can have, or a small part of it. Where a shape is a closed mesh, the solid of it is
compared.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from msahl.check.bodies import impossible
from msahl.check.possible_inertia import nearest_possible, second_moments
from msahl.deck.faults import Element
from msahl.importers.meshes import MeshFiles
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log
from msahl.importers.robot import Inertia, Link, Look
from msahl.importers.solids import extent, solid_of

if TYPE_CHECKING:
    from msahl.algebra.vector import Matrix

SMALL = 0.02
"""Share of the farthest distance below which a radius of gyration is doubtful: that of a solid ball
is 0.45, of a solid rod 0.58, both by the second moment along one axis."""
ROUNDED = 1.01
"""Factor on the farthest distance that a radius of gyration may have: files are rounded."""
REPAIR = "--repair takes the nearest possible one"


def checked(
    given: Inertia,
    link: Link,
    element: Element,
    options: ImportOptions,
    meshes: MeshFiles,
    log: Log,
) -> Inertia:
    """Return the inertia of a link, repaired if that is wanted and necessary; what is wrong with it
    is noted at ``element``."""
    if given.mass < 0.0:
        log.fault(element, f"the mass is {given.mass:g} kg; it must not be negative")
        return given
    if given.mass == 0.0:
        if given.J.any():
            log.doubtful(element, "a tensor without mass; it counts as it stands")
        return given
    complaint = impossible(matrix(given.J))
    if complaint:
        solid = solid_of(link.looks, meshes, given.mass)
        return _repaired(given, complaint, solid, element, options, log)
    words = doubt(given, link.looks, meshes)
    if words:
        log.doubtful(element, words)
    return given


def doubt(given: Inertia, looks: Sequence[Look], meshes: MeshFiles) -> str:
    """Return why the inertia of a body with these shapes is doubtful; "" if it is not."""
    farthest = extent(looks, meshes, given.c)
    k = float(np.sqrt(max(second_moments(given.J).max(), 0.0) / given.mass))
    if not farthest or SMALL * farthest <= k <= ROUNDED * farthest:
        return ""
    solid = _of_solid(solid_of(looks, meshes, given.mass))
    end = f"the {farthest:.4g} m from its mass centre to the end of its shapes"
    how = "more than" if k > farthest else f"{k / farthest:.2g} of"
    return f"radius of gyration {k:.4g} m, {how} {end}{solid}; check the units"


def _repaired(
    given: Inertia,
    complaint: str,
    solid: Inertia | None,
    element: Element,
    options: ImportOptions,
    log: Log,
) -> Inertia:
    """Return the nearest possible inertia if repair is wanted, and note what was wrong."""
    nearest = nearest_possible(given.J, given.mass)
    what = complaint.partition(": ")[0] if ": " in complaint else complaint.partition(";")[0]
    rule = complaint.partition(": ")[2].partition(";")[0]
    moments = ", ".join(f"{m:.6g}" for m in np.linalg.eigvalsh(nearest))
    remedy = "replaced by the nearest possible one" if options.repair else REPAIR
    words = ": ".join(filter(None, (what, rule)))
    log.doubtful(element, f"{words}; {remedy}: {moments} kg-m^2{_of_solid(solid)}")
    return given._replace(J=nearest) if options.repair else given


def _of_solid(solid: Inertia | None) -> str:
    """Return the principal moments of the solid of the meshes, in words."""
    if solid is None:
        return ""
    moments = ", ".join(f"{m:.6g}" for m in np.linalg.eigvalsh(solid.J))
    return f" (a solid of its mesh: {moments} kg-m^2)"


def matrix(J: np.ndarray) -> "Matrix":
    """Return a tensor as a record has it, exactly symmetric."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (0.5 * (J + J.T)).tolist()
    return ((xx, xy, xz), (yx, yy, yz), (zx, zy, zz))
