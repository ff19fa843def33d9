"""How the scene is run: step and end, which of them make sense, and how the start is made."""

import math
from dataclasses import dataclass

from msahl.deck.faults import Element, text
from msahl.deck.values import Reader
from msahl.model import MEAN, Simulation
from msahl.schemes import DAMPING, DEFAULT, DEGREE

MAX_STEPS = 10**9
"""Most steps of a run: more is a slip of the pen (a day at 10 us a step)."""


def read_simulation(element: Element, reader: Reader) -> Simulation:
    """Record of ``<simulation>``, times in s."""
    simulation = Simulation(
        title=text(element.find("title")),
        dt=reader.number(element.find("deltaT"), "time"),
        t_final=reader.number(element.find("tFinal"), "time"),
        scheme=" ".join(element.get("scheme", DEFAULT).split()),
        damping=float(element.get("damping", DAMPING)),
        reactions=" ".join(element.get("reactions", MEAN).split()),
        degree=int(element.get("degree", DEGREE)),
    )
    if reader.faults.sound(element):
        for tag, message in _complaints(simulation):
            place = element.find(tag)
            reader.faults.add(element if place is None else place, message)
    return simulation


@dataclass(frozen=True, slots=True)
class Assembly:
    """How the start is made consistent: see ``Model``."""

    position: str = "check"
    velocity: str = "keepAngular"


def read_assembly(root: Element) -> Assembly:
    """What ``<assembly>`` says; the defaults without it."""
    element = root.find("simulation/assembly")
    default = Assembly()
    if element is None:
        return default
    return Assembly(
        position=" ".join(element.get("position", default.position).split()),
        velocity=" ".join(element.get("velocity", default.velocity).split()),
    )


def check_simulation(simulation: Simulation) -> list[str]:
    """What is wrong with the step and the end of a simulation; empty if nothing is."""
    return [f"{tag}: {message}" for tag, message in _complaints(simulation)]


def _complaints(simulation: Simulation) -> list[tuple[str, str]]:
    """Tag of the wrong element, and the message."""
    times = {"deltaT": simulation.dt, "tFinal": simulation.t_final}
    wrong = [
        (tag, f"it is {value:g} s; it must be greater than zero and finite")
        for tag, value in times.items()
        if not 0.0 < value < math.inf
    ]
    if wrong:
        return wrong
    steps = simulation.t_final / simulation.dt
    if steps < 1.0:
        return [
            (
                "deltaT",
                f"the step {simulation.dt:g} s is longer than the run of "
                f"{simulation.t_final:g} s; shorten it or raise tFinal",
            )
        ]
    if steps > MAX_STEPS:
        return [
            (
                "deltaT",
                f"{steps:.3g} steps of {simulation.dt:g} s to {simulation.t_final:g} s "
                f"are more than {MAX_STEPS:g}; lengthen the step",
            )
        ]
    return []
