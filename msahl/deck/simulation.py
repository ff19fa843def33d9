"""Reader of ``<simulation>``: how the model is run, and how its start is made consistent."""

from msahl.check.simulation import simulation_findings
from msahl.deck.faults import Element, attribute, text
from msahl.deck.values import Reader
from msahl.model import MEAN, Limits, Simulation
from msahl.model.contacts import POISSON
from msahl.model.scheme import CAYLEY, DAMPING, DEFAULT, DEGREE
from msahl.model.settings import AUTOMATIC, GIVEN, NO
from msahl.printable import printable
from msahl.records import record


def read_simulation(element: Element, reader: Reader) -> Simulation:
    """Return the record of ``<simulation>``, times in s."""
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
        accelerations=attribute(element, "accelerations", NO),
        joint_table=attribute(element, "jointTable", AUTOMATIC),
        start=attribute(element, "start", GIVEN),
        impact_law=attribute(element, "impactLaw", POISSON),
    )
    reader.add(element, simulation_findings(simulation))
    return simulation


def _number(element: Element | None, quantity: str, reader: Reader) -> float | None:
    return None if element is None else reader.number(element, quantity)


def _limits(verdict: Element | None, reader: Reader) -> Limits:
    """Return the limits that ``<verdict>`` gives."""
    if verdict is None:
        return Limits()
    return Limits(
        accuracy=_number(verdict.find("accuracy"), "length", reader),
        energy=_number(verdict.find("energy"), "", reader),
        violation=_number(verdict.find("constraintViolation"), "length", reader),
    )


@record
class Assembly:
    """How the start is made consistent: see ``Model``."""

    position: str = "check"
    velocity: str = "keepAngular"


def read_assembly(root: Element) -> Assembly:
    """Return what ``<assembly>`` gives, or the defaults."""
    element = root.find("simulation/assembly")
    default = Assembly()
    if element is None:
        return default
    return Assembly(
        position=attribute(element, "position", default.position),
        velocity=attribute(element, "velocity", default.velocity),
    )
