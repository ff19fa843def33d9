"""Elastic bodies: against the full model, the floating frame's own equations, and conservation."""

from dataclasses import replace

import numpy as np
import pytest

import msahl
from msahl.deck import read_deck
from msahl.deck.source import Source
from msahl.model import ConcentratedLoad, Joint
from msahl.reduction.followers import Start
from msahl.system.names import amplitude_columns, work_columns
from tests.support.elastic import (
    ZERO,
    elastic_model,
    integrate,
    invariants_of_particles,
    reduced_box,
)
from tests.support.models import ROOT, simulate

SPINNING = {
    "position": (0.1, -0.2, 0.3),
    "orientation": (0.3, 0.5, -0.2),
    "velocity": (0.4, 1.0, -0.3),
    "angular_velocity": (20.0, 35.0, -15.0),
}


@pytest.fixture(scope="module")
def body():
    return reduced_box()


def spinning(body):
    """A start in which the body rotates and vibrates: the first modes by 5 mm."""
    q = body.eigenvalues.size
    amplitude, rate = np.zeros((2, q))
    amplitude[:3], rate[1:4] = (0.005, -0.003, 0.002), (5.0, -4.0, 3.0)
    return Start(**SPINNING, amplitude=amplitude, rate=rate)


def fixed(body):
    """A joint that fixes the root where it is."""
    place = tuple((body.centre + body.interface_places[0]).tolist())
    return Joint("Clamp", "rigid", "Base", "Box.Root", place, ZERO)


def amplitudes(result):
    """(rows, q) amplitudes of the only elastic body."""
    return result.others["amplitudes"][:, 1::2]


def test_the_table_of_amplitudes_has_the_elastic_energy_and_its_own_rates(body):
    """While the body rotates and vibrates: sum k a^2/2, and differences of it."""
    model = elastic_model(body, start=spinning(body), dt=1e-5, t_final=1e-3)
    run = simulate(model, scheme="gauss2", solver="newton")
    a, rate = amplitudes(run), run.others["amplitudes"][:, 2::2]
    assert amplitude_columns(model)[:3] == ["time", "Box.1.amplitude", "Box.1.amplitudeRate"]
    energy = 0.5 * a**2 @ np.array(model.elastic_bodies[0].stiffness)
    column = work_columns(model).index("Box.energy")
    # Amplitudes of millimetres follow from places of decimetres, twice in the energy.
    assert run.work[:, column] == pytest.approx(energy, rel=1e-9)
    # Of order 4: highest frequency times the step to the fourth, over 30.
    h, fastest = 1e-5, 2.0 * np.pi * body.frequencies.max()
    differences = (8.0 * (a[3:-1] - a[1:-3]) - (a[4:] - a[:-4])) / (12.0 * h)
    size = (fastest * h) ** 4 / 30.0 * np.abs(rate).max()
    assert np.abs(differences - rate[2:-2]).max() < 2.0 * size + 1e-6 * np.abs(rate).max()


def test_frequencies_of_a_cantilever_are_those_of_the_reduced_model(body):
    """The body with a floating frame of mean axes, clamped by a joint, has the frequencies of the
    one whose frame is fixed at the root."""
    model = msahl.Model(elastic_model(body, joints=(fixed(body),)))
    found = model.modes().frequency
    other = reduced_box(frame="Root").frequencies
    # The error of the modes' own eigenvalues, by the largest: (f_max/f_1)^2 machine epsilons.
    assert found == pytest.approx(other, rel=1e-8)


def test_displacement_of_a_cantilever_is_that_of_the_full_model(body):
    """A load at the tip: static modes of the interface are exact, whatever the normal modes."""
    F = (30.0, 50.0, -20.0)
    load = ConcentratedLoad("Pull", "Box.Tip", ZERO, F, "Base", ZERO, "Base")
    model = msahl.Model(elastic_model(body, joints=(fixed(body),), loads=(load,)))
    rest = model.equilibrium()
    root = reduced_box(frame="Root")
    shapes = root.interface_shapes[1, :3]
    wanted = shapes @ ((shapes.T @ F) / root.eigenvalues)
    place = root.centre + root.interface_places[1]
    moved = np.array([rest[f"Box.Tip.{axis}"] for axis in "xyz"]) - place
    # The tip moves by 2e-4 m: of second order in it is (2e-4)^2 m, by the length of 1 m.
    assert moved == pytest.approx(wanted, rel=1e-4, abs=2e-8)


def keeps_momenta(result):
    """Whether momentum and angular momentum of all masses stay."""
    masses = np.array([one.mass for one in result.model.bodies])
    spins = np.array([one.inertia[0][0] for one in result.model.bodies])
    P, L = [], []
    for k in range(len(masses)):
        R, v = result.matrices(k), result.of("velocity", k)
        if k == 0:  # velocities are those of B, momenta of the mass centre
            v = v + np.cross(result.of("spin", 0), result.model.bodies[0].r_BG)
        x = result.of("position", k) + R @ np.array(result.model.bodies[k].r_BG)
        v, w = (np.einsum("tij,tj->ti", R, a) for a in (v, result.of("spin", k)))
        P.append(masses[k] * v)
        L.append(np.cross(x, masses[k] * v) + spins[k] * w)
    for total in (np.sum(P, axis=0), np.sum(L, axis=0)):
        # Round-off of 100 steps; gauss of a finite step keeps them to round-off as well.
        assert np.abs(total - total[0]).max() < 1e-11 * np.abs(total[0]).max()


@pytest.mark.parametrize("scheme", ["preserving", "gauss3"])
def test_a_free_body_keeps_energy_and_momenta(body, scheme):
    result = simulate(elastic_model(body, spinning(body), 2e-5, 2e-3), scheme=scheme)
    keeps_momenta(result)
    extremes = result.report.extremes
    limit = 1e-11 if scheme == "preserving" else 1e-6
    assert extremes["energyErrorMaxRelative"] < limit


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "order", "dt"), [("preserving", 2, 2e-5), ("gauss2", 4, 4e-5), ("gauss3", 6, 1.6e-4)]
)
def test_order_against_the_equations_of_the_floating_frame(body, scheme, order, dt):
    """With the invariants of the particles, the motion by minimal coordinates is the limit."""
    start, t_final = spinning(body), 8e-4
    given, modal = invariants_of_particles(body)
    x, R, a = integrate(body, given, modal, start, [t_final])
    errors = []
    for part in (1, 2):
        result = simulate(elastic_model(body, start, dt / part, t_final), scheme=scheme)
        place = result.of("position", 0)[-1] + result.matrices(0)[-1] @ body.centre
        rotated = np.abs(result.matrices(0)[-1] - R[-1].as_matrix()).max()
        errors.append(np.r_[np.abs(place - x[-1]).max(), rotated,
                            np.abs(amplitudes(result)[-1] - a[-1]).max()])  # fmt: skip
    slope = np.log2(np.array(errors[0]) / errors[1])
    # Of coarse steps, which the highest modes take with some radians, the order is not yet exact.
    assert slope[2] == pytest.approx(order, abs=0.45), (errors, slope)


@pytest.mark.slow
def test_motion_by_the_invariants_of_the_reduced_body(body):
    """The true invariants differ from those of the particles by the deviation, 2e-4, in terms of
    second order: amplitudes of 5 mm then move by less than 1e-4 of that in half a period."""
    start, t_final = spinning(body), 8e-4
    x, R, a = integrate(body, body.invariants, np.eye(body.eigenvalues.size), start, [t_final])
    result = simulate(elastic_model(body, start, 4e-5, t_final), scheme="gauss3")
    place = result.of("position", 0)[-1] + result.matrices(0)[-1] @ body.centre
    assert np.abs(amplitudes(result)[-1] - a[-1]).max() < 1e-6
    assert np.abs(place - x[-1]).max() < 1e-9
    assert np.abs(result.matrices(0)[-1] - R[-1].as_matrix()).max() < 1e-6


def test_a_free_body_falls_without_vibrating(body):
    """Gravity acts on every mass alike: the particles', the carriers', the nodes'."""
    result = simulate(elastic_model(body, t_final=1e-3, dt=1e-4, gravity=(0.0, 3.0, -9.0)))
    for k in range(len(result.model.bodies)):
        moved = result.of("position", k)[-1] - result.of("position", k)[0]
        # Places of up to a metre have errors of some machine epsilons.
        assert moved == pytest.approx((0.0, 1.5e-6, -4.5e-6), abs=2e-15)
    assert result.column("Box.energy")[-1] < 1e-20


def test_damping_of_a_mode_is_that_of_its_oscillator(body):
    """At rest in space with one mode displaced: a = a0 exp(-zeta w t) cos..., whatever the others,
    to first order in a; the rest of the body does not move."""
    q, zeta = body.eigenvalues.size, 0.05
    start = Start(ZERO, ZERO, ZERO, ZERO, np.eye(q)[0] * 1e-6, np.zeros(q))
    model = elastic_model(body, start, 2e-5, 4e-3)
    (elastic,) = model.elastic_bodies
    omega = np.sqrt(body.eigenvalues)
    damping = tuple((2.0 * zeta * np.array(elastic.stiffness) / omega).tolist())
    model = replace(model, elastic_bodies=(replace(elastic, damping=damping),))
    result = simulate(model, scheme="gauss3")
    w, t = omega[0] * np.sqrt(1.0 - zeta**2), result.time
    decay = np.exp(-zeta * omega[0] * t)
    wanted = decay * (np.cos(w * t) + zeta * omega[0] / w * np.sin(w * t))
    found = amplitudes(result)
    assert found[:, 0] == pytest.approx(1e-6 * wanted, abs=1e-12)  # of second order: 1e-12 m
    lost = result.column("Box.work")[-1]
    energy = 0.5 * elastic.stiffness[0] * 1e-12
    # The rest is less than the square of the decay, exp(-2 zeta w t).
    assert lost == pytest.approx(-energy, rel=2.0 * decay[-1] ** 2)


@pytest.mark.slow
def test_the_deck_of_a_free_rod():
    """Its first mode is an oscillator with the damping of the deck, and keeps to itself."""
    result = simulate(read_deck(ROOT / "decks" / "elastic" / "reduced_rod.xml"))
    omega, zeta = 2.0 * np.pi * 288.17759, 0.02  # as msahl reduce reports it, to 1e-8
    w, t = omega * np.sqrt(1.0 - zeta**2), result.time
    wanted = np.exp(-zeta * omega * t) * (np.cos(w * t) + zeta * omega / w * np.sin(w * t))
    found = amplitudes(result)
    # The phase at 20 ms has 36 times the error of the frequency, the run one of 2e-11 m.
    assert found[:, 0] == pytest.approx(1e-3 * wanted, abs=1e-9)
    assert np.abs(found[:, 1:]).max() < 1e-9


def middle(result):
    """(rows,) how far the middle of the rod is off the line between its ends, in the plane."""
    names = [marker.body for marker in result.model.markers]
    bodies = [one.name for one in result.model.bodies]
    pin, centre, wrist = (result.of("position", bodies.index(name)) for name in names)
    along = (wrist - pin) / np.linalg.norm(wrist - pin, axis=1)[:, None]
    off = centre - 0.5 * (pin + wrist)
    return along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0]


@pytest.mark.slow
def test_slider_crank_against_beams():
    """Slowly the rod bends as that of beams does: the axial force, which stiffens beams alone, has
    a part of (8/40)^2 of the 2 % that it makes at 40 rad/s, 0.1 %."""
    folder = ROOT / "decks" / "elastic"
    circle = b'<circle><radius units="mm">3</radius></circle>'
    rectangle = b'<rectangle><width units="mm">5</width><height units="mm">8</height></rectangle>'
    beams = (folder / "flexible_slider_crank.xml").read_bytes()
    assert circle in beams
    beams = Source.of(beams.replace(circle, rectangle)).model(("omega=8",))
    reduced = read_deck(folder / "reduced_slider_crank.xml", settings=("omega=8",))
    # Steps of both schemes have errors of 1e-10 m here.
    a, b = (
        middle(simulate(model, dt=2e-4, t_final=0.02, scheme="gauss2"))
        for model in (beams, reduced)
    )
    assert np.abs(a).max() > 3e-6
    assert np.abs(a - b).max() < 2e-3 * np.abs(a).max()


def test_accelerations_are_the_rates_of_velocities(body):
    """Of all bodies, in a rotating body that vibrates: the constraints' second derivatives."""
    h = 1e-6
    model = elastic_model(body, spinning(body), h, 4 * h)
    model = replace(model, simulation=replace(model.simulation, accelerations="yes"))
    result = simulate(model, scheme="gauss3")
    count = len(model.bodies)
    table = result.others["accelerations"][:, 1:].reshape(5, count, 6)[2, 1:, :3]
    axes = np.stack([result.matrices(k) for k in range(1, count)], axis=1)
    own = np.stack([result.of("velocity", k) for k in range(1, count)], axis=1)
    table = np.einsum("kij,kj->ki", axes[2], table)
    velocities = np.einsum("tkij,tkj->tki", axes, own)
    rates = (velocities[3] - velocities[1]) / (2.0 * h)
    # The difference has an error of (w h)^2/6 of each vibration, with w up to 5e4 rad/s.
    assert np.abs(table - rates).max() < 1e-3 * np.abs(rates).max()
