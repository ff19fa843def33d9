"""What an FMU does when a master calls it: the classes that its binaries make and call.

The binaries of pythonfmu and pythonfmu3 find a class in a module of the FMU whose bases are named
``Fmi2Slave`` or ``Fmi3Slave``, make an object of it for each instance, and call its methods. No
method raises: what is wrong is logged as an error, and no step is taken from then on.
"""

import ctypes
import json
import math
from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple

from msahl.api.model import load
from msahl.check import ModelError
from msahl.deck import DeckError
from msahl.fmu.description import FIRST, is_known
from msahl.run.options import OptionError
from msahl.run.snapshot import ResumeError
from msahl.run.stepped_run import RunEnded
from msahl.start.velocities import StartError

DECK, RUN = "deck", "run.json"
"""Folder of the deck in the resources of an FMU, and file that says how it runs."""
WORDED = (DeckError, ModelError, OptionError, ResumeError, RunEnded, StartError)
"""Exceptions whose words are for users."""


class Status(IntEnum):
    """The status of a call, as both versions of FMI number it."""

    OK, WARNING, DISCARD, ERROR, FATAL = range(5)


class Message(NamedTuple):
    """A message to the master."""

    status: Status
    category: str
    msg: str
    debug: bool = False


class StepResult(NamedTuple):
    """What a step of FMI 3.0 returns."""

    status: Status = Status.OK
    eventHandlingNeeded: bool = False
    terminateSimulation: bool = False
    earlyReturn: bool = False


def keep(names: dict[str, Any]) -> None:
    """Add a reference to the ``names`` of a module. The binaries of pythonfmu 0.7 run it for each
    instance, and then give back one reference to its names, which they have only borrowed: they
    would be freed while in use.
    """
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(names))


def guarded(otherwise: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Make a method return what is given ``otherwise`` where it would raise, and tell the master:
    the binaries free an instance twice after an exception, which ends the process of the master.
    """

    def guard(method: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(method)
        def call(self: "Slave", *given: Any) -> Any:
            try:
                return method(self, *given)
            except Exception as error:
                self.fail(str(error) if isinstance(error, WORDED) else repr(error))
                return otherwise

        return call

    return guard


class Slave:
    """An instance of an FMU, of the deck in its ``resources``.

    ``fault`` says what is wrong since a call that failed: until a state is restored no step is
    taken.
    """

    def __init__(self, *, instance_name: str, resources: str, **_: Any) -> None:
        self.log: list[Message] = []
        self.fault = ""
        given = json.loads((Path(resources) / RUN).read_bytes())
        model = load(Path(resources) / DECK / given["deck"], **given["changes"])
        self.run = model.co_simulation(**given["options"])
        known = [one.name for one in self.run.variables.values() if is_known(one)]
        self.names = dict(enumerate(known, FIRST))

    def fail(self, fault: str) -> None:
        """Tell the master what is wrong."""
        self.fault = fault
        self.log.append(Message(Status.ERROR, "logStatusError", fault))

    def _get_log_queue(self) -> list[Message]:
        return self.log

    @guarded(None)
    def setup_experiment(self, start: float, stop: float | None = None, *_: Any) -> None:
        """Accept the times between which the master runs [s]; FMI 3.0 does not give the second."""
        if start != 0.0:
            raise RunEnded(f"the start time is {start:g} s; a deck starts at t = 0")
        if stop is not None and stop > self.run.t_final * (1.0 + 1e-9):
            raise RunEnded(
                f"the stop time is {stop:g} s, and the deck's run ends at {self.run.t_final:g} s; "
                "export it with a later --t-final"
            )

    def enter_initialization_mode(self) -> None:
        """Do nothing: values are computed when they are needed."""

    @guarded(None)
    def exit_initialization_mode(self) -> None:
        """Start the run with the values that were set."""
        _ = self.run.values

    def terminate(self) -> None:
        """Do nothing: there is nothing to be written."""

    def step(self, begin: float, size: float) -> bool:
        """Advance from ``begin`` by ``size`` [s]; return whether that was possible."""
        before = self.fault
        good = bool(self._advance(begin, size))
        self.fault = before  # another step may be possible
        return good

    @guarded(False)
    def _advance(self, begin: float, size: float) -> bool:
        if self.fault:
            raise RunEnded(self.fault)
        if abs(begin - self.run.time) > 1e-9 * max(size, self.run.time):
            raise RunEnded(
                f"the step begins at t = {begin:g} s, and the run stands at t = {self.run.time:g} "
                "s; restore the state of that time first"
            )
        self.run.advance(begin + size)
        return True

    def get_numbers(self, references: Sequence[int]) -> list[float]:
        """Return the values of variables, nan if there are none."""
        return [self._value(reference) for reference in references]

    @guarded(None)
    def set_numbers(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set the values of variables."""
        self.run.set(dict(zip(map(self._name, references), values, strict=True)))

    @guarded(math.nan)
    def _value(self, reference: int) -> float:
        return self.run[self._name(reference)] if reference else self.run.time

    def _name(self, reference: int) -> str:
        if reference not in self.names:
            raise RunEnded(f"there is no variable with the value reference {reference}")
        return self.names[reference]

    @guarded(b"")
    def _get_fmu_state(self) -> bytes:
        return self.run.save()

    @guarded(None)
    def _set_fmu_state(self, state: bytes) -> None:
        self.run.restore(state)
        self.fault = ""

    @staticmethod
    def _fmu_state_to_bytes(state: bytes) -> bytes:
        return state

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> bytes:
        return state


class Fmi2Slave(Slave):
    """An instance as the binaries of pythonfmu call it."""

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by one communication step [s]; False means that it is discarded."""
        return bool(self.step(current_time, step_size))

    get_real = Slave.get_numbers
    set_real = Slave.set_numbers


class Fmi3Slave(Slave):
    """An instance as the binaries of pythonfmu3 call it."""

    def do_step(self, current_time: float, step_size: float) -> StepResult:
        """Advance by one communication step [s]."""
        good = self.step(current_time, step_size)
        return StepResult(Status.OK if good else Status.ERROR)

    get_float64 = Slave.get_numbers
    set_float64 = Slave.set_numbers
