"""Every deck against its reference: docs/validation/closed-forms.md.

python -m tools.validation.closed_forms
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from msahl.deck import read_deck
from msahl.model import Model
from msahl.model.scheme import ORDER_TWO
from msahl.post.document import Block, Heading, Items, Paragraph
from msahl.post.table import Cell, Column, Table
from msahl.results.read import ResultError
from msahl.study.dynamics import Dynamics
from msahl.study.errors import METRICS, state_errors
from msahl.study.independent import solve
from msahl.study.plan import Plan
from msahl.study.runs import with_step
from msahl.study.study import Study, study
from tests.support.closed_forms import recognise
from tools.validation.generated import write_generated
from tools.validation.thesis_runs import OUT, ROOT

LONGEST = 10.0
"""Longest duration of a run [s], within which chaotic motions have a reference."""
STEPS = (0.1, 0.04, 0.01, 0.004, 0.002, 0.001, 0.0004)
"""Hainge's sample rates (2010, table 4.2) and two finer [s]."""
SHORT = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125)
"""Step sizes, as multiples of the deck's, if fewer than five of ``STEPS`` give ``COARSE`` steps."""
COARSE = 20
TRUE = [metric for metric in METRICS if metric.needs_reference]


@dataclass(frozen=True)
class Result:
    """A deck and its study."""

    name: str
    model: Model
    exact: bool
    study: Study


def main() -> None:
    """Study all decks and write the page."""
    # Extreme models, which have no independent solution everywhere, have a page of their own.
    paths = [path for path in (ROOT / "decks").rglob("*.xml") if path.parent.name != "extreme"]
    results = list(study_all(sorted(paths)))
    write_generated(OUT / "closed-forms.md", "tools.validation.closed_forms", build(results))


def study_all(paths: list[Path]) -> Iterator[Result]:
    """Yield the studies of all decks."""
    for path in paths:
        model = read_deck(path)
        simulation = model.simulation
        model = with_step(model, simulation.dt, min(simulation.t_final, LONGEST))
        exact = recognise(model)
        print(path.stem, flush=True)
        try:
            plan = Plan(model, steps_for(model), tuple(ORDER_TWO), repeats=1)
            result = study(plan, reference=exact)
        except ResultError as error:
            print(f"  skipped: {error}", flush=True)
            continue
        yield Result(path.stem, model, exact is not None, result)


def steps_for(model: Model) -> tuple[float, ...]:
    """Return the step sizes for a model."""
    t_final = model.simulation.t_final
    listed = tuple(dt for dt in STEPS if COARSE * dt <= t_final * (1.0 + 1e-9))
    return listed if len(listed) >= 5 else tuple(f * model.simulation.dt for f in SHORT)


def build(results: list[Result]) -> list[Block]:
    """Return the blocks of the page."""
    closed = [result for result in results if result.exact]
    return [
        Heading(1, "Closed forms and independent solutions"),
        Paragraph(
            "Every deck except the extreme ones, run at a list of step sizes and compared with a "
            "closed form if there is one, else with an independent solution of the equations of "
            "motion (DOP853, constraint violation removed at every step), over at most "
            f"{LONGEST:g} s. msahl study writes a report on a single deck."
        ),
        Heading(2, "Differences of closed forms and independent solutions"),
        Paragraph(
            "Two solutions that have only the deck in common: elliptic functions, and scipy's "
            "integration of the accelerations. The table shows the largest difference at 201 times."
        ),
        agreement_table(closed),
        Heading(2, "Observed orders"),
        Paragraph(
            "In theory all orders are 2. They are fitted to the largest errors at the output "
            "times; a cell is empty if the error is rounding error at every step size, or the "
            "model lacks it."
        ),
        order_table(results),
        Items(remarks(results)),
        Heading(2, "Largest errors at the smallest step size"),
        finest_table(results),
    ]


def agreement_table(closed: list[Result]) -> Table:
    """Return a table of differences of closed form and independent solution."""
    columns = (
        Column("deck", "deck"),
        Column("form", "closed form"),
        Column("position", "position [m]", form=".1e"),
        Column("orientation", "orientation [rad]", form=".1e"),
        Column("velocity", "velocity [m/s]", form=".1e"),
        Column("angular_velocity", "angular velocity [rad/s]", form=".1e"),
        Column("force", "reaction [N]", form=".1e", missing=""),
    )
    return Table(columns, tuple(_agreement_row(result) for result in closed))


def _agreement_row(result: Result) -> tuple[Cell, ...]:
    exact = recognise(result.model)
    assert exact is not None
    times = np.linspace(0.0, result.model.simulation.t_final, 201)
    dynamics = Dynamics(result.model)
    table = dynamics.publish(solve(dynamics, times, 1e-13))
    errors = state_errors(table, exact.states(times))
    forces = np.abs(dynamics.forces(times, table) - exact.forces(times))
    forms = "; ".join(sorted({form.description for _, form in exact.forms.values()}))
    return (
        result.name.replace("_", " "),
        forms,
        *(
            float(errors[key].max())
            for key in ("position", "orientation", "velocity", "angular_velocity")
        ),
        float(forces.max()) if forces.size else None,
    )


def order_table(results: list[Result]) -> Table:
    """Return a table of orders with their uncertainty, a line per deck and scheme."""
    columns = (
        Column("deck", "deck"),
        Column("scheme", "scheme"),
        Column("reference", "reference"),
        *(Column(metric.key, metric.name) for metric in TRUE),
    )
    rows = []
    for result in results:
        for scheme in result.study.schemes:
            fits = [result.study.fits.get((scheme, metric.key)) for metric in TRUE]
            cells = (f"{fit.order:.2f} +- {fit.uncertainty:.2f}" if fit else "" for fit in fits)
            kind = "exact" if result.exact else "independent"
            rows.append((result.name.replace("_", " "), scheme, kind, *cells))
    return Table(columns, tuple(rows))


def remarks(results: list[Result]) -> tuple[tuple[str, str], ...]:
    """Return the findings of the table for the default scheme."""
    orders = [
        (result.name, metric.key, fit)
        for result in results
        for scheme in result.study.schemes[:1]
        for metric in TRUE
        if (fit := result.study.fits.get((scheme, metric.key)))
    ]
    off = [(n, k, f) for n, k, f in orders if abs(f.order - 2.0) > 0.1]
    alternating = sorted({n.replace("_", " ") for n, k, _ in off if k == "mean_reaction"})
    others = sorted({f"{n.replace('_', ' ')} ({k})" for n, k, _ in off if k != "mean_reaction"})
    return (
        ("Within 0.1 of theory", f"{len(orders) - len(off)} of {len(orders)} orders."),
        (
            "Mean reactions",
            f"Of lower order in: {', '.join(alternating) or 'no model'}. The velocities at t = 0 "
            "satisfy the constraints exactly, those after later steps to O(h^2). If the initial "
            "angular velocity is not zero, the difference remains as an alternation of the mean "
            "reactions from step to step, of size O(h). The mean of two steps, and the "
            "instantaneous reaction, are of order 2.",
        ),
        ("Others that differ by more than 0.1", f"{', '.join(others) or 'none'}."),
        (
            "The decaying scheme",
            "starts without history: if joints or joint motions prescribe the motion, velocities "
            "and reactions begin with an error of O(h), which decays within some steps but is "
            "their largest. Positions are of order 2 in all cases.",
        ),
    )


def finest_table(results: list[Result]) -> Table:
    """Return a table of the largest errors at the smallest step size of each deck."""
    columns = (
        Column("deck", "deck"),
        Column("dt", "step [s]", form="g"),
        *(Column(m.key, f"{m.name} [{m.unit}]", form=".1e", missing="") for m in TRUE),
        Column("energy", "energy balance error / max KE", form=".1e", missing=""),
    )
    rows = []
    for result in results:
        completed = [run for run in result.study.runs if run.trial.completed]
        run = min(completed, key=lambda run: run.trial.dt)
        errors = (run.largest(m.key) for m in TRUE)
        energy = run.largest("energy_over_kinetic")
        rows.append((result.name.replace("_", " "), run.trial.dt, *errors, energy))
    return Table(columns, tuple(rows))


if __name__ == "__main__":
    main()
