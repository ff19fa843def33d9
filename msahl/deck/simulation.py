"""How the scene is run: step and end, which of them make sense, and how the start is made."""

from dataclasses import dataclass

from msahl.deck.faults import Element, attribute, text
from msahl.deck.values import LARGEST, SMALLEST, Reader
from msahl.model import MEAN, Limits, Simulation
from msahl.model.scheme import AUTO, CAYLEY, COLLOCATION, DAMPING, DEFAULT, DEGREE, ORDER_TWO
from msahl.printable import printable

MAX_STEPS = 10**9
"""Most steps of a run: more is a slip of the pen (a day at 10 us a step)."""
MOST_ROWS = 1000
"""Most rows of one step: all are kept at once."""


def read_simulation(element: Element, reader: Reader) -> Simulation:
    """Record of ``<simulation>``, times in s."""
    simulation = Simulation(
        title=printable(text(element.find("title"))),
        dt=reader.number(element.find("deltaT"), "time"),
        t_final=reader.number(element.find("tFinal"), "time"),
        scheme=attribute(element, "scheme", DEFAULT),
        damping=float(element.get("damping", DAMPING)),
        rotation_update=attribute(element, "rotationUpdate", CAYLEY),
        reactions=attribute(element, "reactions", MEAN),
        limits=_limits(element.find("verdict"), reader),
        degree=int(element.get("degree", DEGREE)),
        output_interval=_number(element.find("outputInterval"), "time", reader),
        tolerance=_number(element.find("tolerance"), "length", reader),
        local_tolerance=_number(element.find("localTolerance"), "length", reader),
    )
    if reader.faults.sound(element):
        for tag, message in _complaints(simulation):
            place = element.find(tag)
            reader.faults.add(element if place is None else place, message)
    return simulation


def _number(element: Element | None, quantity: str, reader: Reader) -> float | None:
    return None if element is None else reader.number(element, quantity)


def _limits(verdict: Element | None, reader: Reader) -> Limits:
    """What ``<verdict>`` asks of the figures."""
    return Limits(
        accuracy=_limit(verdict, "accuracy", "length", reader),
        energy=_limit(verdict, "energy", "", reader),
        violation=_limit(verdict, "constraintViolation", "length", reader),
    )


def _limit(verdict: Element | None, tag: str, quantity: str, reader: Reader) -> float | None:
    element = None if verdict is None else verdict.find(tag)
    if element is None:
        return None
    value = reader.number(element, quantity)
    if value <= 0.0 and reader.faults.sound(element):
        message = f"the limit is {text(element)}; no run is that good: give more than zero"
        reader.faults.add(element, message)
    return value


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
        position=attribute(element, "position", default.position),
        velocity=attribute(element, "velocity", default.velocity),
    )


def check_simulation(simulation: Simulation) -> list[str]:
    """What is wrong with the step and the end of a simulation; empty if nothing is."""
    return [f"{tag}: {message}" for tag, message in _complaints(simulation)]


def _complaints(simulation: Simulation) -> list[tuple[str, str]]:
    """Tag of the wrong element, and the message."""
    times = {
        "deltaT": simulation.dt,
        "tFinal": simulation.t_final,
    }
    if simulation.output_interval is not None:
        times["outputInterval"] = simulation.output_interval
    wrong = [
        (tag, f"it is {value:g} s; it must be greater than zero, {SMALLEST:g} to {LARGEST:g} s")
        for tag, value in times.items()
        if not SMALLEST <= value <= LARGEST
    ]
    if not 0.0 <= simulation.damping <= 1.0:
        wrong.append(("damping", f"it is {simulation.damping:g}; it must be from 0 to 1"))
    scheme, degree = simulation.scheme, simulation.degree
    if scheme in COLLOCATION and degree > COLLOCATION[scheme].highest:
        most, gauss = COLLOCATION[scheme].highest, COLLOCATION["gauss"].highest
        remedy = f"those of scheme {scheme} are 1 to {most}, those of gauss go to {gauss}"
        wrong.append(("degree", f"it is of degree {degree}; {remedy}"))
    wrong += _complaints_of_choice(simulation)
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


def _complaints_of_choice(simulation: Simulation) -> list[tuple[str, str]]:
    """What is wrong with tolerances and rows between steps, for the scheme."""
    dt, interval = simulation.dt, simulation.output_interval
    higher = simulation.scheme not in ORDER_TWO
    given = {"tolerance": simulation.tolerance, "localTolerance": simulation.local_tolerance}
    tolerances = {tag: value for tag, value in given.items() if value is not None}
    wrong = []
    for tag, tolerance in tolerances.items():
        if not SMALLEST <= tolerance <= LARGEST:
            wrong.append(
                (
                    tag,
                    f"it is {tolerance:g} m; it must be greater than zero, {SMALLEST:g} to "
                    f"{LARGEST:g} m; 1e-6 m is usual",
                )
            )
        elif not higher:
            wrong.append(
                (
                    tag,
                    f"the {simulation.scheme} scheme takes the steps it is given; let auto choose "
                    f"them (scheme {AUTO}), or omit the tolerance",
                )
            )
    if len(tolerances) > 1:
        wrong.append(
            (
                "localTolerance",
                "steps are chosen by a tolerance or by a localTolerance; give one of them",
            )
        )
    if interval is not None and not higher and abs(interval / dt - round(interval / dt)) > 1e-9:
        wrong.append(
            (
                "outputInterval",
                f"{interval:g} s are no whole number of steps of {dt:g} s, and the "
                f"{simulation.scheme} scheme has rows only at their ends; use a scheme of higher "
                "order, or make it so many steps",
            )
        )
    if interval is not None and interval < dt / MOST_ROWS:
        wrong.append(
            (
                "outputInterval",
                f"{interval:g} s make more than {MOST_ROWS} rows of a step of {dt:g} s; shorten "
                "the step, or lengthen the interval",
            )
        )
    return wrong
