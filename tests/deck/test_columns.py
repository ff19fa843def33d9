"""Elements that are alike are read in columns: the same records and faults as one by one."""

import math
from functools import partial

import numpy as np
import pytest
from lxml import etree

from benchmarks.chain_deck import chain_deck
from benchmarks.structure_decks import structure_deck
from msahl.check.bodies import body_findings, plainly_possible
from msahl.deck import DeckError, alike, columns, read
from msahl.deck.source import Source
from msahl.model import RigidBody

N = 2 * columns.LEAST


def rotated(n):
    """A chain of bodies with mass centres, velocities and axes of their own, in mixed units."""
    root = etree.fromstring(chain_deck(n, 0.01, 0.1).encode())
    for k, body in enumerate(root.iterfind("system/bodies/rigidBody")):
        start, moi = body.find("initialConditions"), body.find("moi")
        start.find("orientation/eulerRotation/u1").text = repr(0.1 * (k % 7))
        start.find("position").set("basis", "Base")
        add(body, "rGB", x="1.5")[0].set("units", "in")
        velocity = add(start, "velocity", v1=repr(0.3 * k), v3="-0.0")
        velocity.set("basis", "inertial" if k % 3 else f"Bob{n - k}")
        add(start, "angularVelocity", omega2="7.0")[0].set("units", "rpm")
        moi.set("about", "B" if k % 2 else "G")
        add(moi, "Ixy", text="1e-4").set("units", "kg-m^2")
    for joint in root.iterfind("system/joints/spherical"):
        joint.find("child/position").set("basis", "inertial")
    return etree.tostring(root)


def add(parent, tag, text="", **children):
    element = etree.SubElement(parent, tag)
    element.text = text or None
    for name, value in children.items():
        add(element, name, value)
    return element


DECKS = {
    "chain": chain_deck(N, 0.01, 0.1).encode(),
    "rotated": rotated(N),
    "net": structure_deck("net", N).encode(),
}


def outcome(data):
    """The model as text, in which -0.0 is not 0.0, or the faults of a deck."""
    try:
        return repr(Source.of(data).model())
    except DeckError as error:
        return list(map(str, error.faults))


def one_by_one(monkeypatch, data):
    with monkeypatch.context() as patch:
        patch.setattr(columns, "LEAST", math.inf)
        patch.setattr(alike, "LEAST", math.inf)
        return outcome(data)


@pytest.mark.parametrize("data", DECKS.values(), ids=DECKS)
def test_columns_are_read_to_the_same_records(data, monkeypatch):
    assert outcome(data) == one_by_one(monkeypatch, data)


@pytest.mark.parametrize("data", DECKS.values(), ids=DECKS)
def test_no_body_or_joint_of_many_alike_is_read_by_itself(data, monkeypatch):
    calls = []

    def count(function, element, reader):
        calls.append(element.tag)
        return function(element, reader)

    for name in ("_read_body", "read_joint"):
        counted = partial(count, getattr(read, name))
        monkeypatch.setattr(read, name, counted)
    Source.of(data).model()
    assert calls == ["ground"]


BODY, JOINT = "system/bodies/rigidBody", "system/joints/spherical"
ONE_OF_MANY = [
    (BODY, "mass", "-1", True),
    (BODY, "mass", "1e101", True),
    (BODY, "mass", "1e-101", True),
    (BODY, "moi/Ixx", "1.0", True),
    (BODY, "moi/Izz", "0", True),
    (BODY, "name", "Bob3", True),
    (BODY, "initialConditions/position/z", "3.0001", True),
    (BODY, "initialConditions/orientation/eulerRotation/u2", "0", True),
    # By 1e-9 rad: the points still fit.
    (BODY, "initialConditions/orientation/eulerRotation/phi", "44.9999999", False),
    (JOINT, "child/name", "Bob5", True),
    (JOINT, "parent/name", "Nobody", True),
    (JOINT, "child/position/z", "-5.001", True),
    # 1e-7 m at an arm of 5 m fits.
    (JOINT, "child/position/z", "-5.0000001", False),
]
"""Elements, what is changed in one of them, and whether that is a fault."""


@pytest.mark.parametrize(("elements", "path", "text", "is_fault"), ONE_OF_MANY)
def test_faults_of_one_of_many_are_those_of_one_by_one(elements, path, text, is_fault, monkeypatch):
    root = etree.fromstring(DECKS["chain"])
    root.findall(elements)[5].find(path).text = text
    data = etree.tostring(root)
    found = outcome(data)
    assert found == one_by_one(monkeypatch, data)
    assert isinstance(found, list) == is_fault


def test_bodies_that_are_plainly_possible_have_no_findings():
    draw = np.random.default_rng(4)
    A = draw.normal(size=(500, 3, 3)) * draw.choice([1e-8, 1.0], size=(500, 3, 1))
    J, masses = A + np.swapaxes(A, 1, 2), draw.choice([-1.0, 0.0, 1e-9, 2.0], size=500)
    square = A[::2] @ np.swapaxes(A[::2], 1, 2)
    trace = np.trace(square, axis1=1, axis2=2)
    J[::2] = trace[:, None, None] * np.eye(3) - square  # of mass points: possible
    scale = np.abs(J).max(axis=(1, 2))
    plain = plainly_possible(masses, J, scale)
    assert 50 < plain.sum() < 450
    for mass, inertia, s in zip(masses[plain], J[plain], scale[plain], strict=True):
        rows = tuple(map(tuple, inertia.tolist()))
        body = RigidBody("A", mass, *[(0.0,) * 3], rows, *[(0.0,) * 3] * 4)
        assert not list(body_findings(body, s))
