"""A sweep from its plan to its tables: check, lock the folder, run what is missing, write."""

import os
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

from msahl.deck import DeckError
from msahl.deck.overrides import find_number
from msahl.deck.parse import parse_with_comments
from msahl.post.measures import unit_of
from msahl.records import record
from msahl.results.job import Job as Run
from msahl.run.column_units import shown_unit
from msahl.run.options import Number
from msahl.run.report import COMPLETED
from msahl.sweep.axes import BY_NAME, Column
from msahl.sweep.faults import PlanError, StoreError
from msahl.sweep.measures import parse_measures, require_columns
from msahl.sweep.plan import Plan
from msahl.sweep.points import TIMED_OUT, Job, Resolver, Row, context_digest, is_kept
from msahl.sweep.store import (
    JOURNAL,
    RUNS,
    Counts,
    Store,
    begin,
    claim,
    remove_left_over,
    runs_head,
    sweep_lock,
    write_info,
    write_parquet,
)
from msahl.sweep.work import ON_FAIL, RETRY, OnFail, Scheduler, Work

ALL = (1, 1)
"""The share of a sweep that is not divided."""
RUNNING, COMPLETE, STOPPED = "running", "complete", "stopped"
"""States of a sweep in ``sweep.json``."""
SECONDS = "S"
"""Stands for a time in the help of an option."""
TRIED = 50
"""Points of a plan that are tried until the deck is valid at one."""


@record(slots=False)
class Sweep:
    """A sweep to be made: its folder, plan and job, and what happens to points that fail.

    ``timeout`` is the time that a point may take [s], None for any. Only the ``share`` (k, n) of
    the points is run, whose outcomes go to ``journal``.
    """

    folder: Path
    plan: Plan
    job: Job
    on_fail: OnFail = ON_FAIL
    timeout: float | None = None
    share: tuple[int, int] = ALL
    journal: str = JOURNAL

    def usable(self, row: Row) -> bool:
        """Whether an outcome of an earlier call is good for this one."""
        if row["status"] == COMPLETED:
            return all(text in row["measures"] for text in self.job.measures) and is_kept(
                self.folder, row["key"], self.job.keep
            )
        if row["status"] == TIMED_OUT:
            allowed = self.timeout is None or self.timeout > row.get("limit", 0.0)
            return not allowed
        tried = row.get("attempts", 1)
        return self.on_fail.policy != RETRY or tried > self.on_fail.times

    def open_store(self) -> Store:
        """The outcomes in the folder."""
        return Store(self.folder, self.job, context_digest(self.job), self.usable, self.journal)


@record(slots=False)
class Hooks:
    """Functions that a sweep calls: ``began`` with the work before the first run, ``progress``
    after outcomes, ``stopped`` to ask whether to stop, and ``comparing`` with the number of points
    that are compared with outcomes of another plan."""

    began: Callable[[Work], Any] = lambda work: None
    progress: Callable[[Counts], Any] = lambda counts: None
    stopped: Callable[[], bool] = lambda: False
    comparing: Callable[[int], Any] = lambda points: None


def check(sweep: Sweep) -> Sweep:
    """Check measures and the deck; returns the sweep with the deck's digest.

    Raises ``PlanError`` and ``DeckError``.

    A deck that is faulty at some points only is no fault of the plan: those points fail.
    """
    measures = parse_measures(sweep.job.measures)
    resolver = Resolver(sweep.job)
    run = _valid_run(sweep.plan, resolver)
    require_columns(measures, run.model)
    head = runs_head(sweep.plan, sweep.job.measures)
    twice = [name for name, count in Counter(head).items() if count > 1]
    if twice:
        raise PlanError(
            f"'{twice[0]}' would be the head of two columns of runs.csv; rename the parameter of "
            "the deck, or give its values a unit"
        )
    units = _units(sweep.job.columns, run.given_text)
    units |= {measure.text: unit_of(measure, run.model) for measure in measures}
    return replace(sweep, job=replace(sweep.job, digest=resolver.digest, units=units))


def _units(columns: Sequence[Column], given: bytes) -> dict[str, str]:
    """Return the units of columns whose cells have none: those that options have, or numbers and
    parameters of the expanded deck ``given``."""
    units, root = {}, None
    for column in columns:
        if column.unit:
            continue
        if column.option:
            kind = BY_NAME[column.name].kind
            units[column.head] = "s" if isinstance(kind, Number) and kind.unit == SECONDS else ""
        else:
            root = parse_with_comments(given) if root is None else root
            with suppress(LookupError):
                units[column.head] = find_number(root, column.name).shown
    return {head: shown_unit(unit) for head, unit in units.items() if unit not in ("", "1")}


def _valid_run(plan: Plan, resolver: Resolver) -> Run:
    """Return the run at the first of some points across the plan at which the deck is valid; raises
    ``DeckError`` with the faults of the first point if it is so at none of them."""
    first: DeckError | None = None
    step = max(1, plan.count // TRIED)
    for number, cells in enumerate(plan):
        if number % step == 0 or number == plan.count - 1:
            try:
                return resolver.run_at(cells)
            except DeckError as error:
                first = first or error
    assert first
    raise first


def carry_out(sweep: Sweep, scheduler: Scheduler, hooks: Hooks = Hooks()) -> Counts:
    """Run the points without outcome and write the tables; returns what was counted.

    Raises ``PlanError`` and ``DeckError`` for a bad plan, ``StoreError`` for a folder that cannot
    be used, ``NotWrittenError`` and ``OSError`` if it cannot be written, and what the scheduler
    raises. Outcomes that were there before remain in every case. Of a share of the points only the
    journal is written.
    """
    sweep = check(sweep)
    claim(sweep.folder, sweep.job.deck)
    if (finished := _finished(sweep)) is not None:
        return finished
    with sweep_lock(sweep.folder, shared=sweep.share != ALL):
        store = _locked_store(sweep)
        try:
            begin(sweep.folder, sweep.plan, sweep.job)
            work = _run_missing(sweep, store, scheduler, hooks)
            if sweep.share != ALL:  # the tables follow from the journals of all shards
                return work.counts
            counts = store.write_tables(sweep.plan)
            remove_left_over(sweep.folder)
        except BaseException:
            with suppress(OSError):  # the folder may be on a full disk
                write_info(sweep.folder, sweep.plan, sweep.job, {"status": STOPPED})
            raise
        finally:
            store.close()
        complete = counts.done == counts.points
        state = {"status": COMPLETE if complete else STOPPED, **counts.as_json()}
        if complete:
            write_parquet(sweep.folder)
        write_info(sweep.folder, sweep.plan, sweep.job, state)
    return counts


def _finished(sweep: Sweep) -> Counts | None:
    """What is counted of a sweep of which nothing is left to do, if its folder cannot be written,
    such as that of another user; None otherwise."""
    tables = sweep.folder / RUNS
    if sweep.share != ALL or os.access(sweep.folder, os.W_OK) or not tables.is_file():
        return None
    store = sweep.open_store()
    try:
        counts = store.counts(sweep.plan)
    finally:
        store.close()
    return counts if counts.done == counts.points else None


def _locked_store(sweep: Sweep) -> Store:
    """The outcomes in the folder, with the journal locked; raises ``StoreError`` if it is not
    possible."""
    store = sweep.open_store()
    try:
        store.journal.lock()
    except StoreError:
        store.close()
        raise
    return store


def _run_missing(sweep: Sweep, store: Store, scheduler: Scheduler, hooks: Hooks) -> Work:
    """Run the points of the plan that have no outcome."""
    work = Work(sweep.plan, store, sweep.on_fail, hooks.progress, sweep.share)
    if store.foreign and work.left:
        hooks.comparing(work.left)
        work.adopt(sweep.plan, hooks.stopped)
    hooks.began(work)
    if work.left:
        store.drop_tables()
        scheduler.run(sweep.job, work, hooks.stopped)
    return work


def preview(sweep: Sweep, most: int) -> tuple[list[tuple[str, ...]], int]:
    """The cells of the first points of a checked sweep, and how many of all points are done."""
    first = list(islice(sweep.plan, most))
    if not sweep.folder.is_dir() or not any(sweep.folder.glob("journal*.jsonl")):
        return first, 0
    store = sweep.open_store()
    try:
        return first, sum(row is not None for _, _, row in store.rows(sweep.plan))
    finally:
        store.close()
