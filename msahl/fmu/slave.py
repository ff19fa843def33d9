"""What an FMU does when a master calls it: the classes that its binaries make and call.

The binaries of pythonfmu and pythonfmu3 find a class in a module of the FMU whose bases are named
``Fmi2Slave`` or ``Fmi3Slave``, make an object of it for each instance, and call its methods by name.
A method that raises ends the instance with the status fatal, and the master is told the message.
"""

from collections.abc import Callable, Iterable, Sequence
from enum import IntEnum
from functools import wraps
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar

from msahl.api.co_simulation import CoSimulation
from msahl.api.model import load
from msahl.deck import DeckError
from msahl.fmu.description import FIRST, is_known
from msahl.run.options import OptionError
from msahl.run.snapshot import ResumeError
from msahl.run.stepped_run import RunEnded
from msahl.start.velocities import StartError

DECK = "deck.xml"
P, R = ParamSpec("P"), TypeVar("R")


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


class FmuError(Exception):
    """What is wrong with a call, in words for the user of the master."""


def worded(function: Callable[P, R]) -> Callable[P, R]:
    """Return the ``function``, whose faults are raised as ``FmuError`` with their words alone."""

    @wraps(function)
    def call(*given: P.args, **named: P.kwargs) -> R:
        try:
            return function(*given, **named)
        except (DeckError, OptionError, ResumeError, RunEnded, StartError) as error:
            raise FmuError(str(error)) from None

    return call


class Slave:
    """An instance of an FMU, of the deck in its ``resources``."""

    run: CoSimulation

    @worded
    def __init__(self, *, instance_name: str, resources: str, **_: Any) -> None:
        self.log: list[Message] = []
        self.run = load(Path(resources) / DECK).co_simulation()
        known = [one.name for one in self.run.variables.values() if is_known(one)]
        self.names = dict(enumerate(known, FIRST))

    def _get_log_queue(self) -> list[Message]:
        return self.log

    @worded
    def setup_experiment(self, start: float, stop: float | None = None, *_: Any) -> None:
        """Accept the times between which the master runs [s]."""
        if start != 0.0:
            raise FmuError(f"the start time is {start:g} s; a deck starts at t = 0")
        if stop is not None and stop > self.run.t_final * (1.0 + 1e-9):
            raise FmuError(
                f"the stop time is {stop:g} s, and the deck's run ends at {self.run.t_final:g} s; "
                "export it with a later --t-final"
            )

    def enter_initialization_mode(self) -> None:
        """Do nothing: values are computed when they are needed."""

    @worded
    def exit_initialization_mode(self) -> None:
        """Start the run with the values that were set."""
        _ = self.run.values

    def terminate(self) -> None:
        """Do nothing: there is nothing to be written."""

    def step(self, begin: float, size: float) -> Status:
        """Advance from ``begin`` by ``size`` [s]; return a status, and log why it is not OK."""
        try:
            if abs(begin - self.run.time) > 1e-9 * max(size, self.run.time):
                raise RunEnded(
                    f"the step begins at t = {begin:g} s, and the run stands at "
                    f"t = {self.run.time:g} s; restore the state of that time first"
                )
            self.run.advance(begin + size)
        except (OptionError, RunEnded) as error:
            self.log.append(Message(Status.ERROR, "logStatusError", str(error)))
            return Status.DISCARD
        return Status.OK

    @worded
    def get_numbers(self, references: Iterable[int]) -> list[float]:
        """Return the values of variables."""
        return [self._value(reference) for reference in references]

    @worded
    def set_numbers(self, references: Sequence[int], values: Sequence[float]) -> None:
        """Set the values of variables."""
        self.run.set(dict(zip(map(self._name, references), values, strict=True)))

    def _value(self, reference: int) -> float:
        return self.run[self._name(reference)] if reference else self.run.time

    def _name(self, reference: int) -> str:
        if reference not in self.names:
            raise FmuError(f"there is no variable with the value reference {reference}")
        return self.names[reference]

    @worded
    def _get_fmu_state(self) -> bytes:
        return self.run.save()

    @worded
    def _set_fmu_state(self, state: bytes) -> None:
        self.run.restore(state)

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
        return self.step(current_time, step_size) == Status.OK

    get_real = Slave.get_numbers
    set_real = Slave.set_numbers


class Fmi3Slave(Slave):
    """An instance as the binaries of pythonfmu3 call it."""

    def do_step(self, current_time: float, step_size: float) -> StepResult:
        """Advance by one communication step [s]."""
        return StepResult(self.step(current_time, step_size))

    get_float64 = Slave.get_numbers
    set_float64 = Slave.set_numbers
