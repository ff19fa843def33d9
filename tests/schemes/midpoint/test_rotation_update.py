"""The rotation increment of a step by the Cayley map and by the exponential map."""

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from lxml import etree

from msahl.algebra.rotation import angle_share, of_angle
from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.model.scheme import EXPONENTIAL
from msahl.run.explain import explain
from tests.support.models import (
    DECKS,
    body,
    build_model,
    chain,
    deck,
)
from tests.support.models import (
    simulate_and_estimate as simulate,
)
from tests.support.reference_motions import euler_motion, top_path

(TOP,) = (path for path in DECKS if path.stem == "top_1")
SPIN = (0.0, 0.9888, 7.5167)


def exponential(model):
    return replace(model, simulation=replace(model.simulation, rotation_update=EXPONENTIAL))


@pytest.mark.parametrize("size", [0.0, 1e-9, 0.05, 0.0999999, 0.1, 0.7, 5.0, 1e3])
def test_the_share_of_the_angle(size):
    """On both sides of q = 0.01, where a series ends."""
    u = np.array([2.0, -1.0, 2.0]) / 3.0
    psi, g = angle_share(tuple(size * u))
    angle = 2.0 * np.arctan(0.5 * size)
    assert psi * size == pytest.approx(angle, rel=4e-16)
    # From d psi/dn = (1/(1 + n^2/4) - psi)/n, which cancels to 1e-16/n^2 of itself.
    if size >= 0.05:
        slope = (1.0 / (1.0 + 0.25 * size**2) - angle / size) / size
        assert g * size == pytest.approx(slope, rel=1e-12)
    else:
        assert g == pytest.approx(-1.0 / 6.0, rel=1e-12)
    # Near half a revolution the tangent magnifies the angle's round-off by itself.
    if angle < 3.0:
        assert of_angle(tuple(angle * u)) == pytest.approx(size * u, rel=1e-14, abs=1e-300)


def test_a_guess_of_half_a_rotation_stays_finite():
    assert np.linalg.norm(of_angle((0.0, 4.0, 0.0))) < 50.0


@pytest.mark.slow
@pytest.mark.parametrize("solver", ["newton", "root"])
def test_a_top_is_six_times_nearer_at_the_same_step(solver):
    known = top_path(10.0, np.radians(10.0), SPIN)
    errors = []
    for model in (deck("top_1"), exponential(deck("top_1"))):
        run = simulate(model, dt=0.01, t_final=10.0, solver=solver)
        assert (run.report.status, run.report.subdivisions) == ("completed", 0)
        # A hundred times its round-off; without psi in (d) it would be 1e-7.
        assert run.report.extremes["energyErrorMaxRelative"] < 1e-13
        errors.append(np.linalg.norm(run.of("position", -1)[-1] - known))
    # Measured: 5.9.
    assert errors[0] > 5.0 * errors[1]


def test_the_top_is_approached_with_order_two():
    known = top_path(10.0, np.radians(10.0), SPIN)
    steps, errors = [0.02, 0.01, 0.005, 0.0025], []
    for h in steps:
        run = simulate(exponential(deck("top_1")), dt=h, t_final=10.0)
        errors.append(np.linalg.norm(run.of("position", -1)[-1] - known))
    assert np.diff(np.log(errors)) / np.diff(np.log(steps)) == pytest.approx(2.0, abs=0.1)


def test_it_takes_no_more_iterations():
    """The derivative is that of the residual, and the guess is one of angles."""
    counts = [
        simulate(model, dt=0.01, t_final=5.0, solver="newton").report.iterations
        for model in (deck("top_1"), exponential(deck("top_1")))
    ]
    assert counts[1] <= 1.05 * counts[0]


def test_the_orientation_of_a_free_body_is_nearer():
    """By a fifth of the error; its spin, about the middle axis, is farther off."""
    inertia, w = (0.2, 0.3, 0.5), (0.1, 4.0, 0.2)
    free = build_model([body(inertia=inertia, angular_velocity=w)], t_final=5.0)
    known = euler_motion(np.diag(inertia), w, np.eye(3), [0.0, 5.0])[1][-1]
    errors = []
    for model in (free, exponential(free)):
        run = simulate(model, dt=0.01, t_final=5.0)
        # Twice what is left of a step, 3e-15, in 500 of them.
        assert run.report.extremes["energyErrorMaxRelative"] < 3e-12
        errors.append(np.abs(run.matrices(0)[-1] - known).max())
    assert errors[0] > 3.0 * errors[1]


def test_of_a_free_chain_no_angular_momentum_is_asked():
    """By the tangent it is kept to round-off, by the angle to order 2."""
    free = chain(4)
    first, *rest = free.bodies
    free = replace(
        free,
        joints=free.joints[:-1],
        gravity=(0.0, 0.0, 0.0),
        bodies=(replace(first, angular_velocity=(1.0, 4.0, 2.0)), *rest),
    )
    asked = []
    for model in (free, exponential(free)):
        checks = simulate(model, dt=0.01, t_final=1.0).report.verdict["checks"]
        asked.append({name: of["word"] for name, of in checks.items() if "Momentum" in name})
    linear = {"linearMomentum": "PASS"}
    assert asked == [linear | {"angularMomentum": "PASS"}, linear]


def test_the_decaying_scheme_has_it_too():
    model = exponential(deck("top_3"))
    run = simulate(model, dt=0.01, t_final=5.0, scheme="decaying")
    # Twice what is left of a step, 3e-15, in 500 of them.
    assert run.report.extremes["energyErrorMaxRelative"] < 3e-12
    assert run.report.extremes["energyTaken"] > 0.0


def test_more_than_half_a_rotation_in_a_step_is_taken_in_parts():
    """No rotation increment is as large by its angle; by its tangent any spin is some rotation."""
    spinning = build_model([body(angular_velocity=(0.0, 0.0, 400.0))], t_final=0.1)
    assert simulate(spinning, dt=0.01, full=True).report.subdivisions == 0
    report = simulate(exponential(spinning), dt=0.01, full=True).report
    assert report.status == "completed"
    assert report.subdivisions > 0


def test_the_deck_and_the_command_line_choose_it(tmp_path):
    own = tmp_path / "deck.xml"
    tree = etree.parse(TOP)
    tree.find("simulation").set("rotationUpdate", "exponential")
    tree.write(own)
    model = read_deck(own)
    assert model.simulation.rotation_update == EXPONENTIAL
    assert "updated by the exponential map" in "\n".join(explain(model))
    runs = (own, "deck"), (TOP, "option", "--rotation-update", "exponential"), (TOP, "cayley")
    for path, name, *options in runs:
        words = ["run", path, "--dt", 0.01, "--t-final", 0.1, "-q", "-o", tmp_path / name, *options]
        assert CliRunner().invoke(main, [str(word) for word in words]).exit_code == 0
    made = {name: (tmp_path / name / "states.csv").read_bytes() for _, name, *_ in runs}
    assert made["deck"] == made["option"] != made["cayley"]
    assert '"rotationUpdate": "exponential"' in (tmp_path / "option" / "run.json").read_text()
    assert read_deck(tmp_path / "option" / "deck.xml").simulation.rotation_update == EXPONENTIAL
    assert '"rotationUpdate": "cayley"' in (tmp_path / "cayley" / "run.json").read_text()
