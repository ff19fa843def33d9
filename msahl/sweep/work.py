"""The points of a sweep that are still to be run, and what happens when one fails.

A scheduler asks for some points at a time (``next``) and gives back each row (``take``), until the
work is ``finished``. Points are read from the plan as they are asked for.
"""

from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Protocol

from msahl.records import record
from msahl.run.report import COMPLETED
from msahl.sweep.faults import PlanError
from msahl.sweep.plan import Plan
from msahl.sweep.points import Job, Point, Resolver, Row
from msahl.sweep.store import Counts, Store

CONTINUE, STOP, RETRY = "continue", "stop", "retry"


@record
class OnFail:
    """What to do if a point fails: go on, stop the sweep, or try it again ``times`` times."""

    policy: str = CONTINUE
    times: int = 0


def parse_on_fail(text: str) -> OnFail:
    """Return the policy that ``--on-fail`` names; raises ``PlanError``."""
    name, _, times = text.partition(":")
    if name in (CONTINUE, STOP) and not times:
        return OnFail(name)
    if name == RETRY and times.isascii() and times.isdigit() and 0 < int(times) <= 1000:
        return OnFail(RETRY, int(times))
    raise PlanError(f"--on-fail {text}: write continue, stop or retry:N, where N is 1 to 1000")


ON_FAIL = OnFail()


class Supply(Protocol):
    """Points to be run, and where their rows go: ``Work``, or a part of it."""

    @property
    def left(self) -> int:
        """The number of points without outcome."""

    @property
    def finished(self) -> bool:
        """Whether no more points will be handed out, and none is running."""

    def next(self, most: int = 1) -> list[Point]:
        """Return up to ``most`` points to run now."""

    def take(self, rows: list[Row]) -> None:
        """Record outcomes of points that were handed out."""

    def give_back(self, points: list[Point]) -> None:
        """Take back points that were handed out but not run."""


class Scheduler(Protocol):
    """Runs points somewhere."""

    def run(self, job: Job, work: "Work", stopped: Callable[[], bool]) -> None:
        """Run the points of ``work`` until it is finished, or until ``stopped`` says so.

        Points that are under way then are given up. Raises ``NotWrittenError`` if a worker cannot
        write tables, ``CompileError`` if there is no compiler.
        """


class Work:
    """The points of a plan without outcome. ``tell`` is called after each outcome.

    Only points with numbers in ``share`` (k, n) are run: k, k + n, k + 2 n, ...
    """

    def __init__(
        self,
        plan: Plan,
        store: Store,
        on_fail: OnFail = ON_FAIL,
        tell: Callable[[Counts], Any] = lambda counts: None,
        share: tuple[int, int] = (1, 1),
    ) -> None:
        self.store, self.on_fail, self.tell, self.share = store, on_fail, tell, share
        self.stopped = False
        self.counts = self._counted(plan)
        self.done_before = self.counts.done
        self.attempts: dict[int, int] = {}
        self._again: deque[Point] = deque()
        self._running: dict[int, Point] = {}
        self._source = self._missing(plan)

    @property
    def left(self) -> int:
        """The number of points without outcome."""
        return self.counts.points - self.counts.done

    @property
    def finished(self) -> bool:
        """Whether no more points will be handed out, and none is running."""
        return self.stopped or not (self._running or self._again or self._fetch())

    def next(self, most: int = 1) -> list[Point]:
        """Return up to ``most`` points to run now; none if all are running or done."""
        points: list[Point] = []
        while not self.stopped and len(points) < most and (self._again or self._fetch()):
            point = self._again.popleft()
            self._running[point.number] = point
            points.append(point)
        return points

    def take(self, rows: list[Row]) -> None:
        """Record the outcomes of points that were handed out; raises ``OSError`` if they cannot be
        written. Rows of points that are not running are ignored: others have brought them."""
        outcomes = []
        for row in rows:
            point = self._running.pop(row["point"], None)
            if point is None:
                continue
            tried = self.attempts.pop(point.number, 0) + 1
            failed = row["status"] != COMPLETED
            if failed and self.on_fail.policy == RETRY and tried <= self.on_fail.times:
                self.attempts[point.number] = tried
                self._again.append(point)
                continue
            outcomes.append(row | {"attempts": tried})
            self.stopped |= failed and self.on_fail.policy == STOP
        if not outcomes:
            return
        self.store.add(outcomes)
        for row in outcomes:
            self.counts.add(row)
        self.tell(self.counts)

    def give_back(self, points: list[Point]) -> None:
        """Take points back whose worker was lost; they are handed out again."""
        for point in points:
            if self._running.pop(point.number, None) is not None:
                self._again.append(point)

    def _fetch(self) -> bool:
        """Read the plan up to the next point to run; whether there is one."""
        point = next(self._source, None)
        if point is not None:
            self._again.append(point)
        return point is not None

    def adopt(self, plan: Plan, stopped: Callable[[], bool]) -> None:
        """Take over outcomes of an earlier plan in the folder: those of points with the same
        resolved deck and options."""
        resolver = Resolver(self.store.job)
        for number, cells in _shared(plan, self.share):
            name = self.store.id_of(cells)
            if stopped():
                return
            if not self.store.has(name):
                row = self.store.adopt(number, name, resolver.key(cells))
                if row is not None:
                    self.counts.add(row)
                    self.done_before += 1

    def _missing(self, plan: Plan) -> Iterator[Point]:
        """Yield the points without outcome; of points with the same id only the first."""
        handed: set[bytes] = set()
        for number, cells in _shared(plan, self.share):
            name = self.store.id_of(cells)
            digest = bytes.fromhex(name)[:16]
            if digest in handed:
                self.counts.points -= 1
            elif not self.store.has(name):
                handed.add(digest)
                yield Point(number, name, cells)

    def _counted(self, plan: Plan) -> Counts:
        """Count the points of the plan, and those whose outcome is known."""
        counts = Counts()
        for number, _, row in self.store.rows(plan):
            if (number - self.share[0]) % self.share[1] == 0:
                counts.points += 1
                if row is not None:
                    counts.add(row)
        return counts


def parse_shard(text: str) -> tuple[int, int]:
    """Return k and n of ``--shard k/n``; raises ``PlanError``."""
    first, slash, last = text.partition("/")
    if slash and first.isdecimal() and last.isdecimal() and 1 <= int(first) <= int(last):
        return int(first), int(last)
    raise PlanError(f"--shard {text}: write k/n, the number of the shard from 1 and that of all")


class Nobody:
    """A scheduler that runs nothing: what is done is collected."""

    def run(self, job: Job, work: Work, stopped: Callable[[], bool]) -> None:
        """See ``Scheduler``."""


def _shared(plan: Plan, share: tuple[int, int]) -> Iterator[tuple[int, tuple[str, ...]]]:
    k, n = share
    for number, cells in enumerate(plan, start=1):
        if (number - k) % n == 0:
            yield number, cells
