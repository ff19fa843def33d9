"""Modal files of MBDyn (.fem): shapes at nodes, modal matrices, lumped masses of the nodes.

Record groups: 1 numbers of nodes and modes, 2 labels, 5 to 7 coordinates, 8 shapes, 9 modal mass,
10 modal stiffness, 11 lumped masses, 12 mass of the rigid body, 13 modal damping. Initial values
(3, 4) and MBDyn's own invariants are not needed. Labels that are no numbers count from 1.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy import sparse

from msahl.reduction.craig_bampton import Basis
from msahl.reduction.elastic_model import MOST_EQUATIONS, ElasticModel
from msahl.reduction.faults import ReductionError, shown
from msahl.reduction.modal import ModalModel
from msahl.reduction.text_files import lines_of, natural, not_a_number, real
from msahl.reduction.units import UNITS

_GROUP = re.compile(r"\*\*\s*RECORD GROUP\s+(\d{1,3})\b", re.I)
NAMES = {
    1: "header", 2: "list of nodes", 5: "x coordinates", 6: "y coordinates", 7: "z coordinates",
    8: "mode shapes", 9: "modal mass matrix", 10: "modal stiffness matrix",
    11: "diagonal of the lumped mass matrix", 12: "inertia of the rigid body",
    13: "modal damping matrix",
}  # fmt: skip
NEEDED = (1, 2, 5, 6, 7, 8, 9, 10, 11)
MOST_MODES = 5000
MASS_DIFFERENCE = 1e-3
"""Largest relative difference of the mass of group 12 and that of the nodes: more is no rounding,
but mass that is at other nodes."""


@dataclass(slots=True)
class _Group:
    """The words of a record group, and the line on which it begins."""

    line: int
    words: list[tuple[int, str]] = field(default_factory=list)


def read_fem(path: Path, units: str) -> ModalModel:
    """Return the model of a file, in SI units; raises ``ReductionError``."""
    groups = _groups(path)
    for number in NEEDED:
        if number not in groups:
            raise ReductionError(
                str(path), f"there is no record group {number}, {NAMES[number]}; write it"
            )
    n, k = _counts(path, groups[1])
    labels = _labels(path, groups[2], n)
    places = np.column_stack([_numbers(path, groups, g, n) for g in (5, 6, 7)])
    shapes = _numbers(path, groups, 8, 6 * n * k).reshape(k, 6 * n).T
    mass, stiffness = (_numbers(path, groups, g, k * k).reshape(k, k) for g in (9, 10))
    damping = _numbers(path, groups, 13, k * k).reshape(k, k) if 13 in groups else None
    lumped = _numbers(path, groups, 11, 6 * n)
    _check(path, groups, lumped, mass, stiffness)
    length, unit = UNITS[units]
    spread = np.tile([length] * 3 + [1.0] * 3, n)
    model = ElasticModel(
        str(path),
        labels,
        length * places,
        np.repeat(np.arange(n), 6),
        np.tile(np.arange(6), n),
        sparse.csr_array(sparse.diags_array(unit * lumped * (length / spread) ** 2)),
        sparse.csr_array((6 * n, 6 * n)),
    )
    scale = unit * length**2
    basis = Basis(
        model,
        spread[:, None] * shapes,
        scale * 0.5 * (mass + mass.T),
        scale * 0.5 * (stiffness + stiffness.T),
        None if damping is None else scale * damping,
        0,
    )
    return ModalModel(basis)


def _groups(path: Path) -> dict[int, _Group]:
    groups: dict[int, _Group] = {}
    current = _Group(0)
    for line, text in lines_of(path):
        stripped = text.strip()
        match = _GROUP.match(stripped)
        if match:
            number = int(match[1])
            if number in groups:
                raise ReductionError(str(path), f"record group {number} appears twice", line)
            groups[number] = current = _Group(line)
        elif stripped and not stripped.startswith("**"):
            current.words.extend((line, word) for word in stripped.split())
    return groups


def _counts(path: Path, group: _Group) -> tuple[int, int]:
    """Return the numbers of nodes and of modes: normal, of attachment, of constraint, less those
    rejected."""
    found = [natural(word) for _, word in group.words[1:6]]
    if len(found) < 5 or None in found:
        raise ReductionError(
            str(path), "expected a revision and the numbers of nodes and of normal, attachment, "
            "constraint, rejected modes", group.line,
        )  # fmt: skip
    n, *modes, rejected = (one or 0 for one in found)
    k = sum(modes) - rejected
    if not (0 < n <= MOST_EQUATIONS // 6 and 0 < k <= MOST_MODES):
        raise ReductionError(
            str(path), f"{n} nodes and {k} modes; up to {MOST_EQUATIONS // 6} and {MOST_MODES} are "
            "accepted", group.line,
        )  # fmt: skip
    return n, k


def _labels(path: Path, group: _Group, n: int) -> np.ndarray:
    if len(group.words) != n:
        raise ReductionError(str(path), f"{len(group.words)} nodes, expected {n}", group.line)
    found = [natural(word) for _, word in group.words]
    if None in found:
        return np.arange(1, n + 1)
    return np.array(found, dtype=np.int64)


def _numbers(path: Path, groups: dict[int, _Group], number: int, count: int) -> np.ndarray:
    group = groups[number]
    if len(group.words) != count:
        raise ReductionError(
            str(path), f"record group {number}, {NAMES[number]}: {len(group.words)} numbers of "
            f"{count}", group.line,
        )  # fmt: skip
    values = np.empty(count)
    for k, (line, word) in enumerate(group.words):
        value = real(word)
        if value is None:
            raise not_a_number(path, line, word)
        values[k] = value
    return values


def _check(
    path: Path,
    groups: dict[int, _Group],
    lumped: np.ndarray,
    mass: np.ndarray,
    stiffness: np.ndarray,
) -> None:
    """Raise ``ReductionError`` for masses and matrices that no body has."""
    if (lumped < 0.0).any():
        k = int(np.argmin(lumped))
        raise ReductionError(
            str(path), f"the lumped mass {shown(groups[11].words[k][1])} is negative",
            groups[11].words[k][0],
        )  # fmt: skip
    for number, A in ((9, mass), (10, stiffness)):
        scale = np.abs(A).max(initial=0.0)
        if not np.allclose(A, A.T, rtol=0.0, atol=1e-6 * scale):
            raise ReductionError(
                str(path), f"record group {number}, {NAMES[number]}, is not symmetric",
                groups[number].line,
            )  # fmt: skip
    total = lumped.reshape(-1, 6)[:, 0].sum()
    stated = real(groups[12].words[0][1]) if 12 in groups and groups[12].words else total
    if stated is None or abs(total - stated) > MASS_DIFFERENCE * abs(stated):
        raise ReductionError(
            str(path), f"the nodes have a mass of {total:g}, the body {stated}; write the lumped "
            "masses of all nodes", groups[12].line,
        )  # fmt: skip
