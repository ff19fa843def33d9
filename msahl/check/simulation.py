"""Rules about how a model is run: step, end, scheme, tolerances, output interval and limits.

The parts of findings are the deck's tags and attributes of ``<simulation>``.
"""

from collections.abc import Collection, Iterator

from msahl.check.faults import LARGEST, SMALLEST, Finding
from msahl.model import INSTANTANEOUS, MEAN, Model, Simulation
from msahl.model.contacts import IMPACT_LAWS
from msahl.model.scheme import AUTO, CAYLEY, COLLOCATION, EXPLICIT, EXPONENTIAL, ORDER_TWO
from msahl.model.settings import ACCELERATIONS, JOINT_TABLES, STARTS

MAX_STEPS = 10**9
"""Largest number of steps of a run. At 10 us a step they take a day, so more are a mistake."""
MOST_OUTPUTS = 1000
"""Largest number of output times within one step, all of which are kept in memory at once."""

POSITIONS = ("check", "project")
VELOCITIES = ("keepAngular", "massWeighted", "asGiven", "refuse")


def check_simulation(simulation: Simulation) -> list[str]:
    """Return what is wrong with step, end, scheme and tolerances of a simulation, as sentences."""
    return [f"{part}: {message}" for part, message in simulation_findings(simulation)]


def simulation_findings(simulation: Simulation) -> Iterator[Finding]:
    """Find what is wrong with step, end, scheme, tolerances, output interval and limits."""
    found = [*_word_findings(simulation)]
    if not found:
        found += _number_findings(simulation)
        found += _tolerance_findings(simulation)
        found += _interval_findings(simulation)
    yield from found or _step_findings(simulation)
    limits = simulation.limits
    values = {"accuracy": limits.accuracy, "energy": limits.energy}
    for tag, value in {**values, "constraintViolation": limits.violation}.items():
        if value is not None and not value > 0.0:
            message = f"the limit is {value:g}; it must be greater than zero"
            yield Finding(f"verdict/{tag}", message)


def start_findings(model: Model) -> Iterator[Finding]:
    """Find unknown ways to make the start consistent."""
    yield from _known("assembly/position", model.position, POSITIONS)
    yield from _known("assembly/velocity", model.velocity, VELOCITIES)


def _known(part: str, word: str, known: Collection[str]) -> Iterator[Finding]:
    if word not in known:
        yield Finding(part, f"unknown value '{word}'; expected one of {', '.join(known)}")


def _word_findings(simulation: Simulation) -> Iterator[Finding]:
    yield from _known("scheme", simulation.scheme, (*ORDER_TWO, *COLLOCATION, *EXPLICIT, AUTO))
    yield from _known("rotationUpdate", simulation.rotation_update, (CAYLEY, EXPONENTIAL))
    yield from _known("impactLaw", simulation.impact_law, IMPACT_LAWS)
    yield from _known("reactions", simulation.reactions, (MEAN, INSTANTANEOUS))
    yield from _known("accelerations", simulation.accelerations, ACCELERATIONS)
    yield from _known("jointTable", simulation.joint_table, JOINT_TABLES)
    yield from _known("start", simulation.start, STARTS)


def _number_findings(simulation: Simulation) -> Iterator[Finding]:
    times = {
        "deltaT": simulation.dt,
        "tFinal": simulation.t_final,
        "outputInterval": simulation.output_interval,
    }
    for tag, value in times.items():
        if value is not None and not SMALLEST <= value <= LARGEST:
            bounds = f"it must be greater than zero, {SMALLEST:g} to {LARGEST:g} s"
            yield Finding(tag, f"it is {value:g} s; {bounds}")
    if not 0.0 <= simulation.damping <= 1.0:
        yield Finding("damping", f"it is {simulation.damping:g}; it must be from 0 to 1")
    scheme, degree = simulation.scheme, simulation.degree
    if scheme in COLLOCATION and not 1 <= degree <= COLLOCATION[scheme].highest:
        most, gauss = COLLOCATION[scheme].highest, COLLOCATION["gauss"].highest
        remedy = f"the {scheme} scheme has the degrees 1 to {most}, the gauss scheme 1 to {gauss}"
        yield Finding("degree", f"the degree is {degree}; {remedy}")


def _tolerance_findings(simulation: Simulation) -> Iterator[Finding]:
    given = {"tolerance": simulation.tolerance, "localTolerance": simulation.local_tolerance}
    tolerances = {tag: value for tag, value in given.items() if value is not None}
    for tag, tolerance in tolerances.items():
        if not SMALLEST <= tolerance <= LARGEST:
            bounds = f"{SMALLEST:g} to {LARGEST:g} m; 1e-6 m is usual"
            message = f"it is {tolerance:g} m; it must be greater than zero, {bounds}"
            yield Finding(tag, message)
        elif simulation.scheme in (*ORDER_TWO, *EXPLICIT):
            message = (
                f"the {simulation.scheme} scheme takes the steps it is given; choose scheme {AUTO} "
                "to have steps chosen by a tolerance, or omit the tolerance"
            )
            yield Finding(tag, message)
    if len(tolerances) > 1:
        message = "steps are chosen by a tolerance or by a localTolerance; give one of them"
        yield Finding("localTolerance", message)


def _interval_findings(simulation: Simulation) -> Iterator[Finding]:
    dt, interval = simulation.dt, simulation.output_interval
    if interval is None or not dt > 0.0:
        return
    if simulation.scheme in ORDER_TWO and abs(interval / dt - round(interval / dt)) > 1e-9:
        message = (
            f"{interval:g} s are no whole number of steps of {dt:g} s, and the "
            f"{simulation.scheme} scheme has results only at the ends of steps; use a scheme of "
            "higher order, or give a multiple of the step"
        )
        yield Finding("outputInterval", message)
    if interval < dt / MOST_OUTPUTS:
        message = (
            f"an interval of {interval:g} s makes more than {MOST_OUTPUTS} output times in a step "
            f"of {dt:g} s; give a shorter step, or a longer interval"
        )
        yield Finding("outputInterval", message)


def _step_findings(simulation: Simulation) -> Iterator[Finding]:
    """Find a step longer than the run, and too many steps."""
    dt, t_final = simulation.dt, simulation.t_final
    steps = t_final / dt
    if steps < 1.0:
        message = (
            f"the step {dt:g} s is longer than the run of {t_final:g} s; give a shorter step or a "
            "later tFinal"
        )
        yield Finding("deltaT", message)
    if steps > MAX_STEPS:
        message = (
            f"{steps:.3g} steps of {dt:g} s to {t_final:g} s are more than {MAX_STEPS:g}; give a "
            "longer step"
        )
        yield Finding("deltaT", message)
