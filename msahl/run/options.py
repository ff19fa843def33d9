"""The options of a run, in one table.

The command line of ``msahl run``, the attributes and elements of ``<simulation>`` that it replaces,
the ``options`` of ``run.json``, the comparison of a resumed run with the interrupted one, and the
command lines that a study recommends all follow from ``OPTIONS``. To add an option, add a row here
and a field of the same name to ``Simulation`` or ``Options`` and to ``RunSettings``.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, replace
from numbers import Integral, Real
from os import fspath
from pathlib import Path
from typing import Any

from msahl.check import check_simulation
from msahl.expressions.syntax import nearest
from msahl.model import INSTANTANEOUS, MEAN, Model, Options, RunSettings, Simulation, resolve
from msahl.model.scheme import CAYLEY, DAMPING, EXPONENTIAL, TOLERANCE, choices, split
from msahl.model.settings import ACCELERATIONS, ERRORS, JOINT_TABLES, LOCAL, OFF, SOLVERS
from msahl.records import record
from msahl.run.report import camel_case
from msahl.run.tables import MOST_JOINTS

MOST_EVERY = 10**9


@record
class Number:
    """A finite number, within a range if one is given; ``unit`` stands for it in the help."""

    unit: str
    least: float | None = None
    most: float | None = None
    positive: bool = False


@record
class Integer:
    """An integer within a range."""

    least: int
    most: int


@record
class Choice:
    """One of some words."""

    words: tuple[str, ...]


@record
class Flag:
    """Given or not."""


@record
class Option:
    """One option of a run.

    ``name`` is the parameter and the field of the settings, ``deck`` the attribute or element of
    ``<simulation>`` that it replaces (empty if there is none), ``default`` what holds if neither
    the command line nor the deck says otherwise, and ``recorded`` its value in ``run.json``.
    """

    name: str
    kind: Number | Integer | Choice | Flag
    help: str
    recorded: Callable[[RunSettings], Any]
    deck: str = ""
    default: Any = None

    @property
    def flag(self) -> str:
        """The option on the command line."""
        return "--" + self.name.replace("_", "-")

    @property
    def key(self) -> str:
        """Its name in ``run.json``."""
        return camel_case(self.name)


OPTIONS = (
    Option(
        "dt",
        Number("S"),
        "Set the step size in seconds (default: deltaT of the deck).",
        lambda settings: settings.dt,
        deck="deltaT",
    ),
    Option(
        "t_final",
        Number("S"),
        "Set the end of the run in seconds (default: tFinal of the deck).",
        lambda settings: settings.t_final,
        deck="tFinal",
    ),
    Option(
        "scheme",
        Choice(choices()),
        "Choose the integration scheme. 'preserving' (order 2) conserves the energy; 'decaying' "
        "(order 2) takes energy from vibrations that are faster than the step. 'gauss1' to "
        "'gauss5' have the orders 2 to 10 and nearly conserve the energy; 'radau1' to 'radau3' "
        "have the orders 1, 3 and 5 and take energy from fast vibrations. 'rk4' and 'rk8' are "
        "explicit, of order 4 and 8, for models in joint coordinates; the energy drifts. 'auto' "
        "chooses the degree of gauss and the step size by the tolerance (default: the deck's, else "
        "preserving).",
        lambda settings: settings.scheme,
        deck="scheme",
    ),
    Option(
        "damping",
        Number("D", 0.0, 1.0),
        "Set the damping of 'decaying', from 0 (none) to 1 (removes the fastest vibrations in one "
        f"step; default: the deck's, else {DAMPING:g}).",
        lambda settings: settings.damping,
        deck="damping",
    ),
    Option(
        "rotation_update",
        Choice((CAYLEY, EXPONENTIAL)),
        "Choose how the schemes of order 2 rotate a body in a step: by the Cayley transform, which "
        "conserves the angular momentum of joined bodies to round-off, or by the exponential map, "
        "which is more accurate for fast rotations (default: the deck's, else cayley).",
        lambda settings: (
            None if settings.degree else EXPONENTIAL if settings.exponential else CAYLEY
        ),
        deck="rotationUpdate",
    ),
    Option(
        "solver",
        Choice(SOLVERS),
        "Choose the solver of a step: 'newton' is compiled, 'root' is scipy.optimize.root, and "
        "'auto' is newton, with root for the first step, and continuation or root for every step "
        "that newton fails on (default: auto).",
        lambda settings: settings.solver,
        default="auto",
    ),
    Option(
        "tolerance",
        Number("TOL"),
        "Choose the step size of gauss, radau or auto so that the estimated global error of the "
        "positions at the output times is at most TOL metres (default: the deck's; of auto, else "
        f"{TOLERANCE:g}).",
        lambda settings: settings.tolerance,
        deck="tolerance",
    ),
    Option(
        "local_tolerance",
        Number("TOL"),
        "Choose the step size so that the local errors of the steps add up to at most TOL metres; "
        "how the motion amplifies them is not considered (default: the deck's).",
        lambda settings: settings.local_tolerance if settings.tolerance is None else None,
        deck="localTolerance",
    ),
    Option(
        "output_interval",
        Number("S"),
        "Set the time between output times in seconds. gauss, radau and auto take any interval, "
        "the other schemes a whole number of steps (default: the deck's, else the step size).",
        lambda settings: settings.output_interval,
        deck="outputInterval",
    ),
    Option(
        "every",
        Integer(1, MOST_EVERY),
        "Write only every Nth output time, and the last one (default: 1).",
        lambda settings: settings.every,
        default=1,
    ),
    Option(
        "reactions",
        Choice((MEAN, INSTANTANEOUS)),
        "Choose the reactions in the tables: 'mean' over the step before each output time, or "
        "'instantaneous' at the output time (default: the deck's, else mean; gauss and radau: "
        "instantaneous).",
        lambda settings: settings.reactions,
        deck="reactions",
    ),
    Option(
        "accelerations",
        Choice(ACCELERATIONS),
        "Write the accelerations of all bodies, and of the coordinates of joints, at the output "
        "times: 'yes' or 'no' (default: the deck's, else no).",
        lambda settings: settings.accelerations,
        deck="accelerations",
    ),
    Option(
        "joint_table",
        Choice(JOINT_TABLES),
        "Write joints.csv, the coordinates of joints and their rates: 'yes', 'no', or 'auto', if "
        f"a joint has an angle or a slide and there are at most {MOST_JOINTS} joints (default: the "
        "deck's, else auto).",
        lambda settings: settings.joint_table,
        deck="jointTable",
    ),
    Option(
        "error",
        Choice(ERRORS),
        "Choose the error estimate: 'estimate' the global error by a more accurate companion run, "
        "add up the 'local' errors of the steps, or 'off' (default: estimate, unless it takes more "
        "than one second and longer than the run).",
        lambda settings: settings.error,
    ),
    Option(
        "accuracy",
        Number("TOL", 0.0, positive=True),
        "Set the largest position error in metres that passes, and report up to which time the run "
        "has it (default: the deck's, else 1 % of the model's size).",
        lambda settings: settings.accuracy,
    ),
    Option(
        "full",
        Flag(),
        "Switch off the model reductions that 'msahl explain' lists.",
        lambda settings: settings.full,
        default=False,
    ),
)
"""All options that the rows of a run depend on, in the order of the help."""


class OptionError(ValueError):
    """Options with which no run can be made; ``faults`` are sentences, one for each option."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("\n".join(faults))
        self.faults = tuple(faults)

    def __reduce__(self) -> tuple[Any, ...]:
        """Let processes send it to others with the same faults."""
        return type(self), (self.faults,)


def checked_options(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options that are not None, numbers as Python's own; raises ``OptionError`` if one
    does not exist or has no such value."""
    known = {option.name: option for option in OPTIONS}
    faults, values = [], dict[str, Any]()
    for name, value in given.items():
        if name not in known:
            faults.append(f"{name}: there is no such option{nearest(name, known)}")
        elif value is not None:
            values[name], expected = accepted(known[name].kind, value)
            if expected:
                faults.append(f"{name}: it is {value!r}; it must be {expected}")
    if faults:
        raise OptionError(faults)
    return values


def path_of(value: Any) -> Path:
    """Return the path that ``value`` is; raises ``OptionError`` if it can be none."""
    with suppress(TypeError):
        given = fspath(value)
        if isinstance(given, str) and given and "\0" not in given:
            return Path(given)
    raise OptionError([f"{value!r:.200} is not a path; give a text or a Path"])


def accepted(kind: Number | Integer | Choice | Flag, value: Any) -> tuple[Any, str]:
    """Return the value of an option, and what it must be if it is something else."""
    match kind:
        case Number(_, least, most, positive):
            words = "a finite number"
            low, high = -math.inf if least is None else least, math.inf if most is None else most
            if most is not None:
                words = f"a number from {low:g} to {high:g}"
            elif positive:
                words = f"a finite number greater than {low:g}"
            if not isinstance(value, Real) or isinstance(value, bool):
                return None, words
            try:
                number = float(value)
            except OverflowError:  # an integer of hundreds of digits
                return None, words
            good = math.isfinite(number) and low <= number <= high
            return number, "" if good and (number > low or not positive) else words
        case Integer(low, high):
            good = isinstance(value, Integral) and not isinstance(value, bool)
            good = good and low <= value <= high
            return (int(value), "") if good else (None, f"an integer from {low} to {high}")
        case Choice(words):
            known = isinstance(value, str) and value in words
            return value, "" if known else f"one of {', '.join(words)}"
        case Flag():
            return value, "" if isinstance(value, bool) else "True or False"


def require_compatible(simulation: Simulation, options: Options) -> None:
    """Raise ``OptionError`` with all that is wrong with step, end, scheme, tolerances and options
    of a run."""
    faults = check_simulation(simulation)
    if not faults:
        settings = resolve(simulation, options)
        if settings.solver == "root" and settings.adaptive:
            faults.append("solver root takes steps of a given size; omit it, or the tolerance")
        if settings.error in (LOCAL, OFF) and settings.tolerance is not None:
            faults.append(
                f"error {settings.error}: a tolerance of the global error needs its estimate; "
                "give a local tolerance instead"
            )
    if faults:
        raise OptionError(faults)


def recorded_options(settings: RunSettings) -> dict[str, Any]:
    """The ``options`` of ``run.json``: all that the rows depend on beside the deck."""
    values: dict[str, Any] = {option.key: option.recorded(settings) for option in OPTIONS}
    return values | {"degree": settings.degree or None}


def with_options(model: Model, given: Mapping[str, Any]) -> Model:
    """The model with the deck's settings replaced by the options that are ``given``, by name."""
    names = {field.name for field in fields(Simulation)}
    changes = {name: value for name, value in _expanded(given).items() if name in names}
    if {"tolerance", "local_tolerance"} & changes.keys():
        changes = {"tolerance": None, "local_tolerance": None, **changes}
    return replace(model, simulation=replace(model.simulation, **changes))


def deck_changes(given: Mapping[str, Any]) -> dict[str, Any]:
    """The attributes and elements of ``<simulation>`` that ``given`` options replace, by name."""
    places = {option.name: option.deck for option in OPTIONS if option.deck} | {"degree": "degree"}
    return {places[name]: value for name, value in _expanded(given).items() if name in places}


def options_beside_deck(given: Mapping[str, Any]) -> Options:
    """The options that a deck cannot hold."""
    names = {field.name for field in fields(Options)}
    return Options(**{name: given[name] for name in names if given.get(name) is not None})


def command_words(given: Mapping[str, Any]) -> list[str]:
    """The words of the command line that give these options."""
    words = []
    for option in OPTIONS:
        value = given.get(option.name)
        if value is None or value is False:
            continue
        shown = f"{value:.15g}" if isinstance(value, float) else str(value)
        words += [option.flag] if value is True else [option.flag, shown]
    return words


def _expanded(given: Mapping[str, Any]) -> dict[str, Any]:
    """The options that are not None, with the scheme's word split into name and degree."""
    values = {name: value for name, value in given.items() if value is not None}
    if "scheme" in values:
        values["scheme"], degree = split(values["scheme"])
        if degree is not None:
            values["degree"] = degree
    return values
