"""A prescribed motion in words: singular positions, checks and verdict, and its ``run.json``."""

from typing import Any

from msahl.analysis.kinematics.prescribed import listed, loaded_elements, moving_bodies
from msahl.analysis.kinematics.singular import Singular
from msahl.analysis.kinematics.solution import Motion
from msahl.run.report import COMPLETED, NOT_CONVERGED, Report
from msahl.run.verdict import (
    DONE,
    FAIL,
    MOST_NAMED,
    PASS,
    VIOLATION,
    WARN,
    Finding,
    Verdict,
    describe_reactions,
)

COMMAND = "kinematics"
SCHEME = "none: positions at each output time by msahl kinematics"
SOLVER = "Newton's method on the constraint equations"
UNCERTAIN = 1e-6
"""Estimated round-off of positions, velocities or accelerations, relative to their largest values,
that warns."""
UNBALANCED = 1e-2
"""Error of the energy balance, relative to the largest kinetic energy, above which the output times
are too few for works by quadrature, so that the energy says nothing of the reactions."""
MOST_SINGULAR = 20
"""Singular positions that are put into words; all are in ``run.json``."""


def describe(found: Motion, position: Singular) -> str:
    """Return a singular position in words."""
    model, equations = found.point.model, found.equations
    bodies = listed(moving_bodies(model, equations, position.motion))
    elements = loaded_elements(model, equations, position.loads)
    motions = [m.name for m in model.motions if m.name in elements]
    others = [name for name in elements if name not in motions]
    cause = f"the motion of {listed(motions)} with " if motions else ""
    joints = f"the joints {listed(others)}" if others else "itself"
    kind = "limit" if position.limit else "singular"
    time = f"t = {position.time:.12g} s (+- {position.uncertainty:.1e} s)"
    return (
        f"{kind} position at {time}: {bodies} can move there though all motions are given, and "
        f"loads of {cause}{joints} can grow without bound"
    )


def message_of(found: Motion, end: float) -> str:
    """Return why a motion does not reach the ``end`` [s]; empty if it does."""
    if found.complete:
        return ""
    limits = [s for s in found.singular if s.limit]
    if limits:
        reason = (
            f"the joints cannot follow the prescribed motions any further: "
            f"{describe(found, limits[-1])}; reduce the motion, or end it before"
        )
    else:
        reason = (
            "Newton's method finds no positions behind the last output time; look for motions that "
            "contradict each other or the joints there"
        )
    return f"{reason}. Results go to t = {found.time:.9g} s of {end:.9g} s"


def warnings_of(found: Motion) -> list[str]:
    """Return what is to be known of a motion: its singular positions."""
    passed = [s for s in found.singular if not s.limit]
    lines = [describe(found, s) for s in passed[:MOST_SINGULAR]]
    if len(passed) > MOST_SINGULAR:
        lines.append(f"and {len(passed) - MOST_SINGULAR} more singular positions; see run.json")
    if found.omitted:
        times = listed([f"{t:.9g}" for t in found.omitted])
        lines.append(f"no row at t = {times} s: the positions there are singular")
    return lines


def verdict_of(found: Motion, end: float) -> Verdict:
    """Return the verdict on a motion, check by check."""
    size, errors = found.equations.size, found.errors
    text = f"{found.rows} output times to t = {found.time:g} s"
    findings = [Finding("completion", PASS if found.complete else FAIL, text)]
    relative = max(
        errors.position / size,
        errors.velocity / max(errors.speed, 1e-300),
        errors.acceleration / max(errors.largest, 1e-300),
    )
    text = (
        f"estimated round-off of positions at most {errors.position:.1e} m, of velocities "
        f"{errors.velocity:.1e} m/s, of accelerations {errors.acceleration:.1e} m/s^2 (condition "
        f"number {errors.condition:.1e})"
    )
    findings.append(Finding("accuracy", PASS if relative <= UNCERTAIN else WARN, text))
    balance = found.energy_error / found.kinetic if found.kinetic > 0.0 else 0.0
    text = (
        f"reactions balance the energy to {found.energy_error:.1e} J, with works by quadrature "
        "over the output times"
    )
    text += "" if balance <= UNBALANCED else "; for work.csv choose more output times"
    findings.append(Finding("energy", PASS if balance <= UNBALANCED else DONE, text))
    text = f"constraint violation at most {found.violation:.1e} m"
    good = found.violation <= VIOLATION * size and found.contradiction <= VIOLATION
    findings.append(Finding("constraintViolation", PASS if good else WARN, text))
    findings.append(_singular_positions(found))
    if found.non_unique:
        named = dict(list(found.non_unique.items())[:MOST_NAMED])
        text = (
            "joints are redundant: the motion is unique, but these reactions are not: "
            f"{describe_reactions(named)}"
        )
        findings.append(Finding("reactions", PASS, text))
    return Verdict(tuple(findings))


def _singular_positions(found: Motion) -> Finding:
    passed = [s for s in found.singular if not s.limit]
    times = listed([f"{s.time:.9g}" for s in passed])
    if not found.singular:
        return Finding("singularPositions", PASS, "no singular position")
    if not passed:
        return Finding("singularPositions", WARN, "the motion ends at a limit position")
    text = f"singular positions at t = {times} s, passed with smooth velocities; see the warnings"
    return Finding("singularPositions", WARN, text)


def report_of(found: Motion, end: float) -> Report:
    """Return the report on a motion, as ``run.json`` has it."""
    model, equations = found.point.model, found.equations
    n, c = equations.coordinate.size, equations.equation.size
    return Report(
        status=COMPLETED if found.complete else NOT_CONVERGED,
        message=message_of(found, end),
        output_times=found.rows,
        time=found.time,
        joints=len(model.joints) + len(model.couplings),
        subsystems=1,
        unknowns=n,
        degrees_of_freedom={"byCount": n - c, "byRank": 0},
        non_unique_reactions=found.non_unique,
        iterations=found.iterations,
        warnings=warnings_of(found),
        extremes={
            "constraintViolationMax": found.violation,
            "largestKineticEnergy": found.kinetic,
            "energyErrorMax": found.energy_error,
            "energyErrorMaxRelative": found.energy_error / found.kinetic if found.kinetic else None,
        },
        verdict=verdict_of(found, end).as_json(),
    )


def kinematics_as_json(found: Motion) -> dict[str, Any]:
    """Return what ``run.json`` has under ``kinematics``."""
    model, equations = found.point.model, found.equations
    return {
        "errorBars": {
            "position": found.errors.position,
            "velocity": found.errors.velocity,
            "acceleration": found.errors.acceleration,
            "conditionNumber": found.errors.condition,
        },
        "steps": found.steps,
        "redundantEquations": found.redundant,
        "omittedTimes": found.omitted,
        "singularPositions": [
            {
                "time": s.time,
                "uncertainty": s.uncertainty,
                "limit": s.limit,
                "bodies": moving_bodies(model, equations, s.motion),
                "elements": loaded_elements(model, equations, s.loads),
            }
            for s in found.singular
        ],
    }
