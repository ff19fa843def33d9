"""Models: decks that were read, or records, with other numbers where wanted, ready to be run."""

import math
from collections.abc import Mapping, Sequence
from functools import cached_property
from numbers import Integral, Real
from os import PathLike
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Unpack

from msahl.api.arguments import (
    COUNT,
    NOT_NEGATIVE,
    At,
    Mapped,
    Names,
    Numbers,
    Weights,
    require,
)
from msahl.api.html import html_table
from msahl.api.options import RunOptions
from msahl.api.result import Result
from msahl.api.running import run_job
from msahl.check import require_sound
from msahl.deck import ParsedDeck, Source, listed_parameters
from msahl.deck.overrides import STOP_WHEN
from msahl.model import Model as Records
from msahl.results.job import Job, make_job
from msahl.run.options import Choice, OptionError, checked_options, path_of

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element as PlainElement

    import pandas as pd
    from lxml.etree import _Element

    from msahl.analysis.state_space.model import LinearModel
    from msahl.api.co_simulation import CoSimulation
    from msahl.api.derivatives import Gradients
    from msahl.api.equilibria import Equilibrium
    from msahl.api.inverse import InverseResult
    from msahl.api.modes import Modes, ModesOver

Value = float | str
"""A number, in the unit that the deck has there, or a number with its unit, such as ``"80 cm"``."""


def load(
    deck: "str | PathLike[str] | bytes | _Element | PlainElement", **parameters: Value
) -> "Model":
    """Read a deck: the path of a file, its text (``<data>...``), or its root element.

    ``parameters`` get other values, as by ``Model.with_``. Raises ``DeckError`` with every fault
    found.
    """
    try:
        source = Source.of(deck)
    except TypeError as error:
        raise OptionError([str(error)]) from None
    return Model(ParsedDeck(source), parameters)


class Model:
    """A model of records, or of a deck that was read, with ``changes`` of its numbers by name.

    ``records`` are what it is made of, complete and in SI units (``msahl.model.Model``).
    """

    def __init__(
        self, model: Records | ParsedDeck, changes: Mapping[str, Value] | None = None
    ) -> None:
        """Return the model of records, such as ``msahl.model.Model`` has them, or of a deck.

        Raises ``ModelError`` with every fault of the records, ``DeckError`` with every fault of the
        deck with these changes.
        """
        if isinstance(model, Records):
            require_sound(model)
            model = ParsedDeck(Source.of_model(model))
        if not isinstance(model, ParsedDeck):
            raise TypeError(
                f"a model is made of records (msahl.model.Model), not {type(model).__name__}; of "
                "a deck msahl.load makes one"
            )
        if changes is not None and not isinstance(changes, Mapping):
            raise OptionError([f"changes: it is {changes!r:.200}; it must be numbers by name"])
        self._deck = model
        self.changes: dict[str, Value] = dict(changes or {})
        self._settings = tuple(
            f"{name}={_shown(name, value)}" for name, value in self.changes.items()
        )
        self.records: Records = model.model(self._settings)

    def with_(self, **changes: Value) -> "Model":
        """Return a model with other numbers: parameters of the deck by name, such as ``L=0.8`` or
        ``L="80 cm"``, and all its numbers by path: ``**{"Bob.mass": "3 kg"}``.

        A number without unit is in the unit that the deck has there. Raises ``DeckError`` with
        every fault found.
        """
        return Model(self._deck, {**self.changes, **changes})

    def run(
        self,
        *,
        gradient: str | Sequence[str] = (),
        wrt: str | Sequence[str] = (),
        **options: Unpack[RunOptions],
    ) -> Result:
        """Run the model and return its results, which are kept in memory.

        The ``options`` are those of ``msahl run``. Raises ``OptionError``, a ``ValueError``, if
        they are wrong, ``StartError`` if the model has no consistent state at t = 0. A run that
        cannot complete returns the results up to there; its ``status`` says why it ended.

        With measures in ``gradient``, such as ``"Tip.z final"``, and names of numbers in ``wrt``,
        the ``gradient`` of the results holds the derivatives of the former by the latter; raises
        ``GradientError``, a ``ValueError``, if there are none.
        """
        require(gradient=(gradient, Names()), wrt=(wrt, Names()))
        if not len(gradient) and not len(wrt):
            return run_job(self.job(**options))
        from msahl.api.gradients import run_with_gradients

        return run_with_gradients(self.job(**options), gradient, wrt)

    def gradient(
        self,
        measures: str | Sequence[str],
        wrt: str | Sequence[str],
        **options: Unpack[RunOptions],
    ) -> "Gradients":
        """Run the model and return the derivatives of ``measures``, such as ``"Tip.z final"``, by
        numbers of the deck, named as in ``with_``, with their errors.

        Raises ``GradientError``, a ``ValueError``, if there are none, and what ``run`` raises.
        """
        from msahl.api.gradients import run_with_gradients

        require(measures=(measures, Names()), wrt=(wrt, Names()))
        found = run_with_gradients(self.job(**options), measures, wrt).gradient
        assert found is not None
        return found

    def inverse(
        self,
        motion: "str | PathLike[str] | Result | pd.DataFrame | Mapping[str, Any]",
        loads: Sequence[str] = (),
        weights: Mapping[str, float] | None = None,
        smooth: float = 0.0,
        companion: "str | PathLike[str] | Result | pd.DataFrame | Mapping[str, Any] | None" = None,
        columns: Mapping[str, str] = MappingProxyType({}),
    ) -> "InverseResult":
        """Return the loads of actuators that produce a ``motion``: a result, a table, or the path
        of a table or of a run's folder. ``columns`` says what columns of tables are, and their
        units: ``{"q1": "Shaft.angle:deg"}``.

        The arguments are the options of ``msahl inverse``. Raises ``InverseError``, a
        ``ValueError``, if they are wrong or leave degrees of freedom undetermined.
        """
        from msahl.api.inverse import Wanted, loads_of

        weights = {} if weights is None else weights
        require(loads=(loads, Names()), weights=(weights, Weights()), smooth=(smooth, NOT_NEGATIVE))
        require(columns=(columns, Mapped()))
        wanted = Wanted(motion, loads, weights, smooth, companion, columns)
        return loads_of(self.job(), wanted)

    def co_simulation(self, **options: Unpack[RunOptions]) -> "CoSimulation":
        """Return a run that is advanced from outside, step by step of another program: a controller
        or a master of FMUs. The ``options`` are those of ``run``.

        Raises ``OptionError`` if they are wrong or ask for a tolerance of the global error.
        """
        from msahl.api.co_simulation import CoSimulation

        return CoSimulation(self, options)

    def job(self, **options: Unpack[RunOptions]) -> Job:
        """Return what ``run`` would run, checked; raises ``OptionError`` as ``run`` does."""
        given: dict[str, Any] = dict(options)
        condition, settings, records = given.pop("stop_when", None), self._settings, self.records
        if condition is not None:
            if not isinstance(condition, str) or not condition.isprintable():
                raise OptionError([f"stop_when: it is {condition!r:.200}; it must be a condition"])
            settings = (*settings, f"{STOP_WHEN}{condition}")
            records = self._deck.model(settings)
        return make_job(self._deck.source, records, checked_options(given), settings)

    def kinematics(
        self, step: float | None = None, t_final: float | None = None, every: int = 1
    ) -> Result:
        """Return the motion of a model whose prescribed motions leave no degrees of freedom, as
        ``msahl kinematics`` computes it: without integrating, with accelerations and reactions.

        ``step`` is the time between output times and ``t_final`` the end [s], of which every
        ``every``-th is computed. Raises ``StartError`` if degrees of freedom remain. A motion that
        cannot be followed to its end is returned up to there; its ``status`` says so.
        """
        from msahl.analysis.kinematics.solution import options_of
        from msahl.api.kinematics import kinematics_of

        require(every=(every, COUNT))
        return kinematics_of(self.job(**options_of(step, t_final)), every)

    def equilibrium(self, rotation: Sequence[float] = (0.0, 0.0, 0.0)) -> "Equilibrium":
        """Return the equilibrium to which the forces lead from where the deck has the bodies: at
        rest, or with the complete model in a steady ``rotation`` [rad/s], inertial axes. Raises
        ``StartError`` if none is found.
        """
        from msahl.api.equilibria import equilibrium_of

        require(rotation=(rotation, Numbers(3)))
        return equilibrium_of(self.job(), rotation, lambda deck: Model(deck, {}))

    def equilibria(
        self, starts: int = 1, rotation: Sequence[float] = (0.0, 0.0, 0.0)
    ) -> "list[Equilibrium]":
        """Return all equilibria that are found from the deck's configuration and ``starts`` - 1
        others, drawn at random, as ``msahl equilibrium`` does.
        """
        from msahl.api.equilibria import equilibria_of

        require(starts=(starts, COUNT), rotation=(rotation, Numbers(3)))
        return equilibria_of(self.job(), starts, rotation, lambda deck: Model(deck, {}))

    def linearize(
        self,
        inputs: Sequence[str] = (),
        outputs: Sequence[str] = (),
        *,
        at: float | str = 0.0,
        states: str = "coordinates",
    ) -> "LinearModel":
        """Return the model linearised with ``inputs`` and ``outputs`` by name: ``at`` a time [s],
        after a run to it, or at an ``"equilibrium"``. The ``states`` are ``"coordinates"`` or those
        of the ``"nullspace"``.

        Raises ``OptionError`` for names that do not exist, ``StartError`` if the model does not get
        there.
        """
        from msahl.analysis.equilibria.at import point_at
        from msahl.analysis.state_space.linearize import linearize

        require(inputs=(inputs, Names()), outputs=(outputs, Names()), at=(at, At()))
        require(states=(states, Choice(("coordinates", "nullspace"))))
        inputs, outputs = _listed(inputs), _listed(outputs)
        return linearize(point_at(self.records, at), tuple(inputs), tuple(outputs), states)

    def modes(
        self,
        at: float | str = 0.0,
        number: int | None = None,
        near: float = 0.0,
        method: str = "auto",
    ) -> "Modes":
        """Return eigenvalues, frequencies, damping ratios and mode shapes, linearised at a time
        [s], after a run to it, or at the ``"equilibrium"``; the options are those of ``msahl
        modes``. Raises ``StartError`` if there is no such configuration, ``OptionError`` if an
        argument has no meaning.
        """
        from msahl.analysis.modes.following import Request
        from msahl.api.modes import modes_of

        _require_modes(at, number, near, method)
        return modes_of(self.records, at, Request(number, near, method))

    def modes_over(
        self,
        name: str,
        values: Sequence[float],
        at: float | str = 0.0,
        number: int | None = None,
        near: float = 0.0,
        method: str = "auto",
        orders: Sequence[float] = (),
    ) -> "ModesOver":
        """Return the modes followed over ``values`` of a parameter or number, in its unit of the
        deck, with the critical values between them; the options are those of ``msahl modes``.
        """
        from msahl.analysis.modes.files import Over
        from msahl.analysis.modes.following import Request
        from msahl.api.modes import modes_of_many

        _require_modes(at, number, near, method)
        require(values=(values, Numbers(least=1)), orders=(orders, Numbers()))
        if not isinstance(name, str):
            raise OptionError([f"name: it is {name!r:.200}; it must be a text"])
        unit = self.parameters.get(name, {}).get("units", "")
        over = Over(name, "" if unit == "1" else unit, tuple(orders))
        self.with_(**{name: values[0]})  # a wrong name is a fault, not a value without modes

        def records_at(value: float) -> Records:
            return self._deck.model((*self._settings, f"{name}={float(value)!r}"))

        return modes_of_many(records_at, values, over, at, Request(number, near, method))

    @property
    def title(self) -> str:
        """The title of the deck; empty if it has none."""
        return self.records.simulation.title

    @property
    def source(self) -> Source:
        """The deck that was read, without the changed numbers, and the files of its parts."""
        return self._deck.source

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the deck with its parts, without comments and changed numbers."""
        return self._deck.digest()

    @cached_property
    def xml(self) -> bytes:
        """The deck with the changed numbers, as ``deck.xml`` of a run has it; of a model of
        records, the deck that says the same."""
        return self._deck.source.text({}, self._settings)

    def write(self, path: "str | PathLike[str]") -> None:
        """Write the deck to a file: of a model of records, one that is read back to equal
        records."""
        path_of(path).write_bytes(self.xml)

    @property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """The deck's parameters by name: ``{"L": {"value": 0.8, "units": "m"}}``."""
        return listed_parameters(self.xml)

    def __reduce__(self) -> tuple[Any, ...]:
        """Let models be sent to other processes: as the bytes of the deck and the changes."""
        return _restored, (self._deck.source, self.changes)

    def __repr__(self) -> str:
        changed = "".join(f", {name}={value!r}" for name, value in self.changes.items())
        return f"msahl.load({str(self._deck.source.path)!r}{changed})"

    def _repr_html_(self) -> str:
        """Return a short table for a notebook."""
        model, simulation = self.records, self.records.simulation
        rows = {
            "deck": str(self._deck.source.path),
            "bodies": str(len(model.bodies)),
            "joints": str(len(model.joints) + len(model.couplings)),
            "loads": str(len(model.loads)),
            "scheme": simulation.scheme,
            "step size": f"{simulation.dt:g} s",
            "end": f"{simulation.t_final:g} s",
            **{name: str(value) for name, value in self.changes.items()},
        }
        return html_table(self.title or "model", rows)


def _listed(names: str | Sequence[str]) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names)


def _require_modes(at: float | str, number: int | None, near: float, method: str) -> None:
    """Raise ``OptionError`` for wrong arguments of ``modes`` and ``modes_over``."""
    from msahl.analysis.modes.solution import METHODS

    require(at=(at, At()), near=(near, NOT_NEGATIVE), method=(method, Choice(tuple(METHODS))))
    if number is not None:
        require(number=(number, COUNT))


def _restored(source: Source, changes: dict[str, Value]) -> Model:
    """Return the model that was sent by another process."""
    return Model(ParsedDeck(source), changes)


def _shown(name: str, value: Value) -> str:
    """Return a value as the text of a setting; raises ``OptionError`` for anything but a number or
    a text."""
    if isinstance(value, str):
        return value
    if isinstance(value, Integral) and not isinstance(value, bool):
        return repr(int(value))
    if isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value):
        return repr(float(value))
    raise OptionError([f"{name}: it is {value!r}; give a finite number, or a text such as '80 cm'"])
