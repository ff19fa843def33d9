"""The verdict on the loads of inverse dynamics: whether they produce the motion, and how well."""

from collections.abc import Iterator

import numpy as np

from msahl.analysis.inverse.run_tables import integrated, powers
from msahl.analysis.inverse.solution import Solution
from msahl.joints.coordinates import ORIENTATION
from msahl.run.verdict import FAIL, PASS, WARN, Finding, Verdict, describe_reactions

ROUND_OFF = 1e-9
"""Missing force, over the largest of the balance, that is round-off."""
MISSING_FAIL = 0.01
"""Likewise, beyond its error bar, that fails."""
MISFIT, MISFIT_FAIL = 1e-6, 0.01
"""Misfit of given values, over the size of the model, that warns, and fails."""
ERROR, ERROR_FAIL = 0.01, 0.3
"""Error bar that warns, and fails, over the largest load of the same unit or, if that is larger,
the largest force of the balance, for torques times the size of the model."""
MOST_NAMED = 8


def verdict(solution: Solution) -> Verdict:
    """Return how good the loads are, and whether they produce the motion."""
    return Verdict((
        _produced(solution),
        *_unique(solution),
        _misfit(solution),
        *_errors(solution),
        *_energy(solution),
        *_reactions(solution),
    ))  # fmt: skip


def _produced(solution: Solution) -> Finding:
    """Whether the drives produce the motion."""
    rows, lacking = solution.rows, solution.degrees_of_freedom - solution.rank
    if lacking <= 0:
        text = f"the drives produce the motion: they act on all {solution.rank} degrees of freedom"
        if not solution.degrees_of_freedom:
            text = "there is no degree of freedom: the motion is that of prescribed motions"
        elif solution.rank == 1:
            text = "the drives produce the motion: they act on the only degree of freedom"
        return Finding("produced", PASS, text)
    at = int(np.argmax(rows.missing))
    missing, largest = float(rows.missing[at]), float(rows.largest.max())
    beyond = missing - float(rows.missing_error[at])
    share = missing / largest if largest else 0.0
    named = ", ".join(solution.undriven[:MOST_NAMED])
    text = (
        f"the drives act on {solution.rank} of {solution.degrees_of_freedom} degrees of freedom, "
        f"and not on some motions of {named}; the largest force that no drive produces is "
        f"{missing:.3g} N ({share:.1e} of the largest) at {solution.motion.time[at]:.4g} s, error "
        f"bar {rows.missing_error[at]:.1e} N"
    )
    if beyond <= ROUND_OFF * largest:
        return Finding("produced", PASS, f"{text}: the motion follows from the loads")
    word = FAIL if beyond > MISSING_FAIL * largest else WARN
    advice = ": this part of the motion cannot be produced; name more drives with --loads"
    return Finding("produced", word, text + advice)


def _unique(solution: Solution) -> Iterator[Finding]:
    """Which loads are unique."""
    if solution.unique.all():
        return
    shared = [d.name for d, own in zip(solution.drives, solution.unique, strict=True) if not own]
    more = len(solution.drives) - solution.rank
    weighted = " times their weights" if np.any(solution.weights != 1.0) else ""
    text = (
        f"the loads of {', '.join(shared[:MOST_NAMED])} are not unique: {more} more "
        f"drive{'s' if more > 1 else ''} than needed; of all loads that produce the motion these "
        f"have the least sum of squares{weighted} [N, N m]"
    )
    yield Finding("uniqueLoads", PASS, text)


def _misfit(solution: Solution) -> Finding:
    """How far given values contradict the joints or each other."""
    misfit = np.abs(solution.rows.misfit)
    row, column = np.unravel_index(int(np.argmax(misfit)), misfit.shape)
    largest, size = float(misfit[row, column]), solution.size
    share = largest / size
    names = [t.name for t in solution.motion.tracks for _ in range(_width(t.coordinate))]
    redundant = misfit.shape[1] - solution.degrees_of_freedom
    text = f"the given values are met to {largest:.1e} m"
    if redundant > 0:
        text += f" ({redundant} more than needed, by least squares)"
    if share > MISFIT:
        text += (
            f", worst {names[column]} at {solution.motion.time[row]:.4g} s: they contradict the "
            "joints or each other"
        )
        kept = ", ".join(motion.name for motion in solution.driven.motions[:MOST_NAMED])
        text += f", or the prescribed motions that --loads does not name: {kept}" if kept else ""
    word = PASS if share <= MISFIT else WARN if share <= MISFIT_FAIL else FAIL
    return Finding("misfit", word, text)


def _width(coordinate: str) -> int:
    return 3 if coordinate == ORIENTATION else 1


def _errors(solution: Solution) -> Iterator[Finding]:
    """How large the error bars are, by the unit of the load."""
    for rotates in (False, True):
        chosen = [k for k, drive in enumerate(solution.drives) if drive.rotates == rotates]
        if not chosen:
            continue
        unit = solution.drives[chosen[0]].unit
        error = solution.rows.error[:, chosen].max(axis=1)
        load = float(np.abs(solution.rows.loads[:, chosen]).max())
        # Loads that are differences of larger forces are as accurate as these.
        force = float(solution.rows.largest.max()) * (solution.size if rotates else 1.0)
        at, scale = int(np.argmax(error)), max(load, force)
        share = float(error[at]) / scale if scale else 0.0
        by = "the largest load" if load >= force else "the largest force of the balance"
        text = (
            f"error bars at most {error[at]:.1e} {unit} ({share:.1e} of {by}), at "
            f"{solution.motion.time[at]:.4g} s; by other splines{_other_errors(solution)}"
        )
        word = PASS if share <= ERROR else WARN if share <= ERROR_FAIL else FAIL
        if word != PASS:
            text += "; give rates, more rows, or --smooth if the table is noisy"
            if solution.motion.error is not None:
                text += ", or run the deck with smaller steps"
        elif _lacks_run_error(solution):
            word = WARN
        yield Finding("errorMoments" if rotates else "errorForces", word, text)


def _lacks_run_error(solution: Solution) -> bool:
    """Return whether the motion is that of a run, whose error is unknown, by splines."""
    motion = solution.motion
    unknown = motion.error is not None and not motion.error.is_known
    return unknown and not solution.companion and not motion.has_accelerations


def _other_errors(solution: Solution) -> str:
    """Return which errors the error bars contain besides those of splines, and which not."""
    error = solution.motion.error
    if solution.companion:
        return f" and the table {solution.companion}"
    if error is None:
        return "; smooth errors of the table itself are not in them (--companion)"
    if error.is_known:
        return " and the estimated error of the run"
    remedy = "run it with --error, or with --accelerations yes, or give a --companion"
    return f"; the error of the run was not estimated and is not in them: {remedy}"


def _energy(solution: Solution) -> Iterator[Finding]:
    """How well the work of all loads agrees with the change of the energy: reported only."""
    if solution.rank < solution.degrees_of_freedom:
        return
    time = solution.motion.time
    both = (solution.rows.power, powers(solution))
    work = sum(integrated(time, part).sum(axis=1) for part in both)
    change = solution.rows.energy - solution.rows.energy[0]
    left = float(np.abs(work - change).max())
    text = f"work of all loads less change of the energy: at most {left:.1e} J"
    scale = max(float(np.abs(work).max()), float(np.ptp(solution.rows.energy)))
    if scale > 0.0:
        text += f", {left / scale:.1e} of the largest"
    yield Finding("energyBalance", PASS, text)


def _reactions(solution: Solution) -> Iterator[Finding]:
    """Which reactions are not unique."""
    found = solution.non_unique_reactions
    if found:
        named = describe_reactions(dict(list(found.items())[:MOST_NAMED]))
        more = len(found) - MOST_NAMED
        text = f"these reactions are not unique: {named}"
        text += f"; and those of {more} more" if more > 0 else ""
        yield Finding("reactions", PASS, text)
