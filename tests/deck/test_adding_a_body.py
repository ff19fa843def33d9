"""The kinds of body of docs/adding-an-element.md, added as it says."""

import json

import numpy as np
import pandas as pd
import pytest

from tests.support.guide import apply, call, call_all, copy_program, listings, python, section

GUIDE = section("Adding a kind of body")
CHANGES = listings(GUIDE, "diff")
(DECK,) = listings(GUIDE, "xml")
OWN = section("Adding a kind of body with inertia of its own")
(ROTORS,) = listings(OWN, "python")
(SATELLITE,) = listings(OWN, "xml")


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the program with all listings of the guide."""
    root = tmp_path_factory.mktemp("checkout")
    copy_program(root)
    for changes in CHANGES:
        apply(root, changes)
    (root / "ball.xml").write_text(DECK)
    return root


def test_a_kind_of_body_changes_at_most_eight_files():
    files = [listing.splitlines()[0] for listing in CHANGES]
    # With its deck, its entry in docs/deck.md and the line in CHANGELOG.md.
    assert len(set(files)) + 3 <= 8


@pytest.mark.slow
def test_the_body_is_shown_and_run(checkout):
    call_all(
        checkout,
        "msahl check ball.xml",
        "msahl show ball.xml -o show.html",
        "msahl run ball.xml --scheme gauss3 --dt 0.1 -o run "
        "--gradient 'Axle.angle final' --wrt Ball.radius",
    )
    angle = pd.read_csv(checkout / "run" / "joints.csv")["Axle.angle"].iloc[-1]
    assert angle == pytest.approx(0.2 * np.sin(10.0), abs=1e-4)  # order 6, 1 rad a step: 1/7!
    gradient = pd.read_csv(checkout / "run" / "gradients.csv").iloc[0]
    # Omega = sqrt(k/J) goes with 1/r, of 100 mm, and q = w0/Omega sin(Omega t).
    by_r = (0.2 * np.sin(10.0) - 2.0 * np.cos(10.0)) / 100.0
    assert gradient["derivative"] == pytest.approx(by_r, rel=1e-3)  # likewise


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (">100<", ">0<", "principal moments about G 0, 0, 0 kg-m^2"),
        (">2</mass>", ">-2</mass>", "the mass is -2 kg; it must be greater than zero"),
    ],
)
def test_its_faults_are_those_of_a_body(checkout, old, new, message):
    (checkout / "wrong.xml").write_text(DECK.replace(old, new))
    result = call(checkout, "check", "wrong.xml")
    assert result.returncode == 2
    assert "body 'Ball'" in result.stderr
    assert message in result.stderr


@pytest.fixture(scope="module")
def with_rotors(tmp_path_factory):
    """A copy of the program with the body that has inertia of its own."""
    root = tmp_path_factory.mktemp("rotors")
    copy_program(root)
    for changes in listings(OWN, "diff"):
        apply(root, changes)
    (root / "msahl/formulations/absolute/rotors.py").write_text(ROTORS)
    (root / "gyrostat.xml").write_text(SATELLITE)
    (root / "spinning.xml").write_text(SATELLITE.replace("<omega1>0.1</omega1>", SPIN))
    return root


SPIN = "<omega3>1</omega3>"


def test_a_body_with_inertia_of_its_own_changes_at_most_eight_files():
    changed = {listing.splitlines()[0] for listing in listings(OWN, "diff")}
    assert len(changed) + len((ROTORS, SATELLITE)) <= 8


def test_a_gyrostat_moves_as_its_deck_says(with_rotors):
    """w = 0.1 (cos 4t, sin 4t, 0) at t = 1; of order 2 its phase is wrong by (n h)^2/12 n t."""
    runs = {
        "preserving": (SECOND := "--scheme preserving", 1.4e-3),
        "exponential": (f"{SECOND} --rotation-update exponential", 1.4e-3),
        "decaying": ("--scheme decaying --damping 0.1", 1.5e-3),  # and a little damping
        "gauss3": ("--scheme gauss3", 1e-8),  # order 6: (n h)^6/1e5
        "radau2": ("--scheme radau2", 1e-4),  # order 3: (n h)^3/72
    }
    commands = [
        f"msahl run gyrostat.xml --dt 0.05 --error off -o {name} {options}"
        for name, (options, _) in runs.items()
    ]
    call_all(with_rotors, "msahl check gyrostat.xml", *commands)
    expected = 0.1 * np.array([np.cos(4.0), np.sin(4.0), 0.0])
    for name, (_, bound) in runs.items():
        states = pd.read_csv(with_rotors / name / "states.csv").iloc[-1]
        w = states[["Satellite.wx", "Satellite.wy", "Satellite.wz"]].to_numpy(float)
        assert np.abs(w - expected).max() < bound, name
        if name in ("preserving", "exponential"):  # the moment does no work in a step
            assert w @ (w * [0.5, 0.5, 0.3]) == pytest.approx(0.005, rel=1e-12)


def test_a_gyrostat_is_linearised_and_written(with_rotors):
    call_all(with_rotors, "msahl linearize spinning.xml -o linear.json")
    linear = json.loads((with_rotors / "linear.json").read_text())
    poles = np.linalg.eigvals(np.array(linear["A"]))
    # It nutates at (C w3 + h)/A.
    assert np.abs(poles - 4.6j).min() < 1e-9
    assert linear["disagreement"] < 1e-10  # of its derivatives and differences; usually 1e-13
    result = python(with_rotors, "-c", WRITTEN)
    assert result.returncode == 0, result.stderr


WRITTEN = """
from pathlib import Path
from msahl.deck.source import Source, read_deck
from msahl.deck.write_model import write_deck
model = read_deck("gyrostat.xml")
assert model.bodies[0].spin == (0.0, 0.0, 2.0)
assert Source(Path("written.xml"), write_deck(model)).model() == model
"""
