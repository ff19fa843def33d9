"""What the figures of a run say, in sentences."""

import numpy as np

from msahl.post.metrics import Constraints, Energy, JointWork

GRADES = (
    (1e-10, "that is round-off"),
    (1e-6, "far below what a picture shows"),
    (1e-3, "small, but more than round-off"),
    (np.inf, "the balance is not kept: look for the reason before using the numbers"),
)
"""Errors over the largest kinetic energy up to which a grade is given. Round-off gathers over the
steps: 1e-10 leaves room for a million of them."""

SMALL_START = 0.1
"""E(1) below this part of the largest kinetic energy makes the error over it look bad."""


def energy_verdict(energy: Energy) -> str:
    """How well the energy balance is kept."""
    error, relative = energy.absolute_error.max, energy.error_over_kinetic
    if relative is None:
        return f"Nothing moves; yet the energy balance is off by up to {error:.1e} J."
    # Not "greater": an error that is no number is not round-off.
    grade = next((words for limit, words in GRADES if relative.max <= limit), GRADES[-1][1])
    return (
        f"Energy is kept to {relative.max:.1e} of the largest kinetic energy "
        f"({error:.1e} J of {energy.largest_kinetic:.4g} J): {grade}."
    )


def start_verdict(energy: Energy) -> str:
    """What E(1) does to the error over it; empty if it does no harm."""
    if energy.first is None:
        return (
            "The energy at the start, E(1), is zero: the error over |E(1)| (Hainge, eq. 3.11) is "
            "undefined."
        )
    if energy.first < SMALL_START * energy.largest_kinetic:
        part = energy.first / energy.largest_kinetic
        return (
            f"The energy at the start, E(1), is only {part:.1e} of the largest kinetic energy: the "
            "error over |E(1)| (Hainge, eq. 3.11) looks larger than it is."
        )
    return ""


def constraints_verdict(found: Constraints) -> list[str]:
    """How well joints, couplings and motions are kept, and how fast they part."""
    closed = [part for part in (_closed(found, 0, "m"), _closed(found, 1, "rad")) if part]
    parting = [part for part in (_parting(found, 0, "m/s"), _parting(found, 1, "rad/s")) if part]
    sentences = [f"The joints stay closed to {' and '.join(closed)}."] if closed else []
    if parting:
        sentences.append(
            f"At the rows they part at up to {' and '.join(parting)}. This belongs to the size of "
            "the step and falls with its square."
        )
    return sentences


def _closed(found: Constraints, kind: int, unit: str) -> str:
    """Widest gap of one ``kind`` and whose it is; empty if no element has such gaps."""
    violation = found.violation[:, :, kind]
    if np.isnan(violation).all():
        return ""
    widest = np.nanmax(violation)
    name = found.names[int(np.nanargmax(violation) % len(found.names))]
    part = f", {widest / found.length:.1e} of the longest arm" if unit == "m" else ""
    return f"{widest:.1e} {unit} (the widest: {name}{part})"


def _parting(found: Constraints, kind: int, unit: str) -> str:
    rate = found.rate[:, :, kind]
    if np.isnan(rate).all():
        return ""
    fastest = np.nanmax(rate)
    compared = unit == "m/s" and found.speed
    part = f" ({fastest / found.speed:.1e} of the largest speed)" if compared else ""
    return f"{fastest:.1e} {unit}{part}"


def work_verdict(work: JointWork | None, energy: Energy) -> str:
    """Whether the joints do work; empty without joints or without every step's row."""
    if work is None or not work.sharp.size:
        return ""
    most = float(np.abs(work.sharp).max())
    size = energy.largest_kinetic
    part = f", {most / size:.1e} of the largest kinetic energy" if size else ""
    return f"No joint does more than {most:.1e} J of work over any step{part}."
