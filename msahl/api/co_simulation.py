"""A run that another program advances: what ``Model.co_simulation`` and FMUs are made of."""

import json
import math
from base64 import b64decode, b64encode
from collections.abc import Mapping
from dataclasses import replace
from numbers import Real
from typing import Any, Protocol, Unpack

import numpy as np

from msahl.api.options import RunOptions
from msahl.api.running import at_start
from msahl.api.variables import INPUT, OUTPUT, PARAMETER, TUNABLE, Variable, variables_of
from msahl.check import require_sound
from msahl.expressions.syntax import nearest
from msahl.model import Model as Records
from msahl.model import SignalState
from msahl.model.settable import with_parameter
from msahl.results.job import Job
from msahl.run.options import OptionError
from msahl.run.snapshot import ResumeError, Snapshot
from msahl.run.stepped_run import SteppedRun, require_no_tolerance
from msahl.run.tables import SIGNALS
from msahl.version import VERSION

DOUBLES = np.dtype("<f8")
LARGEST = 1e100
"""Largest number that is accepted, as in decks."""


class Runnable(Protocol):
    """What a run needs of a ``Model``, which makes it."""

    @property
    def title(self) -> str:
        """See ``Model``."""

    @property
    def digest(self) -> str:
        """See ``Model``."""

    @property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """See ``Model``."""

    @property
    def records(self) -> Records:
        """See ``Model``."""

    @property
    def changes(self) -> dict[str, Any]:
        """See ``Model``."""

    def with_(self, **changes: float | str) -> "Runnable":
        """See ``Model``."""

    def job(self, **options: Unpack[RunOptions]) -> Job:
        """See ``Model``."""


class CoSimulation:
    """A run of a ``model``, at ``time`` [s], that goes on when ``advance`` is called.

    Its numbers are read and set by name: all columns of tables; parameters of the deck, in their
    units there, before the first step; inputs and numbers of loads, such as ``Spring.stiffness``,
    in SI at any time, from which on they hold. What was set decides where the run starts; that
    raises ``DeckError``, ``ModelError`` or ``StartError`` when it is first needed.
    """

    def __init__(self, model: Runnable, options: RunOptions) -> None:
        self._model, self._options = model, options
        job = model.job(**options)
        require_no_tolerance(job.settings)
        self.variables = variables_of(model.records, model.parameters)
        self._identity = f"{model.digest} {model.changes} {sorted(options.items())}"
        self.t_final = job.settings.t_final
        self.interval = job.settings.output_interval or job.settings.dt
        self._given: dict[str, float] = {}
        self._inputs: dict[str, float] = {}  # set at the present time, which no row has yet
        self._parameters: dict[str, float] = {}  # with which the run has started
        self._run: SteppedRun | None = None
        self._places: dict[str, int] = {}

    @property
    def title(self) -> str:
        """The title of the deck; empty if it has none."""
        return self._model.title

    @property
    def time(self) -> float:
        """Time of the present communication point [s]."""
        return 0.0 if self._run is None else self._run.time

    @property
    def values(self) -> dict[str, float]:
        """All columns of tables at the present time, by name."""
        row = self._started().row.tolist()
        return {
            name: row[place]
            for name, place in self._places.items()
            if self.variables[name].kind == OUTPUT
        }

    def __getitem__(self, name: str) -> float:
        """Return a number by its name; raises ``OptionError`` if there is none."""
        variable = self._variable(name)
        is_held = variable.kind != INPUT or self.time == 0.0 or name in self._inputs
        if variable.kind == OUTPUT or not is_held:  # an event may have set an input
            return float(self._started().row[self._places[name]])
        return self._given.get(name, variable.start)

    def set(self, values: Mapping[str, float]) -> None:
        """Set numbers by name: from now on, they have these values. Raises ``OptionError``, and
        sets none, if one cannot be set or has no such value; ``RunEnded`` if the model has no
        forces with them.
        """
        faults = [fault for name, value in values.items() if (fault := self._fault(name, value))]
        if faults:
            raise OptionError(faults)
        changed = {name: float(value) for name, value in values.items() if self[name] != value}
        if not changed:
            return
        before, self._given = self._given, {**self._given, **changed}
        if self.time == 0.0:
            self._run = None
            return
        try:
            self._set_now(changed)
        except BaseException:
            self._given = before
            raise

    def advance(self, to: float) -> None:
        """Take the steps up to the time ``to`` [s]. Raises ``RunEnded`` if that is not possible."""
        if not isinstance(to, Real) or not math.isfinite(to):
            raise OptionError([f"to: it is {to!r:.200}; it must be a time in seconds"])
        self._started().advance(float(to))
        self._inputs.clear()

    def save(self) -> bytes:
        """Return the state of the run, from which it goes on to the last bit."""
        run = self._run
        saved = None if run is None else _packed(run.save())
        head = {
            "msahl": VERSION,
            "of": self._identity,
            "given": self._given,
            "inputs": self._inputs,
            "at_start": self._parameters,
            "run": saved,
        }
        return json.dumps(head).encode()

    def restore(self, saved: bytes) -> None:
        """Go to where ``save`` was called, of this run or another of the same model and options.
        Raises ``ResumeError`` for any other.
        """
        try:
            head = json.loads(saved)
            if head["msahl"] != VERSION:
                raise ResumeError(f"it was saved by msahl {head['msahl']}, and this is {VERSION}")
            if head["of"] != self._identity:
                raise ResumeError("it was saved by a run of another deck, or with other options")
            state = None if head["run"] is None else _unpacked(head["run"])
            given, at_start = dict(head["given"]), dict(head["at_start"])
            inputs = dict(head["inputs"])
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ResumeError("it is not the saved state of a run") from error
        if state is None:
            self._given, self._inputs, self._run = given, inputs, None
            return
        if self._run is None or at_start != self._parameters:
            self._given, self._run = at_start, None
        try:
            self._started().restore(state)
        except ResumeError as error:
            raise ResumeError(
                "it was saved on another machine, or with other libraries: the model's matrices "
                "differ in the last digits"
            ) from error
        self._given, self._inputs = given, inputs

    def _fault(self, name: str, value: Any) -> str:
        """Return why a number cannot be set; empty if it can."""
        variable = self.variables.get(name)
        if variable is None:
            return _unknown(name, self.variables)
        if variable.kind == OUTPUT:
            return f"{name} is a result of the run; set an input or a parameter"
        if not isinstance(value, Real) or not abs(float(value)) <= LARGEST:
            return f"{name}: it is {value!r:.200}; give a finite number, of up to {LARGEST:g}"
        if variable.kind == PARAMETER and self.time > 0.0 and self[name] != value:
            return (
                f"{name} is a parameter of the deck, constant from t = 0 on; set it before the "
                "first step, or set an input or a number of a load"
            )
        return ""

    def _variable(self, name: str) -> Variable:
        if name not in self.variables:
            raise OptionError([_unknown(name, self.variables)])
        return self.variables[name]

    def _of_kind(self, kind: str, values: Mapping[str, float]) -> dict[str, float]:
        return {n: value for n, value in values.items() if self.variables[n].kind == kind}

    def _set_now(self, changed: Mapping[str, float]) -> None:
        """Set inputs and numbers of loads at the present time."""
        tunable = self._of_kind(TUNABLE, changed)
        if tunable:
            require_sound(
                self._with_numbers(self._model.records, self._of_kind(TUNABLE, self._given))
            )
        known = self.variables
        numbers = {(known[n].load, known[n].parameter): value for n, value in tunable.items()}
        inputs = self._of_kind(INPUT, changed)
        self._started().set(inputs, numbers)
        self._inputs.update(inputs)

    def _started(self) -> SteppedRun:
        """Return the run, which starts with what has been set."""
        if self._run is None:
            model = self._model.with_(**self._of_kind(PARAMETER, self._given))
            job = model.job(**self._options)
            numbers = self._of_kind(TUNABLE, self._given) | self._of_kind(INPUT, self._given)
            records = self._with_numbers(job.model, numbers)
            if numbers:
                require_sound(records)
            job = at_start(replace(job, model=records))
            self._run = SteppedRun(job.model, job.options)
            self._parameters = dict(self._given)
            columns = [(table, c) for table, heads in self._run.columns.items() for c in heads]
            place = {of: k for k, of in enumerate(columns)}
            self._places = {
                v.name: place[v.table or SIGNALS, v.name.removeprefix(f"{v.table}.")]
                for v in self.variables.values()
                if v.kind in (INPUT, OUTPUT)
            }
        return self._run

    def _with_numbers(self, model: Records, numbers: Mapping[str, float]) -> Records:
        """Return the ``model`` with other numbers of loads and values of inputs."""
        wanted = [self.variables[name] for name in self._of_kind(TUNABLE, numbers)]
        loads = list(model.loads)
        for k, load in enumerate(loads):
            for variable in (one for one in wanted if one.load == load.name):
                load = with_parameter(load, variable.parameter, numbers[variable.name])
            loads[k] = load
        signals = tuple(
            replace(signal, initial=numbers[signal.name])
            if isinstance(signal, SignalState) and signal.name in numbers
            else signal
            for signal in model.signals
        )
        return replace(model, loads=tuple(loads), signals=signals)


def _unknown(name: str, known: Mapping[str, Variable]) -> str:
    return f"{name}: the model has no such number{nearest(name, list(known))}"


def _packed(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a run has saved, as JSON can hold it."""
    before = state["before"]
    return {
        **state,
        "row": _text(state["row"]),
        "rows": [[t, _text(row)] for t, row in state["rows"].items()],
        "now": _snapshot_as_json(state["now"]),
        "before": None if before is None else _snapshot_as_json(before),
    }


def _unpacked(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return what ``_packed`` was given."""
    before = state["before"]
    return {
        **state,
        "row": _array(state["row"]),
        "rows": {t: _array(row) for t, row in state["rows"]},
        "now": _snapshot(state["now"]),
        "before": None if before is None else _snapshot(before),
    }


def _snapshot_as_json(snapshot: Snapshot) -> dict[str, Any]:
    memory = _text(snapshot.memory)
    return {"system": snapshot.system, "numbers": snapshot.numbers, "memory": memory}


def _snapshot(saved: Mapping[str, Any]) -> Snapshot:
    return Snapshot(saved["system"], saved["numbers"], _array(saved["memory"]))


def _text(array: np.ndarray) -> str:
    return b64encode(array.astype(DOUBLES, copy=False).tobytes()).decode()


def _array(text: str) -> np.ndarray:
    return np.frombuffer(b64decode(text), DOUBLES).astype(float)
