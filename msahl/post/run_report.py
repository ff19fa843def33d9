"""Assemble the report on one run: verdict, motion, graphs, accuracy; the rest is folded.

It is one document, which is written as an HTML file and as Markdown with its pictures.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from msahl.post.document import (
    Banner,
    Block,
    Folded,
    Graphs,
    Heading,
    Items,
    OnPage,
    Paragraph,
    Picture,
)
from msahl.post.draw import style
from msahl.post.figures import SPATIAL, run_title, spatial_figure
from msahl.post.graph_data import INTERVALS
from msahl.post.metrics import Metrics
from msahl.post.page.blocks import part_of
from msahl.post.page.drawing import as_picture
from msahl.post.page.files import write_document
from msahl.post.page.markup import element
from msahl.post.page.parts import Part, combine, wrap
from msahl.post.run_graphs import Choice, groups
from msahl.post.sentences import (
    describe_constraints,
    describe_energy,
    describe_start,
    describe_work,
)
from msahl.post.summary import (
    body_table,
    constraints_table,
    energy_table,
    events_table,
    loads_table,
    no_work_note,
    partial_note,
    reactions_table,
    work_table,
)
from msahl.post.table import Column, Table
from msahl.post.view.viewer import show_sample, viewer_block
from msahl.results.read import Run
from msahl.results.sample import sample_run
from msahl.run.verdict import describe_reactions

HISTORIES = (
    *("drives", "signals", "markers", "groups", "amplitudes", "joints"),
    *("positions", "reactions", "energy"),
)
ERRORS = ("error", "constraints", "work")
"""Kinds of graphs that are shown, and that are folded."""
CAPTIONS = {
    "linkage": "Bodies at a few instants, faint to strong, and paths of their mass centres",
    "path": "Paths of the bodies' reference points B",
    "path3d": "Paths of the bodies' reference points B in space",
}
NUMBERS, ROWS = 300_000, 1 << 14
"""Most numbers and rows of a run that the viewer gets."""
GLANCE = (
    *("bodies", "joints", "couplings", "motions", "contacts", "events", "loads"),
    "degrees of freedom",
    *("scheme, solver", "step size dt [s]", "output times", "time loop [s]"),
)
"""Facts that stand beside the motion."""
MEANINGS = {
    "PASS": "The results can be used.",
    "DONE": "The run is complete, but its error was not estimated.",
    "WARN": "Use the results with care.",
    "FAIL": "Do not use the results.",
}
CHECKS = {
    "completion": "Completion",
    "accuracy": "Global error",
    "energy": "Energy balance",
    "linearMomentum": "Linear momentum",
    "angularMomentum": "Angular momentum",
    "constraintViolation": "Constraints, position level",
    "constraintViolationRate": "Constraints, velocity level",
    "constraintWork": "Work of the constraints",
    "initialVelocities": "Initial velocities",
    "impacts": "Energy of impacts",
    "solver": "Solver",
    "pivotRatio": "Conditioning",
    "signals": "Signals and auxiliary states",
    "jumps": "Jumps by reactions",
    "speedJumps": "Jumps of prescribed speeds",
    "parallelCapsules": "Parallel capsules",
    "reactions": "Reactions",
    "forceError": "Errors of forces",
    "momentError": "Errors of moments",
    "loadError": "Errors of loads",
    "produced": "Loads of a given motion",
    "uniqueLoads": "Loads that are not unique",
    "misfit": "Given values",
    "errorForces": "Error bars of forces",
    "errorMoments": "Error bars of torques",
    "energyBalance": "Work and energy",
}
"""Names of the checks for a reader; another is shown by its own name."""

DEFINITIONS = (
    (
        "E",
        "m v_G.v_G/2 + w.J w/2 - m g.x_G, summed over the bodies (Hainge 2010, eq. 3.5-3.10), and "
        "the elastic energy of springs and beams.",
    ),
    (
        "balance error",
        "E(t) - E(0) - work of loads and motions since t = 0; zero for the exact motion.",
    ),
    (
        "balance error over |E(1)|",
        "balance error divided by the absolute energy at the start (eq. 3.11).",
    ),
    (
        "balance error over max KE",
        "balance error divided by the largest kinetic energy at any output time.",
    ),
    ("RMS", "root mean square over all output times or steps (eq. 3.12)."),
    ("max", "largest absolute value."),
    (
        "work",
        "work of concentrated loads, drag, friction, dampers and motions since t = 0. The energy "
        "stored in springs and beams is elastic energy instead.",
    ),
    (
        "constraint violation",
        "norm of the residuals of the constraint equations of a joint, coupling or motion at "
        "position level: lengths [m], and angles or products of unit vectors [rad]. Equations "
        "that constrain rates only have none.",
    ),
    (
        "constraint violation rate",
        "time derivative of the constraint violation (velocity level), or the residual of an "
        "equation that constrains rates.",
    ),
    (
        "reaction",
        "force and moment of the parent on the child, mean over the step, in inertial axes; the "
        "moment is about the joint's point on the child. A reaction is not unique if redundant "
        "joints share it; then the one of least mass-weighted norm is given.",
    ),
    ("load", "generalised force of a coupling or motion along the coordinate it prescribes."),
    (
        "Hainge's virtual work",
        "F_k . C_k (V_(k-1) + V_k)/2 dt: joint force, child's velocity, step size (eq. "
        "3.16-3.18); C_k is the rotation matrix at the end of the step. It is not zero if a joint "
        "exchanges energy between translation and rotation. Some RMS values that Hainge prints "
        "are negative: compare those with the mean.",
    ),
    (
        "work of the reaction",
        "F . (displacement of the child's joint point - displacement of the parent's) + M . "
        "(rotation of the child - rotation of the parent): work of a joint's reaction on both of "
        "its bodies over the step.",
    ),
)


def write_report(run: Run, metrics: Metrics, folder: Path) -> list[Path]:
    """Write ``report.md`` with its pictures, and ``report.html``, to ``folder``; return both paths.

    ``report.html`` is one file that contains all it shows.
    """
    return write_document(run_title(run), build_report(run, metrics), folder, "report")


def build_report(run: Run, metrics: Metrics, viewer: bool = True) -> list[Block]:
    """Return the blocks of the report; without a ``viewer`` the page has a still picture."""
    title, (linkage, paths) = run_title(run), _pictures(run)
    return [
        Heading(1, title, _line(run)),
        *banner(run),
        _motion(run, linkage, viewer),
        Heading(2, "Time histories"),
        *_thinning_note(run),
        Graphs(title, tuple(groups(run, metrics, HISTORIES))),
        *_events(run),
        Heading(2, "Paths"),
        OnPage(wrap("div", *map(part_of, paths), class_="pictures"), tuple(paths)),
        Heading(2, "Accuracy"),
        *_accuracy(run),
        Folded("Errors over time", (Graphs(title, tuple(groups(run, metrics, ERRORS))),)),
        Folded("Accuracy metrics in words", (_in_words(run, metrics),)),
        Folded("Tables of energy, constraints, reactions and work", _tables(run, metrics)),
        Folded("Settings and versions", (_facts_table(run),)),
        Folded("Definitions", (Items(DEFINITIONS),)),
    ]


def _line(run: Run) -> str:
    """Return the deck and when it ends."""
    deck = run.info.get("deck", {}).get("path", "")
    steps, end = run.info.get("steps"), f"{run.time[-1]:g} s"
    extent = f"{steps} steps to t = {end}" if steps else f"{len(run.time)} output times to {end}"
    by = f"msahl {run.info['command']}, " if "command" in run.info else ""
    return f"{deck}: {by}{extent}" if deck else by + extent


def banner(run: Run) -> list[Block]:
    """Return the verdict on a run with its reasons, and the warnings of the run."""
    verdict = run.info.get("verdict") or {}
    name, note = verdict.get("word", ""), partial_note(run)
    reasons = [note, *(verdict.get("reasons", []) or _good_news(verdict))]
    lines = [Paragraph(f"{text[0].upper()}{text[1:]}.") for text in reasons if text]
    warnings = tuple(("Warning", text) for text in run.info.get("warnings", []))
    blocks = (*lines, *((Items(warnings),) if warnings else ()))
    if name not in MEANINGS:
        return [Banner("", "", blocks)] if blocks else []
    return [Banner(name, MEANINGS[name], blocks)]


def _good_news(verdict: dict[str, Any]) -> list[str]:
    """Return what a run without complaints has reached: its global error and energy balance."""
    checks = verdict.get("checks", {})
    return [checks[name]["text"] for name in ("accuracy", "energy") if name in checks]


def _motion(run: Run, linkage: Sequence[Picture], viewer: bool) -> OnPage:
    """Return the motion with the facts on the run beside it."""
    shown = combine(*map(part_of, linkage))
    if viewer:
        moving = viewer_block(
            [show_sample(sample_run(run, NUMBERS, ROWS), columns=False, events=run.events)]
        )
        shown = wrap("div", moving, wrap("div", shown, class_="printed"))
    known = _facts(run)
    rows = [(element("dt", n), element("dd", known[n])) for n in GLANCE if n in known]
    facts = element("dl", rows, class_="facts")
    return OnPage(wrap("div", shown, facts, class_="split"), tuple(linkage))


def _pictures(run: Run) -> tuple[list[Picture], list[Picture]]:
    """Return the picture of the linkage, unless it hardly moves, and those of the paths."""
    with style():
        found = ((kind, spatial_figure(run, kind, Choice())) for kind in SPATIAL)
        drawn = {
            kind: as_picture(figure[0], CAPTIONS[kind], figure[1])
            for kind, figure in found
            if not isinstance(figure, str)
        }
    return [drawn[k] for k in drawn if k == "linkage"], [drawn[k] for k in drawn if k != "linkage"]


def _thinning_note(run: Run) -> list[Block]:
    """Say which values the graphs of a long run show."""
    if len(run.time) <= 2 * INTERVALS:
        return []
    text = (
        f"Each graph shows values at {2 * INTERVALS} of the {len(run.time)} output times, and in "
        "their place the least or the largest value near them where that lies outside. Drag to "
        "zoom, double-click to see all."
    )
    return [OnPage(Part(element("p", text, class_="note")))]


def _events(run: Run) -> list[Block]:
    """Return what happened to contacts, and by events of the deck."""
    count = 0 if run.events is None else len(run.events)
    if not count:
        return []
    table, note = events_table(run), []
    if count > len(table.rows):
        note = [Paragraph(f"The first {len(table.rows)} of {count}; all are in events.csv.")]
    return [Heading(2, "Contacts and events"), *note, table]


def _accuracy(run: Run) -> list[Block]:
    """Return the estimated errors in a sentence, and a table of all checks."""
    checks = (run.info.get("verdict") or {}).get("checks", {})
    columns = (Column("check", "check"), Column("word", "verdict"), Column("text", "found"))
    rows = tuple((CHECKS.get(n, n), c["word"], c["text"]) for n, c in checks.items())
    estimate = _estimate(run)
    return [
        *((Paragraph(estimate),) if estimate else ()),
        *((Table(columns, rows),) if rows else ()),
    ]


def _estimate(run: Run) -> str:
    """Describe the estimated global errors; empty if there are none."""
    error = run.info.get("error") or {}
    names = (
        ("position", "positions", "m"),
        ("velocity", "velocities", "m/s"),
        ("angularVelocity", "angular velocities", "rad/s"),
        ("force", "reaction forces", "N"),
    )
    parts = [f"{w} by at most {error[k]:.1e} {u}" for k, w, u in names if error.get(k) is not None]
    if not parts:
        return ""
    companion = error.get("companion")
    by = f", by comparison with a second run ({companion})" if companion else ""
    until = error.get("until")
    end = f" up to t = {until:g} s" if until is not None and not error.get("complete") else ""
    return (
        f"The results differ from the exact motion of the model, as estimated{by}{end}: "
        f"{', '.join(parts)}."
    )


def _in_words(run: Run, metrics: Metrics) -> Items:
    return Items(tuple(("", sentence) for sentence in _sentences(run, metrics)))


def _sentences(run: Run, metrics: Metrics) -> list[str]:
    sentences = [
        describe_energy(metrics.energy),
        describe_start(metrics.energy),
        *describe_constraints(metrics.constraints, "command" not in run.info),
        describe_work(metrics.work, metrics.energy),
    ]
    if run.every > 1:
        sentences.append(f"These metrics are of the output times, one of {run.every} steps.")
        if run.model.joints:
            sentences.append(f"V{no_work_note(run)[1:]}.")
    return [sentence for sentence in sentences if sentence]


def _tables(run: Run, metrics: Metrics) -> tuple[Block, ...]:
    """Return the tables of energy and bodies; of loads, constraints, reactions and virtual work if
    there are any."""
    named = [("", metrics)]
    blocks: list[Block] = [
        Heading(3, "Energy"),
        energy_table(named).without("run").transposed(),
        body_table(metrics.energy),
    ]
    if metrics.loads.names:
        blocks += [Heading(3, "Loads and motions"), loads_table(metrics.loads)]
    if metrics.constraints.names:
        blocks += [
            Heading(3, "Constraint violation"),
            constraints_table(named).without("run").filled(),
            Heading(3, "Reactions"),
            reactions_table(metrics.reactions).filled(),
        ]
    if run.model.joints and metrics.work is not None:
        blocks += [Heading(3, "Virtual work over a step"), work_table(named).without("run")]
    return tuple(blocks)


def _facts_table(run: Run) -> Table:
    columns = (Column("quantity", "quantity"), Column("value", "value"))
    return Table(columns, tuple(_facts(run).items()))


def _facts(run: Run) -> dict[str, str]:
    """Return what was run and how, from ``run.json``."""
    info, model, simulation = run.info, run.model, run.model.simulation
    deck, options, seconds = (info.get(key, {}) for key in ("deck", "options", "seconds"))
    versions = ("msahl", "python", "numpy", "scipy", "numba")
    thinned = f" (one of {run.every} steps)" if run.every > 1 else ""
    counts = ("bodies", "joints", "couplings", "motions", "contacts", "events", "loads")
    facts = {
        "deck": deck.get("path"),
        "SHA-256 of the deck": deck.get("digest"),
        **{name: len(getattr(model, name)) or None for name in counts},
        "degrees of freedom": _degrees_of_freedom(run),
        "reactions that are not unique": (
            describe_reactions(info.get("nonUniqueReactions", {})) or None
        ),
        "independent subsystems": _subsystems(run),
        "step size dt [s]": f"{simulation.dt:.12g}",
        "end time [s]": f"{simulation.t_final:.12g}",
        "scheme, solver": ", ".join(options.get(key, "?") for key in ("scheme", "solver")),
        "output times": f"{len(run.time)}{thinned}",
        "unknowns": info.get("unknowns"),
        "iterations": info.get("iterations"),
        "step subdivisions": info.get("subdivisions"),
        "time loop [s]": f"{seconds['loop']:.2g}" if "loop" in seconds else None,
        "time taken [s]": ", ".join(f"{n} {t:.3g}" for n, t in seconds.items()) or None,
        "versions": ", ".join(f"{name} {info[name]}" for name in versions if name in info) or None,
    }
    return {name: str(value) for name, value in facts.items() if value is not None}


def _degrees_of_freedom(run: Run) -> str | None:
    """Return the degrees of freedom; by count and by rank if the two differ."""
    found = run.info.get("degreesOfFreedom")
    if not found:
        return None
    count, rank = found.get("byCount"), found.get("byRank")
    if count is None or count == rank:
        return str(rank)
    return f"{rank} by rank, {count} by count: the joints are redundant"


def _subsystems(run: Run) -> str | None:
    """Return the number of independent subsystems, and how many of them move in a plane or are
    stepped in joint coordinates.
    """
    subsystems, planar = run.info.get("subsystems"), run.info.get("planarSubsystems")
    trees = run.info.get("treeSubsystems")
    of_them = [f"{planar} planar"] if planar else []
    of_them += [f"{trees} in joint coordinates"] if trees else []
    return f"{subsystems}, of them {' and '.join(of_them)}" if of_them else subsystems
