"""Interface between the run loop and the schemes: a ``Stepper`` advances one subsystem.

The run loop asks for a ``Chunk`` of steps and receives an ``Advance``. It needs to know nothing
else of a scheme, so steps of a given size (``fixed_stepper.FixedStepper``, for every scheme) and
steps whose size follows from a tolerance (``collocation.stepper.AdaptiveStepper``) go through the
same loop.

A class that implements ``Stepper`` must

1. advance the state of its workspace by accepted steps only: after ``advance`` the state is
   that of the last step counted in ``Advance.steps``, also where a further step failed;
2. write, for step k of a chunk, the row k of ``workspace.monitor.rows`` and the rows of
   ``workspace.tables`` that the schedule assigns to it, and no others;
3. return why it stopped early as ``Advance.outcome`` and never raise for a step that cannot be
   solved; the only exception is ``Stopped``, raised where ``requests`` says that the run is to be
   stopped within a step, and then the caller restores a saved state;
4. list in ``memory`` and ``counters`` everything besides ``workspace.state``, ``workspace.start``
   and ``workspace.pivots`` on which its next step depends, so that a run which is restored from
   them continues bit for bit; ``memory`` holds arrays of doubles (or None), ``counters`` what JSON
   can hold, and ``restore`` takes the latter back;
5. name in ``kind`` the compiled code that it runs, one name for each set of argument types, list
   in ``calls`` what has to be compiled or loaded, and compile nothing before the first step;
6. start its next step from the accelerations of the state, without extrapolation from earlier
   steps, after ``reset_prediction``: the caller changed the state or its steps are changing fast;
7. take the degree of another stepper in ``follow``, if it has one, and the coordinates in which
   this one has solved its last steps: a companion run is compared with the run step by step;
8. return in ``smallest_tried`` the size [s] of the shortest step that it tries for a chunk;
9. count in ``scipy_steps``, ``path_steps`` and ``subdivisions`` the steps solved by scipy, those
   solved along a path from shorter ones, and those divided;
10. end a step, or a part of it, at every event that divides steps, and go on from there; and
    return an ``Event`` that ends the run, after ``arm``, in ``Advance.event``, with the steps
    before the one in which it occurs. Steps of a system without margins
    (``events.margins``) cost nothing more;
11. take the parts of divided steps in two halves where ``halves_parts`` is set, as companions do;
12. take steps of different sizes in one call of compiled code, after ``vary_sizes`` and where it
    has such code, as companions of runs by tolerance do: their steps seldom have one size;
13. go on in ``begin_anew`` from a state in which loads have jumped from outside.
"""

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

import numpy as np

from msahl.events.search import Event
from msahl.jit.compiled import Call
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.outcome import Outcome, Requests
from msahl.schemes.output_schedule import NO_OUTPUT, OutputSchedule

NO_TIMES = np.zeros(0)
Parts = Mapping[int, tuple[float, ...]]
"""By the number of a step in its chunk, the fractions of it at which events divided it."""
UNDIVIDED: Parts = MappingProxyType({})


class Chunk(NamedTuple):
    """Steps that the run loop asks for in one call.

    A stepper with steps of a given size takes the steps ``first`` .. ``last - 1`` of ``schedule``,
    each of size ``h``. A stepper that chooses its steps takes about ``last`` steps, until it has
    passed all of ``times``, and ends no step beyond the last of these.
    """

    last: int
    first: int = 0
    h: float = 0.0  # [s]
    begin: float = 0.0  # time of the state [s]
    ends: np.ndarray = NO_TIMES  # (steps,) times of the steps' ends, by the run's own grid [s]
    schedule: OutputSchedule = NO_OUTPUT
    times: np.ndarray = NO_TIMES  # (rows,) output times [s]


class Advance(NamedTuple):
    """What a stepper did with a ``Chunk``."""

    steps: int  # number of the first step that was not taken: ``last`` if all were
    outcome: Outcome  # of the last step that was tried
    schedule: OutputSchedule  # the rows of the steps taken, and maybe of those after them
    sizes: np.ndarray  # (steps,) [s]
    ends: np.ndarray  # (steps,) times of the steps' ends [s]
    event: Event | None = None  # that ends the run within the next step
    parts: Parts = UNDIVIDED  # of the steps that events divide


class Stepper(Protocol):
    """Advances one subsystem by steps; see the obligations at the top of this module."""

    workspace: Workspace
    method: Any  # that takes the next steps, with the contacts and elements that act now
    requests: Requests
    scipy_steps: int
    path_steps: int
    subdivisions: int
    halves_parts: bool

    @property
    def kind(self) -> str:
        """Name of the compiled code that the steps need."""

    @property
    def calls(self) -> list[Call]:
        """Compiled functions that take the steps, with arguments of the types of their calls."""

    @property
    def memory(self) -> Any:
        """Arrays, in nested tuples, that a saved run must hold besides the workspace's own."""

    @property
    def counters(self) -> dict[str, Any]:
        """Numbers and words that a saved run must hold besides ``memory``."""

    def restore(self, counters: dict[str, Any]) -> None:
        """Take back what ``counters`` returned."""

    def advance(self, chunk: Chunk, patience: float = math.inf) -> Advance:
        """Take the steps of a ``chunk``; after ``patience`` seconds no further step that the
        compiled loop cannot solve is begun.
        """

    def vary_sizes(self, varies: bool) -> None:
        """Expect ``take_varied`` to be called, or not."""

    def take_varied(self, sizes: np.ndarray, first: int, schedule: OutputSchedule) -> int:
        """Take the steps of a chunk from ``first`` on that have these ``sizes`` (steps,) [s], as
        ``advance`` would; return the number of the first that compiled code did not take, which may
        be ``first``.
        """

    @property
    def trouble(self) -> str:
        """Why contacts keep it from taking further steps, in words; empty if they do not."""

    @property
    def sliding(self) -> tuple[int, float] | None:
        """The switch of expressions along whose level the motion slides, and since when [s]."""

    def reset_prediction(self) -> None:
        """Predict the next step from the accelerations of the state alone."""

    def begin_anew(self) -> None:
        """Take the next steps from the present state, whose loads have just jumped and whose
        accelerations follow them: contacts, conditions and switches follow as well. Raises
        ``ContactsUnsolved``.
        """

    def arm(self, time: float) -> None:
        """Let events after ``time`` [s] end the run: none before this is called."""

    @property
    def forms(self) -> np.ndarray | None:
        """(chunk,) 1 where a step of the last chunk was solved in joint coordinates, 0 where it was
        in absolute ones; None if there are no others.
        """

    def follow(self, other: "Stepper", steps: int, parts: int) -> None:
        """Take the degree of another stepper and, in each of the ``parts`` of the ``steps`` that it
        took last, absolute coordinates where it did.
        """

    def smallest_tried(self, h: float) -> float:
        """Size [s] of the shortest step tried; ``h`` is the given one."""

    def as_json(self) -> tuple[dict[str, Any] | None, dict[str, float]]:
        """Report on the step-size control for ``run.json``, None if there is none, and the
        extremes of the local errors that it estimated.
        """
