"""The report on a reduction: lines of text."""

import math
from collections.abc import Iterator

import numpy as np

from msahl.reduction.body import ReducedBody
from msahl.reduction.mesh.reduce import MeshSummary
from msahl.reduction.reduce import Reduction

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
MOST_SHOWN = 40
"""Modes that the table has."""


def report(found: Reduction, mesh: MeshSummary | None = None) -> Iterator[str]:
    """Yield the lines of the report; of a mesh, with its volume and errors."""
    body, inertia = found.body, found.body.invariants
    yield f"{found.nodes} nodes, {found.equations} degrees of freedom, {inertia.mass:.9g} kg"
    if mesh is not None:
        elements = ", ".join(f"{count} {kind}" for kind, count in mesh.elements.items())
        yield f"elements: {elements}; volume {mesh.volume:.9g} m^3"
        yield from mesh.notes
    centre = ", ".join(f"{x:.6g}" for x in body.centre)
    moments = ", ".join(f"{x:.6g}" for x in np.linalg.eigvalsh(inertia.inertia))
    yield f"mass centre {centre} m, principal moments of inertia {moments} kg-m^2"
    yield f"interface: {', '.join(_interfaces(found))}"
    yield ""
    yield from _basis(found)
    yield ""
    yield from _table(body, None if mesh is None else mesh.errors)


def _table(body: ReducedBody, mesh: np.ndarray | None) -> Iterator[str]:
    """Yield the frequencies, with the errors of the reduction and of a mesh."""
    yield "mode  frequency [Hz]  too high by" + (
        "" if mesh is None else "  and by the mesh, compared with half the element size"
    )
    rows = zip(body.frequencies, body.frequency_errors, strict=True)
    for k, (frequency, error) in enumerate(rows, 1):
        if k > MOST_SHOWN:
            yield f"   and {len(body.frequencies) - MOST_SHOWN} more"
            break
        shown = _error(error)
        if mesh is not None and math.isfinite(error):
            shown = f"{shown:11s}  {_error(mesh[k - 1])}"
        yield f"{k:4d}  {frequency:14.9g}  {shown}"


def _interfaces(found: Reduction) -> Iterator[str]:
    body = found.body
    for name, rotates in zip(body.interface_names, body.interface_rotates, strict=True):
        yield f"{name} ({6 if rotates else 3})"


def _basis(found: Reduction) -> Iterator[str]:
    """Yield what the shapes are, and what the omitted ones would add."""
    body = found.body
    if math.isnan(body.static_residual):
        yield (f"{found.normal} modes of the file; without the full model no error is known")
    else:
        yield (
            f"{found.static} static and {found.normal} normal modes with the interface "
            f"fixed; residual of the statics {body.static_residual:.1e} of the forces"
        )
        yield f"lowest omitted frequency of these: {_frequency(body.following_frequency)}"
        parts = zip(DIRECTIONS, body.effective_mass, strict=True)
        shown = ", ".join(f"{name} {100.0 * part:.1f} %" for name, part in parts)
        yield f"part of the inner mass that moves in the normal modes: {shown}"
    where = "the free body (mean axes)" if body.frame == "mean" else f"{body.frame} fixed"
    yield f"{len(body.eigenvalues)} modes of {where}, without rigid-body modes"
    yield f"forces of rigid displacements: {found.resistance:.1e} of their terms"
    if body.stiffening is not None:
        yield "geometric stiffening: displacements of second order are in the file"


def _frequency(value: float) -> str:
    return "none" if math.isinf(value) else f"{value:.6g} Hz"


def _error(value: float) -> str:
    if math.isnan(value):
        return "not known"
    return f"{value:.1e}" if math.isfinite(value) else "above the omitted frequency"
