"""Build the page on one run: verdict, picture, time histories, accuracy; the rest is folded."""

from collections.abc import Callable
from typing import Any

from msahl.post.document import Paragraph
from msahl.post.draw import style
from msahl.post.figures import Choice, figures
from msahl.post.linkage.draw import lacks_motion
from msahl.post.metrics import Metrics
from msahl.post.page.blocks import fold, header, part_of, section, table, word
from msahl.post.page.drawing import drawn
from msahl.post.page.graphs import INTERVALS, graphs
from msahl.post.page.markup import element, running
from msahl.post.page.page import NOTHING, Part, wrap, write_page
from msahl.post.run_graphs import diagnostics, histories
from msahl.post.summary import partial_note
from msahl.post.table import Column, Table
from msahl.post.view.page import show_sample, viewer_block
from msahl.results.read import Run
from msahl.results.sample import sample_run

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
    "solver": "Solver",
    "pivotRatio": "Conditioning",
    "reactions": "Reactions",
    "produced": "Loads of a given motion",
    "uniqueLoads": "Loads that are not unique",
    "misfit": "Given values",
    "errorForces": "Error bars of forces",
    "errorMoments": "Error bars of torques",
    "energyBalance": "Work and energy",
}
"""Names of the checks for a reader; another is shown by its own name."""

NUMBERS, ROWS = 300_000, 1 << 14
"""Most numbers and rows of a run that the viewer gets."""

Pictured = Callable[[Run, Metrics], Part]


def run_page(run: Run, metrics: Metrics, folded: dict[str, list[Any]], picture: Pictured) -> str:
    """Return the page on a run as HTML.

    ``folded`` has titles and blocks that follow below the accuracy; ``picture`` makes the picture
    of the mechanism.
    """
    title = run.model.simulation.title or run.folder.resolve().name
    content = [
        header(title, _line(run)),
        banner(run),
        wrap("div", picture(run, metrics), _facts(run), class_="split"),
        section("Time histories", _thinning_note(run), graphs(histories(run, metrics))),
        section("Accuracy", *_accuracy(run)),
        fold("Errors over time", graphs(diagnostics(run, metrics), "diagnostics")),
        *(fold(name, *blocks) for name, blocks in folded.items() if blocks),
    ]
    return write_page(title, wrap("main", *content))


def _line(run: Run) -> str:
    """Return the deck and when it ends."""
    deck = run.info.get("deck", {}).get("path", "")
    steps, end = run.info.get("steps"), f"{run.time[-1]:g} s"
    extent = f"{steps} steps to t = {end}" if steps else f"{len(run.time)} output times to {end}"
    by = f"msahl {run.info['command']}, " if "command" in run.info else ""
    return f"{deck}: {by}{extent}" if deck else by + extent


def banner(run: Run) -> Part:
    """Return the verdict on a run with its reasons, in its colour, and the warnings of the run."""
    verdict = run.info.get("verdict") or {}
    name = verdict.get("word", "")
    lines = [element("p", word(name), f" {MEANINGS.get(name, '')}", class_="head")] if name else []
    if note := partial_note(run):
        lines.append(element("p", running(f"{note[0].upper()}{note[1:]}.")))
    reasons = verdict.get("reasons", []) or _good_news(verdict)
    lines += [element("p", running(f"{text[0].upper()}{text[1:]}.")) for text in reasons if text]
    warnings = run.info.get("warnings", [])
    lines += [element("p", element("b", "Warning"), ": ", running(text)) for text in warnings]
    kind = f"banner {name.lower()}" if name in MEANINGS else "banner"
    return wrap("div", *lines, class_=kind, role="status") if lines else NOTHING


def _good_news(verdict: dict[str, Any]) -> list[str]:
    """Return what a run without complaints has reached: its global error and energy balance."""
    checks = verdict.get("checks", {})
    return [checks[name]["text"] for name in ("accuracy", "energy") if name in checks]


def still_picture(run: Run, metrics: Metrics) -> Part:
    """Return the linkage at a few instants; of a motion that it does not show, the paths."""
    kind, words = "linkage", "The bodies and their joints at a few instants"
    if lacks_motion(run):
        kind, words = "path", "Paths of the bodies' reference points"
    with style():
        ((_, figure),) = figures(run, metrics, Choice(), [kind])
        picture = drawn(figure, kind)
    return Part(element("figure", picture, role="img", aria_label=words))


def moving_picture(run: Run, metrics: Metrics) -> Part:
    """Return the viewer of the motion; in print, the still picture."""
    viewer = viewer_block([show_sample(sample_run(run, NUMBERS, ROWS), columns=False)])
    return wrap("div", viewer, wrap("div", still_picture(run, metrics), class_="printed"))


def _facts(run: Run) -> Part:
    """Return the size of the model and how it was run, at a glance."""
    model, info = run.model, run.info
    counts = (
        ("bodies", model.bodies),
        ("joints", model.joints),
        ("couplings", model.couplings),
        ("motions", model.motions),
        ("loads", model.loads),
    )
    rank = info.get("degreesOfFreedom", {}).get("byRank")
    options, seconds = info.get("options", {}), info.get("seconds", {})
    facts = [
        *((name, str(len(group))) for name, group in counts if group),
        ("degrees of freedom", None if rank is None else str(rank)),
        ("scheme", options.get("scheme")),
        ("step size", f"{model.simulation.dt:g} s"),
        ("output times", str(len(run.time))),
        ("computing", f"{seconds['loop']:.2g} s" if "loop" in seconds else None),
    ]
    rows = [(element("dt", name), element("dd", value)) for name, value in facts if value]
    return Part(element("dl", rows, class_="facts"))


def _thinning_note(run: Run) -> Part:
    """Say which values the graphs of a long run show."""
    if len(run.time) <= 2 * INTERVALS:
        return NOTHING
    text = (
        f"Each graph shows the least and the largest value in each of {INTERVALS} intervals of the "
        f"{len(run.time)} output times. Drag to zoom, double-click to see all."
    )
    return Part(element("p", text, class_="note"))


def _accuracy(run: Run) -> list[Part]:
    """Return the estimated errors in a sentence, and a table of all checks."""
    content = [part_of(Paragraph(text)) for text in (_estimate(run),) if text]
    checks = (run.info.get("verdict") or {}).get("checks", {})
    columns = (Column("check", "check"), Column("word", "verdict"), Column("text", "found"))
    rows = tuple((CHECKS.get(n, n), c["word"], c["text"]) for n, c in checks.items())
    return [*content, Part(table(Table(columns, rows)))] if rows else content


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
