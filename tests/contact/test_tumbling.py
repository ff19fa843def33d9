"""Bodies with several contacts with friction, which fall, tumble and come to rest."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.contact import chain
from msahl.deck import read_deck
from tests.contact.models import run_events

HEAD = """<data><unitSystem>SI</unitSystem><system><gravity><g3>-9.81</g3></gravity>
<bodies><ground><name>Floor</name></ground>{bodies}</bodies>{joints}
<contacts>{contacts}</contacts></system>
<simulation scheme="gauss" degree="3"><deltaT>0.01</deltaT><tFinal>1.5</tFinal></simulation>
</data>"""
BOX = """<rigidBody><name>Box</name><mass>1</mass>
<moi><Ixx>.01</Ixx><Iyy>.02</Iyy><Izz>.03</Izz></moi>
<initialConditions><position basis="Floor"><z>1</z></position>
<velocity><v1>2</v1></velocity>
<angularVelocity><omega1>3</omega1><omega2>5</omega2><omega3>1</omega3></angularVelocity>
</initialConditions></rigidBody>"""
CORNERS = """<planeContact><name>C</name>
<parent><name>Floor</name><normal><z>1</z></normal></parent><child><name>Box</name></child>
<box><x>.2</x><y>.3</y><z>.4</z></box><restitution>.3</restitution><friction>.4</friction>
</planeContact>"""
LINK = """<rigidBody><name>L{k}</name><mass>.5</mass>
<moi><Ixx>.001</Ixx><Iyy>.0108</Iyy><Izz>.0108</Izz></moi>
<initialConditions><position basis="Floor"><x>{x}</x><z>.6</z></position></initialConditions>
</rigidBody>"""
JOINT = """<spherical><name>J{k}</name>
<parent><name>L{before}</name><position><x>.25</x></position></parent>
<child><name>L{k}</name><position><x>-.25</x></position></child></spherical>"""
END = """<planeContact><name>E{k}</name>
<parent><name>Floor</name><normal><z>1</z></normal></parent>
<child><name>L{k}</name><position><x>.25</x></position></child>
<restitution>.2</restitution><friction>.3</friction></planeContact>"""


def model_of(tmp_path, **parts):
    path = tmp_path / "deck.xml"
    path.write_text(HEAD.format(**{"joints": "", **parts}))
    return read_deck(path)


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["gauss3", "preserving"])
def test_a_box_tumbles_and_comes_to_rest_on_a_face(tmp_path, scheme):
    """Between its impacts it flies without multipliers, slips of an edge change direction fast as
    they end, and both ends of an edge begin to slip at once.
    """
    model = model_of(tmp_path, bodies=BOX, contacts=CORNERS)
    report, sink, events = run_events(model, scheme)
    assert report.status == "completed"
    states = sink.table("states")
    # Lowest corners at z = 0: half of one of its edges; the solver's round-off in a thousand steps.
    assert np.abs(states[-1, 3] - np.array((0.1, 0.15, 0.2))).min() < 1e-9
    assert np.abs(states[-1, 7:13]).max() < 1e-9
    lost = sum(event[6] for event in events if event[1] == "impact")
    assert 0.0 < lost < 0.5 * 4.0 + 0.5 * (0.09 + 0.5 + 0.03) + 9.81


@pytest.mark.slow
def test_slips_of_a_face_that_lands_end_at_once(tmp_path):
    """By steps of a tolerance it lands with slips of 3e-7 m/s at four corners, whose ways of 1e-14
    m no step resolves.
    """
    model = model_of(tmp_path, bodies=BOX, contacts=CORNERS)
    given = {"tolerance": None, "local_tolerance": 1e-7, "output_interval": 0.01}
    model = replace(model, simulation=replace(model.simulation, **given))
    report, sink, _ = run_events(model, "auto")
    assert report.status == "completed"
    assert np.abs(sink.table("states")[-1, 7:13]).max() < 1e-9


def test_a_chain_of_rods_falls_flat(tmp_path):
    """Five points in a line meet the floor at once; along the rods all but one of their slips are
    the same, so their shares of friction are not unique.
    """
    model = model_of(
        tmp_path,
        bodies="".join(LINK.format(k=k, x=0.25 + 0.5 * k) for k in range(4)),
        joints="<joints>"
        + "".join(JOINT.format(k=k, before=k - 1) for k in range(1, 4))
        + "</joints>",
        contacts="".join(END.format(k=k) for k in range(4))
        + END.format(k=0).replace("E0", "E").replace(">.25<", ">-.25<"),
    )
    report, sink, events = run_events(replace(model), "gauss3")
    assert report.status == "completed"
    heights = sink.table("states")[:, [1 + 12 * b + 2 for b in range(4)]]
    first = min(event[0] for event in events)
    assert first == pytest.approx(np.sqrt(1.2 / 9.81), abs=1e-12)
    # At rest to the height of rebounds that are omitted, 1e-10 m, and round-off.
    assert np.abs(heights[-1]).max() < 1e-9


@pytest.mark.parametrize("links", [6, pytest.param(10, marks=pytest.mark.slow)])
def test_a_chain_that_lies_straight_comes_to_rest(monkeypatch, links):
    """Fixed at one end it is held by all of its links, whose shares are not unique: where the share
    of one is used up, others hold it.
    """
    monkeypatch.setattr(chain, "FRICTION", 0.3)
    report, sink, _ = run_events(chain.chain(links), "gauss2", dt=1e-3, t_final=0.6)
    assert report.status == "completed"
    velocities = [12 * body + k for body in range(links) for k in range(7, 13)]
    # At rest to round-off.
    assert np.abs(sink.table("states")[-1, velocities]).max() < 1e-12
