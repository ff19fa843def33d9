"""Steps end at events: an event finds its time within a step, and the motion goes on from there."""

import math
from dataclasses import replace

import numpy as np
import pytest

from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Chunk
from tests.support.models import body, build_model

G, HEIGHT = 9.80665, 1.0


class Floor:
    """An ideal floor at z = 0: a falling ball comes back with the speed that it had."""

    def __init__(self):
        self.times = []

    def first(self, workspace, before, h):
        """Root of the parabola of free fall."""
        z, v = float(before.x[0, 2]), float(before.v[0, 2])
        root = (v + math.sqrt(v * v + 2.0 * G * z)) / G / h
        return root if root <= 1.0 else math.inf

    def apply(self, workspace):
        """Reverse the velocity."""
        self.times.append(float(workspace.state.time[0]))
        workspace.state.v[0, 2] *= -1.0
        workspace.state.x[0, 2] = 0.0


def falling(**simulation):
    ball = body("Ball", position=(0.0, 0.0, HEIGHT))
    model = replace(build_model([ball], []), gravity=(0.0, 0.0, -G))
    return replace(model, simulation=replace(model.simulation, dt=0.03, t_final=3.0, **simulation))


def bounces():
    """Times [s] of the first three."""
    first = math.sqrt(2.0 * HEIGHT / G)
    return [first * (2 * k + 1) for k in range(3)]


@pytest.mark.parametrize("scheme", ["preserving", "gauss2", "radau2"])
@pytest.mark.parametrize("solver", ["newton", "auto"])
def test_fixed_steps_end_at_events_and_keep_their_grid(scheme, solver):
    model = falling()
    name, degree = scheme.rstrip("2"), 2 if scheme.endswith("2") else None
    model = replace(model, simulation=replace(model.simulation, scheme=name, degree=degree))
    integrator = SubsystemIntegrator(model, solver, False, 100)
    integrator.show_start()
    integrator.stepper.events = floor = Floor()
    schedule = OutputSchedule.at_ends(np.ones(100, dtype=bool))
    assert integrator.advance(Chunk(100, h=0.03, schedule=schedule)).steps == 100
    assert floor.times == pytest.approx(bounces(), abs=1e-9)
    assert float(integrator.workspace.state.time[0]) == pytest.approx(3.0, abs=1e-12)
    heights = integrator.workspace.tables.states[:, 2]
    assert heights.min() > -1e-12
    times = 0.03 * np.arange(1, 101)
    period = 2.0 * bounces()[0]
    since = (times + 0.5 * period) % period - 0.5 * period
    assert heights == pytest.approx(HEIGHT - 0.5 * G * since**2, abs=1e-9)


def test_steps_by_tolerance_end_at_events():
    model = falling(scheme="gauss", degree=2, local_tolerance=1e-8)
    integrator = SubsystemIntegrator(model, "newton", False, 100)
    integrator.show_start()
    integrator.stepper.events = floor = Floor()
    begin, output = 0.0, np.linspace(0.0, 3.0, 31)[1:]
    for _ in range(200):
        advanced = integrator.advance(Chunk(100, begin=begin, times=output))
        begin, output = float(advanced.ends[-1]), output[len(advanced.schedule.share) :]
        if not output.size:
            break
    assert begin == pytest.approx(3.0)
    assert floor.times == pytest.approx(bounces(), abs=1e-7)
