"""Modes followed over a parameter: closed forms of a rotor, known thresholds, crossings."""

import math

import numpy as np
import pytest

from msahl.analysis.equilibria.at import point_at
from msahl.analysis.linearised.point import at_start
from msahl.analysis.modes.campbell import campbell, campbell_rows, critical_rows
from msahl.analysis.modes.following import Request
from msahl.analysis.modes.solution import modes
from msahl.deck import ParsedDeck, Source
from msahl.model.settings import EQUILIBRIUM
from msahl.start.velocities import StartError
from tests.analysis.modes.test_modes import hanging, sleeping_top
from tests.support.models import ROOT

ROTOR = ROOT / "decks/mechanisms/rotor.xml"
BICYCLE = ROOT / "decks/mechanisms/bicycle.xml"


def counted(deck, name, *settings):
    """The points of a deck over a number, and the values at which they were built."""
    parsed, built = ParsedDeck(Source.of_file(deck)), []

    def point_of(value):
        built.append(value)
        return at_start(parsed.model((*settings, f"{name}={value!r}")))

    return point_of, built


def whirls(speed, d):
    """Eigenvalues of the rotor of the deck by its polynomial: forward whirls have imag > 0."""
    m, Ip, Id, a, b, k = 30.0, 0.5, 0.3, 0.15, 0.25, 1e6
    bearing = np.poly1d([d, k])
    across = np.poly1d([m, 0.0, 0.0]) + 2.0 * bearing
    tilting = np.poly1d([Id, -1j * Ip * speed, 0.0]) + (a * a + b * b) * bearing
    return (across * tilting - ((b - a) * bearing) ** 2).roots


@pytest.mark.parametrize("d", [0.0, 200.0])
def test_whirls_of_a_rotor_over_its_speed(d):
    point_of, _ = counted(ROTOR, "speed", f"d={d}")
    speeds = np.linspace(0.0, 600.0, 7)
    found = campbell(point_of, speeds)
    assert found.followed.modes == 4
    rows = campbell_rows(found)
    for speed in speeds:
        exact = whirls(speed, d)
        own = rows[rows[:, 0] == speed]
        values = own[:, 2] + 1j * own[:, 3]
        # The coefficients of the polynomial span 1e12, which its roots feel.
        both = np.where(exact.imag > 0.0, exact, exact.conj())
        for value in values:
            assert np.abs(both - value).min() <= 1e-10 * abs(value)
    # Two whirls go forward, and their frequencies rise; two go backward, and theirs fall.
    last = found.followed.spectra[-1]
    frequency = {
        int(found.followed.mode[-1][i]): (last.whirl[i], last.modes.value[i].imag)
        for i in found.followed.rows(-1)
    }
    first = found.followed.spectra[0]
    for mode, (whirl, w) in frequency.items():
        i = found.followed.row(0, mode)
        assert np.sign(w - first.modes.value[i].imag) == whirl
    assert sorted(whirl for whirl, _ in frequency.values()) == [-1, -1, 1, 1]


def test_critical_speeds_of_a_rotor():
    point_of, built = counted(ROTOR, "speed", "d=0")
    found = campbell(point_of, np.linspace(0.0, 400.0, 5), orders=(1.0,))
    m, Ip, Id, a, b, k = 30.0, 0.5, 0.3, 0.15, 0.25, 1e6
    exact = []
    for whirl in (1.0, -1.0):
        # s = i speed, forward, or -i speed, backward: an equation for the square of the speed.
        across = np.poly1d([-m, 2.0 * k])
        tilting = np.poly1d([-(Id - whirl * Ip), (a * a + b * b) * k])
        squares = (across * tilting - ((b - a) * k) ** 2).roots
        exact += [(np.sqrt(square), whirl) for square in squares if square > 0.0]
    exact.sort()
    assert [c.whirl for c in found.critical] == [whirl for _, whirl in exact]
    for critical, (speed, _) in zip(found.critical, exact, strict=True):
        assert critical.value == pytest.approx(speed, rel=1e-12)
        assert abs(critical.value - speed) <= critical.error + 1e-14 * speed
        assert critical.order == 1.0
    # Five values, some ten for each of three roots, and those that follow whirls from rest.
    assert len(built) <= 60


@pytest.mark.slow
def test_weave_and_capsize_speed_of_the_bicycle():
    point_of, built = counted(BICYCLE, "v")
    found = campbell(point_of, np.linspace(0.0, 10.0, 11))
    weave, capsize = found.critical
    # 15 digits are published.
    assert weave.value == pytest.approx(4.29238253634111, abs=5e-14)
    assert capsize.value == pytest.approx(6.02426201538837, abs=5e-13)
    assert abs(capsize.value - 6.02426201538837) <= capsize.error
    assert weave.eigenvalue.imag > 3.0
    assert capsize.eigenvalue.imag == 0.0
    assert not weave.grows_above
    assert capsize.grows_above
    # Two growing motions at rest become the weave: one of them ends there.
    assert found.followed.modes == 4
    assert [len(found.followed.rows(k)) for k in (0, -1)] == [4, 3]
    assert len(built) <= 60


@pytest.mark.slow
def test_a_value_that_is_critical_itself():
    point_of, _ = counted(BICYCLE, "v")
    found = campbell(point_of, [5.0, 6.02426201538837, 7.0])
    (capsize,) = found.critical
    assert capsize.value == pytest.approx(6.02426201538837, abs=5e-13)


def test_threshold_of_the_sleeping_top_to_round_off():
    found = campbell(lambda spin: at_start(sleeping_top(spin)), [1.0, 1.2, 1.5, 2.0])
    (threshold,) = found.critical
    # Two eigenvalues meet; each is off by 1e-8 there, the square of their distance is not.
    assert threshold.value == pytest.approx(2.0 * math.sqrt(0.44 * 0.6) / 0.75, rel=1e-14)
    assert not threshold.grows_above


def test_a_hanging_chain_under_inverted_gravity():
    found = campbell(lambda g: at_start(hanging(2, gravity=g)), [-3.0, -1.0, 0.7, 2.0])
    assert {c.value for c in found.critical} == {0.0}
    assert all(not c.grows_above for c in found.critical)


def test_modes_that_cross_are_followed_by_their_shapes():
    # One vibrates along x, the other along y; the stiffness of one passes that of the other.
    rng = np.random.default_rng(4)
    for values in (np.linspace(0.5, 1.7, 5), np.sort(rng.uniform(0.3, 2.0, 7))):
        parsed = ParsedDeck(Source.of(TWO_SPRINGS))
        found = campbell(lambda k: at_start(parsed.model([f"k={k!r}"])), values)  # noqa: B023
        followed = found.followed
        for mode in range(2):
            shapes = [
                np.abs(s.modes.shape[followed.row(k, mode), 0, :2])
                for k, s in enumerate(followed.spectra)
            ]
            along = np.argmax(shapes[0])
            for shape, spectrum in zip(shapes, followed.spectra, strict=True):
                if spectrum.value != 1.0:
                    assert np.argmax(shape) == along


TWO_SPRINGS = """<data><parameters><parameter name="k" units="N/m">1</parameter></parameters>
<system><bodies><ground><name>G</name></ground><rigidBody><name>B</name><mass>1</mass>
<moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi></rigidBody></bodies><loads><bushing>
<name>S</name><parent><name>G</name></parent><child><name>B</name></child>
<stiffness><x>{k}</x><y units="N/m">1</y></stiffness></bushing></loads></system>
<simulation><deltaT>0.01</deltaT><tFinal>1</tFinal></simulation></data>"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("y", "damping", "values", "expected"),
    [
        # Both directions lose their stiffness together, or one a little later, at a value given or
        # not. Frequencies without damping are square roots there.
        ("k", "", (-1.0, -0.3, 0.5), (0.0, 0.0)),
        ("k", "", (-1.0, 0.0, 0.5), (0.0, 0.0)),
        ("k-0.3", "", (-1.0, 1.0), (0.0, 0.3)),
        ("k-1e-8", "", (-1.0, 1.0), (0.0, 1e-8)),
        ("k", "<damping><x>0.2</x><y>0.2</y></damping>", (-1.0, 0.5), (0.0, 0.0)),
        ("k-0.01", "<damping><x>0.2</x><y>0.2</y></damping>", (-1.0, 0.5), (0.0, 0.01)),
    ],
)
def test_two_modes_that_become_critical_together(y, damping, values, expected):
    source = TWO_SPRINGS.replace(' units="N/m"', "")
    source = source.replace("<y>1</y>", f"<y>{{{y}}}</y><z>1</z>")
    parsed = ParsedDeck(Source.of(source.replace("</stiffness>", "</stiffness>" + damping)))
    built = []

    def point_of(k):
        built.append(k)
        return at_start(parsed.model([f"k={k!r}"]))

    found = campbell(point_of, values)
    assert len({c.mode for c in found.critical}) == 2
    for critical, value in zip(found.critical, expected, strict=True):
        assert abs(critical.value - value) <= critical.error + 1e-16 * value
        assert critical.error <= 1e-14
        assert critical.eigenvalue == 0.0
        assert not critical.grows_above
    # Two roots by Brent's method.
    assert len(built) <= 60


EXCHANGE = """<data><parameters><parameter name="p">0</parameter>
<parameter name="c" units="N-s/m">1</parameter></parameters><system><bodies><ground><name>G</name>
</ground>{bodies}</bodies><joints>{joints}</joints><loads>{loads}</loads></system><simulation>
<deltaT>0.01</deltaT><tFinal>1</tFinal></simulation></data>"""
BODY = (
    "<rigidBody><name>{0}</name><mass>1</mass><moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>"
    "</rigidBody>"
)
SLIDE = (
    "<prismatic><name>S{0}</name><parent><name>G</name><axis><x>1</x></axis></parent><child><name>"
    "{0}</name></child></prismatic>"
)
SPRING = (
    "<slideSpringDamper><name>K{0}</name><joint>S{0}</joint><stiffness>{1}</stiffness>"
    "</slideSpringDamper><actuator><name>F{0}</name><joint>S{0}</joint><coordinate>slide"
    "</coordinate><expression>{{{2}*(p-1.03)*c*S{0}.slideRate}}</expression></actuator>"
)


@pytest.mark.parametrize("stiffness", [300.0, 100.0])
def test_modes_that_exchange_stability_at_one_value(stiffness):
    """Of two oscillators one begins to grow where the other ceases to: as many grow on both sides.
    With the same frequency each is the mirror image of the other.
    """
    deck = EXCHANGE.format(
        bodies=BODY.format("A") + BODY.format("B"),
        joints=SLIDE.format("A") + SLIDE.format("B"),
        loads=SPRING.format("A", 100.0, 1) + SPRING.format("B", stiffness, -1),
    )
    parsed = ParsedDeck(Source.of(deck))
    found = critical_rows(
        campbell(lambda p: at_start(parsed.model((f"p={p!r}",))), np.linspace(0.0, 2.0, 6))
    )
    assert len(found) == 2
    assert np.abs(np.array([row[0] for row in found]) - 1.03).max() <= 1e-12


def test_values_without_modes_are_reported():
    def point_of(value):
        if value == 2.0:
            raise StartError("the joints cannot be closed")
        return at_start(hanging(1, gravity=value))

    found = campbell(point_of, [1.0, 2.0, 4.0])
    assert found.failures == [(2.0, "the joints cannot be closed")]
    assert set(campbell_rows(found)[:, 0]) == {1.0, 4.0}
    assert critical_rows(found).shape == (0, 8)


def test_each_value_has_its_own_equilibrium():
    deck = ROOT / "decks/machines/quarter_car.xml"
    parsed = ParsedDeck(Source.of_file(deck))
    found = campbell(
        lambda m: point_at(parsed.model([f"bodyMass={m!r}"]), EQUILIBRIUM), [250.0, 300.0]
    )
    assert all(s.modes.equilibrium.holds for s in found.followed.spectra)
    alone = modes(point_at(parsed.model(["bodyMass=300.0"]), EQUILIBRIUM))
    last = found.followed.spectra[-1].modes
    assert np.abs(last.value - alone.value).max() <= 1e-12 * np.abs(alone.value).max()


def test_the_lowest_modes_of_a_large_model():
    wanted = Request(number=3, method="sparse")
    found = campbell(lambda g: at_start(hanging(40, gravity=g)), [5.0, 10.0], wanted)
    rows = campbell_rows(found)
    first, last = (rows[rows[:, 0] == g] for g in (5.0, 10.0))
    # Frequencies are in proportion to the root of gravity.
    assert last[:, 3] == pytest.approx(np.sqrt(2.0) * first[:, 3], rel=1e-11)
