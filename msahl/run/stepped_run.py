"""A run that another program advances from one communication point to the next."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from msahl.contact.modes import ContactsUnsolved
from msahl.jit.compiled import prepare
from msahl.model import Model, Options, RunSettings, resolve
from msahl.model.settings import OFF
from msahl.run.changes import Changes
from msahl.run.communication import SAME_TIME, FreeSteps, GridSteps, on_grids
from msahl.run.loop import Hooks, TimeLoop, require_start
from msahl.run.options import OptionError
from msahl.run.report import COMPLETED
from msahl.run.setup import build_setup
from msahl.run.snapshot import Snapshot, digest
from msahl.run.step_plan import ROUND_OFF
from msahl.run.stop import words_of
from msahl.run.tables import tables_of_model


class RunEnded(Exception):  # noqa: N818 - an outcome
    """A run that cannot go on to a communication point; the message says why."""


class Rows:
    """A sink that keeps the rows at communication points: all columns of all ``tables``."""

    takes_observed = True

    def __init__(self, tables: Sequence[str]) -> None:
        self.tables = tables
        self.kept: dict[float, np.ndarray] = {}

    def write(self, tables: Mapping[str, np.ndarray]) -> None:
        """See ``Sink``."""
        if self.tables[0] not in tables:
            return
        rows = np.hstack([tables[name][:, 1:] for name in self.tables])
        self.kept.update(zip(tables[self.tables[0]][:, 0].tolist(), rows, strict=True))

    def restart(self) -> None:
        """See ``Sink``."""
        self.kept.clear()

    def forget_before(self, t: float) -> None:
        """Drop the rows before ``t`` [s]."""
        self.kept = {time: row for time, row in self.kept.items() if time >= t}


class SteppedRun:
    """The run of a sound ``model`` with these ``options``, at ``time`` [s].

    ``columns`` are those of all tables but the time, by table; ``row`` has their values now. Steps
    and rows are those of ``loop.run`` as long as nothing is set. Raises ``OptionError`` for a
    tolerance of the global error, ``StartError`` if there is no consistent start.
    """

    def __init__(self, model: Model, options: Options) -> None:
        require_start(model)
        options = replace(options, error=OFF)
        settings = resolve(model.simulation, options)
        require_no_tolerance(settings)
        self.columns = {name: heads[1:] for name, heads in tables_of_model(model).items()}
        self.rows = Rows(tuple(self.columns))
        with np.errstate(all="ignore"):
            setup = build_setup(model, settings, None)
            local = settings.local_tolerance
            self.plan = GridSteps(setup.output) if local is None else FreeSteps(setup.output, local)
            self.setup = replace(setup, plan=self.plan)
            self.loop = TimeLoop(self.setup, self.rows, Hooks())
            self.loop.begin(None)
            prepare(self.setup.calls, lambda: False)
        self.loop.system = digest(self.setup.integrators)
        self.changes = [Changes(integrator) for integrator in self.setup.integrators]
        self.time, self.row = 0.0, self.rows.kept[0.0]
        self.before: Snapshot | None = None  # of the step that has passed ``time``, if one has
        self.changed = False  # whether something was set at ``time``
        self.failure = ""  # why no step was possible: none is until a state is restored

    @property
    def t_final(self) -> float:
        """Time at which the run ends [s]."""
        return self.plan.given.grid.t_final

    def advance(self, t: float) -> None:
        """Go on to ``t`` [s], later than now. Raises ``RunEnded``, with what is wrong, if the run
        cannot.
        """
        t = float(on_grids(np.array([t]), self.plan.given)[0])
        if not self.time < t:
            raise RunEnded(f"t = {t:g} s is not after t = {self.time:g} s, where the run stands")
        if t > self.t_final:
            raise RunEnded(
                f"the run ends at t = {self.t_final:g} s, before t = {t:g} s; give --t-final"
            )
        # Schemes of order 2 have rows at the ends of steps only.
        self._aim(t, t - self.time, self.changed or not self.setup.settings.degree)
        with np.errstate(all="ignore"):
            self._take_steps(t)
        self.time, self.row, self.changed = t, self.rows.kept[self._key(t)], False
        self.rows.forget_before(t)

    def set(self, states: Mapping[str, float], parameters: Mapping[tuple[str, str], float]) -> None:
        """Set auxiliary ``states`` by name and ``parameters`` [SI] of loads, by load and name, now.
        Raises ``RunEnded`` if contacts have no forces with these.
        """
        with np.errstate(all="ignore"):
            self._end_step_here()
            try:
                for changes in self.changes:
                    changes.apply(states, parameters)
            except ContactsUnsolved as error:
                self.failure = str(error)
                raise RunEnded(self.failure) from error
        self.rows.kept, self.changed = {self.time: self.row}, True
        self.loop.accepted.update(self.setup.integrators)

    def save(self) -> dict[str, Any]:
        """Return all that the run needs to go on from now, as JSON can hold it but for arrays."""
        return {
            "time": self.time,
            "changed": self.changed,
            "row": self.row,
            "rows": dict(self.rows.kept),
            "now": self._snapshot(),
            "before": self.before,
            "parameters": [changes.values for changes in self.changes],
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go to where ``save`` was called, of this run or another of the same model and options.
        Raises ``ResumeError`` if it is not the same.
        """
        for changes, values in zip(self.changes, saved["parameters"], strict=True):
            changes.restore(values)
        self._go_to(saved["now"])
        self.time, self.changed, self.row = saved["time"], saved["changed"], saved["row"]
        self.rows.kept, self.before = dict(saved["rows"]), saved["before"]

    def _aim(self, t: float, interval: float, exact: bool) -> None:
        self.plan.aim.target, self.plan.aim.interval = t, interval
        self.plan.aim.exact = exact

    def _key(self, t: float) -> float:
        """Return the time [s] under which the values at ``t`` are kept, nan if they are not."""
        near = SAME_TIME * min(self.plan.aim.interval, self.plan.output.grid.h)
        return next((time for time in self.rows.kept if abs(time - t) <= near), math.nan)

    def _take_steps(self, t: float) -> None:
        """Take the steps up to ``t`` [s], or that which has passed it once more for its output."""
        if self.failure:
            raise RunEnded(self.failure)
        if math.isnan(self._key(t)) and self.plan.progress.time >= t:
            assert self.before is not None
            self._go_to(self.before)
        while math.isnan(self._key(t)):
            if self.plan.ended:
                end = self.plan.progress.time
                words = f", where {words_of(self.setup.model)}" if self.loop.stopping else ""
                self.failure = f"the run ended at t = {end:.9g} s{words}"
                raise RunEnded(self.failure)
            self.before = self._snapshot() if self.plan.passes else None
            self.loop.take_chunk(self.setup.output.chunk)
            if self.loop.report.status != COMPLETED:
                self.failure = self.loop.report.message
                raise RunEnded(self.failure)

    def _end_step_here(self) -> None:
        """Let a step end at the present time."""
        if self.plan.progress.time <= self.time * (1.0 + ROUND_OFF):
            return
        assert self.before is not None
        self._go_to(self.before)
        self._aim(self.time, math.inf, True)
        self.rows.kept.clear()
        self._take_steps(self.time)

    def _snapshot(self) -> Snapshot:
        """Snapshot of the steps, without the history of the run."""
        found = self.loop.snapshot()
        numbers = {**found.numbers, "seconds": {}, "resumed": []}
        return Snapshot(found.system, numbers, found.memory)

    def _go_to(self, snapshot: Snapshot) -> None:
        self.failure = ""
        self.plan.begin_again()
        self.loop.stopping = False
        self.loop.go_to(snapshot)
        self.loop.report.resumed.clear()


def require_no_tolerance(settings: RunSettings) -> None:
    """Raise ``OptionError`` for steps that follow from a tolerance of the global error."""
    if settings.tolerance is not None:
        raise OptionError(
            [
                "a tolerance of the global error needs complete runs, and this one is advanced "
                "from outside: give localTolerance (--local-tolerance), or a scheme with steps of "
                "a given size"
            ]
        )
