"""Define the machines with beams of docs/validation/error.md, and their reference solutions.

The error by the steps is against the same mesh by two other schemes at much smaller steps;
positions are compared with a mesh of more elements of a high degree, so their error is that of
steps and mesh together, which is what a run estimates.
"""

from dataclasses import replace
from functools import cache

import numpy as np

from msahl.api.running import finer_mesh
from msahl.beams.places import common_places
from msahl.deck.source import Source
from msahl.model import Model, Options
from msahl.model.settings import OFF
from msahl.results.job import make_job
from msahl.run.loop import run
from msahl.run.mesh_error import FinerMesh
from msahl.run.tables import SIGNALS, STATES, MemorySink
from msahl.system.names import signal_columns
from tools.validation.error_models import Case
from tools.validation.reference import Truth

FINE = (4, 4)
"""Elements of a scene's beam for each of its own, and their degree, in the fine mesh."""
TWO_WAYS = (("gauss", 4, 32), ("radau", 3, 96))
"""Scheme, degree and steps from one output time to the next of the two solutions."""

STRIP = """<beam theory="{theory}"><name>Strip</name>
<elements>{elements}</elements><degree>{degree}</degree>
<centreLine><straight><end><x>1</x></end></straight></centreLine>
<section><rectangle><width units="mm">30</width><height units="mm">10</height></rectangle></section>
<material><youngsModulus units="GPa">2.1</youngsModulus><poissonsRatio>0.3</poissonsRatio>
<density units="kg/m^3">1000</density></material>{more}</beam>"""
JOINT = """<joints><{kind}><name>Root</name><parent><name>Base</name>{axis}</parent>
<child><name node="first">Strip</name></child></{kind}></joints>"""
TIP = """<concentrated><name>Force</name><body node="last">Strip</body>
<force basis="Base"><zForce>1</zForce></force><law>{law}</law></concentrated>"""


def strip(joint: str, after: str, before: str = "", theory: str = "inextensible") -> str:
    """Return the deck of a strip of 1 m along x, with braces for its mesh."""
    kind, _, axis = joint.partition(" ")
    axis = f"<axis><{axis}>1</{axis}></axis>" if axis else ""
    beam = STRIP.replace("{theory}", theory).replace("{more}", "")
    return (
        f"<data><system>{before}<bodies><ground><name>Base</name></ground>{beam}</bodies>"
        f"{JOINT.format(kind=kind, axis=axis)}{after}</system>"
        "<simulation><deltaT>0.01</deltaT><tFinal>0.1</tFinal></simulation></data>"
    )


def law(*children: str) -> str:
    """A sudden or controlled force at the tip."""
    return f"<loads>{TIP.format(law=''.join(children))}</loads>"


PLUCK = strip("rigid", law("<polynomial><c0>1</c0></polynomial>"))
SWING = strip("revolute y", "", "<gravity><g3>-9.81</g3></gravity>")
SPIN_UP = strip(
    "revolute z",
    """<motions><jointMotion><name>Motor</name><joint>Root</joint><coordinate>angle</coordinate>
<law><ramp><from>0</from><to>1.5</to><start>0</start><end>0.6</end></ramp></law></jointMotion></motions>""",
)
CONTROLLED = strip(
    "rigid",
    """<markers><marker><name>Tip</name><body node="last">Strip</body></marker></markers>
<signals><state name="f">(20*(0.1*sin(4*t) - Tip.z) - 1.5*Tip.vz - f)/0.01</state></signals>"""
    + law("<expression>f</expression>"),
)
SLIDER_CRANK = """<data><system><bodies><ground><name>Base</name></ground>
<rigidBody><name>Crank</name><mass>0.2</mass>
<moi><Ixx>1e-5</Ixx><Iyy>4e-4</Iyy><Izz>4e-4</Izz></moi></rigidBody>
<beam><name>Rod</name><elements>{elements}</elements><degree>{degree}</degree>
<centreLine><straight><start><x>0.15</x></start><end><x>0.45</x></end></straight></centreLine>
<section><circle><radius units="mm">3</radius></circle></section>
<material><youngsModulus units="GPa">200</youngsModulus><poissonsRatio>0.3</poissonsRatio>
<density units="kg/m^3">7870</density></material><dampingTime>1e-5</dampingTime>
<initialConditions><velocity><v2>3</v2></velocity>
<angularVelocity><omega3>-6.666666666666667</omega3></angularVelocity></initialConditions></beam>
<rigidBody><name>Slider</name><mass units="g">67</mass>
<moi><Ixx>1e-5</Ixx><Iyy>1e-5</Iyy><Izz>1e-5</Izz></moi></rigidBody></bodies>
<joints><revolute><name>Bearing</name><parent><name>Base</name><axis><z>1</z></axis></parent>
<child><name>Crank</name><position><x>-0.075</x></position></child>
<initialConditions><angleRate>13.333333333333334</angleRate></initialConditions></revolute>
<revolute><name>Pin</name>
<parent><name>Crank</name><position><x>0.075</x></position><axis><z>1</z></axis></parent>
<child><name node="first">Rod</name></child></revolute>
<revolute><name>Wrist</name><parent><name node="last">Rod</name><axis><z>1</z></axis></parent>
<child><name>Slider</name></child></revolute>
<prismatic><name>Guide</name><parent><name>Base</name><axis><x>1</x></axis></parent>
<child><name>Slider</name></child></prismatic></joints></system>
<simulation><deltaT>0.001</deltaT><tFinal>0.1</tFinal></simulation></data>"""


def beam(text: str, elements: int, degree: int, t_final: float, outputs: int, name: str) -> Case:
    """Return a model of the table with beams, from the text of a deck."""

    def mesh(times: int, high: int) -> str:
        given = text.replace("{elements}", str(times * elements))
        return given.replace("{degree}", str(high))

    own = mesh(1, degree)
    return Case(
        name,
        "beam",
        lambda: Source.of(own).model(()),
        t_final,
        outputs,
        own_truth=lambda case: truth(case, Source.of(mesh(*FINE)).model(())),
        finer=cache(lambda: _finer(own)),
    )


def _finer(text: str) -> FinerMesh | None:
    source = Source.of(text)
    return finer_mesh(make_job(source, source.model(()), {}))


def truth(case: Case, fine: Model) -> Truth:
    """Return the reference of a case, and of a ``fine`` mesh of it, each by two schemes."""
    (states, columns), (other, other_columns) = (
        solve_at(case, case.model, way) for way in TWO_WAYS
    )
    mine, exact = common_places(case.model), common_places(fine)
    shared = [place for place in mine if place in exact]
    where, there = ([group[place] for place in shared] for group in (mine, exact))
    places, places_other = (
        solve_at(case, fine, way)[0].reshape(len(states), -1, 4, 3)[:, there, 0] for way in TWO_WAYS
    )
    return Truth(
        case.times,
        states,
        other,
        0.0,
        0.0,
        columns,
        other_columns,
        np.array(where),
        places,
        places_other,
    )


def solve_at(
    case: Case, model: Model, way: tuple[str, int, int]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return states (m, 12 n) and signals of a ``model`` at the output times of a case, by scheme,
    degree and steps per output time.
    """
    scheme, degree, per_output = way
    simulation = replace(
        model.simulation,
        dt=case.t_final / (case.outputs * per_output),
        t_final=case.t_final,
        scheme=scheme,
        degree=degree,
    )
    sink = MemorySink(only=(STATES, SIGNALS))
    report = run(replace(model, simulation=simulation), Options(every=per_output, error=OFF), sink)
    if report.status != "completed":
        raise ArithmeticError(f"{case.name}: {report.message}")
    names = signal_columns(model)[1:]
    columns = dict(zip(names, sink.table(SIGNALS)[:, 1:].T, strict=True)) if names else {}
    return sink.table(STATES)[:, 1:], columns


BEAMS = (
    beam(PLUCK, 2, 3, 0.4, 20, "plucked strip"),
    beam(SWING, 2, 3, 0.6, 20, "swinging strip"),
    beam(SPIN_UP, 2, 2, 0.32, 8, "blade that spins up"),
    beam(CONTROLLED, 2, 3, 0.24, 8, "strip under control"),
    beam(SLIDER_CRANK, 2, 2, 0.04, 8, "flexible slider-crank"),
)
