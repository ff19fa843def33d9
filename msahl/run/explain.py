"""Describes what running a model involves, in words: the command ``msahl explain``."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from msahl.check.faults import listed
from msahl.jit.compiled import on_disk
from msahl.joints.coordinates import ORIENTATION, coordinates, is_angle
from msahl.linalg.elimination import products
from msahl.model import Model, RunSettings, resolve
from msahl.model.scheme import COLLOCATION
from msahl.run.joint_table import JointTable
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.tables import STATES
from msahl.run.time_grid import TimeGrid
from msahl.run.verdict import describe_reactions
from msahl.system.arrays import multiplier_count
from msahl.system.names import STRAINS
from msahl.system.reductions import all_unknowns, in_space
from msahl.system.subsystems import split

AXES = "xyz"
MOST_LISTED = 20
"""Joints of a subsystem whose coordinates are listed."""


def explain(model: Model) -> list[str]:
    """Lines about bodies, degrees of freedom, unknowns, model reductions and what is loaded."""
    with np.errstate(all="ignore"):  # as in a run
        integrators = [
            SubsystemIntegrator(subsystem, "newton", full=False, chunk=1)
            for subsystem in split(model)
        ]
    grid = TimeGrid.of_steps(model.simulation)
    alone = len(integrators) == 1
    return [
        model.simulation.title or "(no title)",
        f"  {_bodies(model)}, {_count(len(model.joints), 'joint')}, "
        f"{_count(len(model.couplings), 'coupling')}, {_count(len(model.motions), 'motion')}, "
        f"{_count(len(model.loads), 'load')}, {_count(len(model.grounds), 'ground')}; "
        f"{grid.n} steps of {grid.h:g} s",
        f"scheme: {_scheme(resolve(model.simulation))}",
        *_beams(model),
        *_elastic_bodies(model),
        *_degrees_of_freedom(model, integrators),
        *_events(model),
        *(line for integrator in integrators for line in _coordinates(integrator)),
        *_unknowns(model, integrators),
        *(line for integrator in integrators for line in _reductions(integrator, alone)),
        *_omitted_terms(model, integrators),
        *_loaded(integrators),
    ]


def _own_bodies(model: Model) -> list[str]:
    """Return the names of the bodies that are shown and no nodes of beams."""
    nodes = {name for beam in model.beams for name in beam.nodes}
    return [body.name for body in model.shown_bodies if body.name not in nodes]


def _bodies(model: Model) -> str:
    bodies = _count(len(_own_bodies(model)), "body", "bodies")
    return f"{bodies}, {_count(len(model.beams), 'beam')}" if model.beams else bodies


def _beams(model: Model) -> Iterator[str]:
    """Beams: their size, and the strains that cannot change."""
    mass = {body.name: body.mass for body in model.bodies}
    for beam in model.beams[:MOST_LISTED]:
        kilograms = sum(mass[name] for name in beam.nodes)
        zero = [STRAINS[i] for i in range(6) if beam.compliance[0][i][i] == 0.0]
        yield (
            f"beam {beam.name}: {sum(beam.lengths):.6g} m, {kilograms:.6g} kg, "
            f"{_count(len(beam.lengths), 'element')} of degree {beam.degree} between the nodes "
            f"{beam.nodes[0]} to {beam.nodes[-1]}" + (f"; no {', '.join(zero)}" if zero else "")
        )


def _elastic_bodies(model: Model) -> Iterator[str]:
    """Elastic bodies: their mass, modes, and the bodies that stand for them."""
    mass = {body.name: body.mass for body in model.bodies}
    for body in model.elastic_bodies[:MOST_LISTED]:
        nodes = [one.body for one in body.followers if one.is_node]
        yield (
            f"elastic body {body.name}: {sum(mass[name] for name in body.bodies):.6g} kg, "
            f"{_count(len(body.stiffness), 'mode')}, interface {', '.join(nodes) or 'none'}; "
            f"{len(body.followers)} bodies follow its frame"
        )


def _count(n: int, one: str, many: str = "") -> str:
    return f"{n or 'no'} {one if n == 1 else many or one + 's'}"


def _scheme(settings: RunSettings) -> str:
    """The scheme in words: name, order, what it does to the energy."""
    if settings.dissipative:
        energy = "takes energy from motions that are faster than the step"
    elif settings.explicit:
        energy = "explicit: does not conserve the energy, which drifts"
    else:
        energy = "nearly conserves the energy" if settings.degree else "conserves the energy"
    if settings.exponential:
        energy += "; rotations are updated by the exponential map"
    degree = f" of degree {settings.degree}" if settings.family in COLLOCATION else ""
    return f"{settings.scheme}{degree}, of order {settings.order}; {energy}"


def _degrees_of_freedom(model: Model, integrators: Sequence[SubsystemIntegrator]) -> Iterator[str]:
    bodies = 6 * len(model.bodies)
    rank = sum(integrator.rank for integrator in integrators)
    equations = rank + sum(integrator.redundant for integrator in integrators)
    yield (
        f"degrees of freedom: by count {bodies} - {equations} = {bodies - equations}, "
        f"by rank {bodies} - {rank} = {bodies - rank}"
    )
    shared = {
        name: columns for integrator in integrators for name, columns in integrator.shared.items()
    }
    if shared:
        yield (
            f"  {equations - rank} constraint equations follow from the others: motion and energy "
            f"are unique, but not these reactions: {describe_reactions(shared)}"
        )
    names = [joint.name for joint in model.joints] + [c.name for c in model.couplings]
    unique = [name for name in names if name not in shared]
    if shared and unique:
        yield f"  all reactions are unique of: {', '.join(unique)}"


def _events(model: Model) -> Iterator[str]:
    """Events of the deck: when they happen, and what they do."""
    if model.released:
        yield f"released at t = 0: {', '.join(model.released)}"
    for event in model.events[:MOST_LISTED]:
        sets = [change.state for change in event.states]
        sets += [f"{p.load}.{p.parameter} = {p.value:g}" for p in event.parameters]
        pushes = [impulse.element for impulse in event.impulses]
        actions = [("releases", event.releases), ("engages", event.engages)]
        actions += [("sets", tuple(sets)), ("pushes", tuple(pushes))]
        done = [f"{verb} {', '.join(names)}" for verb, names in actions if names]
        often = "each time that" if event.repeats else "when"
        what = ", ".join(done) or "gives its message"
        yield f"event {event.name}: {what} {often} {event.condition}"


def _coordinates(integrator: SubsystemIntegrator) -> Iterator[str]:
    """Angles and slides of the first joints at the start, with their rates."""
    joints = [
        joint
        for joint in integrator.model.joints
        if coordinates(joint) and ORIENTATION not in coordinates(joint)
    ][:MOST_LISTED]
    if not joints:
        return
    integrator.show_start()
    states = np.insert(integrator.workspace.tables.states[:1], 0, 0.0, axis=1)
    model = replace(integrator.model, joints=tuple(joints))
    values = iter(JointTable(model, 2).rows({STATES: states})[0, 1:].tolist())
    for joint in joints:
        names = coordinates(joint)
        pairs = zip(
            names, [next(values) for _ in names], [next(values) for _ in names], strict=True
        )
        yield f"{joint.name} at t = 0: {', '.join(_coordinate(*pair) for pair in pairs)}"


def _coordinate(name: str, value: float, rate: float) -> str:
    """A coordinate with its rate in words; an angle in degrees."""
    unit = "deg" if is_angle(name) else "m"
    if unit == "deg":
        value, rate = math.degrees(value), math.degrees(rate)
    return f"{name} {value + 0.0:.7g} {unit}, rate {rate + 0.0:.7g} {unit}/s"


def _unknowns(model: Model, integrators: Sequence[SubsystemIntegrator]) -> Iterator[str]:
    bodies = len(model.bodies)
    equations = sum(multiplier_count(integrator.workspace.system) for integrator in integrators)
    solved = sum(integrator.workspace.unknowns.free.size for integrator in integrators)
    systems = (in_space(integrator.workspace.system) for integrator in integrators)
    full = sum(all_unknowns(system).size for system in systems)
    yield (
        f"unknowns of a step: {12 * bodies + equations} (displacements, rotations, their rates, "
        f"multipliers), {full} after the rates are eliminated, {solved} are solved for"
    )


def _reductions(integrator: SubsystemIntegrator, alone: bool) -> Iterator[str]:
    """Model reductions of one subsystem, and the size of its elimination."""
    workspace = integrator.workspace
    head = "" if alone else f"subsystem of {_members(integrator.model)}: "
    lu = workspace.unknowns.elimination
    if integrator.axis is not None:
        of_beams = "" if workspace.system.beams is None else "each point of a beam three strains, "
        yield (
            f"{head}planar: nothing moves along {AXES[integrator.axis]}, so each body has three "
            f"unknowns, {of_beams}and equations that symmetry fulfils are omitted"
        )
    bodies = zip(integrator.model.bodies, workspace.system.frames.ballistic, strict=False)
    hidden = integrator.model.hidden
    flying = [body.name for body, ballistic in bodies if ballistic and body.name not in hidden]
    if flying:
        yield (
            f"{head}only gravity acts on {', '.join(flying)}: the mass centre moves by "
            "h v + h^2 g/2 exactly, and only the rotation is solved for"
        )
    yield f"{head}elimination: {lu.order.size} pivots, {products(lu)} multiplications"
    yield head + _formulation(integrator)


def _formulation(integrator: SubsystemIntegrator) -> str:
    """The coordinates in which steps are solved, and why."""
    tree, reason, cut, closing = integrator.formulation
    if tree is None:
        return f"steps are solved in absolute coordinates, with multipliers: {reason}"
    solved = f"steps are solved in {_count(tree.body.size, 'joint coordinate')}"
    if cut is None:
        return f"{solved}, without constraint equations: the joints form open trees"
    equations = _count(cut.scale.size, "constraint equation")
    return f"{solved} with {equations}, those of what is not in the tree: {listed(closing)}"


def _members(subsystem: Model) -> str:
    names = [*_own_bodies(subsystem), *(beam.name for beam in subsystem.beams)]
    return ", ".join(names if len(names) <= 4 else [*names[:3], f"... ({len(names)} bodies)"])


def _omitted_terms(model: Model, integrators: Sequence[SubsystemIntegrator]) -> Iterator[str]:
    """Terms that the model does not have, so that its equations are built without them."""
    if len(integrators) > 1:
        yield (
            f"{len(integrators)} independent subsystems, solved separately: no joint and no load "
            "connects them"
        )
    absent = {
        "gravity": not np.any(model.gravity),
        "joints": not model.joints,
        "equations along axes (sliding joints, springs)": all(
            integrator.workspace.system.scalar is None for integrator in integrators
        ),
        "loads": not (model.loads or model.compliant_contacts),
    }
    names = [name for name, missing in absent.items() if missing]
    if names:
        yield f"omitted, as the model has none: {', '.join(names)}"


def _loaded(integrators: Sequence[SubsystemIntegrator]) -> Iterator[str]:
    yield (
        "a run loads numpy, lxml, orjson and llvmlite; of scipy.optimize only the function for the "
        "first step and for steps that Newton's method fails on (--solver auto), nothing with "
        "--solver newton; neither pandas nor matplotlib"
    )
    kept = on_disk([call for integrator in integrators for call in integrator.stepper.calls])
    yield (
        "the step is compiled and stored on disk"
        if kept
        else "the first run compiles the step for this kind of model, once (5 to 20 seconds)"
    )
