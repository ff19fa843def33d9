"""Inputs of a model in analyses of one configuration: numbers that nothing there changes.

As the auxiliary state that it is in a run, an input would be one more unknown of an equilibrium,
and a pole at zero. One that an event sets stays a state.
"""

from collections.abc import Iterable
from dataclasses import replace

from msahl.expressions.syntax import Number
from msahl.model import Model, Signal, SignalState
from msahl.model.signals import AnySignal


def with_constant_inputs(model: Model) -> Model:
    """Return the ``model`` with its inputs as signals that are numbers."""
    if not any(state.is_input for state in model.states):
        return model
    changed = {change.state for event in model.events for change in event.states}
    return replace(model, signals=tuple(_constant(signal, changed) for signal in model.signals))


def with_inputs(signals: Iterable[AnySignal]) -> tuple[AnySignal, ...]:
    """Return the signals of a model ``with_constant_inputs`` with inputs again."""
    return tuple(map(_input, signals))


def _constant(signal: AnySignal, changed: set[str]) -> AnySignal:
    if isinstance(signal, SignalState) and signal.is_input and signal.name not in changed:
        return Signal(signal.name, Number(signal.initial), signal.unit, is_input=True)
    return signal


def _input(signal: AnySignal) -> AnySignal:
    if isinstance(signal, Signal) and signal.is_input and isinstance(signal.expression, Number):
        value = signal.expression.value
        return SignalState(signal.name, Number(0.0), value, signal.unit, is_input=True)
    return signal
