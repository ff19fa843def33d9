"""docs/validation/stability.md, from the kept cells."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from math import inf
from pathlib import Path

from cells import (
    BOUND,
    BOUNDED,
    COARSE,
    COMPARED,
    DOUBTFUL,
    FAILED,
    GOOD,
    HELD,
    KEPT,
    KEPT_NEARLY,
    LARGEST,
    LATE,
    REFUSED,
    RESTART_HORIZON,
    RESTARTED,
    SPAN,
    STEPS,
    Cell,
    energy_asked,
    show_value,
)
from extreme import FAMILIES, FIRM, STIFF
from measured import OUT
from stability_maps import label_of, maps, ringing, title_of

from msahl.model.scheme import ORDER_TWO
from msahl.post.document import Block, Heading, Items, Paragraph, Picture, as_markdown
from msahl.post.table import Cell as Entry
from msahl.post.table import Column, Table
from msahl.run.verdict import FAIL, WORDS

PAGE = OUT / "stability.md"
PLAIN = ("mass_ratio", "point_mass", "spin", "folded_chain", "cranks")
"""Families of a metre and a second, without a singular position on their way."""

QUICK = ("stiff_spring", "stiff_pendulum", "bushing_loop", "governor", "inconsistent_as_given")
"""Families with something in them that vibrates quicker than most steps."""

REASONS = {
    "mass_ratio": "At a step as long as the swing the first guess is far off, and the Jacobian's "
    "condition has grown with the ratio of masses and the turn of a step; what a heavy link does "
    "to a light one is then known to few digits.",
    "needle_to_disk": "The spin about the axis, constant in truth, is kept by the schemes to the "
    "order of the step only, and the less inertia there is about the axis, the less it takes to "
    "change it: by (step)^2 times the inertia across over that about the axis. With a needle it "
    "grows to hundreds and thousands of radians a second, at constant energy, until a step holds "
    "many turns and cannot be solved.",
    "length": "At a millionth of a metre a step of 0.01 s is five swings; the bodies turn by up "
    "to half a turn a step, where solutions lie close to each other, and steps are halved again "
    "and again.",
    "stiff_pendulum": "The length of the spring is known to 1e-16 m, and that times its stiffness "
    "is a force: of 4e-5 N at a period of 1e-5 s. It does work in every step, so the energy is "
    "kept to less than elsewhere; the swing does not suffer. At a step of 1 s, half the swing, "
    "steps are halved again and again. A rod (joint distance) in place of a spring that stiff "
    "gives the same swing at any step. gauss has forces at its nodes, none that give what they "
    "take: a spring as stiff as that makes of what the step does not resolve more energy than the "
    "swing has.",
    "bushing_loop": "As with the pendulum on a spring: what the mount gives is known to 1e-16 m, "
    "and that times its stiffness is a force that does work. From 1e9 N/m on, steps of 0.1 s and "
    "more, in which the loop turns by much of a radian, are halved again and again. A pin in "
    "place of the mount holds at any step.",
    "taut_chain": "With no slack the joints hold the chain and their equations are dependent: the "
    "residual stays at some 1e-12, a little above what counts as solved. With hardly any slack "
    "the forces on the way are as large as one over its root, and so is their round-off: at large "
    "steps as much energy comes or goes as the chain has, while the runs end as completed. Look "
    "at the energy.",
    "inverted": "It hardly moves at such a step: the error is round-off of the weight's energy "
    "over a kinetic energy of nearly nothing.",
    "spin": "Within a step of a higher order a body can make less than a whole turn: the "
    "parameters of its turn are polynomials in time, and have no end there. What spins by more "
    "has its steps halved until they are as short as that, or not at all. Order 2 keeps the spin, "
    "though not the turn.",
    "stiff_spring": "The length of the spring is known to 1e-16 m, and that times its stiffness "
    "is a force, of the size at which a step counts as solved. What is above it is halved.",
    "cranks": "With 32 cranks each of many steps of 1 s is rescued by the dense solver, which "
    "takes long with so many bodies; nothing else is wrong. Such a step is more of the swing than "
    "higher orders can follow: they come to their end with the energy lost.",
    "drift": "Ten thousand kilometres away one place of a position's last digit is 1.9e-9 m: the "
    "gap is one of these. Motion and energy do not suffer.",
    "long_run": "A step of 1 s is nearly a quarter of the swing. Sooner or later the preserving "
    "scheme comes to steps that must be halved, and from then on most are. At 0.1 s round-off has "
    "gathered over a million steps.",
    "inconsistent_as_given": "A jump of 1000 m/s makes the links turn by up to half a turn a "
    "step, there and back, for ever with the preserving scheme. Higher orders close the jump in "
    "their first step, as an inelastic blow does: radau enters what that takes as its work, with "
    "gauss the balance lacks it.",
    "toggle": "With rod and crank of one length the mechanism may go on in two ways where they "
    "are folded.",
}
"""Why cells of a family are bad, in words."""


def write_page(cells: Sequence[Cell]) -> None:
    """Write the page and its pictures."""
    PAGE.write_text(as_markdown(build(cells)))


def build(cells: Sequence[Cell]) -> list[Block]:
    """The page."""
    return [
        Heading(1, "Where the method holds"),
        Paragraph(
            f"{len(cells)} runs of extreme scenes: {len(STEPS)} steps from {STEPS[0]:g} to "
            f"{STEPS[-1]:g} s by {', '.join(COMPARED)}, against masses, inertias, lengths, spins, "
            "stiffness, damping and geometry far from anything ordinary. Each is a deck that msahl "
            f"run has run, of at most {SPAN:g} s and some thousand steps, and is judged by its "
            f"energy balance and gaps ({KEPT:g} are asked; of the energy by {nearly_kept()}, which "
            f"keep it only as well as positions, {KEPT_NEARLY:g}), by true positions where there "
            "are any, and by how it ended. Made by make stability; all figures of all runs are in "
            "stability.csv."
        ),
        Heading(2, "What to expect"),
        Items(tuple(expectations(cells))),
        Heading(2, "What to choose"),
        Items(tuple(choices(cells))),
        Paragraph(
            "Largest steps of the list [s] up to which all runs of a family of a metre and a "
            "second are within their tolerance:"
        ),
        step_table(cells),
        Paragraph(
            "Runs of stiff scenes, and of a jump that stays: how many hold, and how many of them "
            "are within their tolerance of the true position:"
        ),
        quick_table(cells),
        Heading(2, "At a glance"),
        Paragraph(
            "holds: the largest step up to which every run of the family, at all values, came to "
            "its end with energy and gaps kept. good: the largest step up to which every run that "
            "can be compared is within the tolerance of its true position. The other columns are "
            "the worst of the runs that hold. Halvings are steps taken in parts, rescues such that "
            "scipy took; both in parts of the steps."
        ),
        glance_table(cells),
        *verdict_blocks(cells),
        Heading(2, "Maps"),
        Paragraph(
            "The number in a cell is the decade of the error of position [m]: -6 is some 1e-6 m. "
            "The tolerance is a thousandth of the scene's own size, for the top a hundredth of its "
            "way. A cell without a number has no true position: later than a chaotic scene can be "
            "known, or failed."
        ),
        *(
            Picture(f"figures/{path.name}", ", ".join(title_of(n) for n in names), b"")
            for path, names in maps(cells)
        ),
        Heading(2, "What rings"),
        Paragraph(
            "Vibrations far quicker than the step, at 0.01 s: the preserving scheme and gauss keep "
            "them as an alternation from row to row, the decaying one takes them within some "
            "steps. It begins without a history, though, and its first rows may ring more; the "
            "dampers of the governor as it is do without it. radau remembers nothing from step to "
            "step and needs no start: what is far quicker than the step it takes in one, what is "
            "hardly quicker, as in the governor without dampers, in some."
        ),
        Picture(f"figures/{ringing().name}", "A stiff spring and the governor at 0.01 s", b""),
        Heading(2, "Every run that failed or is bad"),
        *bad_blocks(cells),
        Heading(2, "The scenes"),
        Paragraph(
            "Decks are in decks/extreme; each says what it shows and what to expect. A cell is run "
            "again by"
        ),
        Paragraph(
            "python tools/validation/extreme.py FAMILY VALUE > deck.xml, then msahl run deck.xml "
            "--dt STEP --t-final END --scheme SCHEME, with the values of its line in stability.csv."
        ),
        scene_table(cells),
        Items(tuple(notes())),
    ]


def shares(cells: Sequence[Cell]) -> Counter[str]:
    """How many cells of each outcome."""
    return Counter(cell.outcome for cell in cells)


def expectations(cells: Sequence[Cell]) -> Iterator[tuple[str, str]]:
    """What the table says, in plain words and its own numbers."""
    count = shares(cells)
    held = sum(count[outcome] for outcome in HELD)
    yield (
        "It runs",
        f"{held} of {len(cells)} runs came to their end with energy and joints kept: {count[GOOD]} "
        f"within the tolerance of the true position, {count[COARSE]} with a step too large for it, "
        f"{count[BOUNDED]} with no true position to compare. {count[DOUBTFUL]} came to their end "
        f"with an energy error or a gap above what is asked, {count[FAILED]} stopped at a step "
        f"that did not converge, {count[LATE]} were stopped because their steps had become too "
        f"hard, {count[REFUSED]} had no start.",
    )
    for scheme in dict.fromkeys(cell.scheme for cell in cells):
        own = [cell for cell in cells if cell.scheme == scheme]
        held = sum(cell.outcome in HELD for cell in own)
        yield f"Scheme {scheme}", f"{held} of {len(own)} hold."
    lost = sum(cell.rows != cell.rows_found for cell in cells if cell.outcome != LATE)
    yield (
        "Rows are kept",
        "Every run, whole or stopped, has as many rows on file as it reports."
        if not lost
        else f"{lost} runs have another number of rows on file than they report.",
    )
    lossy = [cell for cell in cells if cell.outcome == DOUBTFUL and cell.energy is not None]
    if lossy:
        worst_of = max(lossy, key=lambda cell: cell.energy or 0.0)
        yield (
            "Completed is not yet good",
            "A run can come to its end with its energy lost. The worst here: "
            f"{title_of(worst_of.family).lower()}, {show_value(worst_of.value)}, at a step of "
            f"{worst_of.dt:g} s ({worst_of.scheme}): off by {worst_of.energy:.1e} of the largest "
            "kinetic energy. The last line of the run says so; read it.",
        )
    ends = [cell for cell in cells if cell.outcome == COARSE and cell.scheme in ORDER_TWO]
    worst = max((cell.energy or 0.0 for cell in ends), default=0.0)
    yield (
        "Energy says nothing about position",
        f"The {len(ends)} coarse runs by {' and '.join(ORDER_TWO)} keep their energy to "
        f"{worst:.1e} and better, and are somewhere else than they should be. "
        "Halve the step and compare, or use msahl study.",
    )


def nearly_kept() -> str:
    """Schemes whose energy error is one of the step's."""
    return " and ".join(s for s in COMPARED if energy_asked(s) > KEPT)


def choices(cells: Sequence[Cell]) -> Iterator[tuple[str, str]]:
    """What to choose, from the table."""
    yield (
        "Step",
        "By order 2 a three-hundredth of the period of the quickest motion that matters gives a "
        "thousandth after three periods; the error goes with the square of the step and with time. "
        "Smaller steps are safe and cost time; larger ones hold as well, but are somewhere else. "
        "Higher orders take steps many times as large, as far as the motion is smooth.",
    )
    yield (
        "Scheme",
        "preserving or gauss, as long as the step resolves what there is: the one for a balance "
        "kept at any step, the other for positions. Where springs, bushings or a start that jumps "
        "vibrate quicker than the step, one that decays: radau for the accuracy of what is slow, "
        "decaying for steps that are too large for that as well, by order 2 and never gaining "
        "energy. Both say in scheme.work what they took. Not gauss: what it does not resolve it "
        "neither damps nor keeps. Of the runs of one and the same cell " + pair_text(cells) + ".",
    )
    good = Counter(c.scheme for c in cells if c.family in QUICK and c.outcome == GOOD)
    told = ", ".join(f"{scheme} in {n}" for scheme, n in good.most_common())
    compared = {_place(c) for c in cells if c.family in QUICK and c.error is not None}
    yield (
        "Stiff scenes",
        f"Of {len(compared)} cells with a true position the schemes are within the tolerance: "
        f"{told}.",
    )
    yield (
        "Damping",
        "Leave it at 0.5. Physical dampers are kept at any strength: "
        + span_text(cells, "damping")
        + ".",
    )
    yield (
        "In place of what is nearly rigid",
        "use the joint: it costs nothing, has no stiffness to resolve, and closes to round-off at "
        "any step.",
    )


def step_table(cells: Sequence[Cell]) -> Table:
    """Largest good steps of plain families by each scheme."""

    def steps(name: str, scheme: str) -> float | None:
        own = [cell for cell in cells if cell.scheme == scheme]
        return largest(own, name, lambda c: c.outcome in (GOOD, BOUNDED))

    return _by_scheme(cells, PLAIN, steps, "g")


def quick_table(cells: Sequence[Cell]) -> Table:
    """How many cells of stiff families hold and are good by each scheme."""

    def counts(name: str, scheme: str) -> str:
        own = [c for c in cells if (c.family, c.scheme) == (name, scheme)]
        held, good = (sum(c.outcome in which for c in own) for which in (HELD, (GOOD,)))
        compared = any(c.error is not None for c in own)
        return f"{held} of {len(own)}" + (f", {good} good" if compared else "")

    return _by_scheme(cells, QUICK, counts)


def _by_scheme(
    cells: Sequence[Cell],
    families: Sequence[str],
    entry: Callable[[str, str], Entry],
    form: str = "",
) -> Table:
    """A line a family, a column a scheme, of those there are."""
    schemes, names = (dict.fromkeys(getattr(c, of) for c in cells) for of in ("scheme", "family"))
    columns = (
        Column("family", "scene"),
        *(Column(scheme, scheme, form=form, missing="-") for scheme in schemes),
    )
    rows = ((title_of(n), *(entry(n, s) for s in schemes)) for n in families if n in names)
    return Table(columns, tuple(rows))


def largest(cells: Sequence[Cell], name: str, good: Callable[[Cell], bool]) -> float | None:
    """The largest step up to which all cells of a family are good; None if there is none."""
    found = None
    for dt in STEPS:
        own = [cell for cell in cells if cell.family == name and cell.dt == dt]
        if not own or not all(map(good, own)):
            break
        found = dt
    return found


def pair_text(cells: Sequence[Cell]) -> str:
    """In how many cells only one of the schemes holds."""
    schemes = list(dict.fromkeys(cell.scheme for cell in cells))
    held = {s: {_place(c) for c in cells if c.scheme == s and c.outcome in HELD} for s in schemes}
    texts = []
    for scheme in schemes:
        others = set().union(*(held[s] for s in schemes if s != scheme))
        texts.append(f"{len(held[scheme] - others)} hold with {scheme} alone")
    return ", ".join(texts)


def _place(cell: Cell) -> tuple[str, float | str, float]:
    return cell.family, cell.value, cell.dt


def span_text(cells: Sequence[Cell], name: str) -> str:
    """How many cells of a family hold."""
    own = [cell for cell in cells if cell.family == name]
    held = sum(cell.outcome in HELD for cell in own)
    values = [cell.value for cell in own]
    return f"{held} of {len(own)} runs hold, from {min(values):g} to {max(values):g} critical"


def glance_table(cells: Sequence[Cell]) -> Table:
    """A line a family and scheme."""
    columns = (
        Column("family", "scene"),
        Column("scheme", "scheme"),
        Column("holds", "holds to [s]", form="g", missing="-"),
        Column("good", "good to [s]", form="g", missing="-"),
        Column("held", "hold"),
        Column("energy", "energy over max KE", form=".1e", missing=""),
        Column("gap", "gap [m]", form=".1e", missing=""),
        Column("rate", "gap rate [m/s]", form=".1e", missing=""),
        Column("iterations", "iterations a step", form=".1f", missing=""),
        Column("subdivisions", "subdivisions", form=".2g", missing=""),
        Column("rescues", "rescues", form=".2g", missing=""),
        Column("condition", "condition", form=".0e", missing=""),
    )
    rows = []
    for name in dict.fromkeys(cell.family for cell in cells):
        for scheme in dict.fromkeys(cell.scheme for cell in cells):
            own = [c for c in cells if (c.family, c.scheme) == (name, scheme)]
            rows.append(_glance_row(name, scheme, own))
    return Table(columns, tuple(rows))


def _glance_row(name: str, scheme: str, own: Sequence[Cell]) -> tuple[Entry, ...]:
    held = [cell for cell in own if cell.outcome in HELD]

    def worst(figure: Callable[[Cell], float | None]) -> float | None:
        known = [value for value in map(figure, held) if value is not None]
        return max(known, default=None)

    compared = any(cell.error is not None for cell in own)
    near = largest(own, name, lambda c: c.outcome in (GOOD, BOUNDED))
    return (
        title_of(name),
        scheme,
        largest(own, name, lambda c: c.outcome in HELD),
        near if compared else None,
        f"{len(held)} of {len(own)}",
        worst(lambda c: c.energy),
        worst(lambda c: c.gap),
        worst(lambda c: c.violation_rate),
        worst(lambda c: c.iterations),
        worst(lambda c: (c.subdivisions or 0) / max(c.steps, 1)),
        worst(lambda c: (c.rescues or 0) / max(c.steps, 1)),
        worst(lambda c: c.condition),
    )


def verdict_blocks(cells: Sequence[Cell]) -> list[Block]:
    """Outcomes against the verdicts that the runs gave themselves, if they gave any."""
    if not any(cell.verdict for cell in cells):
        return []
    words = list(dict.fromkeys(cell.verdict for cell in cells if cell.verdict))
    outcomes = [o for o in (*HELD, DOUBTFUL, FAILED, LATE, REFUSED) if shares(cells)[o]]
    columns = (
        Column("outcome", "outcome here"),
        *(Column(word, word, "verdict of the run", form="d") for word in sorted(words)),
        Column("none", "none", "verdict of the run", form="d"),
    )
    rows = []
    for outcome in outcomes:
        own = Counter(cell.verdict for cell in cells if cell.outcome == outcome)
        rows.append((outcome, *(own[word] for word in sorted(words)), own[None]))
    return [
        Heading(2, "What the runs say of themselves"),
        Paragraph(
            "The verdict in run.json beside the outcome here, which knows true positions where the "
            "run does not."
        ),
        Table(columns, tuple(rows)),
        Paragraph(
            "The same asked for an accuracy, the tolerance here (msahl run --shadow), up to the "
            "time of comparison, beside the largest true error of positions, and of turns times "
            "the bodies' lengths, at all rows."
        ),
        judged_table(cells),
        Items(tuple(lost_energy(cells))),
    ]


def true_error(cell: Cell) -> float:
    """Largest error of positions and turns, in tolerances."""
    return max(cell.error or 0.0, cell.turned or 0.0) / cell.tolerance


NEAR = (("within the tolerance", 1.0), ("within ten times", 10.0), ("beyond", inf))


def judged_table(cells: Sequence[Cell]) -> Table:
    """How many runs of each size of error have which verdict."""
    columns = (
        Column("error", "true error"),
        *(Column(word, word, "verdict with --shadow", form="d") for word in WORDS),
    )
    rows, least = [], -1.0
    for words, most in NEAR:
        own = [c.judged for c in cells if c.judged and least < true_error(c) <= most]
        rows.append((words, *(own.count(word) for word in WORDS)))
        least = most
    return Table(columns, tuple(rows))


def lost_energy(cells: Sequence[Cell]) -> Iterator[tuple[str, str]]:
    """Runs that are where they should be and fail."""
    own = [c for c in cells if c.judged == FAIL and true_error(c) <= 1.0]
    if own:
        names = ", ".join(dict.fromkeys(title_of(c.family).lower() for c in own))
        yield (
            "FAIL where the positions are right",
            f"{len(own)} runs ({names}): their energy balance is off by "
            f"{min(c.energy or 0.0 for c in own):.1e} of the largest kinetic energy and more, so "
            "their velocities and reactions are worth nothing, though positions hardly move in the "
            "time that can be compared.",
        )


def bad_blocks(cells: Sequence[Cell]) -> Iterator[Block]:
    """Every cell that does not hold, family by family, with the reason."""
    verdicts = any(cell.verdict for cell in cells)
    for name in dict.fromkeys(cell.family for cell in cells):
        bad = [c for c in cells if c.family == name and c.outcome not in HELD]
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
            Column("energy", "energy over max KE", form=".1e", missing=""),
            Column("gap", "gap [m]", form=".1e", missing=""),
            Column("message", "what the run says"),
        ]
        if verdicts:
            columns.append(Column("verdict", "verdict", missing=""))
        rows = []
        for c in bad:
            row = [show_value(c.value), c.scheme, c.dt, c.outcome, c.steps, c.energy, c.gap]
            rows.append((*row, first_sentence(c.message), *([c.verdict] if verdicts else [])))
        yield Table(tuple(columns), tuple(rows))


def first_sentence(message: str) -> str:
    """The part of a message that says what happened, without its advice."""
    return message.split(". ")[0].strip()


def scene_table(cells: Sequence[Cell]) -> Table:
    """What each family is, what is varied, and what it is compared with."""
    columns = (
        Column("name", "family"),
        Column("deck", "deck"),
        Column("varied", "varied"),
        Column("values", "values"),
        Column("tolerance", "tolerance [m]"),
        Column("reference", "true positions"),
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
    """How the figures were taken."""
    yield (
        "True positions",
        "exact: a closed form. independent: msahl study's own integration of the accelerations. "
        "finer: the default scheme at a tenth of the smallest step compared at that time, where "
        "the independent solution does not come to an end in reasonable time.",
    )
    yield (
        "Limits",
        f"The pendulum on a spring of a period of {STIFF:g} s and less is compared with one on a "
        f"rod, the loop with a mount of {FIRM:g} N/m and more with one of four pins.",
    )
    yield (
        "Condition",
        f"of the first step's Jacobian, scaled as it is solved, up to {LARGEST} unknowns; by the "
        "schemes of order 2 it is that of the default one. Where it grows with stiffness the "
        "spring's own row is the large one, which does no harm to the others.",
    )
    yield (
        "Time",
        f"A run is asked to stop after {BOUND:g} s of a processor (long runs later) and told to "
        "after as long again; most take some hundredths. Which runs end so depends on the machine. "
        "Compilers have done before. Families and schemes can be run again alone (stability.py "
        "FAMILY SCHEME); the other lines then stay as they were.",
    )
    yield (
        "Restart",
        f"A deck is run to half of at most {RESTART_HORIZON:g} s, a new deck is made of its last "
        "row, and what that one ends with is compared with the whole. Velocities of a row fit the "
        "joints to the square of the step; the start makes them fit. A decaying scheme begins "
        "again without memory. Joint springs, couplings and drives count from t = 0, so decks "
        f"with those need their free places changed; they are not among the {len(RESTARTED)} here.",
    )
