"""Decks of machines and toys with contacts against closed forms and other models."""

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.linalg import expm
from scipy.optimize import brentq

import msahl
from msahl.cli.main import main
from msahl.post.events import crossings
from msahl.results.read import read_run
from tests.contact.woodpecker import strikes
from tests.support.models import ROOT

G = 9.81
RELAXED = 1e-6
"""Contacts with friction may be redundant: multipliers are relaxed by 1e-9 of their compliance,
which adds up along a chain of ten."""


def run_deck(tmp_path, path, name="run"):
    done = CliRunner().invoke(main, ["run", str(path), "-q", "-o", str(tmp_path / name)])
    assert done.exit_code == 0, done.output
    return msahl.read(tmp_path / name)


def deck_path(name):
    return ROOT / "decks" / "contact" / f"{name}.xml"


def test_a_landing_gear_takes_the_drop(tmp_path):
    """In three phases of linear equations: free fall, one mass on the tyre, two masses."""
    run = run_deck(tmp_path, deck_path("landing_gear"))
    m, wheel, tyre, k, c, preload = 300.0, 15.0, 2e5, 15e3, 3e3, 1200.0
    touch, speed = np.sqrt(0.8 / G), np.sqrt(0.8 * G)
    w, sag = np.sqrt(tyre / (m + wheel)), (m + wheel) * G / tyre

    def depth(t):
        return sag * (1.0 - np.cos(w * t)) + speed / w * np.sin(w * t)

    off = brentq(lambda t: tyre * depth(t) - preload * (m + wheel) / m, 0.0, 0.01, xtol=1e-16)
    (opens,) = run.events[run.events.kind == "opens"].to_dict("records")
    assert opens["time"] == pytest.approx(touch + off, abs=1e-11)
    # Places a, b below those of the touch, of the airframe and the wheel, and their rates.
    rates = np.array(
        [
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [-k / m, k / m, -c / m, c / m],
            [k / wheel, -(k + tyre) / wheel, c / wheel, -c / wheel],
        ]
    )
    rest = -np.linalg.solve(rates, [0.0, 0.0, G - preload / m, G + preload / wheel])
    v = sag * w * np.sin(w * off) + speed * np.cos(w * off)
    begin = np.array([depth(off), depth(off), v, v]) - rest
    since = run.states.time.to_numpy() - touch - off
    found = run.states[["Airframe.z", "Wheel.z"]].to_numpy()
    for row, t in zip(found[since > 0.0], since[since > 0.0], strict=True):
        a, b = (rest + expm(rates * t) @ begin)[:2]
        assert row == pytest.approx([1.2 - a, 0.2 - b], abs=1e-9)
    assert found[:, 0].min() < found[-1, 0] - 0.01  # it has been lower, and comes back


@pytest.mark.slow
def test_a_wheel_without_rim_walks_down_a_slope(tmp_path):
    run = run_deck(tmp_path, deck_path("walking_wheel"))
    a, slope, inertia = np.pi / 8.0, np.radians(4.0), 0.4 + 2.0
    gain = 4.0 * 2.0 * G * np.sin(a) * np.sin(slope) / inertia
    q = (0.4 + 2.0 * np.cos(2.0 * a)) / inertia
    impacts = run.events[run.events.kind == "impact"]
    assert impacts.element.tolist() == [f"Foot{k}" for k in range(2, len(impacts) + 2)]
    # The chord between two tips rotates about the foot that stands.
    squares = (impacts.gapSpeedBefore.to_numpy() / (2.0 * np.sin(a))) ** 2
    first = 1.44 + 4.0 * G * (np.cos(slope) - np.cos(a + slope)) / inertia
    assert squares[0] == pytest.approx(first, abs=1e-9)
    assert squares[1:] == pytest.approx(q**2 * squares[:-1] + gain, abs=1e-9)
    lost = 0.5 * inertia * (1.0 - q**2) * squares
    assert impacts.energyLost.to_numpy() == pytest.approx(lost, abs=1e-9)
    limit = gain / (1.0 - q**2)
    assert (np.diff(np.abs(squares - limit)) < 0.0).all()


@pytest.mark.slow
def test_a_chain_is_laid_on_a_floor(tmp_path):
    run = run_deck(tmp_path, deck_path("falling_chain"))
    hangs = run.reactions.time < 0.0995
    for k in range(1, 10):
        load = -run.reactions.loc[hangs, f"Thread{k}.load"].to_numpy()
        assert load == pytest.approx(0.01 * G * k, rel=RELAXED)
    height = 1.0 + 0.02 * np.arange(10)
    lands = run.events[run.events.kind == "impact"]
    assert lands.element.tolist() == [f"Land{k}" for k in range(1, 11)]
    times = 0.1 + np.sqrt(2.0 * height / G)
    assert lands.time.to_numpy() == pytest.approx(times, abs=1e-11)
    assert lands.energyLost.to_numpy() == pytest.approx(0.01 * G * height + 0.045, abs=1e-11)
    last = run.states.iloc[-1]
    assert [last[f"Bead{k}.x"] for k in range(1, 11)] == pytest.approx(3.0 * times, abs=1e-10)
    weight = [run.reactions[f"Land{k}.load"].iloc[-1] for k in range(1, 11)]
    assert weight == pytest.approx([0.01 * G] * 10, rel=RELAXED)


@pytest.mark.slow
def test_a_pin_lies_against_its_hole_as_a_link_does(tmp_path):
    """The pin leaves where the force of the link vanishes, and stays in the hole."""
    path = deck_path("clearance")
    run, text = run_deck(tmp_path, path), path.read_text()
    begin, end = text.index("    <contacts>"), text.index("  </system>")
    link = (
        "      <distance><name>Link</name><parent><name>Slider</name></parent>"
        "<child><name>Rod</name><position><x>0.15</x></position></child></distance>\n    </joints>"
    )
    text = (text[:begin] + text[end:]).replace("    </joints>", link)
    (tmp_path / "link.xml").write_text(text.replace(">0.65<", ">0.25<"))
    linked = run_deck(tmp_path, tmp_path / "link.xml", "link")
    opens = run.events[run.events.kind == "opens"].time.iloc[0]
    zero = crossings(read_run(tmp_path / "link"), "Link.Fx", 0.0)
    assert min(abs(each.time - opens) for each in zero) < 1e-7
    close = run.states.time < opens - 5e-4
    size = int(close.sum())
    same = run.states["Slider.x"].to_numpy()[:size] - linked.states["Slider.x"].to_numpy()[:size]
    assert np.abs(same).max() < 1e-9
    angle = 10.0 * run.states.time.to_numpy()
    ideal = 0.1 * np.cos(angle) + np.sqrt(0.09 - (0.1 * np.sin(angle)) ** 2)
    # The rod leans by the gap across as well, which is of second order.
    assert np.abs(run.states["Slider.x"].to_numpy() - ideal).max() < 0.002 * 1.1
    impacts = run.events[run.events.kind == "impact"]
    assert impacts.gapSpeedAfter.iloc[0] == pytest.approx(-0.3 * impacts.gapSpeedBefore.iloc[0])


@pytest.mark.slow
def test_a_woodpecker_comes_down_its_pole(tmp_path):
    run = run_deck(tmp_path, deck_path("woodpecker"))
    impacts = run.events[run.events.kind == "impact"]
    beak = impacts.time[impacts.element == "Beak"].to_numpy()
    assert beak[0] == pytest.approx(0.0826940, abs=5e-8)
    # The digits of the deck.
    assert np.diff(beak[4:]) == pytest.approx(0.1307475, abs=1e-7)
    other = strikes(1e-4, 0.5)
    # Of first order, with 1,300 steps in a period.
    assert other == pytest.approx(beak[: other.size], abs=2e-3)
