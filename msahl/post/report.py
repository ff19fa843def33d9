"""Write the report on one run: Markdown with its pictures, and a page (``post.run_page``)."""

from pathlib import Path

from msahl.post.document import Block, Heading, Items, Paragraph, Picture, as_markdown
from msahl.post.draw import encode, style
from msahl.post.figures import Choice, figures
from msahl.post.metrics import Metrics
from msahl.post.run_page import Pictured, moving_picture, run_page
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
    loads_table,
    no_work_note,
    partial_note,
    reactions_table,
    work_table,
)
from msahl.post.table import Column, Table
from msahl.results.read import Run
from msahl.results.write import replace_file
from msahl.run.verdict import describe_reactions

CAPTIONS = {
    "linkage": "Bodies at a few instants, faint to strong, and paths of their mass centres",
    "path": "Paths of the bodies' reference points B",
    "path3d": "Paths of the bodies' reference points B in space",
    "error": "Estimated global error of positions and orientations, the largest of all bodies",
    "energy": "Energies and energy balance error",
    "work": "Virtual work of each joint over each step",
    "joints": "Angles and slides of joints, and their rates",
    "constraints": "Constraint violation of each joint, coupling and motion",
    "reactions": "Force and moment of each joint on its child, and loads of couplings and motions",
}

DEFINITIONS = (
    (
        "E",
        "m v_G.v_G/2 + w.J w/2 - m g.x_G, summed over the bodies (Hainge 2010, eq. 3.5-3.10), and "
        "the elastic energy of springs.",
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
        "stored in springs is elastic energy instead.",
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
    blocks = build_report(run, metrics)
    folder.mkdir(parents=True, exist_ok=True)
    for block in blocks:
        if isinstance(block, Picture):
            replace_file(folder / block.name, block.png)
    texts = {"report.md": as_markdown(blocks), "report.html": build_page(run, metrics)}
    for name, text in texts.items():
        replace_file(folder / name, text.encode())
    return [folder / name for name in texts]


def build_page(run: Run, metrics: Metrics, picture: Pictured = moving_picture) -> str:
    """Return the page on a run; tables, settings and definitions are folded."""
    folded: dict[str, list[Block]] = {
        "Accuracy metrics in words": [_in_words(run, metrics)],
        "Tables of energy, constraints, reactions and work": _tables(run, metrics),
        "Settings and versions": [_facts(run)],
        "Definitions": [Items(DEFINITIONS)],
    }
    return run_page(run, metrics, folded, picture)


def build_report(run: Run, metrics: Metrics) -> list[Block]:
    """Return the blocks of the report in their order."""
    return [
        Heading(1, _title(run)),
        Paragraph(_status(run)),
        *_warnings(run),
        *_verdict(run),
        Heading(2, "Accuracy"),
        _in_words(run, metrics),
        *_tables(run, metrics),
        Heading(2, "Figures"),
        *_pictures(run, metrics),
        Heading(2, "Run"),
        _facts(run),
        Heading(2, "Definitions"),
        Items(DEFINITIONS),
    ]


def _title(run: Run) -> str:
    return run.model.simulation.title or run.folder.resolve().name


def _status(run: Run) -> str:
    steps = run.info.get("steps")
    extent = f"{steps} steps" if steps else f"{len(run.time)} output times"
    subject = f"The motion by msahl {run.info['command']}" if "command" in run.info else "The run"
    complete = f"{subject} is complete: {extent} to t = {run.time[-1]:g} s."
    note = partial_note(run)
    return f"{note[0].upper()}{note[1:]}." if note else complete


def _warnings(run: Run) -> list[Block]:
    warnings = run.info.get("warnings", [])
    return [Items(tuple(("Warning", text) for text in warnings))] if warnings else []


def _verdict(run: Run) -> list[Block]:
    """Return the verdict on the run and its checks."""
    verdict = run.info.get("verdict")
    if not verdict:
        return []
    checks = verdict["checks"].items()
    return [
        Paragraph(f"Verdict: {verdict['word']}."),
        Items(tuple((f"{check}, {found['word']}", found["text"]) for check, found in checks)),
    ]


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


def _tables(run: Run, metrics: Metrics) -> list[Block]:
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
    return blocks


def _pictures(run: Run, metrics: Metrics) -> list[Block]:
    with style():
        return [
            Picture(f"{name}.png", CAPTIONS[name.partition("-")[0]], encode(figure, "png"))
            for name, figure in figures(run, metrics, Choice())
        ]


def _facts(run: Run) -> Table:
    """Return the table of what was run and how, from ``run.json``."""
    info, simulation = run.info, run.model.simulation
    deck, options = info.get("deck", {}), info.get("options", {})
    seconds = ", ".join(f"{phase} {time:.3g}" for phase, time in info.get("seconds", {}).items())
    versions = ("msahl", "python", "numpy", "scipy", "numba")
    facts = (
        ("deck", deck.get("path")),
        ("SHA-256 of the deck", deck.get("digest")),
        ("bodies, joints, couplings, motions, loads", _counts(run)),
        ("degrees of freedom", _degrees_of_freedom(run)),
        (
            "reactions that are not unique",
            describe_reactions(info.get("nonUniqueReactions", {})) or None,
        ),
        ("independent subsystems", _subsystems(run)),
        ("step size dt [s]", f"{simulation.dt:.12g}"),
        ("end time [s]", f"{simulation.t_final:.12g}"),
        ("scheme, solver", ", ".join(options.get(key, "?") for key in ("scheme", "solver"))),
        ("output times", f"{len(run.time)} (one of {run.every} steps)" if run.every > 1 else None),
        ("output times", str(len(run.time)) if run.every == 1 else None),
        ("unknowns", info.get("unknowns")),
        ("iterations", info.get("iterations")),
        ("step subdivisions", info.get("subdivisions")),
        ("time taken [s]", seconds or None),
        (
            "versions",
            ", ".join(f"{name} {info[name]}" for name in versions if name in info) or None,
        ),
    )
    known = tuple((name, str(value)) for name, value in facts if value is not None)
    return Table((Column("quantity", "quantity"), Column("value", "value")), known)


def _counts(run: Run) -> str:
    model = run.model
    groups = (model.bodies, model.joints, model.couplings, model.motions, model.loads)
    return ", ".join(str(len(group)) for group in groups)


def _degrees_of_freedom(run: Run) -> str | None:
    """Return the degrees of freedom; by count and by rank if the two differ."""
    found = run.info.get("degreesOfFreedom")
    if not found:
        return None
    count, rank = found.get("byCount"), found.get("byRank")
    if count == rank:
        return str(rank)
    return f"{rank} by rank, {count} by count: the joints are redundant"


def _subsystems(run: Run) -> str | None:
    """Return the number of independent subsystems, and how many of them move in a plane."""
    subsystems, planar = run.info.get("subsystems"), run.info.get("planarSubsystems")
    return f"{subsystems}, {planar} of them planar" if planar else subsystems
