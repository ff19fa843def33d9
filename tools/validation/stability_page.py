"""Write docs/validation/stability.md from the stored cells."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from math import inf
from pathlib import Path

from msahl.model.scheme import ORDER_TWO
from msahl.post.document import Block, Heading, Items, Paragraph, Picture
from msahl.post.table import Cell as Entry
from msahl.post.table import Column, Table
from msahl.run.verdict import FAIL, WORDS
from tools.validation.extreme_families import FAMILIES, FIRM, STIFF, STIFF_SPRINGS, compliant
from tools.validation.generated import write_generated
from tools.validation.stability_cells import (
    BOUND,
    BOUNDED,
    COARSE,
    COMPARED,
    DOUBTFUL,
    FAILED,
    GOOD,
    KEPT,
    KEPT_NEARLY,
    LARGEST,
    LATE,
    REFUSED,
    RESTART_HORIZON,
    RESTARTED,
    SPAN,
    STABLE,
    STEPS,
    Cell,
    energy_asked,
    show_value,
)
from tools.validation.stability_maps import label_of, maps, ringing, title_of
from tools.validation.thesis_runs import OUT

PAGE = OUT / "stability.md"
PLAIN = ("mass_ratio", "point_mass", "spin", "folded_chain", "cranks")
"""Families of about a metre and a second that pass no singular position."""

STIFF_FAMILIES = (
    "stiff_spring",
    "stiff_pendulum",
    "bushing_loop",
    "governor",
    "inconsistent_as_given",
)
"""Families with a vibration that is faster than most step sizes, in the stiffness form."""

REASONS = {
    "mass_ratio": "At a step as long as the swing the predicted unknowns are far off, and the "
    "condition number of the Jacobian grows with the mass ratio and with the rotation per step; "
    "the effect of a heavy link on a light one is then known to few digits only.",
    "needle_to_disk": "The angular velocity about the axis is constant in the exact motion. The "
    "schemes keep it constant only to the order of the step, and the smaller the moment of inertia "
    "about the axis, the larger the change: (step size)^2 times the moment across over that about "
    "the axis. For a needle it grows to hundreds and thousands of radians per second at constant "
    "energy, until a step contains many revolutions and does not converge.",
    "length": "At a length of a millionth of a metre a step of 0.01 s is five swings. The bodies "
    "rotate by up to 180 degrees per step, where solutions lie close to each other, and steps are "
    "subdivided again and again.",
    "stiff_pendulum": "The length of the spring is known to 1e-16 m; times its stiffness that is "
    "a force of 4e-5 N at a period of 1e-5 s. It does work in every step, so the energy balance "
    "is less accurate than elsewhere; the swing is not affected. At a step of 1 s, half the "
    "swing, steps are subdivided again and again. A rod (joint distance) instead of such a stiff "
    "spring gives the same swing at any step size. The gauss schemes evaluate forces at their "
    "nodes, which does not conserve energy: if the step does not resolve the vibration, the "
    "energy error of so stiff a spring exceeds the energy of the swing.",
    "bushing_loop": "As with the pendulum on a spring, the deflection of the mount is known to "
    "1e-16 m, and times its stiffness that is a force that does work. From 1e9 N/m on, steps of "
    "0.1 s and more, in which the loop rotates by a large part of a radian, are subdivided again "
    "and again. With a pin instead of the mount the model is stable at any step size.",
    "taut_chain": "Without slack the constraint equations are linearly dependent: the residual "
    "stays near 1e-12, slightly above the limit of convergence. With very little slack the forces "
    "grow as one over its square root, and so do their rounding errors: at large steps the chain "
    "gains or loses as much energy as it has, while the runs end as completed. Look at the energy "
    "balance.",
    "inverted": "The pendulum hardly moves in such a step: the error is the rounding error of the "
    "weight's energy over a kinetic energy near zero.",
    "spin": "In a step of higher order a body can make less than one revolution: its rotation "
    "parameters are polynomials in time, which are singular there. Faster rotations need steps "
    "that are subdivided to that length, or do not converge. Schemes of order 2 keep the angular "
    "velocity, though not the angle.",
    "stiff_spring": "The length of the spring is known to 1e-16 m; times its stiffness that is a "
    "force of the size at which a step counts as converged. Steps with a larger residual are "
    "subdivided.",
    "cranks": "With 32 cranks many steps of 1 s are solved by the dense scipy solver, which takes "
    "long for so many bodies; otherwise the runs are good. For higher orders such a step is too "
    "large a part of the swing: they reach the end time with their energy lost.",
    "drift": "At a distance of ten thousand kilometres the last digit of a position is 1.9e-9 m: "
    "the constraint violation is one of these. Motion and energy are not affected.",
    "long_run": "A step of 1 s is nearly a quarter of the swing. Sooner or later the preserving "
    "scheme comes to steps that must be subdivided, and from then on most are. At 0.1 s rounding "
    "errors of a million steps have accumulated.",
    "inconsistent_as_given": "A jump of 1000 m/s makes the links rotate by up to 180 degrees per "
    "step, forth and back without end with the preserving scheme. Higher orders remove the jump in "
    "their first step, like an inelastic impact: radau books the energy it takes as its work, with "
    "gauss it is missing from the balance.",
    "stiff_pendulum_compliance": "No step of the schemes of order 2 is subdivided, and the energy "
    "is kept to rounding errors at any step size and stiffness. The gauss schemes evaluate forces "
    "at their nodes in this form as well. At a step of 1 s, half the swing, a step of radau3 "
    "converges where that of the stiffness form is subdivided, and is too long to be right.",
    "bushing_loop_compliance": "Steps of 1 s, in which the loop rotates by a large part of a "
    "radian, are subdivided as with a pin in place of the mount. The gauss schemes do not conserve "
    "energy where the step does not resolve the vibration, in this form as well.",
    "toggle": "If rod and crank have the same length, the mechanism has two branches where it is "
    "folded.",
}
"""Why some cells of a family are bad."""


def write_page(cells: Sequence[Cell]) -> None:
    """Write the page and its figures."""
    write_generated(PAGE, "tools.validation.stability", build(cells))


def build(cells: Sequence[Cell]) -> list[Block]:
    """Return the blocks of the page."""
    return [
        Heading(1, "Stability at extreme parameters"),
        Paragraph(
            f"{len(cells)} runs of extreme models at {len(STEPS)} step sizes from {STEPS[0]:g} s "
            f"to {STEPS[-1]:g} s by the schemes {', '.join(COMPARED)}, with extreme masses, "
            "inertias, lengths, angular velocities, stiffnesses, dampings and geometries. Each is "
            f"run by msahl run for at most {SPAN:g} s and some thousand steps. A run is rated by "
            f"its energy balance and constraint violation (relative limit {KEPT:g}; for the energy "
            f"of {nearly_kept()}, which conserve it only as accurately as positions, "
            f"{KEPT_NEARLY:g}), by reference positions if there are any, and by how it ended. All "
            "results of all runs are in stability.csv."
        ),
        Heading(2, "Findings"),
        Items(tuple(expectations(cells))),
        Heading(2, "Recommendations"),
        Items(tuple(choices(cells))),
        Paragraph(
            "Largest of these step sizes [s] up to which all runs of a family of about a metre "
            "and a second are within their tolerance:"
        ),
        step_table(cells),
        Paragraph(
            "Runs of stiff models, and of a model with inconsistent velocities: how many are "
            "stable, and how many of these are within the tolerance of the reference position:"
        ),
        quick_table(cells),
        Heading(2, "Overview"),
        Paragraph(
            "stable to: the largest step size up to which every run of the family, at all values, "
            "reached the end time within the limits of energy balance and constraint violation. "
            "good to: the largest step size up to which every run with a reference is within the "
            "tolerance of its position. The other columns are the worst values of the stable "
            "runs. Subdivisions and steps solved by scipy are given per step."
        ),
        glance_table(cells),
        *verdict_blocks(cells),
        Heading(2, "Maps"),
        Paragraph(
            "The number in a cell is the decade of the position error [m]: -6 means about 1e-6 m. "
            "The tolerance is a thousandth of the model's size, for the top a hundredth of its "
            "displacement. A cell without a number has no reference position: the motion is "
            "chaotic at that time, or the run failed."
        ),
        *(
            Picture(f"figures/{path.name}", ", ".join(title_of(n) for n in names), b"")
            for path, names in maps(cells)
        ),
        Heading(2, "Vibrations faster than the step"),
        Paragraph(
            "Vibrations much faster than a step of 0.01 s: with preserving and gauss they appear "
            "as an alternation from step to step, decaying damps them within some steps. Its "
            "first steps have no history and may alternate more; the dampers of the governor "
            "avoid that. radau needs no history: it damps a vibration that is much faster than "
            "the step in one step, and one that is slightly faster, as in the governor without "
            "dampers, in some."
        ),
        Picture(f"figures/{ringing().name}", "A stiff spring and the governor at 0.01 s", b""),
        Heading(2, "All runs that failed or are doubtful"),
        *bad_blocks(cells),
        Heading(2, "Models"),
        Paragraph(
            "The decks are in decks/extreme; each says what it shows and what to expect. To repeat "
            "a cell, run"
        ),
        Paragraph(
            "python -m tools.validation.extreme_families FAMILY VALUE > deck.xml, then msahl run "
            "deck.xml --dt STEP --t-final END --scheme SCHEME, with the values of its line in "
            "stability.csv."
        ),
        model_table(cells),
        Items(tuple(notes())),
    ]


def shares(cells: Sequence[Cell]) -> Counter[str]:
    """Count the cells of each outcome."""
    return Counter(cell.outcome for cell in cells)


def expectations(cells: Sequence[Cell]) -> Iterator[tuple[str, str]]:
    """Yield the findings of the table."""
    count = shares(cells)
    stable = sum(count[outcome] for outcome in STABLE)
    yield (
        "Stable runs",
        f"{stable} of {len(cells)} runs reached the end time within the limits of energy balance "
        f"and constraint violation: {count[GOOD]} within the tolerance of the reference position, "
        f"{count[COARSE]} with a step too large for it, {count[BOUNDED]} without a reference. "
        f"{count[DOUBTFUL]} reached the end time outside these limits, {count[FAILED]} ended at a "
        f"step that did not converge, {count[LATE]} were stopped because too many steps had to be "
        f"subdivided, {count[REFUSED]} had no consistent initial conditions.",
    )
    for scheme in dict.fromkeys(cell.scheme for cell in cells):
        own = [cell for cell in cells if cell.scheme == scheme]
        stable = sum(cell.outcome in STABLE for cell in own)
        yield f"Scheme {scheme}", f"{stable} of {len(own)} runs are stable."
    finished = [cell for cell in cells if cell.outcome != LATE]
    lost = sum(cell.output_times != cell.output_times_found for cell in finished)
    yield (
        "Results on file",
        "Every run, completed or stopped, has as many output times on file as it reports."
        if not lost
        else f"{lost} runs have another number of output times on file than they report.",
    )
    lossy = [cell for cell in cells if cell.outcome == DOUBTFUL and cell.energy is not None]
    if lossy:
        worst_of = max(lossy, key=lambda cell: cell.energy or 0.0)
        yield (
            "A completed run may be wrong",
            "A run can reach its end time with its energy lost. The worst one: "
            f"{title_of(worst_of.family).lower()}, {show_value(worst_of.value)}, at a step of "
            f"{worst_of.dt:g} s ({worst_of.scheme}), with an energy balance error of "
            f"{worst_of.energy:.1e} of the largest kinetic energy. The verdict of the run says so.",
        )
    ends = [cell for cell in cells if cell.outcome == COARSE and cell.scheme in ORDER_TWO]
    worst = max((cell.energy or 0.0 for cell in ends), default=0.0)
    yield (
        "The energy balance does not show position errors",
        f"The {len(ends)} coarse runs by {' and '.join(ORDER_TWO)} have an energy balance error of "
        f"at most {worst:.1e}, but wrong positions. Use the error estimate, or msahl study.",
    )


def nearly_kept() -> str:
    """Return the schemes whose energy error depends on the step size."""
    return " and ".join(s for s in COMPARED if energy_asked(s) > KEPT)


def choices(cells: Sequence[Cell]) -> Iterator[tuple[str, str]]:
    """Yield the recommendations that follow from the table."""
    yield (
        "Step size",
        "With a scheme of order 2, a three-hundredth of the period of the fastest motion of "
        "interest gives a relative error of a thousandth after three periods; the error grows "
        "with the square of the step size and with time. Larger steps are stable as well, but "
        "less accurate. Higher orders allow steps many times larger if the motion is smooth.",
    )
    yield (
        "Scheme",
        "Use preserving or gauss if the step resolves all vibrations: preserving for an energy "
        "balance at any step size, gauss for accurate positions. If springs, bushings or "
        "inconsistent initial velocities vibrate faster than the step, use a scheme that damps: "
        "radau for accurate slow motion, decaying for steps that are too large even for that. "
        "decaying is of order 2 and never gains energy. Both write the energy they take to the "
        "column scheme.work. Do not use gauss then: it neither damps nor bounds what the step does "
        "not resolve. Of runs of the same cell " + pair_text(cells) + ".",
    )
    good = Counter(c.scheme for c in cells if c.family in STIFF_FAMILIES and c.outcome == GOOD)
    counts = ", ".join(f"{scheme} in {n}" for scheme, n in good.most_common())
    compared = {_place(c) for c in cells if c.family in STIFF_FAMILIES and c.error is not None}
    yield (
        "Stiff models",
        f"Of {len(compared)} cells with a reference position the schemes are within the tolerance: "
        f"{counts}.",
    )
    yield (
        "Damping",
        "Keep the default, 0.5. Physical dampers of any strength are stable: "
        + span_text(cells, "damping")
        + ".",
    )
    yield (
        "Nearly rigid connections",
        "Use a joint: it costs nothing, has no stiffness to resolve, and its constraint "
        "violation is rounding error at any step size. Where the elasticity matters, give the "
        f'spring or bushing form="compliance"{form_text(cells)}.',
    )


def form_text(cells: Sequence[Cell]) -> str:
    """Say how many runs of stiff springs are stable by the schemes of order 2 in each form."""
    texts = []
    both = [compliant(name) for name in STIFF_SPRINGS], STIFF_SPRINGS
    if not any(cell.family in both[0] for cell in cells):
        return ""
    for form, names in zip(("compliance", "stiffness"), both, strict=True):
        own = [c for c in cells if c.family in names and c.scheme in ORDER_TWO]
        stable = [c for c in own if c.outcome in STABLE]
        most = max((c.iterations or 0.0 for c in stable), default=0.0)
        texts.append(
            f"{len(stable)} of {len(own)} such runs by {' and '.join(ORDER_TWO)} are stable in the "
            f"{form} form, with at most {most:.0f} iterations per step"
        )
    return f": {', '.join(texts)}"


def step_table(cells: Sequence[Cell]) -> Table:
    """Return a table of the largest good step sizes of plain families by scheme."""

    def steps(name: str, scheme: str) -> float | None:
        own = [cell for cell in cells if cell.scheme == scheme]
        return largest(own, name, lambda c: c.outcome in (GOOD, BOUNDED))

    return _by_scheme(cells, PLAIN, steps, "g")


def quick_table(cells: Sequence[Cell]) -> Table:
    """Return a table of how many cells of stiff families are stable and good, by scheme."""

    def counts(name: str, scheme: str) -> str:
        own = [c for c in cells if (c.family, c.scheme) == (name, scheme)]
        stable, good = (sum(c.outcome in which for c in own) for which in (STABLE, (GOOD,)))
        compared = any(c.error is not None for c in own)
        return f"{stable} of {len(own)}" + (f", {good} good" if compared else "")

    pairs = ((name, compliant(name)) for name in STIFF_FAMILIES)
    return _by_scheme(cells, [name for pair in pairs for name in pair], counts)


def _by_scheme(
    cells: Sequence[Cell],
    families: Sequence[str],
    entry: Callable[[str, str], Entry],
    form: str = "",
) -> Table:
    """Return a table with a line per family and a column per scheme."""
    schemes, names = (dict.fromkeys(getattr(c, of) for c in cells) for of in ("scheme", "family"))
    columns = (
        Column("family", "model"),
        *(Column(scheme, scheme, form=form, missing="-") for scheme in schemes),
    )
    rows = ((title_of(n), *(entry(n, s) for s in schemes)) for n in families if n in names)
    return Table(columns, tuple(rows))


def largest(cells: Sequence[Cell], name: str, good: Callable[[Cell], bool]) -> float | None:
    """Return the largest step size up to which all cells of a family are good; None if none is."""
    found = None
    for dt in STEPS:
        own = [cell for cell in cells if cell.family == name and cell.dt == dt]
        if not own or not all(map(good, own)):
            break
        found = dt
    return found


def pair_text(cells: Sequence[Cell]) -> str:
    """Say in how many cells only one of the schemes is stable."""
    schemes = list(dict.fromkeys(cell.scheme for cell in cells))
    stable = {
        s: {_place(c) for c in cells if c.scheme == s and c.outcome in STABLE} for s in schemes
    }
    texts = []
    for scheme in schemes:
        others = set().union(*(stable[s] for s in schemes if s != scheme))
        texts.append(f"{len(stable[scheme] - others)} are stable with {scheme} only")
    return ", ".join(texts)


def _place(cell: Cell) -> tuple[str, float | str, float]:
    return cell.family, cell.value, cell.dt


def span_text(cells: Sequence[Cell], name: str) -> str:
    """Say how many cells of a family are stable."""
    own = [cell for cell in cells if cell.family == name]
    stable = sum(cell.outcome in STABLE for cell in own)
    values = [cell.value for cell in own]
    extent = f"from {min(values):g} to {max(values):g} times the critical damping"
    return f"{stable} of {len(own)} runs are stable, {extent}"


def glance_table(cells: Sequence[Cell]) -> Table:
    """Return the overview table, a line per family and scheme."""
    columns = (
        Column("family", "model"),
        Column("scheme", "scheme"),
        Column("stable_to", "stable to [s]", form="g", missing="-"),
        Column("good", "good to [s]", form="g", missing="-"),
        Column("stable", "stable runs"),
        Column("energy", "energy error / max KE", form=".1e", missing=""),
        Column("violation", "constraint violation [m]", form=".1e", missing=""),
        Column("violation_rate", "violation rate [m/s]", form=".1e", missing=""),
        Column("iterations", "iterations per step", form=".1f", missing=""),
        Column("subdivisions", "subdivisions", form=".2g", missing=""),
        Column("scipy_steps", "scipy steps", form=".2g", missing=""),
        Column("condition", "condition number", form=".0e", missing=""),
    )
    rows = []
    for name in dict.fromkeys(cell.family for cell in cells):
        for scheme in dict.fromkeys(cell.scheme for cell in cells):
            own = [c for c in cells if (c.family, c.scheme) == (name, scheme)]
            rows.append(_glance_row(name, scheme, own))
    return Table(columns, tuple(rows))


def _glance_row(name: str, scheme: str, own: Sequence[Cell]) -> tuple[Entry, ...]:
    stable = [cell for cell in own if cell.outcome in STABLE]

    def worst(figure: Callable[[Cell], float | None]) -> float | None:
        known = [value for value in map(figure, stable) if value is not None]
        return max(known, default=None)

    compared = any(cell.error is not None for cell in own)
    near = largest(own, name, lambda c: c.outcome in (GOOD, BOUNDED))
    return (
        title_of(name),
        scheme,
        largest(own, name, lambda c: c.outcome in STABLE),
        near if compared else None,
        f"{len(stable)} of {len(own)}",
        worst(lambda c: c.energy),
        worst(lambda c: c.violation),
        worst(lambda c: c.violation_rate),
        worst(lambda c: c.iterations),
        worst(lambda c: (c.subdivisions or 0) / max(c.steps, 1)),
        worst(lambda c: (c.scipy_steps or 0) / max(c.steps, 1)),
        worst(lambda c: c.condition),
    )


def verdict_blocks(cells: Sequence[Cell]) -> list[Block]:
    """Return tables of outcomes against the runs' own verdicts, if they have any."""
    if not any(cell.verdict for cell in cells):
        return []
    words = list(dict.fromkeys(cell.verdict for cell in cells if cell.verdict))
    outcomes = [o for o in (*STABLE, DOUBTFUL, FAILED, LATE, REFUSED) if shares(cells)[o]]
    columns = (
        Column("outcome", "outcome here"),
        *(Column(word, word, "verdict of the run", form="d") for word in sorted(words)),
        Column("none", "none", "verdict of the run", form="d"),
    )
    rows: list[tuple[Entry, ...]] = []
    for outcome in outcomes:
        own = Counter(cell.verdict for cell in cells if cell.outcome == outcome)
        rows.append((outcome, *(own[word] for word in sorted(words)), own[None]))
    return [
        Heading(2, "Verdicts of the runs"),
        Paragraph(
            "The verdict in run.json beside the outcome here, which uses reference positions that "
            "the run does not have."
        ),
        Table(columns, tuple(rows)),
        Paragraph(
            "The verdict of a run up to the time of comparison with --accuracy TOLERANCE, beside "
            "the largest error of positions, and of orientations times the bodies' lengths, at "
            "all output times."
        ),
        accuracy_table(cells),
        Items(tuple(lost_energy(cells))),
    ]


def true_error(cell: Cell) -> float:
    """Return the largest error of positions and orientations over the tolerance."""
    return max(cell.error or 0.0, cell.rotation_error or 0.0) / cell.tolerance


NEAR = (("within the tolerance", 1.0), ("within ten times", 10.0), ("beyond", inf))


def accuracy_table(cells: Sequence[Cell]) -> Table:
    """Return a table of verdicts by the size of the error."""
    columns = (
        Column("error", "true error"),
        *(Column(word, word, "verdict with --accuracy", form="d") for word in WORDS),
    )
    rows: list[tuple[Entry, ...]] = []
    least = -1.0
    for words, most in NEAR:
        own = [
            c.accuracy_verdict
            for c in cells
            if c.accuracy_verdict and least < true_error(c) <= most
        ]
        rows.append((words, *(own.count(word) for word in WORDS)))
        least = most
    return Table(columns, tuple(rows))


def lost_energy(cells: Sequence[Cell]) -> Iterator[tuple[str, str]]:
    """Yield the runs whose positions are right and whose verdict is FAIL."""
    own = [c for c in cells if c.accuracy_verdict == FAIL and true_error(c) <= 1.0]
    if own:
        names = ", ".join(dict.fromkeys(title_of(c.family).lower() for c in own))
        yield (
            "FAIL where the positions are right",
            f"{len(own)} runs ({names}): their energy balance error is "
            f"{min(c.energy or 0.0 for c in own):.1e} of the largest kinetic energy and more, so "
            "their velocities and reactions are wrong, though positions hardly move in the time "
            "that is compared.",
        )


def bad_blocks(cells: Sequence[Cell]) -> Iterator[Block]:
    """Yield every cell that is not stable, family by family, with the reason."""
    verdicts = any(cell.verdict for cell in cells)
    for name in dict.fromkeys(cell.family for cell in cells):
        bad = [c for c in cells if c.family == name and c.outcome not in STABLE]
        if not bad:
            continue
        yield Heading(3, title_of(name))
        if name in REASONS:
            yield Paragraph(REASONS[name])
        columns = [
            Column("value", label_of(name).replace("\n", " ")),
            Column("scheme", "scheme"),
            Column("dt", "step [s]", form="g"),
            Column("outcome", "outcome"),
            Column("steps", "steps", form="d"),
            Column("energy", "energy error / max KE", form=".1e", missing=""),
            Column("violation", "constraint violation [m]", form=".1e", missing=""),
            Column("message", "message of the run"),
        ]
        if verdicts:
            columns.append(Column("verdict", "verdict", missing=""))
        rows: list[tuple[Entry, ...]] = []
        for c in bad:
            row: list[Entry] = [show_value(c.value), c.scheme, c.dt, c.outcome, c.steps]
            row += [c.energy, c.violation]
            rows.append((*row, first_sentence(c.message), *([c.verdict] if verdicts else [])))
        yield Table(tuple(columns), tuple(rows))


def first_sentence(message: str) -> str:
    """Return the first sentence of a message, which says what happened."""
    return message.split(". ")[0].strip()


def model_table(cells: Sequence[Cell]) -> Table:
    """Return a table of the families: deck, parameter, values, tolerance and reference."""
    columns = (
        Column("name", "family"),
        Column("deck", "deck"),
        Column("varied", "varied"),
        Column("values", "values"),
        Column("tolerance", "tolerance [m]"),
        Column("reference", "reference"),
    )
    rows = []
    for name in dict.fromkeys(cell.family for cell in cells):
        own = [cell for cell in cells if cell.family == name]
        values = ", ".join(show_value(v) for v in dict.fromkeys(c.value for c in own))
        tolerances = sorted({cell.tolerance for cell in own})
        spread = f"{tolerances[0]:g}" + (f" to {tolerances[-1]:g}" if tolerances[1:] else "")
        kinds = ", ".join(sorted({c.reference for c in own if c.reference})) or "none"
        deck = (
            f"decks/{FAMILIES[name].path.parent.name}/{FAMILIES[name].path.name}"
            if (name in FAMILIES)
            else ", ".join(f"{Path(n).name}" for n in RESTARTED)
        )
        rows.append((name, deck, label_of(name).replace("\n", " "), values, spread, kinds))
    return Table(columns, tuple(rows))


def notes() -> Iterator[tuple[str, str]]:
    """Yield notes on how the results were obtained."""
    yield (
        "Reference positions",
        "exact: a closed form. independent: msahl study's own integration of the accelerations. "
        "finer: the default scheme at a tenth of the smallest step size compared at that time, if "
        "the independent solution takes too long.",
    )
    yield (
        "Limits",
        f"A pendulum on a spring with a period of {STIFF:g} s or less is compared with one on a "
        f"rod, a loop with a mount of {FIRM:g} N/m or more with one of four pins.",
    )
    yield (
        "Condition number",
        f"of the scaled Jacobian of the first step, up to {LARGEST} unknowns; for schemes of "
        "order 2 that of the default one. If it grows with a stiffness, the equation of the "
        "spring is the large one, which does not harm the others.",
    )
    yield (
        "Time limit",
        f"A run is interrupted after {BOUND:g} s of processor time (long runs later) and ended "
        "after twice as long; most take some hundredths of that. Which runs end so depends on "
        "the machine. Kernels are compiled before. Families and schemes can be run again "
        "separately (python -m tools.validation.stability FAMILY SCHEME); the other lines then "
        "stay as they were.",
    )
    yield (
        "Restart",
        f"A deck is run to half of at most {RESTART_HORIZON:g} s, a new deck is made of its last "
        "state, and the end of its run is compared with that of an uninterrupted one. Velocities "
        "violate the constraints by the square of the step size; the start of the second run makes "
        "them consistent. A decaying scheme starts again without history. Joint springs, couplings "
        "and joint motions count from t = 0, so decks that have them would need other free lengths "
        f"and angles; they are not among these {len(RESTARTED)} decks.",
    )
