"""Frequencies, steady rotation and long motions of beams against independent solutions."""

from dataclasses import replace
from shutil import copy

import numpy as np
import pytest
from numpy.polynomial import Legendre
from scipy.linalg import eigh

from msahl.algebra.vector import ZERO
from msahl.analysis.equilibria.load_path import grown
from msahl.analysis.equilibria.static_equations import Spin, Statics, with_rates
from msahl.analysis.linearised.point import at_start, complete
from msahl.analysis.modes.solution import modes
from msahl.deck import read_deck
from msahl.elements.beams.build import build_beam
from msahl.jit.compiled import compiled
from msahl.model import Joint
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.midpoint import newton
from msahl.system.diagnostics import energy_balance
from msahl.system.momentum import momentum
from tests.support.beams import cantilever, section, straight
from tests.support.models import GROUND, ROOT, build_model, deck, simulate

RIGID = np.inf
BENDING = (RIGID, RIGID, RIGID, RIGID, 1.0, 20.0)
"""Stiffnesses of a beam without stretch, shear and torsion, of EI = 1 in its soft plane x, z."""
J = 1e-4
"""Rotary inertia per length about d_2 and d_3, of length and mass per length 1."""
ROTARY = (2.0 * J, J, J)
CLAMPED = np.array([1.875104068711961, 4.694091132974175, 7.854757438237613])
FREE = np.array([4.730040744862704, 7.853204624095838, 10.99560783800167])
"""beta L of uniform Euler-Bernoulli beams without rotary inertia."""


def ritz(rotary, speed=0.0, free=False):
    """(3,) lowest angular frequencies of bending, by 16 polynomials in Ritz's method.

    V = 1/2 int [w''^2 + speed^2 ((1 - x^2)/2 - rotary) w'^2] dx : bending, centrifugal tension and
    rotary inertia; T = 1/2 int [w_dot^2 + rotary w'_dot^2] dx.
    """
    x, weight = np.polynomial.legendre.leggauss(40)
    x, weight = (x + 1.0) / 2.0, weight / 2.0
    shapes = [Legendre.basis(k, domain=[0.0, 1.0]) for k in range(16)]
    if not free:
        square = Legendre.fit([0.0, 0.5, 1.0], [0.0, 0.25, 1.0], 2, domain=[0.0, 1.0])
        shapes = [square * shape for shape in shapes]
    w, slope, curvature = (np.array([s.deriv(n)(x) for s in shapes]) for n in range(3))
    tension = speed**2 * ((1.0 - x**2) / 2.0 - rotary)
    stiffness = (curvature * weight) @ curvature.T + (slope * (tension * weight)) @ slope.T
    mass = (w * weight) @ w.T + rotary * (slope * weight) @ slope.T
    values = eigh(stiffness, mass, eigvals_only=True)
    return np.sqrt(values[2:5] if free else values[:3])


def across(found):
    """(3,) lowest angular frequencies, and their errors, of the modes that move along z."""
    moves = np.abs(found.shape[:, :, 2]).max(axis=1) > 1e-3
    moves[: found.zeros] = False
    return 2.0 * np.pi * found.frequency[moves][:3], found.error[moves][:3]


def bending(degree, elements, free=False):
    """Modes of a cantilever or of a free beam."""
    if not free:
        return modes(at_start(cantilever(degree, elements, BENDING, inertia=ROTARY)))
    line = straight(degree, elements)
    beam, nodes = build_beam("Beam", line, section(BENDING, inertia=ROTARY))
    return modes(at_start(build_model(nodes, beams=(beam,))))


def test_ritz_has_the_frequencies_of_closed_forms_and_of_published_blades():
    """Wright, Smith, Thresher and Wang 1982: five digits."""
    assert ritz(0.0) == pytest.approx(CLAMPED**2, rel=1e-10)
    assert ritz(0.0, free=True) == pytest.approx(FREE**2, rel=3e-10)
    published = {
        1.0: (3.6816, 22.181, 61.842),
        3.0: (4.7973, 23.320, 62.985),
        6.0: (7.3604, 26.809, 66.684),
    }
    for speed, values in published.items():
        assert ritz(0.0, speed) == pytest.approx(values, rel=1.5e-5)


@pytest.mark.slow
@pytest.mark.parametrize("free", [False, True])
def test_frequencies_of_bending_and_their_order_in_space(free):
    exact = ritz(J, free=free)
    for degree, elements, tolerance in ((1, 8, 0.5), (2, 6, 0.2), (3, 3, 1.3)):
        few, many = (
            np.abs(across(bending(degree, n, free))[0][0] / exact[0] - 1.0)
            for n in (elements, 2 * elements)
        )
        # The first mode, of which so few elements have the slope already.
        assert np.log2(few / many) == pytest.approx(2 * degree, abs=tolerance)
    found, error = across(bending(4, 4, free))
    # Measured: 1e-10, 1.3e-7, 8.4e-6 of a cantilever and 1.6e-7, 9.8e-6, 1.8e-4 of a free beam.
    most = np.array([2e-7, 1.1e-5, 2e-4]) if free else np.array([2e-9, 1.5e-7, 9e-6])
    assert (np.abs(found / exact - 1.0) < most).all()
    assert (error < 1e-5).all()


def test_without_rotary_inertia_the_closed_forms_follow():
    """A beam of degree 3 with J = 1e-9 lacks less than 1e-7 of the lowest frequency."""
    inertia = (2e-9, 1e-9, 1e-9)
    found, _ = across(modes(at_start(cantilever(3, 6, BENDING, inertia=inertia))))
    assert found == pytest.approx(CLAMPED**2, rel=3e-5)
    assert found[0] == pytest.approx(CLAMPED[0] ** 2, rel=1e-7)


def rotating(degree, elements, speed, stiffness=BENDING, **others):
    """A beam on a revolute joint in steady rotation about z: the state is an equilibrium in
    rotating axes. ``others``: length, mass and inertia.
    """
    line = straight(degree, elements, others.pop("length", 1.0))
    beam, nodes = build_beam("Beam", line, section(stiffness, **others))
    hub = Joint("Hub", "revolute", GROUND.name, nodes[0].name, ZERO, ZERO)
    model = build_model(nodes, [hub], beams=(beam,))
    start, spin = at_start(model), Spin(np.array([0.0, 0.0, speed]), np.zeros(3))
    rest = grown(Statics(start.system, start.state, spin), start.state)
    assert rest.converged
    return complete(model, start.system, with_rates(rest.state, spin))


@pytest.mark.parametrize("speed", [1.0, 6.0])
def test_a_rotating_blade_flaps_at_the_frequencies_of_ritz(speed):
    found = modes(rotating(4, 4, speed, inertia=ROTARY))
    assert found.equilibrium.holds
    assert found.equilibrium.axes == pytest.approx((0.0, 0.0, speed), abs=1e-12)
    # As of the cantilever at rest: up to 7e-9, 1.3e-7 and 8.4e-6; six elements leave 4e-10, 5e-9
    # and 3e-7.
    difference = np.abs(across(found)[0] / ritz(J, speed) - 1.0)
    assert (difference < (1e-8, 2e-7, 1e-5)).all()


def test_a_blade_stretches_by_the_closed_form():
    """EA u'' + mu w^2 (x + u) = 0: u(L) = tan(kL)/k - L with k = w sqrt(mu/EA)."""
    stiffness = (2.8e7, 1e7, 1e7, 1.4e4, 1.4e4, 1.4e4)
    point = rotating(3, 2, 6.0, stiffness, length=10.0, mass=1.2)
    k = 6.0 * np.sqrt(1.2 / 2.8e7)
    extension = np.linalg.norm(point.state.x[len(point.model.bodies) - 1]) - 10.0
    # Positions of 10 m are known to 2e-15.
    assert extension == pytest.approx(np.tan(10.0 * k) / k - 10.0, abs=2e-14)
    assert extension == pytest.approx(5.143174e-4, abs=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "steps", "order"), [("preserving", 40, 2), ("gauss2", 20, 4)])
def test_the_right_angle_converges_in_time(scheme, steps, order):
    """Its tip at 1 s, until when the load grows evenly. Fast vibrations, which no
    step resolves, leave 1e-8.
    """
    model = deck("right_angle")

    def tip(scheme, steps):
        return simulate(model, dt=1.0 / steps, t_final=1.0, scheme=scheme).of("position")[-1]

    exact = tip("gauss3", 100)
    few, many = (np.abs(tip(scheme, n) - exact).max() for n in (steps, 2 * steps))
    # Measured: 2.05 and 3.8.
    assert np.log2(few / many) == pytest.approx(order, abs=0.4)
    assert many < 1e-5


def motion_after_the_loads(name, loaded, dt, free, steps):
    """Energy less the work of the loads, momenta, and iterations and factorisations per step: when
    the loads end at ``free``, reached by steps of the size ``loaded``, and after ``steps`` of size
    ``dt`` more.
    """
    model = deck(name)
    model = replace(model, simulation=replace(model.simulation, dt=dt, scheme="preserving"))
    work = SubsystemIntegrator(model, "newton", True, 10).workspace
    monitor, take_step = work.monitor, compiled(newton.take_step)

    def advance(size, count):
        begun = work.counts.copy()
        for _ in range(count):
            residual, _ = take_step(work, size, 1.0)
            assert residual < 1e-11
        of = energy_balance(work.system, work.state, work.start, monitor.violation, monitor.rate)
        # The balance is the energy less the work of the loads.
        energy, sums = of + work.state.work.sum(), momentum(work.system, work.state, work.start)
        return energy, sums, (work.counts - begun) / count

    return advance(loaded, round(free / loaded)), advance(dt, steps)


def assert_kept(name, before, after):
    """Energy, and of a free beam momentum and angular momentum, stay to 1e-10."""
    energy, sums, _ = before
    later, now, _ = after
    assert energy > 1.0
    assert abs(later - energy) < 1e-10 * energy
    if name == "spaghetti":
        assert np.abs(now.P - sums.P).max() < 1e-10 * sums.P_size
        assert np.abs(now.L - sums.L).max() < 1e-10 * sums.L_size


LONG_MOTIONS = [
    ("spaghetti", 0.1, 0.1, 5.0),
    ("spaghetti", 0.5, 0.5, 5.0),
    ("spaghetti", 0.1, 1.0, 5.0),
    ("right_angle", 0.25, 0.25, 2.0),
    ("right_angle", 2.5, 2.5, 2.5),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "loaded", "dt", "free"), LONG_MOTIONS)
def test_energy_and_momenta_stay_after_the_loads_for_ten_thousand_steps(name, loaded, dt, free):
    before, after = motion_after_the_loads(name, loaded, dt, free, 10_000)
    assert_kept(name, before, after)


def test_steps_far_longer_than_the_vibrations_are_solved_by_newton():
    """Ten times the step of Simo and Vu-Quoc: accelerations alternate, so the start is the last
    step's motion. The prediction by accelerations fails once, with 25 iterations at most.
    """
    before, after = motion_after_the_loads("spaghetti", 0.1, 1.0, 5.0, 200)
    assert_kept("spaghetti", before, after)
    # Measured over 10,000 steps: 9.3 and 3.4.
    iterations, factorisations = after[2]
    assert iterations < 12.0
    assert factorisations < 5.0


FOUR_BAR = {
    1.0: (0.3077372634, 0.0990217779, -0.0020438808),
    2.0: (0.3518112371, 0.0433001005, -0.0038349498),
    3.5: (0.2645438784, 0.1173871491, -0.0033646877),
    5.0: (0.1508716241, 0.0803483115, -0.0004295224),
    7.0: (0.1218406420, 0.0206734244, 0.0027865699),
    9.0: (0.1472595325, 0.0760956678, 0.0024610467),
    11.0: (0.2773757011, 0.1140233864, -0.0010719591),
}
"""Position [m] of the hinge C of the four-bar linkage in equilibrium at the crank's angle at these
times. Independent of msahl: r' = R (e1 + C_n R^T n), R' = R [C_m R^T m]^, m' = -r' x n along the
three bars by Runge-Kutta's method, shooting for force and moment at A and the angles of B and C,
and continuation by arc length from 0 to 7.2 rad, in which the crank's angle never turns back. Twice
the steps along the bars change forces by 2e-7 N and angles by 4e-10.
"""
SECTION = {
    2.0: (-53.6276, 43.8288, -575.9109, 62.6115, 77.4238, 2.5067),
    9.0: (-46.2527, -22.7732, 174.8407, -14.5936, 60.7449, -1.3210),
}
"""Forces [N] and moments [N m] in bar AB at 0.5281754 of its length, likewise."""


@pytest.mark.slow
def test_the_four_bar_follows_its_equilibria_through_both_flat_positions():
    model = deck("flexible_four_bar")
    run = simulate(model, dt=0.02, error="off")
    row = {t: round(t / 0.02) for t in FOUR_BAR}
    end = [body.name for body in model.bodies].index(model.beams[1].nodes[-1])
    place = run.of("position", end)
    for t, expected in FOUR_BAR.items():
        # Motion within 1.4 s after the flat positions leaves 1.2e-7, of which half is along z.
        assert place[row[t]] == pytest.approx(expected, abs=1.5e-7)
    forces = run.others["beams"][:, 1:].reshape(len(place), -1, 12)[:, 6, 6:]
    for t, expected in SECTION.items():
        # The bar's own inertia is 0.02 N along it.
        assert forces[row[t]] == pytest.approx(expected, abs=0.03)


EXUDYN = {
    "right_angle": (2.0, (10.10626177, 9.30784516, 0.06925597), 1e-5),
    "spaghetti": (2.0, (1.64707324, 8.09337504, 0.28181863), 6e-5),
}
"""Time, place of the last node and tolerance: by Exudyn 1.13.6, ObjectBeamGeometricallyExact with
16 and 32 (right angle, per leg) or 32 and 64 elements, extrapolated with order 2 in space and in
time (generalized alpha, steps of 10 and 5 ms), with an error of 1e-5 and 2e-5. Twice the elements
change ours by 8e-6 and 5e-5.
"""


@pytest.mark.parametrize("name", EXUDYN)
def test_large_motions_in_space_are_those_of_exudyn(name):
    t, expected, tolerance = EXUDYN[name]
    tip = simulate(deck(name), dt=0.02, t_final=t, scheme="gauss2", error="off").of("position")[-1]
    assert tip == pytest.approx(expected, abs=tolerance)


def test_the_rod_of_the_slider_crank_bends_as_in_exudyn():
    """Its middle, 0.24 mm off the line of its ends at 0.02 s. By Exudyn 1.13.6 with 16 and 32
    elements, extrapolated as above, whose beams have no damping.
    """
    model = deck("flexible_slider_crank")
    (beam,) = model.beams
    model = replace(model, beams=(replace(beam, damping=(0.0,) * 6),))
    run = simulate(model, dt=1e-4, t_final=0.02, scheme="preserving", error="off")
    middle = [body.name for body in model.bodies].index(beam.nodes[len(beam.nodes) // 2])
    assert run.of("position", middle)[-1] == pytest.approx((0.2446269, 0.05406266, 0.0), abs=1e-6)


BLADE = """<data>
  <unitSystem>SI</unitSystem>
  <includes>
    <include href="part.xml" prefix="A."><set name="precone">0</set></include>
  </includes>
  <system><bodies><ground><name>Hub</name></ground></bodies></system>
  <simulation><title>Blade</title><deltaT>0.01</deltaT><tFinal>1</tFinal></simulation>
</data>
"""


def blade(tmp_path):
    """The blade of the wind rotor on a ground, without precone, damping and load."""
    copy(ROOT / "decks" / "elastic" / "parts" / "blade.xml", tmp_path / "part.xml")
    path = tmp_path / "blade.xml"
    path.write_text(BLADE, encoding="utf-8")
    changes = ("A.Blade.dampingTime=0", "A.Blade.degree=4", "A.Blade.elements=6")
    return read_deck(path, settings=changes)


def ritz_of_blade(count=14):
    """(4,) lowest frequencies [Hz] of a cantilever of 20 m with a rectangular section, linear from
    0.8 by 0.12 m to 0.4 by 0.04 m, that twists by -10 degrees: deflections and rotations in two
    planes, with shear, by ``count`` polynomials each.
    """
    E, G, rho, length = 30e9, 5e9, 1200.0, 20.0
    nu = E / (2.0 * G) - 1.0
    x, weight = np.polynomial.legendre.leggauss(60)
    s, weight = (x + 1.0) / 2.0, weight * length / 2.0
    b, h, angle = 0.8 - 0.4 * s, 0.12 - 0.08 * s, np.radians(-10.0) * s
    area, shear = b * h, 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu) * G * b * h
    domain = [0.0, length]
    shapes = [Legendre([0.5, 0.5], domain) * Legendre.basis(k, domain) for k in range(count)]
    value, slope = (np.array([f.deriv(n)(s * length) for f in shapes]) for n in range(2))
    none = np.zeros_like(value)

    def of(columns):
        """One of the fields v, w (deflections) and p, q (rotations about y, z), in all unknowns."""
        return np.concatenate([columns.get(name, none) for name in "vwpq"])

    def across(y, z):
        c, sine = np.cos(angle), np.sin(angle)
        return c * y + sine * z, c * z - sine * y

    def quadratic(pairs):
        return sum((field * (weight * factor)) @ field.T for field, factor in pairs)

    shears = across(of({"v": slope, "q": -value}), of({"w": slope, "p": value}))
    bends = across(of({"p": slope}), of({"q": slope}))
    rotations = across(of({"p": value}), of({"q": value}))
    I2, I3 = b * h**3 / 12.0, h * b**3 / 12.0
    K = quadratic([(f, shear) for f in shears] + list(zip(bends, (E * I2, E * I3), strict=True)))
    moved = [(of({name: value}), rho * area) for name in "vw"]
    M = quadratic(moved + list(zip(rotations, (rho * I2, rho * I3), strict=True)))
    return np.sqrt(eigh(K, M, eigvals_only=True, subset_by_index=[0, 3])) / (2.0 * np.pi)


def test_a_tapered_twisted_blade_has_the_frequencies_of_ritz(tmp_path):
    point, exact = at_start(blade(tmp_path)), ritz_of_blade()
    # The lowest is 1e-13 of the largest, squared: dense matrices must not take it for a zero.
    for method, tolerance in (("sparse", (1e-6, 1e-6, 1e-6, 1e-5)), ("dense", (1e-4,) * 4)):
        found = modes(point, 4, method=method)
        assert found.zeros == 0
        assert (np.abs(found.frequency / exact - 1.0) < tolerance).all()
