"""Changes of a subsystem from outside, between two steps: auxiliary states and numbers of laws."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from msahl.model.events import ParameterChange
from msahl.run.subsystem import SubsystemIntegrator
from msahl.start.velocities import solve_accelerations
from msahl.switching.parameters import LawParameters
from msahl.system.work_arrays import PlainFirst, WorkArrays, new_work_arrays


class Changes:
    """What is set from outside in the subsystem of an ``integrator``."""

    def __init__(self, integrator: SubsystemIntegrator) -> None:
        self.integrator, model = integrator, integrator.model
        self.number = {signal.name: n for n, signal in enumerate(model.states)}
        self.loads = {load.name for load in model.loads}
        self._own: LawParameters | None = None
        self._arrays: WorkArrays | None = None

    @property
    def parameters(self) -> LawParameters:
        """The numbers of laws: those that events set as well, where they do."""
        switching = self.integrator.switching
        if switching is not None and switching.actions.parameters is not None:
            return switching.actions.parameters
        if self._own is None:
            self._own = LawParameters(self.integrator.model, self.integrator.workspace.system)
        return self._own

    @property
    def values(self) -> dict[str, dict[str, float]]:
        """The numbers of laws that were set and that events do not know, by load and parameter."""
        return {} if self._own is None else self._own.values

    def restore(self, values: Mapping[str, Mapping[str, float]]) -> None:
        """Restore what ``values`` returned."""
        if self._own is not None or values:
            self.parameters.restore(values)

    def apply(
        self, states: Mapping[str, float], parameters: Mapping[tuple[str, str], float]
    ) -> None:
        """Set auxiliary ``states`` by name and ``parameters`` [SI] by load and name: those that the
        subsystem has. Loads jump; the next steps begin anew. Raises ``ContactsUnsolved``.
        """
        own = {self.number[name]: value for name, value in states.items() if name in self.number}
        for n, value in own.items():
            self.integrator.workspace.state.auxiliary[n] = value
        changed = {key: value for key, value in parameters.items() if key[0] in self.loads}
        for (load, name), value in changed.items():
            self.parameters.set(ParameterChange(load, name, value))
        if own or changed:
            self._settle()
            self.integrator.stepper.begin_anew()

    def _settle(self) -> None:
        """Set accelerations and reactions to those of the present loads; nothing is known of how
        they go on.
        """
        workspace: Any = self.integrator.stepper.method.workspace
        system, state = workspace.system, workspace.state
        if self._arrays is None:
            rises = {name: np.zeros_like(state.v_rise) for name in ("v_rise", "w_rise")}
            still = new_work_arrays(system, state._replace(**rises))
            self._arrays = still._replace(call=PlainFirst(system))
        solve_accelerations(system, state, workspace.unknowns, None, self._arrays)
        for trend in (state.a_trend, state.alpha_trend, state.force_trend):
            trend[:] = 0.0
