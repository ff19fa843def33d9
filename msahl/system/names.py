"""Names of what the flat arrays hold: CSV columns, and rows of the equations for messages."""

import numpy as np

from msahl.elements.beams.shape import gauss_stations
from msahl.formulations.absolute.frames import first_multiplier
from msahl.joints.coordinates import columns
from msahl.joints.registry import KINDS
from msahl.laws.registry import JOINT_LAWS
from msahl.model import (
    Bushing,
    Joint,
    JointLoad,
    JointSpring,
    Load,
    MarkerDistance,
    Model,
    SignalTable,
    SpringDamper,
    resolve,
)
from msahl.model.beams import is_damped
from msahl.model.scheme import WORKER
from msahl.system.arrays import System

STATE_COLUMNS = ("x", "y", "z", "P1", "P2", "P3", "vx", "vy", "vz", "wx", "wy", "wz")
ACCELERATION_COLUMNS = ("ax", "ay", "az", "alphax", "alphay", "alphaz")
MARKER_COLUMNS = (
    *("x", "y", "z", "vx", "vy", "vz", "ax", "ay", "az"),
    *("q0", "q1", "q2", "q3", "wx", "wy", "wz"),
)
GROUP_COLUMNS = (
    *("x", "y", "z", "vx", "vy", "vz", "px", "py", "pz", "Lx", "Ly", "Lz"),
    *("kinetic", "potential"),
)
FORCE_COLUMNS = ("Fx", "Fy", "Fz")
MOMENT_COLUMNS = ("Mx", "My", "Mz")
RESULTANT_COLUMNS = ("n1", "n2", "n3", "m1", "m2", "m3")
BEAM_COLUMNS = (
    *("stretch", "shear2", "shear3", "twist", "curvature2", "curvature3"),
    *RESULTANT_COLUMNS,
)
LOAD_COLUMN, FACTOR_COLUMN, POWER_COLUMN = "load", "factor", "power"
AMPLITUDE = "amplitude"
STRAINS = (
    *("stretch", "shear along d2", "shear along d3"),
    *("torsion", "bending about d2", "bending about d3"),
)
ENERGY = "energy"
"""Value of a spring in the table of work."""
Springy = SpringDamper | JointSpring | Bushing


def state_columns(model: Model) -> list[str]:
    """Header of ``states.csv``."""
    ends = [f".{c}" for c in STATE_COLUMNS]
    return ["time", *[body.name + end for body in model.bodies for end in ends]]


def acceleration_columns(model: Model) -> list[str]:
    """Header of ``accelerations.csv``."""
    return ["time", *(f"{b.name}.{c}" for b in model.bodies for c in ACCELERATION_COLUMNS)]


def marker_columns(model: Model) -> list[str]:
    """Header of ``markers.csv``: markers, then the distances and angles between them."""
    names = [f"{marker.name}.{c}" for marker in model.markers for c in MARKER_COLUMNS]
    for sensor in model.sensors:
        value = "distance" if isinstance(sensor, MarkerDistance) else "angle"
        names += [f"{sensor.name}.{value}", f"{sensor.name}.{value}Rate"]
    return ["time", *names]


def group_columns(model: Model) -> list[str]:
    """Header of ``system.csv``."""
    return ["time", *(f"{group.name}.{c}" for group in model.groups for c in GROUP_COLUMNS)]


def coordinate_columns(model: Model, levels: int) -> list[str]:
    """Header of ``joints.csv``: of each joint the values of its coordinates, their rates, and with
    three ``levels`` their accelerations.
    """
    names = ((joint, level) for joint in model.joints for level in range(levels))
    return [
        "time",
        *(f"{element.name}.{c}" for element, level in names for c in columns(element, level)),
    ]


def reaction_columns(model: Model) -> list[str]:
    """Header of ``reactions.csv``: of each joint force and, if it has one, moment; of couplings and
    motions the load [N or N m], of motions the power [W] as well, of contacts the load again, the
    compliant ones behind the rigid ones.
    """
    joints = [f"{joint.name}.{c}" for joint in model.joints for c in joint_columns(joint)]
    couplings = [f"{coupling.name}.{LOAD_COLUMN}" for coupling in model.couplings]
    columns_of_motion = (LOAD_COLUMN, POWER_COLUMN)
    motions = [f"{motion.name}.{c}" for motion in model.motions for c in columns_of_motion]
    sides = (*model.contact_sides, *model.compliant_sides)
    contacts = [f"{side.name}.{LOAD_COLUMN}" for side in sides]
    return ["time", *joints, *couplings, *motions, *contacts]


def joint_columns(joint: Joint) -> tuple[str, ...]:
    """What is shown of one joint's reaction."""
    return FORCE_COLUMNS + (MOMENT_COLUMNS if KINDS[joint.kind].moment else ())


def beam_columns(model: Model) -> list[str]:
    """Header of ``beams.csv``: of each Gauss point of each beam, named by its share of the arc
    length as in ``Blade@0.25``, strains [-, 1/m] and stress resultants [N, N m].
    """
    found = ["time"]
    for beam in model.beams:
        for s in gauss_stations(beam.degree, np.array(beam.lengths)) / sum(beam.lengths):
            found += [f"{beam.name}@{s:.6g}.{column}" for column in BEAM_COLUMNS]
    return found


def amplitude_columns(model: Model) -> list[str]:
    """Header of ``amplitudes.csv``: of each mode of each elastic body, counted from 1 as in
    ``Rod.1``, the amplitude [m] and its rate [m/s].
    """
    found = ["time"]
    for body in model.elastic_bodies:
        for j in range(1, len(body.stiffness) + 1):
            found += [f"{body.name}.{j}.{AMPLITUDE}{level}" for level in ("", "Rate")]
    return found


def workers(model: Model) -> tuple[str, ...]:
    """Names of all whose work is counted: loads, motions, contacts, events, damped beams, elastic
    bodies, a scheme that decays."""
    damped = filter(is_damped, model.beams)
    contacts = (*model.contact_sides, *model.events, *model.compliant_contacts)
    elements = (*model.loads, *model.motions, *contacts, *damped, *model.elastic_bodies)
    names = tuple(element.name for element in elements)
    return (*names, WORKER) if resolve(model.simulation).dissipative else names


def work_columns(model: Model) -> list[str]:
    """Header of ``work.csv``: work since t = 0 of all ``workers``, and elastic energies [J]."""
    springs = [load for load in model.loads if _is_elastic(load)]
    elastic = (*springs, *model.compliant_contacts, *model.elastic_bodies, *model.beams)
    work = [f"{name}.work" for name in workers(model)]
    return ["time", *work, *(f"{element.name}.{ENERGY}" for element in elastic)]


def _is_elastic(load: Load) -> bool:
    """Return whether a load has elastic energy."""
    if isinstance(load, JointLoad):
        return JOINT_LAWS[load.law].is_elastic
    return isinstance(load, Springy)


def resultant_columns(model: Model) -> list[str]:
    """Columns of the stress resultants of beams: forces along and moments about d_1, d_2, d_3 at
    every Gauss point, which are counted from 1 along each beam.
    """
    points = (f"{beam.name}.{g + 1}" for beam in model.beams for g in range(len(beam.strain)))
    return ["time", *(f"{point}.{c}" for point in points for c in RESULTANT_COLUMNS)]


def signal_columns(model: Model) -> list[str]:
    """Header of ``signals.csv``: signals and auxiliary states [SI], loads of actuators [N or N m],
    factors of concentrated loads, and power of actuators [W].
    """
    names = [signal.name for signal in model.signals if not isinstance(signal, SignalTable)]
    loads = [f"{load.name}.{LOAD_COLUMN}" for load in model.actuators]
    factors = [f"{load.name}.{FACTOR_COLUMN}" for load in model.controlled]
    powers = [f"{load.name}.{POWER_COLUMN}" for load in model.actuators]
    return ["time", *names, *loads, *factors, *powers]


def _describe_elastic(model: Model, system: System, element: int, node: int, slot: int) -> str:
    """A strain of an element of a beam in words, or the law of a spring in the compliance form;
    elements of all beams, then such springs are counted from 0.
    """
    for beam in model.beams:
        if element < len(beam.lengths):
            break
        element -= len(beam.lengths)
    else:
        springs = [load for load in model.loads if isinstance(load, Springy) and load.compliance]
        if element >= len(springs):
            return _describe_follower(model, element - len(springs))
        law = "angular law" if system.multipliers.rotational[node] else "law"
        return f"spring '{springs[element].name}', {law} {slot + 1}"
    strains = STRAINS[3:] if system.multipliers.rotational[node] else STRAINS[:3]
    return f"beam '{beam.name}', {strains[slot]} in element {element + 1}"


def _describe_follower(model: Model, number: int) -> str:
    """The equations of a follower in words; those of all elastic bodies are counted from 0."""
    found = [(body, one) for body in model.elastic_bodies for one in body.followers]
    body, follower = found[number]
    which = f", place of '{follower.body}'" if follower.is_node else ""
    return f"elastic body '{body.name}'{which}"


def describe_row(model: Model, system: System, index: int) -> str:
    """Row ``index`` of the flat equations in words."""
    node, axis = index // 3, "xyz"[index % 3]
    frames = system.frames
    k = node - first_multiplier(frames)
    if k < 0:
        kind = "moment about" if frames.rotates[node] else "force along"
        name = model.bodies[frames.owner[frames.of_node[node]]].name
        return f"body '{model.hidden.get(name, name)}', {kind} {axis}"
    elements = model.constrained
    number = int(system.multipliers.element[k])
    if number >= len(elements):
        return _describe_elastic(model, system, number - len(elements), k, index % 3)
    element = elements[number]
    what = f"violation along {axis}" if k < system.coincide.a.size else f"equation {index % 3 + 1}"
    kind = type(element).__name__.lower()
    return f"{kind} '{element.name}', {what}"
