"""The record of a run's figures: extremes over all steps, energy scale, momenta, pivots."""

from collections.abc import Sequence

import numpy as np

from msahl.model import Model, RunSettings
from msahl.ports import forces
from msahl.run.extremes import Extremes
from msahl.run.parallel_capsules import ParallelCapsules
from msahl.run.row_energy import row_energies
from msahl.run.subsystem import SubsystemIntegrator
from msahl.system.diagnostics import STOP
from msahl.system.momentum import Momentum, drift, is_alone, momentum


class Record:
    """Figures of the steps that the ``integrators`` of a ``model`` take until ``t_final`` [s]."""

    def __init__(
        self, model: Model, integrators: Sequence[SubsystemIntegrator], t_final: float
    ) -> None:
        self.integrators, self.capsules = integrators, ParallelCapsules(model)
        first = [integrator.workspace.monitor.rows[:1, :STOP] for integrator in integrators]
        self.extremes = Extremes(
            first, sum(_energy_scale(integrator, t_final) for integrator in integrators)
        )
        self.extremes.raise_scale(sum(map(_work_of_reactions, integrators)))
        self.momenta = [_momentum(integrator) for integrator in integrators]  # at t = 0

    def add(self, steps: int, between: np.ndarray) -> None:
        """Add the first ``steps`` steps of the chunk, and its rows that are ``between`` them."""
        self.extremes.add(
            [integrator.workspace.monitor.rows[:steps, :STOP] for integrator in self.integrators]
        )
        self.extremes.raise_scale(sum(map(_work_of_reactions, self.integrators)))
        if between.size:
            self.extremes.add_rows([row_energies(one, between) for one in self.integrators])

    @property
    def length(self) -> float:
        """Length of the longest body [m]."""
        return max(
            float(integrator.workspace.system.frames.length[:-1].max())
            for integrator in self.integrators
        )

    @property
    def size(self) -> float:
        """Size of the model [m]: its longest body, or its largest displacement if larger."""
        return max(self.length, self.extremes.displacement)

    @property
    def energy_taken(self) -> float:
        """Energy that a dissipative scheme has taken [J]."""
        return -sum(float(integrator.workspace.state.work[-1]) for integrator in self.integrators)

    @property
    def pivot_ratio(self) -> float | None:
        """Largest pivot ratio of a Jacobian, an estimate of its condition number; None if none
        was factored, or if redundant joints make it large by themselves.
        """
        ratios = [
            float(integrator.workspace.pivots[0])
            for integrator in self.integrators
            if integrator.workspace.system.relaxation == 0.0
        ]
        return max(ratios, default=0.0) or None

    @property
    def velocity_change(self) -> float:
        """Constraint violation [m/s] of the deck's initial velocities."""
        rates = (
            integrator.change.rate
            for integrator in self.integrators
            if integrator.change.method != "none"
        )
        return max(rates, default=0.0)

    def momentum_lost(self, settings: RunSettings) -> tuple[float | None, float | None]:
        """Largest relative change of linear and of angular momentum in the subsystems on which
        nothing acts from outside; None if there are none. Dissipative schemes and the exponential
        map do not conserve the angular momentum.
        """
        changes = [
            drift(
                integrator.workspace.system,
                before,
                now,
                float(integrator.workspace.state.time[0]),
                self.extremes.kinetic,
            )
            for integrator, before in zip(self.integrators, self.momenta, strict=True)
            if before is not None and (now := _momentum(integrator)) is not None
        ]
        linear = max((part for part, _ in changes), default=None)
        angular = max((part for _, part in changes), default=None)
        conserves = not settings.dissipative and not settings.exponential
        return linear, angular if conserves else None


def _energy_scale(integrator: SubsystemIntegrator, t_final: float) -> float:
    """Energy [J] with which others are compared: the work of gravity and of the loads over the
    bodies' lengths, and the kinetic energy of bodies that move by their lengths within the run.
    """
    system = integrator.workspace.system
    frames = system.frames
    moving = frames.inverse_mass > 0.0
    mass, length = 1.0 / frames.inverse_mass[moving], frames.length[moving]
    work = np.linalg.norm(system.bodies.gravity) * (mass @ length)
    for scale in forces.work_scales(system.forces, frames.length):
        work += scale
    return float(work + mass @ (length / t_final) ** 2)


def _work_of_reactions(integrator: SubsystemIntegrator) -> float:
    """Work of the joints' reactions over the longest body's length and over one radian [J]."""
    reaction, length = (
        integrator.workspace.state.reaction,
        integrator.workspace.system.frames.length[:-1].max(),
    )
    return float(np.abs(reaction[:, :3]).sum() * length + np.abs(reaction[:, 3:]).sum())


def _momentum(integrator: SubsystemIntegrator) -> Momentum | None:
    """Momentum of a subsystem on which nothing acts from outside, no impulse at a marker either."""
    workspace, events = integrator.workspace, integrator.model.events
    pushed = any(impulse.marker for event in events for impulse in event.impulses)
    if pushed or not is_alone(workspace.system):
        return None
    return momentum(workspace.system, workspace.state, workspace.start)
