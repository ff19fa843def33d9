"""Chapter IV of Hainge (2010) run again: docs/validation/thesis.md and its figures.

python -m tools.validation.thesis
"""

from collections.abc import Iterator

import numpy as np

from msahl.model.scheme import DEFAULT
from msahl.post.document import Block, Heading, Items, Paragraph, Picture
from msahl.post.table import Cell, Column, Table
from msahl.study.runs import run_trials, with_step
from tools.validation.generated import write_generated
from tools.validation.thesis_figures import case_figure, chaos_figure, trend_figure
from tools.validation.thesis_printed import RUNS, STEPS, TRENDS, TRIPLES, Printed
from tools.validation.thesis_runs import OUT, Measured, model_of, run_deck

PAIRS = (
    ("45 and 44.99 degrees", "chaos_45", "chaos_44_99"),
    ("90 and 89.99 degrees", "chaos_90", "chaos_89_99"),
)
REPEATS = 9
FAR = 1.0
"""Distance [m] at which two paths no longer have anything to do with each other."""


def main() -> None:
    """Run everything and write the page."""
    OUT.mkdir(parents=True, exist_ok=True)
    write_generated(OUT / "thesis.md", "tools.validation.thesis", build())


def build() -> Iterator[Block]:
    """Yield the blocks of the page."""
    yield Heading(1, "The thesis, reproduced")
    yield Paragraph(
        "Every case of chapter IV of A. D. Hainge, AFIT/GAE/ENY/10-M10 (2010), run by msahl from "
        "the decks in decks/thesis at the printed settings, and each printed number beside that of "
        "msahl."
    )
    yield Heading(2, "Printed and computed values")
    yield Paragraph(
        "The printed values are those that the thesis calls RMS. Values of msahl: RMS of the "
        "energy balance error over |E(1)| (eq. 3.11) and over the largest kinetic energy; mean "
        "and RMS of the virtual work over a step at the joint with the most, force and velocity "
        "at mid-step (eq. 3.16-3.18); the largest constraint violation of the run."
    )
    yield printed_table()
    yield Heading(2, "Reasons for the differences")
    yield Items(tuple(explanations()))
    yield Heading(2, "The tops with both choices of initial velocities")
    yield Paragraph(top_text())
    yield top_table()
    yield Heading(2, "The triple pendulum")
    yield Paragraph(triple_text())
    yield triple_table()
    yield Heading(2, "Trends")
    yield from trends()
    yield Heading(2, "Chaos")
    yield from chaos()
    yield Heading(2, "Cases")
    yield from cases()


def printed_table() -> Table:
    """Return a table of printed and computed values, a line per printed run."""
    columns = (
        Column("run", "model, step size, end time"),
        Column("status", "msahl"),
        Column("p_energy", "energy", "printed", ".2e", "-"),
        Column("energy_first", "energy over |E(1)|", "msahl", ".2e", "undefined"),
        Column("energy_kinetic", "over max KE", "msahl", ".2e", "-"),
        Column("p_work", "virtual work [J]", "printed"),
        Column("mean", "mean [J]", "msahl"),
        Column("rms", "RMS [J]", "msahl"),
        Column("violation", "violation [m]", "msahl", ".1e"),
    )
    return Table(columns, tuple(_printed_row(run) for run in RUNS))


def _printed_row(run: Printed) -> tuple[Cell, ...]:
    ours = run_deck(run.deck, run.dt, run.t_final)
    energy = ours.metrics.energy
    stopped = f" (stopped at {run.reached:g} s)" if run.reached else ""
    first, kinetic = energy.error_over_first, energy.error_over_kinetic
    return (
        f"{run.deck.replace('_', ' ')}, {run.dt:g} s, {run.t_final:g} s{stopped}",
        "completed" if ours.report.status == "completed" else ours.report.status,
        run.energy,
        first.rms if first else None,
        kinetic.rms if kinetic else None,
        ", ".join(f"{work:.4g}" for work in run.work),
        _figures(ours.work.mean(axis=0)),
        _figures(np.sqrt((ours.work**2).mean(axis=0))),
        float(ours.metrics.constraints.violation[:, :, 0].max()),
    )


def _figures(values: np.ndarray) -> str:
    return ", ".join(f"{value:.2e}" for value in values)


def explanations() -> Iterator[tuple[str, str]]:
    """Yield the reasons for the differences, with numbers."""
    short, long = (run_deck("top_1", 0.002, t) for t in (10.0, 100.0))
    totals = [run.work[0] * round(run.t_final / run.dt) for run in RUNS if run.deck == "top_1"]
    energy = [
        ours.metrics.energy.error_over_kinetic
        for ours in (run_deck(r.deck, r.dt, r.t_final) for r in RUNS)
    ]
    worst = max(spread.rms for spread in energy if spread)
    reports = [run_deck(r.deck, r.dt, r.t_final).report for r in RUNS]
    completed = [report for report in reports if report.status == "completed"]
    undivided = [report for report in completed if not report.subdivisions]
    yield (
        "Failures",
        "The runs of the thesis ended at a step that did not converge. With msahl "
        f"{len(completed)} of {len(RUNS)} runs are completed, {len(undivided)} of them without "
        "step subdivisions. convergence.md shows the reason.",
    )
    yield (
        "Energy",
        "The printed errors are 1e-8 to 1e-6 and fall with the step size. Forces at mean arms "
        "conserve the energy at any step size: the errors of msahl are rounding errors, with an "
        f"RMS of at most {worst:.1e} of the largest kinetic energy, and grow slowly with the "
        "number of steps.",
    )
    e1 = float(run_deck("single_pendulum_89", 0.01, 100.0).metrics.energy.total[0])
    kinetic = run_deck("single_pendulum_89", 0.01, 100.0).metrics.energy.largest_kinetic
    yield (
        "Normalisation by E(1)",
        f"Potential energy is counted from the origin, so at 89 degrees E(1) is {e1:.3g} J, where "
        f"the kinetic energy reaches {kinetic:.4g} J: the error over E(1) is "
        f"{kinetic / abs(e1):.0f} times that over the kinetic energy. At 90 degrees E(1) is zero "
        "and the ratio undefined.",
    )
    yield (
        '"RMS" that are means',
        "A root mean square is not negative; several printed ones are. And a mean that a few "
        "steps dominate falls by ten when ten times as many follow: the tops' printed values do, "
        f"so value times steps is the same for 10 s and 100 s (top 1: {totals[0]:.4f} J and "
        f"{totals[1]:.4f} J). The true RMS does not depend on the length of the run: that of "
        f"msahl for top 1 are {np.sqrt((short.work**2).mean()):.3e} J and "
        f"{np.sqrt((long.work**2).mean()):.3e} J, its means {short.work.mean():.2e} J and "
        f"{long.work.mean():.2e} J.",
    )
    single = run_deck("single_pendulum_45", 0.01, 10.0)
    spin = single.metrics.energy.rotational
    yield (
        "The floor from rotary inertia",
        "lam . v is the power that the joint gives to the translation of the body, and takes "
        "from its rotation. It is zero only for a point mass. Of the single pendulum at 45 "
        f"degrees the work from the start stays within {np.abs(np.cumsum(single.work)).max():.4e} "
        f"J; the rotational energy reaches {spin.max():.4e} J, the same to the digits shown. The "
        "work of the joint's reaction on both of its bodies is at most "
        f"{_reaction_work(single):.1e} J over a step.",
    )
    double = run_deck("double_pendulum_45", 0.002, 10.0)
    yield (
        "The second joint of the double pendulum",
        "Its force moves energy from one bob to the other, which is no error at all: "
        f"{np.sqrt((double.work[:, 1] ** 2).mean()):.2e} J a step as RMS at 45 degrees, where "
        "3.5257e-05 J is printed. The thesis must have taken another velocity there; it does not "
        "say which.",
    )
    yield (
        "Printed twice",
        "The energy and work of the double pendulum over 100 s are the same numbers at 45 degrees "
        "(0.003 s) and at 89 (0.002 s); so are the works over 10 s at 89 and at 135 degrees. One "
        "of each must be a slip. So are g = 9.8 in the tables (the decks have 9.80665) and angular "
        "velocities in m/s.",
    )


def _reaction_work(measured: Measured) -> float:
    work = measured.metrics.work
    return float(np.abs(work.reaction).max()) if work else float("nan")


def top_text() -> str:
    """Describe the effect of the inconsistent velocities."""
    given, consistent = (run_deck("top_1", 0.002, 10.0, choice) for choice in (True, False))
    jumps = np.abs(given.metrics.reactions.force[1:]).max()
    smooth = np.abs(consistent.metrics.reactions.force[1:]).max()
    return (
        "The decks give the mass centre no velocity, yet an angular velocity that moves it: 0.198 "
        "m/s in case 1. If they are used as given, velocity and joint force alternate from step "
        f"to step without end, at conserved energy: the force reaches {jumps:.1f} N in case 1 at "
        f"0.002 s, where the exact one stays within {smooth:.2f} N, and grows as the step size "
        "falls. By default msahl keeps the angular velocity and makes the other one consistent. "
        "Case 3 spins about the axis through the joint, so there both are the same."
    )


def top_table() -> Table:
    """Return a table of the tops at each step size, with both choices of initial velocities."""
    columns = (
        Column("case", "case"),
        Column("dt", "step [s]", form="g"),
        *(
            Column(f"{key}_{choice}", label, choice, ".2e")
            for choice in ("as given", "consistent")
            for key, label in (
                ("force", "largest force [N]"),
                ("energy", "energy error / max KE, RMS"),
                ("mean", "virtual work, mean [J]"),
                ("rms", "RMS [J]"),
            )
        ),
    )
    rows = []
    for case in ("top_1", "top_2", "top_3"):
        for dt in STEPS:
            cells: list[Cell] = [case.replace("_", " "), dt]
            for choice in (True, False):
                ours = run_deck(case, dt, 10.0, choice)
                spread = ours.metrics.energy.error_over_kinetic
                cells += [
                    float(np.sqrt((ours.metrics.reactions.force[1:] ** 2).sum(axis=2)).max()),
                    spread.rms if spread else None,
                    float(ours.work.mean()),
                    float(np.sqrt((ours.work**2).mean())),
                ]
            rows.append(tuple(cells))
    return Table(columns, tuple(rows))


def triple_text() -> str:
    """Say how many runs of the triple pendulum, of which the thesis has none, are completed."""
    reports = [
        run_deck(deck, dt, t).report for deck in TRIPLES for dt in STEPS for t in (10.0, 100.0)
    ]
    completed = sum(report.status == "completed" for report in reports)
    subdivided = sum(report.subdivisions > 0 for report in reports)
    return (
        "In the thesis no step converged at any step size. With msahl, of the runs over 10 s and "
        f"100 s at all step sizes of the thesis, {completed} of {len(reports)} are completed; "
        f"{subdivided} of them have step subdivisions."
    )


def triple_table() -> Table:
    """Return a table of the runs of the triple pendulum."""
    columns = (
        Column("model", "model"),
        Column("dt", "step [s]", form="g"),
        *(
            Column(f"{key}_{end}", label, f"{end} s", form)
            for end in (10, 100)
            for key, label, form in (
                ("status", "msahl", ""),
                ("energy", "energy error / max KE, RMS", ".2e"),
                ("violation", "largest violation [m]", ".1e"),
            )
        ),
    )
    rows = []
    for deck in TRIPLES:
        for dt in STEPS:
            cells: list[Cell] = [deck.replace("_", " "), dt]
            for end in (10.0, 100.0):
                ours = run_deck(deck, dt, end)
                spread = ours.metrics.energy.error_over_kinetic
                status = "completed" if ours.report.status == "completed" else ours.report.status
                violation = float(ours.metrics.constraints.violation[:, :, 0].max())
                cells += [status, spread.rms if spread else None, violation]
            rows.append(tuple(cells))
    return Table(columns, tuple(rows))


def trends() -> Iterator[Block]:
    """Yield the counterparts of figures 4.1-4.9, 4.25-4.33 and 4.59-4.61."""
    for name, decks, figures in TRENDS:
        seconds = np.array([_seconds(deck) for deck in decks])
        title = f"{name} {'' if name == 'top' else 'pendulum '}against the step size"
        path = trend_figure(name, decks, title, seconds)
        yield Picture(f"figures/{path.name}", f"{title} (figures {figures})", b"")
    yield Paragraph(
        "The runs of the thesis took three seconds to ten minutes, and as long again to "
        "post-process. Their energy error falls with the step size; that of msahl is rounding "
        "error at all step sizes. The virtual work over a step falls with the first power of the "
        "step size, because the step size is a factor of it."
    )


def _seconds(deck: str) -> list[float]:
    model = with_step(model_of(deck), 0.1, 10.0)
    return [t.seconds for t in run_trials(model, [(DEFAULT, dt) for dt in STEPS], REPEATS)]


def chaos() -> Iterator[Block]:
    """Yield the counterpart of section 4.2.5: two motions that start 0.01 degrees apart."""
    drawn, sentences = [], []
    for name, one, other in PAIRS:
        time, apart = _apart(one, other)
        far = np.flatnonzero(apart > FAR)
        end = int(far[0]) if far.size else len(time)
        peaks = np.maximum.accumulate(apart)
        fitted = slice(len(time) // 50, end)
        (rate, level), rest = _line(time[fitted], np.log(peaks[fitted]))
        (power, _), power_rest = _line(np.log(time[fitted]), np.log(peaks[fitted]))
        drawn.append((name, time, apart, np.exp(level + rate * time)))
        reach = f"1 m at t = {time[end]:.1f} s" if far.size else f"{peaks[-1]:.2g} m at the end"
        sentences.append(
            (
                name,
                f"apart by {apart[0]:.2e} m at the start, {np.interp(10.0, time, peaks):.2e} m by "
                f"10 s, {reach}. Growth of the largest distance so far: as an exponential "
                f"{rate:.3f} per second, off by a factor of {np.exp(rest):.2f} (RMS); as a power "
                f"of time {power:.2f}, off by {np.exp(power_rest):.2f}.",
            )
        )
    path = chaos_figure(drawn)
    yield Paragraph(
        "Figures 4.55 and 4.56 show two pairs of double pendulums whose starts are 0.01 degrees "
        "apart, for 10 s; here they are run to the end time of the decks. The 45 degree pair "
        "drifts apart like two clocks of slightly different rate; the 90 degree pair is chaotic. "
        "Both are run at the decks' step of 0.002 s."
    )
    yield Items(tuple(sentences))
    yield Picture(f"figures/{path.name}", "Distance of the second bobs (figures 4.55, 4.56)", b"")


def _line(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """Return slope and level of a least-squares line, and the RMS of its residual."""
    line = np.polyfit(x, y, 1)
    return line, float(np.sqrt(np.mean((y - np.polyval(line, x)) ** 2)))


def _apart(one: str, other: str) -> tuple[np.ndarray, np.ndarray]:
    simulation = model_of(one).simulation
    runs = [run_deck(deck, simulation.dt, simulation.t_final).run for deck in (one, other)]
    columns = [f"2ndBall.{c}" for c in "xyz"]
    a, b = (run.states[columns].to_numpy() for run in runs)
    return runs[0].time, np.sqrt(((a - b) ** 2).sum(axis=1))


def cases() -> Iterator[Block]:
    """Yield a figure of path, energy and virtual work for every case."""
    for deck in dict.fromkeys(run.deck for run in RUNS):
        printed = [run for run in RUNS if run.deck == deck]
        runs = [
            (f"{r.t_final:g} s at {r.dt:g} s", run_deck(deck, r.dt, r.t_final)) for r in printed
        ]
        yield _case(deck, ", ".join(f"4.{run.figures}" for run in printed), runs)
    for deck in TRIPLES:
        runs = [(f"{t:g} s at 0.002 s", run_deck(deck, 0.002, t)) for t in (10.0, 100.0)]
        yield _case(deck, "none in the thesis", runs)


def _case(deck: str, figures: str, runs: list[tuple[str, Measured]]) -> Picture:
    title = deck.replace("_", " ")
    path = case_figure(deck, title, runs)
    return Picture(f"figures/{path.name}", f"{title}: path, energy, work (figures {figures})", b"")


if __name__ == "__main__":
    main()
