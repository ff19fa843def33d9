"""Describe the accuracy metrics of a run in sentences."""

import numpy as np

from msahl.post.metrics import Constraints, Energy, JointWork

GRADES = (
    (1e-10, "this is rounding error"),
    (1e-6, "this is too small to be seen in a figure"),
    (1e-3, "this is small, but larger than rounding error"),
    (np.inf, "the energy balance is violated; find the cause before you use the results"),
)
"""Largest energy balance error over the largest kinetic energy, and how it is graded. Rounding
errors accumulate over the steps: 1e-10 allows for a million of them."""

SMALL_START = 0.1
"""If |E(1)| is less than this fraction of the largest kinetic energy, a sentence says that the
error over |E(1)| looks larger than it is."""


def describe_energy(energy: Energy) -> str:
    """Say how large the energy balance error is."""
    error, relative = energy.absolute_error.max, energy.error_over_kinetic
    if relative is None:
        return f"No body moves, but the energy balance error reaches {error:.1e} J."
    # Not "greater": a NaN is not a rounding error.
    grade = next((words for limit, words in GRADES if relative.max <= limit), GRADES[-1][1])
    return (
        f"The largest energy balance error is {error:.1e} J, which is {relative.max:.1e} of the "
        f"largest kinetic energy ({energy.largest_kinetic:.4g} J): {grade}."
    )


def describe_start(energy: Energy) -> str:
    """Say why the error over |E(1)| is undefined or misleading; empty if it is neither."""
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


DISCRETISATION = (
    " It is a discretisation error: with the scheme of order 2 it falls with the square of the "
    "step size."
)


def describe_constraints(found: Constraints, integrated: bool = True) -> list[str]:
    """Say how large the constraint violations are at position level and at velocity level, of
    motions that were ``integrated`` or computed at each time.
    """
    position = [part for part in (_violation(found, 0, "m"), _violation(found, 1, "rad")) if part]
    velocity = [part for part in (_rate(found, 0, "m/s"), _rate(found, 1, "rad/s")) if part]
    sentences = []
    if position:
        sentences.append(
            f"The largest constraint violation at position level is {' and '.join(position)}."
        )
    if velocity:
        sentences.append(
            "The largest constraint violation at velocity level, at the output times, is "
            f"{' and '.join(velocity)}.{DISCRETISATION if integrated else ''}"
        )
    return sentences


def _violation(found: Constraints, kind: int, unit: str) -> str:
    """Return the largest violation of one ``kind`` and its element; empty if there is none."""
    violation = found.violation[:, :, kind]
    if np.isnan(violation).all():
        return ""
    largest = np.nanmax(violation)
    name = found.names[int(np.nanargmax(violation) % len(found.names))]
    part = f", {largest / found.length:.1e} of the longest arm" if unit == "m" else ""
    return f"{largest:.1e} {unit} (at {name}{part})"


def _rate(found: Constraints, kind: int, unit: str) -> str:
    """Return the largest violation rate of one ``kind``; empty if there is none."""
    rate = found.rate[:, :, kind]
    if np.isnan(rate).all():
        return ""
    largest = np.nanmax(rate)
    compared = unit == "m/s" and found.speed
    part = f" ({largest / found.speed:.1e} of the largest speed)" if compared else ""
    return f"{largest:.1e} {unit}{part}"


def describe_work(work: JointWork | None, energy: Energy) -> str:
    """Say how much work the joints do; empty without joints or if not every step was written."""
    if work is None or not work.reaction.size:
        return ""
    most = float(np.abs(work.reaction).max())
    size = energy.largest_kinetic
    part = f", {most / size:.1e} of the largest kinetic energy" if size else ""
    return f"The reaction of a joint does at most {most:.1e} J of work over a step{part}."
