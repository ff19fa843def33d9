"""Rules about rigid bodies: the mass is positive and the tensor of inertia is possible."""

from collections.abc import Iterator

import numpy as np

from msahl.algebra.many import apart
from msahl.algebra.vector import Matrix
from msahl.check.faults import LARGEST, Finding
from msahl.check.possible_inertia import nearest_possible
from msahl.model import RigidBody

TRIANGLE = 1e-9
"""Share of the largest entry by which a principal moment may exceed the sum of the other two. Flat
plates and thin rods reach the sum exactly, but for rounding."""

POSITIVE = 1e-12
"""A principal moment below this share of the largest entry counts as zero."""

TENSOR = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")
ENTRIES = ((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2))
"""Names of the entries of a tensor, and their places."""

SYMMETRIC = 1e-9
"""Share of the largest entry by which entries across the diagonal may differ."""


def body_findings(body: RigidBody, scale: float | None = None) -> Iterator[Finding]:
    """Find an impossible mass or inertia.

    ``scale`` is the largest entry of the tensor as it was given, about whatever point, since the
    tensor has the rounding errors of that entry.
    """
    if not body.mass > 0.0:
        message = f"the mass is {body.mass:g} kg; it must be greater than zero"
        yield Finding("mass", message)
    complaint = apart(impossible, body.inertia, scale)
    if complaint:
        yield Finding("inertia", complaint + _nearest(body))


def _nearest(body: RigidBody) -> str:
    """Return the nearest possible tensor, in words."""
    J = np.array(body.inertia)
    if not (np.isfinite(J).all() and np.abs(J).max() <= LARGEST and body.mass > 0.0):
        return ""
    J = nearest_possible(J, body.mass)
    entries = zip(TENSOR, J[ENTRIES], strict=True)
    words = ", ".join(f"{name} {value:.6g}" for name, value in entries)
    return f"; the nearest possible tensor about G has {words} kg-m^2 (msahl check --repair)"


def _is_plainly_possible(J: Matrix, scale: float | None) -> bool:
    """Return whether a diagonal tensor is possible: its principal moments need no eigenvalues."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = J
    if xy or xz or yx or yz or zx or zy:
        return False
    smallest, middle, largest = sorted((xx, yy, zz))
    scale = largest if scale is None else scale
    return smallest > POSITIVE * scale and largest <= smallest + middle + TRIANGLE * scale


def plainly_possible(mass: np.ndarray, J: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return which of many bodies have no findings beyond doubt, (n,) bool: those far from all
    limits. ``mass`` (n,), ``J`` (n, 3, 3), ``scale`` (n,) as in ``body_findings``."""
    finite = np.isfinite(J).all(axis=(1, 2))
    smallest, middle, largest = np.linalg.eigvalsh(np.where(finite[:, None, None], J, 0.0)).T
    margin = smallest + middle - largest > -0.5 * TRIANGLE * scale
    return (mass > 0.0) & finite & (smallest > 1e-6 * scale) & margin


def impossible(J: Matrix, scale: float | None = None) -> str:
    """Return why no body has the inertia tensor ``J`` about its mass centre; "" if one can."""
    if _is_plainly_possible(J, scale):
        return ""
    entries = np.array(J)
    scale = float(np.abs(entries).max()) if scale is None else scale
    if np.abs(entries - entries.T).max() > SYMMETRIC * scale:
        return "the tensor is not symmetric; give Ixy, Ixz and Iyz the same value twice"
    smallest, middle, largest = np.linalg.eigvalsh(J).tolist()
    moments = f"principal moments about G {smallest:.6g}, {middle:.6g}, {largest:.6g} kg-m^2"
    if smallest <= POSITIVE * scale:
        return f"{moments}: all must be greater than zero; give a small one in place of zero"
    if largest > smallest + middle + TRIANGLE * scale:
        return f"{moments}: none may exceed the sum of the other two; check entries and units"
    return ""
