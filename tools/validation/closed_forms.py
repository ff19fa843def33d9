"""Every deck against its reference: docs/validation/closed-forms.md.

python tools/validation/closed_forms.py
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from measured import OUT, ROOT

from msahl.deck import read_deck
from msahl.model import Model
from msahl.model.scheme import ORDER_TWO
from msahl.post.document import Block, Heading, Items, Paragraph, as_markdown
from msahl.post.table import Cell, Column, Table
from msahl.results.read import ResultError
from msahl.study.dynamics import Dynamics
from msahl.study.errors import METRICS, state_errors
from msahl.study.exact import recognise
from msahl.study.independent import solve
from msahl.study.plan import Plan
from msahl.study.runs import with_step
from msahl.study.study import Study, study

LONGEST = 10.0
"""Scenes are followed this long [s]: the chaotic ones have a reference to compare with."""
STEPS = (0.1, 0.04, 0.01, 0.004, 0.002, 0.001, 0.0004)
"""Hainge's sample rates (2010, table 4.2) and two finer [s]."""
SHORT = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125)
"""Steps, in the deck's own, where fewer than five of these make ``COARSE`` steps or more."""
COARSE = 20
TRUE = [measure for measure in METRICS if measure.true]


@dataclass(frozen=True)
class Result:
    """A deck and what its study says."""

    name: str
    model: Model
    exact: bool
    study: Study


def main() -> None:
    """Study all decks and write the page."""
    OUT.mkdir(parents=True, exist_ok=True)
    # Extreme scenes, which no independent solution follows everywhere, have a page of their own.
    paths = [path for path in (ROOT / "decks").rglob("*.xml") if path.parent.name != "extreme"]
    results = list(study_all(sorted(paths)))
    (OUT / "closed-forms.md").write_text(as_markdown(build(results)))


def study_all(paths: list[Path]) -> Iterator[Result]:
    """The studies of all decks."""
    for path in paths:
        model = read_deck(path)
        simulation = model.simulation
        model = with_step(model, simulation.dt, min(simulation.t_final, LONGEST))
        exact = recognise(model) is not None
        print(path.stem, flush=True)
        try:
            result = study(Plan(model, steps_for(model), tuple(ORDER_TWO), repeats=1))
        except ResultError as error:
            print(f"  left out: {error}", flush=True)
            continue
        yield Result(path.stem, model, exact, result)


def steps_for(model: Model) -> tuple[float, ...]:
    """The steps that suit a model."""
    t_final = model.simulation.t_final
    listed = tuple(dt for dt in STEPS if COARSE * dt <= t_final * (1.0 + 1e-9))
    return listed if len(listed) >= 5 else tuple(f * model.simulation.dt for f in SHORT)


def build(results: list[Result]) -> list[Block]:
    """The page."""
    closed = [result for result in results if result.exact]
    return [
        Heading(1, "Closed forms and independent solutions"),
        Paragraph(
            "Every deck but the extreme ones, run at a list of steps and compared with a closed "
            "form where there is one, else with an independent solution of the scene's equations "
            f"(DOP853, joints closed at every step), over at most {LONGEST:g} s. Made by make "
            "validation; one deck's whole story is told by msahl study."
        ),
        Heading(2, "Closed forms against the independent solution"),
        Paragraph(
            "Two ways to the truth that share no more than the deck: elliptic functions, and "
            "scipy's integrator on the accelerations. Largest difference at 201 times."
        ),
        agreement_table(closed),
        Heading(2, "Observed orders"),
        Paragraph(
            "Theory: 2 throughout. Of the largest errors over the rows; an empty place has no "
            "error to fit: it is round-off at every step, or the scene lacks it."
        ),
        order_table(results),
        Items(remarks(results)),
        Heading(2, "Largest errors at the finest step"),
        finest_table(results),
    ]


def agreement_table(closed: list[Result]) -> Table:
    """Differences of closed form and independent solution."""
    columns = (
        Column("deck", "deck"),
        Column("form", "closed form"),
        Column("position", "position [m]", form=".1e"),
        Column("orientation", "orientation [rad]", form=".1e"),
        Column("velocity", "velocity [m/s]", form=".1e"),
        Column("spin", "angular velocity [rad/s]", form=".1e"),
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
    words = "; ".join(sorted({form.words for _, form in exact.forms.values()}))
    return (
        result.name.replace("_", " "),
        words,
        *(
            float(errors[key].max())
            for key in ("position", "orientation", "velocity", "angular_velocity")
        ),
        float(forces.max()) if forces.size else None,
    )


def order_table(results: list[Result]) -> Table:
    """Orders with their uncertainty, a row a deck and scheme."""
    columns = (
        Column("deck", "deck"),
        Column("scheme", "scheme"),
        Column("reference", "reference"),
        *(Column(measure.key, measure.name) for measure in TRUE),
    )
    rows = []
    for result in results:
        for scheme in result.study.schemes:
            fits = [result.study.fits.get((scheme, measure.key)) for measure in TRUE]
            cells = (f"{fit.order:.2f} +- {fit.uncertainty:.2f}" if fit else "" for fit in fits)
            kind = "exact" if result.exact else "independent"
            rows.append((result.name.replace("_", " "), scheme, kind, *cells))
    return Table(columns, tuple(rows))


def remarks(results: list[Result]) -> tuple[tuple[str, str], ...]:
    """What the table shows, with its own numbers; those of the default scheme."""
    orders = [
        (result.name, measure.key, fit)
        for result in results
        for scheme in result.study.schemes[:1]
        for measure in TRUE
        if (fit := result.study.fits.get((scheme, measure.key)))
    ]
    off = [(n, k, f) for n, k, f in orders if abs(f.order - 2.0) > 0.1]
    alternating = sorted({n.replace("_", " ") for n, k, _ in off if k == "mean_reaction"})
    others = sorted({f"{n.replace('_', ' ')} ({k})" for n, k, _ in off if k != "mean_reaction"})
    return (
        ("Within 0.1 of theory", f"{len(orders) - len(off)} of {len(orders)} orders."),
        (
            "Mean reactions",
            f"Of lower order in: {', '.join(alternating) or 'no scene'}. The velocities at t = 0 "
            "close the joints exactly, those of later steps to O(h^2); where the motion starts "
            "with a spin, the difference stays as an alternation of the means from step to step, "
            "of size O(h). The mean of two steps, and the reaction at the row, are of order 2.",
        ),
        ("Others off by more than 0.1", f"{', '.join(others) or 'none'}."),
        (
            "The decaying scheme",
            "starts without history: where joints or drives prescribe the motion, velocities and "
            "reactions begin with an error of O(h), which dies within some rows but is their "
            "largest. Positions are of order 2 throughout.",
        ),
    )


def finest_table(results: list[Result]) -> Table:
    """Largest errors at the finest step of each deck."""
    columns = (
        Column("deck", "deck"),
        Column("dt", "step [s]", form="g"),
        *(Column(m.key, f"{m.name} [{m.unit}]", form=".1e", missing="") for m in TRUE),
        Column("energy", "energy over max KE", form=".1e", missing=""),
    )
    rows = []
    for result in results:
        listed = [p for p in result.study.points if p.trial.completed and not p.tried]
        point = min(listed, key=lambda p: p.trial.dt)
        errors = (point.largest(m.key) for m in TRUE)
        energy = point.largest("energy_over_kinetic")
        rows.append((result.name.replace("_", " "), point.trial.dt, *errors, energy))
    return Table(columns, tuple(rows))


if __name__ == "__main__":
    main()
