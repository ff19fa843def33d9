"""The report on one run: built once as blocks, written as Markdown and as HTML."""

from pathlib import Path

from msahl.post.document import Block, Heading, Items, Paragraph, Picture, as_html, as_markdown
from msahl.post.draw import encode, style
from msahl.post.figures import Choice, figures
from msahl.post.metrics import Measures
from msahl.post.sentences import constraints_verdict, energy_verdict, start_verdict, work_verdict
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
    "path": "Paths of the bodies' reference points",
    "error": "Estimated error, the largest of all bodies",
    "energy": "Energies, and the error of their balance",
    "work": "Virtual work of each joint over each step",
    "constraints": "Gap and gap rate of each joint, coupling and motion",
    "reactions": "Force and moment of each joint on its child; loads of couplings and motions",
}

DEFINITIONS = (
    (
        "E",
        "m v_G.v_G/2 + w.J w/2 - m g.x_G, summed over the bodies (Hainge 2010, eq. 3.5-3.10), and "
        "the elastic energy of springs.",
    ),
    (
        "error",
        "E(t) - E(0) - work since t = 0 of loads and motions; zero for the exact motion.",
    ),
    ("error over |E(1)|", "error over the absolute energy of the first row (eq. 3.11)."),
    ("error over max KE", "error over the largest kinetic energy of any row."),
    ("RMS", "square root of the mean square, over all rows or steps (eq. 3.12)."),
    ("max", "largest absolute value."),
    (
        "work",
        "of concentrated loads, drag, friction, dampers and motions since t = 0. What springs "
        "store and give back is elastic energy instead.",
    ),
    (
        "gap",
        "how far the equations of a joint, coupling or motion are from being kept: lengths [m], "
        "and angles or products of unit vectors [rad]; none for equations between rates.",
    ),
    ("gap rate", "rate of the gap, or what an equation between rates is off by."),
    (
        "reaction",
        "of the parent on the child, mean over the step, inertial axes; the moment is about the "
        "joint's point on the child. Not unique: redundant joints share it, and the smallest, "
        "weighted by mass, is given.",
    ),
    ("load", "of a coupling or motion along the free motion it prescribes."),
    (
        "Hainge's measure",
        "F_k . C_k (V_(k-1) + V_k)/2 dt: joint force, child's velocity, step (eq. 3.16-3.18); C "
        "is that of the step's end. Not zero where a joint moves energy between translation and "
        "rotation. What Hainge prints as its RMS is negative at times: compare it with the mean.",
    ),
    (
        "work of the reaction",
        "F . (way of the child's point - way of the parent's) + M . (turn of the child - turn of "
        "the parent): work of a joint on both of its bodies over the step.",
    ),
)


def write_report(run: Run, measures: Measures, folder: Path) -> list[Path]:
    """Write ``report.md`` with its pictures and ``report.html`` to ``folder``; the two paths."""
    blocks = build_report(run, measures)
    folder.mkdir(parents=True, exist_ok=True)
    for block in blocks:
        if isinstance(block, Picture):
            replace_file(folder / block.name, block.png)
    texts = {"report.md": as_markdown(blocks), "report.html": as_html(_title(run), blocks)}
    for name, text in texts.items():
        replace_file(folder / name, text.encode())
    return [folder / name for name in texts]


def build_report(run: Run, measures: Measures) -> list[Block]:
    """What the report says, in order."""
    return [
        Heading(1, _title(run)),
        Paragraph(_status(run)),
        *_warnings(run),
        *_judgement(run),
        Heading(2, "How wrong it is"),
        Items(tuple(("", sentence) for sentence in _verdicts(run, measures))),
        *_figures_in_tables(run, measures),
        Heading(2, "What it looks like"),
        *_pictures(run, measures),
        Heading(2, "What ran"),
        _facts(run),
        Heading(2, "What the numbers mean"),
        Items(DEFINITIONS),
    ]


def _title(run: Run) -> str:
    return run.model.simulation.title or run.folder.resolve().name


def _status(run: Run) -> str:
    steps = run.info.get("steps")
    taken = f"{steps} steps" if steps else f"{len(run.time)} rows"
    whole = f"The run is complete: {taken} to t = {run.time[-1]:g} s."
    note = partial_note(run)
    return f"{note[0].upper()}{note[1:]}." if note else whole


def _warnings(run: Run) -> list[Block]:
    warnings = run.info.get("warnings", [])
    return [Items(tuple(("Warning", text) for text in warnings))] if warnings else []


def _judgement(run: Run) -> list[Block]:
    """The verdict the run was given, check by check."""
    verdict = run.info.get("verdict")
    if not verdict:
        return []
    checks = verdict["checks"].items()
    return [
        Paragraph(f"Verdict: {verdict['word']}."),
        Items(tuple((f"{check}, {found['word']}", found["text"]) for check, found in checks)),
    ]


def _verdicts(run: Run, measures: Measures) -> list[str]:
    sentences = [
        energy_verdict(measures.energy),
        start_verdict(measures.energy),
        *constraints_verdict(measures.constraints),
        work_verdict(measures.work, measures.energy),
    ]
    if run.every > 1:
        sentences.append(f"These figures are of every {run.every}th step, the ones on file.")
        if run.model.joints:
            sentences.append(f"V{no_work_note(run)[1:]}.")
    return [sentence for sentence in sentences if sentence]


def _figures_in_tables(run: Run, measures: Measures) -> list[Block]:
    """Tables of energy and of bodies, and of loads, constraints, reactions and virtual work where
    there are any."""
    measured = [("", measures)]
    blocks: list[Block] = [
        Heading(3, "Energy"),
        energy_table(measured).without("run").transposed(),
        body_table(measures.energy),
    ]
    if measures.loads.names:
        blocks += [Heading(3, "Loads and motions"), loads_table(measures.loads)]
    if measures.constraints.names:
        blocks += [
            Heading(3, "Joints"),
            constraints_table(measured).without("run").filled(),
            reactions_table(measures.reactions).filled(),
        ]
    if run.model.joints and measures.work is not None:
        blocks += [Heading(3, "Virtual work over a step"), work_table(measured).without("run")]
    return blocks


def _pictures(run: Run, measures: Measures) -> list[Block]:
    with style():
        return [
            Picture(f"{name}.png", CAPTIONS[name.partition("-")[0]], encode(figure, "png"))
            for name, figure in figures(run, measures, Choice())
        ]


def _facts(run: Run) -> Table:
    """What ran, as far as ``run.json`` tells."""
    info, simulation = run.info, run.model.simulation
    deck, options = info.get("deck", {}), info.get("options", {})
    seconds = ", ".join(f"{phase} {time:.3g}" for phase, time in info.get("seconds", {}).items())
    versions = ("msahl", "python", "numpy", "scipy", "numba")
    facts = (
        ("deck", deck.get("path")),
        ("deck's SHA-256", deck.get("digest")),
        ("bodies, joints, couplings, motions, loads", _counts(run)),
        ("degrees of freedom", _freedoms(run)),
        (
            "reactions that are not unique",
            describe_reactions(info.get("nonUniqueReactions", {})) or None,
        ),
        ("subsystems", _subsystems(run)),
        ("step dt [s]", f"{simulation.dt:.12g}"),
        ("end [s]", f"{simulation.t_final:.12g}"),
        ("scheme, solver", ", ".join(options.get(key, "?") for key in ("scheme", "solver"))),
        ("rows on file", f"{len(run.time)} (every {run.every}. step)" if run.every > 1 else None),
        ("rows on file", str(len(run.time)) if run.every == 1 else None),
        ("unknowns", info.get("unknowns")),
        ("iterations", info.get("iterations")),
        ("steps cut in halves", info.get("subdivisions")),
        ("seconds", seconds or None),
        (
            "versions",
            ", ".join(f"{name} {info[name]}" for name in versions if name in info) or None,
        ),
    )
    known = tuple((name, str(value)) for name, value in facts if value is not None)
    return Table((Column("what", "what"), Column("value", "value")), known)


def _counts(run: Run) -> str:
    model = run.model
    groups = (model.bodies, model.joints, model.couplings, model.motions, model.loads)
    return ", ".join(str(len(group)) for group in groups)


def _freedoms(run: Run) -> str | None:
    """Degrees of freedom, by both ways to count them where they differ."""
    told = run.info.get("degreesOfFreedom")
    if not told:
        return None
    count, rank = told.get("byCount"), told.get("byRank")
    return str(rank) if count == rank else f"{rank} by rank, {count} by count: redundant joints"


def _subsystems(run: Run) -> str | None:
    """How many parts move independently, and in how many of them all stays in parallel planes."""
    told, planar = run.info.get("subsystems"), run.info.get("planarSubsystems")
    return f"{told}, {planar} of them planar" if planar else told
