"""Numbers of laws that events have set, put into the arrays of a system that runs.

The arrays of the forces are built from the model with the numbers that are set now, and what
differs from those of the model as it was is copied into the arrays in use. What these have from the
configuration at t = 0, such as an unloaded length that the deck does not give, stays.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from msahl.model import Model
from msahl.model.events import ParameterChange
from msahl.model.settable import with_parameter
from msahl.ports.forces import Forces
from msahl.system.arrays import System
from msahl.system.build import topology_of
from msahl.system.collect import collect
from msahl.system.parameters import build_parameters

GROUPS = ("point", "along", "compliance")
"""The groups of forces whose numbers can be set."""


class LawParameters:
    """The numbers of the loads of a ``model``, of which the ``system`` runs."""

    def __init__(self, model: Model, system: System) -> None:
        self.model, self.relaxed = model, bool(system.relaxation)
        self.used = dict(_numbers(system.forces))
        self.begin = {name: array.copy() for name, array in self.used.items()}
        self.built = dict(_numbers(self._build(model)))
        self.values: dict[str, dict[str, float]] = {}  # set by now, by load and parameter

    @property
    def key(self) -> bytes:
        """What differs where other numbers are set."""
        return repr(self.values).encode() if self.values else b""

    def set(self, change: ParameterChange) -> None:
        """Set one number from now on."""
        own = {**self.values.get(change.load, {}), change.parameter: change.value}
        values = self.values | {change.load: dict(sorted(own.items()))}
        self.restore(dict(sorted(values.items())))

    def restore(self, values: Mapping[str, Mapping[str, float]]) -> None:
        """Let exactly these ``values`` be set."""
        if values == self.values:
            return
        self.values = {load: dict(own) for load, own in values.items()}
        for name, array in _numbers(self._build(self._changed())):
            old = self.built[name]
            now = ~((array == old) | (np.isnan(array) & np.isnan(old)))
            self.used[name][:] = np.where(now, array, self.begin[name])

    def _changed(self) -> Model:
        loads = []
        for load in self.model.loads:
            for parameter, value in self.values.get(load.name, {}).items():
                load = with_parameter(load, parameter, value)
            loads.append(load)
        return replace(self.model, loads=tuple(loads))

    def _build(self, model: Model) -> Forces:
        elements = collect(model)
        return build_parameters(elements, topology_of(elements, self.relaxed)).forces


def _numbers(forces: Forces) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the arrays of numbers of forces, by name."""
    for name in GROUPS:
        group: Any = getattr(forces, name)
        for field, array in zip(group._fields, group, strict=True) if group is not None else ():
            if isinstance(array, np.ndarray) and array.dtype == float:
                yield f"{name}.{field}", array
