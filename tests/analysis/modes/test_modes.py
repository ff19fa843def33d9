"""Modes of models whose eigenvalues are known in closed form, or published."""

from dataclasses import replace

import numpy as np
import pytest

import msahl
from msahl.algebra.vector import ZERO
from msahl.analysis.linearised.point import at_start, at_time
from msahl.analysis.modes.eigenvalues import eigenvalues
from msahl.analysis.modes.solution import modes
from msahl.deck import read_deck
from msahl.model import Joint
from msahl.start.velocities import StartError
from tests.support.models import GROUND, ROOT, body, build_model, deck, free_bodies, pendulum

BICYCLE = ROOT / "decks" / "mechanisms" / "bicycle.xml"
PUBLISHED = {
    0: (-5.53094371765393, -3.13164324790656, 3.13164324790656, 5.53094371765393),
    2: (-8.67387984831735, -3.07158645641514, 2.68234517512745 + 1.68066296590675j),
    4: (-12.15861426576447, -1.42944427361326, 0.41325331521125 + 3.07910818603206j),
    6: (-16.0853712309803, -0.00406690076970, -1.52644486584142 + 5.87673060598709j),
    8: (-20.27940894394569, 0.14327879765713, -2.69348683581097 + 8.46037971396931j),
    10: (-24.62459635017404, 0.16105338653172, -3.72016840437287 + 10.90681139476287j),
}
"""Meijaard et al. 2007, table 2: eigenvalues [1/s] by speed [m/s]."""
CHAINS = {
    1: (1.22474487,),
    2: (0.85569455, 2.29516597),
    3: (0.69636768, 1.73205081, 3.27221328),
    10: (0.38035152, 0.88124412, 1.41807451, 2.01212418),
}
"""Frequencies of hanging slender rods in sqrt(g/l), to the digits printed."""


@pytest.mark.parametrize("v", PUBLISHED)
def test_benchmark_bicycle_has_the_published_eigenvalues(v):
    found = modes(at_start(read_deck(BICYCLE, False, [f"v={v}"])))
    assert found.equilibrium.holds
    assert not found.warnings
    assert (found.zeros, found.degrees_of_freedom) == (6, 3)
    values = found.value[found.zeros :]
    assert len(values) == len(PUBLISHED[v])
    for published in PUBLISHED[v]:
        # 15 digits are published; capsize at 6 m/s has 12.
        error = np.abs(values - published).min()
        assert error <= max(1e-12 * abs(published), 2e-13)
    assert found.error.max() < 1e-11


def test_bicycle_is_stable_between_weave_and_capsize_speed():
    for v, stable in ((4.29, False), (4.295, True), (6.02, True), (6.03, False)):
        found = modes(at_start(read_deck(BICYCLE, False, [f"v={v}"])))
        assert (found.value.real.max() <= 0.0) == stable


def hanging(n, gravity=9.81, length=1.0, spinning=ZERO):
    """Slender rods on parallel hinges, hanging down along z."""
    J = np.diag([1.0, 1.0, 1e-3]) * length**2 / 12.0
    rods = [
        body(f"R{k}", 1.0, J, position=(0.0, 0.0, (k + 0.5) * length), angular_velocity=spinning)
        for k in range(n)
    ]
    names = [GROUND.name, *(rod.name for rod in rods)]
    above = [ZERO] + [(0.0, 0.0, 0.5 * length)] * n
    axes = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    joints = [
        Joint(f"H{k}", "revolute", names[k], names[k + 1], above[k], (0.0, 0.0, -0.5 * length),
              axes, axes)
        for k in range(n)
    ]  # fmt: skip
    return build_model(rods, joints, gravity=(0.0, 0.0, gravity))


@pytest.mark.parametrize("n", CHAINS)
def test_hanging_chain_of_rods_has_its_frequencies(n):
    found = modes(at_start(hanging(n)))
    frequencies = 2.0 * np.pi * found.frequency / np.sqrt(9.81)
    exact = chain_frequencies(n)
    assert np.abs(frequencies - exact).max() <= 1e-12 * exact.max()
    assert np.abs(exact[: len(CHAINS[n])] - CHAINS[n]).max() <= 6e-9
    assert np.abs(found.value.real).max() <= 1e-12
    assert np.abs(found.damping).max() <= 1e-12


@pytest.mark.parametrize(
    ("n", "printed"),
    [(2, (0.76536686, 1.84775907)), (3, (0.64480583, 1.51468821, 2.50797629))],
)
def test_hanging_chain_of_point_masses_has_its_frequencies(n, printed):
    # Distances between mass centres: the bodies' rotations are rigid-body modes.
    balls = [body(f"P{k}", 1.0, (0.4, 0.4, 0.4), (0.0, 0.0, k + 1.0)) for k in range(n)]
    names = [GROUND.name, *(ball.name for ball in balls)]
    lengths = [
        Joint(
            f"D{k}", "distance", names[k], names[k + 1], ZERO, ZERO, parameters=(("length", 1.0),)
        )
        for k in range(n)
    ]
    found = modes(at_start(build_model(balls, lengths, gravity=(0.0, 0.0, 9.81))))
    assert (found.zeros, found.rigid) == (6 * n, 3 * n)
    # Tension over length: k times the weight of one, above the k lowest masses.
    tension = np.arange(n, 0, -1.0)
    K = np.diag(tension + np.append(tension[1:], 0.0))
    K -= np.diag(tension[1:], 1) + np.diag(tension[1:], -1)
    exact = np.sqrt(np.linalg.eigvalsh(K))
    assert np.abs(exact - printed).max() <= 6e-9
    # Along x and along y.
    frequencies = found.value[found.zeros :].imag / np.sqrt(9.81)
    assert np.abs(frequencies - np.repeat(exact, 2)).max() <= 1e-12 * exact.max()


def chain_frequencies(n):
    """Of the angles of n rods of length and mass 1 at g = 1: K - w^2 M in closed form."""
    from scipy.linalg import eigh

    k = np.arange(n)
    later = n - 1 - np.maximum.outer(k, k)
    M = later + 0.5 + np.diag(np.full(n, 1.0 / 3.0 - 0.5))
    K = np.diag(n - 1 - k + 0.5)
    return np.sqrt(eigh(K, M, eigvals_only=True))


def sleeping_top(spin):
    """The thesis's top, upright: 0.75 and 0.44 kg m^2 about its pivot, m g l = 0.6 N m."""
    top = body("Top", 1.0, (0.4, 0.4, 0.75), (0.0, 0.0, 0.2), angular_velocity=(0.0, 0.0, spin))
    pivot = Joint("Pivot", "spherical", GROUND.name, "Top", ZERO, (0.0, 0.0, -0.2))
    return build_model([top], [pivot], gravity=(0.0, 0.0, -3.0))


def test_sleeping_top_has_its_frequencies():
    found = modes(at_start(sleeping_top(3.0)))
    assert found.equilibrium.holds
    # J' w^2 - J3 s w + m g l = 0 and, in inertial axes, the spin is the zero eigenvalue.
    exact = np.sort(np.roots([0.44, -0.75 * 3.0, 0.6]))
    lateral = np.sort(found.value.imag[found.zeros :])
    assert np.abs(lateral - exact).max() <= 1e-13
    assert np.abs(exact - [0.28224507, 4.83139130]).max() <= 6e-9
    (growing,) = (v for v in modes(at_start(sleeping_top(1.0))).value if v.real > 1e-3)
    assert growing == pytest.approx(0.79829040 + 0.85227273j, abs=6e-9)


def test_sleeping_top_is_stable_above_its_threshold():
    threshold = 2.0 * np.sqrt(0.44 * 0.6) / 0.75
    assert threshold == pytest.approx(1.3701581417, abs=6e-11)
    for spin, stable in ((threshold * (1 - 1e-9), False), (threshold * (1 + 1e-9), True)):
        found = modes(at_start(sleeping_top(spin)))
        # Here two eigenvalues meet: the growth is the root of the distance from the threshold.
        growth = found.value.real.max()
        exact = 0.75 * threshold * np.sqrt(2e-9) / (2 * 0.44)
        assert (growth < 0.01 * exact) if stable else (growth == pytest.approx(exact, rel=1e-3))


def test_unsymmetric_body_is_unstable_about_its_middle_axis():
    inertia = np.array([1.0, 2.0, 3.0])
    for axis in range(3):
        spin = tuple(2.0 * np.eye(3)[axis])
        found = modes(at_start(build_model([body("B", 1.0, inertia, angular_velocity=spin)])))
        assert found.equilibrium.holds
        assert np.allclose(found.equilibrium.axes, spin)
        a, b, c = (inertia[(axis + k) % 3] for k in range(3))
        rate = 2.0 * np.sqrt(complex(-(a - b) * (a - c) / (b * c)))
        assert np.abs(found.value - rate).min() <= 1e-12


def test_conical_pendulum_is_a_steady_motion_in_axes_that_rotate():
    point = at_start(deck("conical_pendulum"))
    found = modes(point)
    assert found.equilibrium.holds
    assert not found.equilibrium.at_rest
    later = modes(at_time(point.model, 0.37))
    assert later.equilibrium.relative < 1e-3


def test_modes_do_not_depend_on_redundant_joints_or_where_the_model_stands():
    one = hanging(2)
    # A second hinge on the same axis: five equations that follow from the first's.
    first = one.joints[0]
    second = replace(
        first, name="Again", parent_point=(0.0, 0.7, 0.0), child_point=(0.0, 0.7, -0.5)
    )
    found = modes(at_start(one)), modes(at_start(replace(one, joints=(*one.joints, second))))
    assert (found[0].redundant, found[1].redundant) == (0, 5)
    assert np.abs(found[0].value - found[1].value).max() <= 1e-12


def test_rigid_body_modes_are_counted_by_rank():
    found = modes(at_start(free_bodies_at_rest()))
    assert (found.zeros, found.rigid) == (24, 12)
    assert not found.value.any()


def free_bodies_at_rest():
    """Two bodies that nothing holds."""
    model = free_bodies(np.random.default_rng(2), 2, gravity=False)
    still = [replace(b, velocity=ZERO, angular_velocity=ZERO) for b in model.bodies]
    return replace(model, bodies=tuple(still))


def test_a_model_that_is_not_in_equilibrium_is_reported():
    found = modes(at_start(pendulum(45.0)))
    assert not found.equilibrium.holds
    # Half of the weight is not balanced across the rod, sin 45 deg cos 45 deg.
    assert found.equilibrium.residual == pytest.approx(2.0 * 9.80665 * 0.5, rel=1e-2)
    assert "no equilibrium" in found.warnings[0]
    assert "Bob" in found.warnings[0]
    upright = replace(pendulum(0.0), gravity=(0.0, 0.0, -9.80665))
    assert modes(at_start(upright)).value.real.max() > 1.0


def test_shapes_are_those_of_the_reference_points():
    model = hanging(1)
    rod = replace(model.bodies[0], r_BG=(0.0, 0.1, 0.2), position=(0.0, -0.1, 0.3))
    hinge = replace(model.joints[0], child_point=(0.0, 0.1, -0.3))
    found = modes(at_start(replace(model, bodies=(rod,), joints=(hinge,))))
    shape = found.shape[0, 0]
    # The reference point stands 0.3 m below the hinge's axis.
    assert shape[0] == pytest.approx(0.3 * shape[4])
    assert np.abs(shape[[1, 2, 3, 5]]).max() <= 1e-14


def test_round_off_of_zeros_is_not_balanced():
    found = eigenvalues(np.array([[-1e-200, 1.0], [1e-300, -1e-180]]))
    assert (found.zeros, found.null) == (2, 1)
    assert modes(at_time(deck("gear"), 0.01)).zeros == 2


def test_eigenvalues_of_a_matrix_with_jordan_blocks():
    rng = np.random.default_rng(3)
    J = np.diag([0.0, 0.0, 0.0, 0.0, -1e-3, 2.0, -40.0]) + np.diag([1.0, 1.0, 0, 0, 0, 0], 1)
    X = rng.normal(size=(7, 7))
    found = eigenvalues(X @ J @ np.linalg.inv(X))
    assert (found.zeros, found.null) == (4, 2)
    assert np.abs(found.value[4:] - [-1e-3, 2.0, -40.0]).max() <= 1e-11
    A = X @ J @ np.linalg.inv(X)
    residual = A @ found.vector - found.vector * found.value
    assert np.abs(residual[:, 4:]).max() <= 1e-10 * np.abs(found.vector[:, 4:]).max()
    errors = np.abs(found.value[4:] - [-1e-3, 2.0, -40.0])
    assert np.all(errors <= found.error[4:])


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ((-1,), "^at: it is -1; it must be a time"),
        (("never",), "^at: it is "),
        ((0.0, 0), "^number: "),
        ((0.0, None, -2.0), "^near: "),
        ((0.0, None, 0.0, "quick"), "^method: "),
    ],
)
def test_arguments_without_a_meaning_are_refused(words, expected):
    model = msahl.load(ROOT / "decks/basics/parameters.xml")
    with pytest.raises(msahl.OptionError, match=expected):
        model.modes(*words)


def test_too_many_rigid_body_modes_are_refused_without_matrices(monkeypatch):
    bodies = [body(f"B{k}", 1.0, np.eye(3), (float(k), 0.0, 0.0)) for k in range(101)]
    name = "msahl.analysis.modes.solution.pencil"
    monkeypatch.setattr(name, lambda *_: pytest.fail("matrices were built"))
    with pytest.raises(StartError, match="at least 606 rigid-body modes"):
        modes(at_start(build_model(bodies)))
