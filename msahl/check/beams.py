"""Rules about beams: their elements, sections and nodes."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from msahl.check.bodies import body_findings
from msahl.check.faults import Finding
from msahl.elements.beams.shape import node_stations
from msahl.model import RigidBody
from msahl.model.beams import Beam

MOST_DEGREE = 8
"""Degree of an element; equations of higher ones lose digits and gain no accuracy."""

SYMMETRIC = 1e-9
"""Share of the largest entry by which entries of a compliance across the diagonal may differ, or an
eigenvalue be below zero, in units of its rows and columns."""


def geometry_findings(
    kind: str, sizes: Sequence[float], others: Mapping[str, float]
) -> Iterator[Finding]:
    """Find sizes [m] of a section's shape that are not possible; ``others`` are numbers that must
    be greater than zero as well, by the tags of the deck."""
    if not min(sizes) > 0.0:
        yield Finding("", "a size is not greater than zero; correct it")
    elif kind == "tube" and sizes[1] > sizes[0]:
        yield Finding("thickness", "the wall is thicker than the radius; correct one of them")
    elif kind == "iSection" and 2.0 * sizes[2] >= sizes[1]:
        yield Finding("flange", "two flanges are as high as the section; correct one of them")
    elif kind == "iSection" and sizes[3] >= sizes[0]:
        yield Finding("web", "the web is as thick as the section is wide; correct one of them")
    for tag, value in others.items():
        if not value > 0.0:
            yield Finding(tag, f"it is {value:g}; it must be greater than zero")


def beam_findings(beam: Beam, nodes: Sequence[RigidBody]) -> Iterator[Finding]:
    """Find numbers of a beam that do not fit together, and impossible nodes."""
    count = len(beam.lengths) * beam.degree
    if not 1 <= beam.degree <= MOST_DEGREE:
        yield Finding("degree", f"the degree is {beam.degree}; give 1 to {MOST_DEGREE}")
        return
    if len(beam.nodes) != count + 1 or len(beam.stations) != count + 1:
        message = f"{len(beam.lengths)} elements of degree {beam.degree} have {count + 1} nodes"
        yield Finding("nodes", f"{message}, not {len(beam.nodes)}; correct one of them")
        return
    if len(beam.compliance) != count or len(beam.strain) != count:
        yield Finding("compliance", f"there are {count} Gauss points; give numbers for each")
        return
    if not min(beam.lengths) > 0.0:
        yield Finding("lengths", "an element has no length; give lengths greater than zero")
    elif not np.allclose(
        node_stations(beam.degree, np.array(beam.lengths)), beam.stations, rtol=1e-9, atol=0.0
    ):
        yield Finding("stations", "they are not those of Gauss and Lobatto; leave them to the deck")
    if min(beam.damping) < 0.0:
        yield Finding("damping", "a damping time is less than zero; give zero or more")
    for C in np.unique(np.array(beam.compliance), axis=0):
        yield from _compliance_findings(C)
    for node in nodes:
        found = list(body_findings(node))
        if found:
            message = f"its node '{node.name}' is impossible: {found[0].message}"
            yield Finding("", message)
            return


def _compliance_findings(C: np.ndarray) -> Iterator[Finding]:
    """Find a compliance (6, 6) that is not symmetric, or negative for some load."""
    scale = np.sqrt(np.abs(np.diag(C)))
    scale[scale == 0.0] = 1.0
    C = C / scale / scale[:, None]
    if not np.isfinite(C).all():
        yield Finding("compliance", "it is not finite; give finite numbers")
    elif np.abs(C - C.T).max() > SYMMETRIC or np.linalg.eigvalsh(C).min() < -SYMMETRIC:
        message = "it is not symmetric, or negative for some load"
        yield Finding("compliance", f"{message}; correct the stiffnesses")
