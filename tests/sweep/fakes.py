"""Plans with made-up rows, and schedulers that make them at once."""

from pathlib import Path

from msahl.sweep.axes import parse_set
from msahl.sweep.plan import make_plan
from msahl.sweep.points import Job, crashed_row, run_points
from msahl.sweep.store import Store
from msahl.sweep.sweep import Sweep
from tests.sweep.decks import DECK, QUICK


def sweep(folder: Path, *sets, measures=(), keep="summary", **more) -> Sweep:
    """A sweep of the test deck over ``sets``."""
    plan = make_plan([parse_set(text) for text in sets])
    job = Job(str(DECK), plan.columns, QUICK, measures, keep, str(folder))
    return Sweep(folder, plan, job, **more)


def row_of(point, status="completed", **more):
    """A row of a point that was not run."""
    row = crashed_row(point, "", status) | {"verdict": "PASS", "key": point.id}
    return row | {"error": 0.25, "seconds": {"loop": 0.5}} | more


class FakeScheduler:
    """Makes rows at once; those of points in ``fails`` fail so often as it says."""

    def __init__(self, fails=None, most=None, chunk=1):
        self.fails, self.most, self.chunk, self.ran = dict(fails or {}), most, chunk, []
        self.jobs, self.largest = [], 0

    def run(self, job, work, stopped):
        """See ``Scheduler``."""
        self.jobs.append(job)
        while not work.finished and not stopped():
            points = work.next(self.chunk)
            self.largest = max(self.largest, len(points))
            self.ran += [point.number for point in points]
            work.take([self.row(job, point) for point in points])
            if self.most is not None and len(self.ran) >= self.most:
                return

    def row(self, job, point):
        """One row, of which each measure is the point's number."""
        left = self.fails.get(point.number, 0)
        if left:
            self.fails[point.number] = left - 1
            return row_of(point, "not converged", message="it diverged", verdict="FAIL")
        return row_of(point, measures={text: float(point.number) for text in job.measures})


class InProcess:
    """Runs points in this process; takes the arguments of ``Pool``."""

    def __init__(self, *_):
        self.ran = []

    def run(self, job, work, stopped):
        """See ``Scheduler``."""
        while not work.finished and not stopped():
            points = work.next(1)
            self.ran += [point.number for point in points]
            work.take(list(run_points(job, points)))


def open_store(folder, made, **more):
    """The store of a sweep in a folder that exists."""
    folder.mkdir(exist_ok=True)
    return Store(folder, made.job, "context", **more)
