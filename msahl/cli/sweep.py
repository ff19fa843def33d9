"""The command ``msahl sweep``: run a deck many times, with other numbers and options."""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.cli.command_line import typed_command
from msahl.cli.console import BAD_VERDICT, NOT_WRITTEN, say, stop
from msahl.cli.interruption import Interruption, stoppable
from msahl.cli.options import DECK, NumberType, output_option, run_options
from msahl.printable import printable, shown_path
from msahl.records import record
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.sweep.plan import Plan
    from msahl.sweep.store import Counts
    from msahl.sweep.sweep import Hooks, Sweep
    from msahl.sweep.work import Scheduler, Work

FIRST_POINTS = 5
"""Points that --dry-run shows."""
REFRESH = 0.2
"""Seconds between two updates of the progress on a terminal."""
MOST_COMPARED = 300
"""Points whose comparison with earlier outcomes takes less than a second or two."""
REPORT = 30.0
"""Seconds between two lines of progress elsewhere."""


@click.command(
    short_help="Run a deck many times with other numbers or options.",
    epilog="""
    Examples:

    \b
    msahl sweep deck.xml --set "L=60:100:5 cm" --set Bob.mass=1,2 --measure "Bob.z max"
    msahl sweep deck.xml --over dt=0.1,0.01,0.001 --over scheme=gauss2,preserving
    msahl sweep deck.xml --set "L~uniform(60,100) cm" --set "Bob.mass~normal(2,0.1)"
                         --sample sobol:1024 --measure "Hinge.F absmax"
    msahl sweep deck.xml --plan plan.csv --measure "time of Crank.angle = 1.57"
    """,
)
@click.argument("deck", type=DECK)
@output_option("sweeps/<deck's name>")
@click.option("--set", "sets", multiple=True, metavar="NAME=VALUES",
              help='Vary a number of the deck: a list (L=0.5,1,2), n values from a to b, both ends '
              'included (Bob.mass=a:b:n, with :log in geometric progression), or a distribution '
              '("L~uniform(4,6)"; also loguniform, normal, truncnormal, lognormal, triangular). A '
              'unit behind the last value is that of all: "L=60:100:5 cm". Repeat for more; all '
              "combinations are run.")  # fmt: skip
@click.option("--over", "overs", multiple=True, metavar="OPTION=VALUES",
              help="Vary an option of a run likewise: dt=0.1,0.01 or scheme=gauss2,preserving. "
              "Repeat for more.")  # fmt: skip
@click.option("--zip", "zipped", is_flag=True,
              help="Go through all lists side by side instead of combining them.")  # fmt: skip
@click.option("--sample", metavar="KIND:N",
              help="Draw N points of the distributions: sobol:N, lhs:N (Latin hypercube), "
              "random:N, or saltelli:N, which is N (d + 2) points for the Sobol indices of d "
              "numbers.")  # fmt: skip
@click.option("--seed", type=click.IntRange(0, 2**64 - 1), default=0,
              show_default=True, metavar="N",
              help="Set the seed of the sample; the same seed gives the same points.")  # fmt: skip
@click.option("--plan", "plan_file", type=click.Path(path_type=Path), metavar="FILE",
              help="Read the points from a CSV file: a column for each number of the deck "
              "(Bob.mass, L [cm]) or option (--dt), a row for each point.")  # fmt: skip
@click.option("--measure", "measures", multiple=True, metavar="TEXT",
              help="Add a number of each run to runs.csv: a column of its tables and max, min, "
              "absmax, mean, rms, range, initial, final or 'at T' (\"Tip.z max\"; \"Hinge.F "
              'absmax" takes the norm of Fx, Fy, Fz), "displacement of Tip max", "time of '
              'Crank.angle = 1.57", seconds (of '
              "the loop), or a figure of run.json such as energyErrorMax. Verdict and estimated "
              "error are there in any case. Repeat for more.")  # fmt: skip
@click.option("--keep", type=click.Choice(("summary", "tables", "all")), default="summary",
              show_default=True, help="Keep of each run its row in runs.csv only, its tables as "
              "well, or the complete folder of results, which msahl-post reads.")  # fmt: skip
@click.option("--on-fail", default="continue", show_default=True, metavar="POLICY",
              help="Choose what happens if a point fails: continue, stop, or retry:N, to try it up "
              "to N times again.")  # fmt: skip
@click.option("--timeout", type=NumberType(min=0.0, min_open=True), metavar="S",
              help="Set the time in seconds after which a point has failed; compiling is not "
              "counted (default: none).")  # fmt: skip
@click.option("--jobs", type=click.IntRange(min=1, max=1024), metavar="N",
              help="Set the number of processes (default, and at most: the number of "
              "cores).")  # fmt: skip
@click.option("--scheduler", metavar="ADDRESS",
              help="Run the points on the workers of this Dask scheduler, such as "
              "tcp://host:8786, or of the one that writes this file.")  # fmt: skip
@click.option("--shard", metavar="K/N",
              help="Run only every Nth point, from point K on. Run all N shards anywhere, then "
              "--merge.")  # fmt: skip
@click.option(
    "--merge",
    is_flag=True,
    help="Run nothing, and write the tables from the journals of all shards in DIR.",
)
@click.option("--dry-run", is_flag=True, help="Print the plan and run nothing.")
@run_options
@click.option("-q", "--quiet", is_flag=True, help="Print only faults.")
def sweep(deck: Path, output: Path | None, **given: Any) -> None:
    """Run DECK at many points: with other numbers (--set) and options (--over) each time.

    Writes runs.csv, one row for each point in the order of the plan, with its values, status,
    verdict, estimated error and measures; plan.csv, seconds.csv, and journal.jsonl. Outcomes are
    kept: the same command again runs only what is missing, after an interruption or after values
    were added.

    Exit status: 0 if all points completed, 1 if one failed or its verdict is FAIL, 2 if the plan is
    not valid, 4 if results could not be written, 130 if interrupted.
    """
    request = Request(deck, output or Path("sweeps") / deck.stem, given)
    from msahl.deck import DeckError
    from msahl.jit.progress import CompileError
    from msahl.sweep.faults import ClusterError, PlanError, StoreError
    from msahl.sweep.points import ChangedError, NotWrittenError
    from msahl.sweep.pool import PoolError

    try:
        sys.exit(carry_out(request))
    except PlanError as error:
        stop("\n".join(f"msahl sweep: {printable(fault)}" for fault in error.faults))
    except DeckError as error:
        stop("\n".join(map(str, error.faults)))
    except (ChangedError, ClusterError, CompileError, PoolError, StoreError) as error:
        stop(f"msahl sweep: {printable(str(error))}")
    except (NotWrittenError, OSError) as error:
        reason = str(error)
        if isinstance(error, OSError):
            reason = f"{shown_path(error.filename or request.folder)}: {error.strerror or error}"
        stop(
            f"msahl sweep: {printable(reason)}; free some disk space or choose another folder with "
            f"-o. What was done is kept; go on with: {typed_command()}",
            NOT_WRITTEN,
        )


@record(slots=False)
class Request:
    """What the user asked for: the deck, the folder, and all other options by name."""

    deck: Path
    folder: Path
    given: dict[str, Any]

    @property
    def run_options(self) -> dict[str, Any]:
        """The options that all runs have, without those not given."""
        from msahl.run.options import OPTIONS

        values = {option.name: self.given[option.name] for option in OPTIONS}
        return {name: value for name, value in values.items() if value not in (None, False)}

    def plan(self) -> "Plan":
        """The plan; raises ``PlanError`` with the faults of all options."""
        from msahl.sweep.axes import parse_over, parse_set
        from msahl.sweep.faults import PlanError
        from msahl.sweep.plan import make_plan, read_plan, with_constants
        from msahl.sweep.samples import parse_sample

        given, axes = self.given, []
        faults: list[str] = []
        for parse, texts in ((parse_set, given["sets"]), (parse_over, given["overs"])):
            for text in texts:
                try:
                    axes.append(parse(text))
                except PlanError as error:
                    faults += error.faults
        if faults:
            raise PlanError(*faults)
        if given["plan_file"] is not None:
            if given["zipped"] or given["sample"]:
                raise PlanError("--plan: the file has all points; omit --zip and --sample")
            plan = with_constants(read_plan(given["plan_file"]), axes)
        else:
            sample = given["sample"]
            drawn = parse_sample(sample, given["seed"]) if sample is not None else None
            plan = make_plan(axes, given["zipped"], drawn)
        both = [c.head for c in plan.columns if c.option and c.name in self._given_options()]
        if both:
            raise PlanError(f"{both[0]} is varied by the plan; omit the option {both[0]}")
        return plan

    def _given_options(self) -> dict[str, Any]:
        """The options of runs that are on the command line."""
        from click.core import ParameterSource

        context = click.get_current_context()
        return {
            name: value
            for name, value in self.run_options.items()
            if context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        }

    def sweep(self) -> "Sweep":
        """The sweep; raises ``PlanError``."""
        from msahl.sweep.journal import journal_of_shard
        from msahl.sweep.measures import parse_measures
        from msahl.sweep.points import Job
        from msahl.sweep.sweep import Sweep
        from msahl.sweep.work import parse_on_fail, parse_shard

        plan, measures = self.plan(), parse_measures(self.given["measures"])
        job = Job(
            os.fspath(self.deck),
            plan.columns,
            self.run_options,
            tuple(measure.text for measure in measures),
            self.given["keep"],
            os.fspath(self.folder),
        )
        on_fail = parse_on_fail(self.given["on_fail"])
        made = Sweep(self.folder, plan, job, on_fail, self.given["timeout"])
        if self.given["shard"] is None:
            return made
        share = parse_shard(self.given["shard"])
        return replace(made, share=share, journal=journal_of_shard(*share))

    def scheduler(self, made: "Sweep", compiling: Callable[[], Any]) -> "Scheduler":
        """What runs the points; raises ``PlanError`` if options exclude each other."""
        from msahl.subprocesses import cores
        from msahl.sweep.faults import PlanError
        from msahl.sweep.pool import Pool
        from msahl.sweep.work import Nobody

        given = self.given
        both = [name for name in ("jobs", "scheduler", "merge") if given[name]]
        if len(both) > 1:
            raise PlanError(f"--{both[0]} and --{both[1]} exclude each other; omit one")
        if given["merge"] and given["shard"]:
            raise PlanError("--merge collects all shards; omit --shard")
        if given["merge"]:
            return Nobody()
        if given["scheduler"] is not None:
            from msahl.sweep.cluster import Cluster

            return Cluster(given["scheduler"], made.timeout, say)
        return Pool(given["jobs"] or cores(), made.timeout, compiling)


def carry_out(request: Request) -> int:
    """Make the sweep; returns the exit status."""
    made, given = request.sweep(), request.given
    if given["dry_run"]:
        show_plan(made)
        return 0
    from msahl.sweep.sweep import carry_out as make

    with stoppable() as stopped, shown(made, given["quiet"]) as progress:
        scheduler = request.scheduler(made, progress.compiling)
        try:
            counts = make(made, scheduler, progress.hooks(stopped))
        except KeyboardInterrupt:  # a second request, or one during the preparation
            progress.end()
            say(f"{shown_path(request.deck)}: stopped; go on with: {typed_command()}")
            return 128 + (stopped.signal or 2)
        progress.end()
    return conclude(request, counts, stopped)


def conclude(request: Request, counts: "Counts", stopped: Interruption) -> int:
    """Print how the sweep ended; returns the exit status."""
    where, folder = shown_path(request.deck), shown_path(request.folder)
    quiet, lines = request.given["quiet"], []
    if counts.failed:
        kinds = ", ".join(
            f"{n} {status}" for status, n in counts.statuses.items() if status != "completed"
        )
        lines.append(f"{where}: {counts.failed} failed ({kinds}); first: {counts.first_failure}")
    if counts.bad:
        lines.append(f"{where}: {counts.bad} completed with the verdict FAIL")
    if counts.done < counts.points and request.given["merge"]:
        left = counts.points - counts.done
        lines.append(f"{where}: {left} of {counts.points} points have no outcome; run their shards")
    elif counts.done < counts.points:
        if not stopped.signal:
            lines.append(f"{where}: stopped because a point failed (--on-fail stop)")
        into = "" if request.given["shard"] else f" -> {folder}/runs.csv.part"
        lines.append(
            f"{where}: {counts.done} of {counts.points} points are done{into}; go on with: "
            f"{typed_command()}"
        )
    elif request.given["shard"]:
        merge = typed_command(without=("shard", "jobs", "scheduler", "quiet"))
        done = f"{where}: all {counts.points} points of shard {request.given['shard']} are done"
        lines += [] if quiet else [f"{done}; after all shards: {merge} --merge"]
    elif not quiet:
        lines.append(f"{where}: all {counts.points} points are done -> {folder}/runs.csv")
    if lines:
        say(printable_lines(lines))
    if stopped.signal and counts.done < counts.points:
        return 128 + stopped.signal
    return 0 if counts.good else BAD_VERDICT


def printable_lines(lines: list[str]) -> str:
    """Lines with escapes for characters that do not print."""
    return "\n".join(map(printable, lines))


def show_plan(made: "Sweep") -> None:
    """Print the plan, its first points, and how many of them are done; run nothing."""
    from msahl.sweep.sweep import check, preview

    made = check(made)
    first, done = preview(made, FIRST_POINTS)
    echo(describe_plan(made.plan))
    for text in made.job.measures:
        echo(f"measure: {text}")
    rows = [made.plan.head, *([str(n), *cells] for n, cells in enumerate(first, start=1))]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        echo("  " + "  ".join(cell.rjust(w) for cell, w in zip(row, widths, strict=True)))
    if made.plan.count > len(first):
        echo("  ...")
    echo(f"{done} of {made.plan.count} points are done in {shown_path(made.folder)}")


def describe_plan(plan: "Plan") -> str:
    """What is varied, and the number of points."""
    sample = plan.sample
    drawn = f" ({sample.kind}:{sample.n}, seed {sample.seed})" if sample else ""
    note = f"\nnote: {sample.note}" if sample and sample.note else ""
    return "\n".join((*plan.axes, f"{plan.count} points{drawn}")) + note


@dataclass
class Progress:
    """Prints what a sweep does: the plan before the first run, then how far it is."""

    sweep: "Sweep"
    quiet: bool
    terminal: bool = False
    began_at: float = 0.0
    told_at: float = 0.0
    before: int = 0
    announced: bool = False
    lines: list[str] = field(default_factory=list)

    def hooks(self, stopped: Interruption) -> "Hooks":
        """What the sweep calls."""
        from msahl.sweep.sweep import Hooks

        return Hooks(self.began, self.tell, stopped, self.comparing)

    def comparing(self, points: int) -> None:
        """Print what takes long before the first run."""
        if not self.quiet and points > MOST_COMPARED:
            say(f"comparing {points} points with the outcomes of an earlier plan in the folder")

    def began(self, work: "Work") -> None:
        """Print the plan and how much of it is done."""
        if self.quiet:
            return
        say(describe_plan(self.sweep.plan))
        if work.done_before:
            say(f"{work.done_before} of them are done already, {work.left} remain")
        self.before = work.done_before
        self.began_at = self.told_at = time.monotonic()

    def compiling(self) -> None:
        """Print once that kernels are compiled."""
        if not self.announced and not self.quiet:
            self.announced = True
            self.end()
            say("compiling kernels for this kind of model (once)")

    def tell(self, counts: "Counts") -> None:
        """Print the progress, not too often."""
        now = time.monotonic()
        if self.quiet or now - self.told_at < (REFRESH if self.terminal else REPORT):
            return
        self.told_at = now
        line = progress_line(counts, self.before, now - self.began_at)
        if self.terminal:
            sys.stderr.write(f"\r{line[:78]:<78}")
            sys.stderr.flush()
            self.lines = [line]
        else:
            say(line)

    def end(self) -> None:
        """End the line of the progress on a terminal."""
        if self.lines:
            sys.stderr.write(f"\r{'':<78}\r")
            sys.stderr.flush()
            self.lines = []


def progress_line(counts: "Counts", before: int, seconds: float) -> str:
    """How many points are done and failed, how many per second, and the time left."""
    rate = (counts.done - before) / max(seconds, 1e-9)
    left = (counts.points - counts.done) / rate if rate > 0.0 else 0.0
    failed = f", {counts.failed} failed" if counts.failed else ""
    speed = f"{rate:.3g} points/s" if rate >= 1.0 else f"{1.0 / max(rate, 1e-9):.3g} s per point"
    return f"  {counts.done} of {counts.points} points{failed}, {speed}, {duration(left)} left"


def duration(seconds: float) -> str:
    """A time in words."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


@contextmanager
def shown(made: "Sweep", quiet: bool) -> Iterator[Progress]:
    """The progress of a sweep; its line on a terminal is removed at the end."""
    progress = Progress(made, quiet, sys.stderr.isatty())
    try:
        yield progress
    finally:
        progress.end()
