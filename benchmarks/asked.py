"""What was asked of the speed, beside what was measured: every verdict is computed here."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from benchmarks.loops import Measured
from benchmarks.process import Ended, LongRun, Starts
from benchmarks.verdict import Verdict
from benchmarks.writers import Written
from msahl.run.report import Report

GENERALISED_ALPHA = "exudyn index 3"
"""Exudyn's generalised-alpha proper; the fastest of its implicit settings is compared with too."""


@dataclass(slots=True)
class Results:
    """All that one run of the benchmark found; what was not measured is empty."""

    loops: list[Measured] = field(default_factory=list)
    imports: Ended | None = None
    starts: dict[str, Starts] = field(default_factory=dict)
    long_run: LongRun | None = None
    long_chain: Report | None = None
    writers: dict[str, Written] = field(default_factory=dict)
    computing: float = float("nan")


def verdicts(results: Results) -> list[Verdict]:
    parts: tuple[Callable[[Results], Iterable[Verdict]], ...] = (
        _small_problems,
        _chains,
        _growth,
        _auto,
        _long_chain,
        _starts,
        _output,
        _memory,
    )
    return [verdict for part in parts for verdict in part(results)]


def _groups(results: Results) -> Iterable[tuple[str, dict[str, Measured]]]:
    """The codes that were timed, by problem and step."""
    groups: dict[str, dict[str, Measured]] = {}
    for row in results.loops:
        if row.samples:
            groups.setdefault(f"{row.problem.name}, h = {row.h:g}", {})[row.code] = row
    return groups.items()


def _exudyn(rows: dict[str, Measured]) -> list[Measured]:
    return [row for code, row in rows.items() if code.startswith("exudyn")]


def _small_problems(results: Results) -> Iterable[Verdict]:
    for name, rows in _groups(results):
        peer = rows.get(GENERALISED_ALPHA)
        if name.startswith("chain") or not peer:
            continue
        fastest = min(_exudyn(rows), key=lambda row: row.per_step)
        for code in ("newton", "newton --rotation-update exponential"):
            ours = rows.get(f"msahl {code}")
            for other in (peer, fastest) if fastest is not peer else (peer,):
                if ours:
                    yield _at_least(f"{name}: {other.code} / {code}, time", 8.0, other, ours)
                    what = f"{name}: {code} / {other.code}, position error"
                    yield _error_at_most(what, ours, other)


def _error_at_most(what: str, ours: Measured, peer: Measured) -> Verdict:
    if not ours.errors or not peer.errors:
        return Verdict(what, "<= 1", "not measured", False)
    ratio = ours.errors.position / peer.errors.position
    return Verdict(what, "<= 1", f"{ratio:.3g}", ratio <= 1.0)


def _at_least(what: str, asked: float, peer: Measured, ours: Measured) -> Verdict:
    ratio = peer.per_step / ours.per_step
    return Verdict(what, f">= {asked:g}", f"{ratio:.2f}", ratio >= asked)


def _chains(results: Results) -> Iterable[Verdict]:
    for name, rows in _groups(results):
        if name.startswith("chain") and "msahl newton" in rows and _exudyn(rows):
            fastest = min(_exudyn(rows), key=lambda row: row.per_step)
            what = f"{name}: {fastest.code} (its fastest) / newton, time"
            yield _at_least(what, 5.0, fastest, rows["msahl newton"])


def _growth(results: Results) -> Iterable[Verdict]:
    times = {
        row.problem.bodies: row.per_step_and_body
        for row in results.loops
        if row.code == "msahl newton" and row.problem.name.startswith("chain")
    }
    if 10 in times and 1000 in times:
        what = "newton, time per step and body: chain of 1000 / chain of 10"
        yield _at_most(what, 1.5, times[1000] / times[10])


def _auto(results: Results) -> Iterable[Verdict]:
    """Per step of a long run, so what the first step costs is spread over a sample's steps."""
    for name, rows in _groups(results):
        if "msahl newton" in rows and "msahl auto" in rows:
            ratio = rows["msahl auto"].per_step / rows["msahl newton"].per_step
            steps = rows["msahl auto"].steps
            yield _at_most(f"{name}: auto / newton, time of {steps} steps", 1.2, ratio)
    for row in results.loops:
        if row.code == "msahl auto" and not row.samples:
            what = f"{row.problem.name}, h = {row.h:g}: auto / newton, time"
            yield Verdict(what, "<= 1.2", row.note, False)


def _long_chain(results: Results) -> Iterable[Verdict]:
    report = results.long_chain
    if report is None:
        return
    error = report.extremes["energyErrorMaxRelative"]
    what = "chain of 1000, h = 0.01, 10 s, newton: largest energy error / largest kinetic energy"
    text = f"{error:.1e}, {report.status} in {report.seconds['loop']:.2f} s"
    met = report.status == "completed" and error is not None and error < 1e-9
    yield Verdict(what, "completed, < 1e-9", text, met)


def _starts(results: Results) -> Iterable[Verdict]:
    if results.imports is None:
        return
    for solver, asked in (("newton", 0.5), ("auto", 0.8)):
        starts = results.starts[solver]
        more = starts.warm.seconds - results.imports.seconds
        yield _at_most(f"warm msahl run, {solver}: beyond the bare imports [s]", asked, more)
        yield _at_most(f"first, compiling msahl run, {solver} [s]", 20.0, starts.cold.seconds)


def _output(results: Results) -> Iterable[Verdict]:
    for name, written in results.writers.items():
        if "msahl" in name:
            what = "writing 50 001 x 19 numbers / computing as many steps"
            yield _at_most(what, 10.0, written.seconds / results.computing)


def _memory(results: Results) -> Iterable[Verdict]:
    run = results.long_run
    if run is not None:
        what = f"peak memory of {run.steps} steps of ten bodies [MB]"
        yield _at_most(what, 400.0, run.ended.memory)


def _at_most(what: str, asked: float, measured: float) -> Verdict:
    return Verdict(what, f"<= {asked:g}", f"{measured:.3g}", measured <= asked)
