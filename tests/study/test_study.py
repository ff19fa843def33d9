"""Studies: errors, orders, references, the recommendation, the report, the command."""

import json
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.algebra.rotation_arrays import angles
from msahl.cli.main import main
from msahl.cli.study import study as command
from msahl.deck import read_deck
from msahl.model import Options
from msahl.model.scheme import ORDER_TWO, decaying
from msahl.post.draw import style
from msahl.results.read import ResultError
from msahl.study import independent as independent_module
from msahl.study import page, reference_cache
from msahl.study.dynamics import Dynamics
from msahl.study.independent import independent
from msahl.study.page import recommendation, write_study
from msahl.study.pictures import pictures
from msahl.study.plan import Plan
from msahl.study.runs import run_in_memory, with_step
from msahl.study.study import study
from tests.support.closed_forms import recognise

DECKS = Path(__file__).parents[2] / "decks"
HALVED = (0.02, 0.01, 0.005, 0.0025)


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    """References are made, not found."""
    monkeypatch.setattr(
        reference_cache.platformdirs, "user_cache_dir", lambda *a, **k: str(tmp_path / "cache")
    )


patient_plan = partial(Plan, reference="independent")
"""A plan whose reference may take any time: that of "auto" depends on how busy the machine is."""


def deck(name, t_final=2.0):
    model = read_deck(DECKS / f"{name}.xml")
    return with_step(model, model.simulation.dt, t_final)


STATE = ("position", "orientation", "velocity", "angular_velocity")
FORCES = ("mean_reaction", "instantaneous_reaction")
ORDERS = {
    "thesis/single_pendulum_45": (*STATE, *FORCES),
    "thesis/single_pendulum_135": (*STATE, *FORCES),
    "thesis/double_pendulum_89": (*STATE, *FORCES),
    "basics/conical_pendulum": (*STATE[:3], *FORCES),  # its spin is kept to round-off
    "thesis/top_1": (*STATE, "instantaneous_reaction"),
    "thesis/top_2": (*STATE, "instantaneous_reaction"),
    "thesis/top_3": (*STATE, "instantaneous_reaction"),
    "basics/ballistic_cylinder": ("orientation", "angular_velocity"),
    "basics/ballistic_sphere": ("orientation",),
    "basics/torque_free": ("orientation", "angular_velocity"),
    "forces/slide_spring": ("position", "velocity"),
    "forces/spring_damper": ("position", "velocity"),
    "forces/torsional_spring": ("orientation", "angular_velocity"),
}


@pytest.mark.parametrize("name", ORDERS)
def test_observed_orders(name):
    result = study(patient_plan(deck(name), HALVED, ("preserving",), repeats=1))
    for key in ORDERS[name]:
        fit = result.fits["preserving", key]
        assert fit is not None, key
        assert fit.order == pytest.approx(2.0, abs=0.1), key


@pytest.mark.parametrize(("scheme", "order"), [("preserving", 2), ("gauss2", 4)])
def test_orders_through_impacts(scheme, order):
    """A pendulum that hits a wall: five impacts, compared with runs at small steps."""
    model = deck("contact/pendulum_at_a_wall", t_final=1.5)
    result = study(Plan(model, (0.04, 0.02, 0.01, 0.005), (scheme,), repeats=1))
    assert "has no contacts and events" in result.reference.description
    fit = result.fits[scheme, "orientation"]
    assert fit is not None
    assert fit.order == pytest.approx(order, abs=0.3)  # steps that events end are shorter
    assert result.fits.get((scheme, "instantaneous_reaction")) is None


def test_an_independent_reference_has_no_contacts():
    with pytest.raises(ResultError, match="neither contacts nor events: use --reference auto"):
        study(patient_plan(deck("contact/pendulum_at_a_wall"), HALVED, ("preserving",), repeats=1))


@pytest.mark.parametrize("name", ["thesis/top_1", "thesis/top_3"])
def test_mean_reactions_of_the_top_alternate_by_an_order_one(name):
    # The first velocities close the joint exactly, the later ones to O(h^2): the difference stays
    # as an alternation of the means. Two steps' mean, at their common row, is of order 2.
    exact, errors = recognise(deck(name)), []
    for dt in (0.002, 0.001):
        _, run = run_in_memory(with_step(deck(name), dt), Options())
        force = run.reactions.to_numpy()[:, 1:]
        two = 0.5 * (force[1:-1] + force[2:]) - exact.forces(run.time[1:-1])
        errors.append(np.abs(two).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_instantaneous_forces_balance():
    # Weight and centripetal force of a pendulum at rest, in closed form.
    model = deck("thesis/single_pendulum_45")
    dynamics = Dynamics(model)
    (body,) = model.bodies
    inertia, m, L, g = 0.008, body.mass, 5.0, 9.80665
    s = np.sqrt(0.5)
    tangential = m * g * s * m * L**2 / (m * L**2 + inertia)  # the part the swing takes
    expected = np.array([-tangential * s, 0.0, tangential * s - m * g])
    # One 9-unknown linear system, numbers up to 20 N.
    np.testing.assert_allclose(
        dynamics.forces(np.zeros(1), dynamics.table)[0], expected, atol=1e-12
    )


def test_a_scheme_registered_later_appears(monkeypatch, tmp_path):
    monkeypatch.setitem(ORDER_TWO, "later", lambda damping: decaying(0.2))
    model, schemes = deck("thesis/single_pendulum_45", 1.0), ("preserving", "decaying", "later")
    assert "later" in patient_plan(model).studied
    result = study(patient_plan(model, HALVED[:3], schemes, repeats=1))
    assert result.schemes == list(schemes)
    monkeypatch.setattr(page, "_pictures", lambda study: [])  # drawn below, and not saved
    write_study(result, tmp_path)
    assert "later" in (tmp_path / "study.csv").read_text()
    with style():
        for _, _, figure in pictures(result):
            labels = [text.get_text() for text in figure.legends[0].get_texts()]
            assert [label for label in labels if ":" not in label] == [
                "preserving",
                "decaying",
                "later",
            ]


def test_errors_are_those_against_the_closed_form():
    model = deck("thesis/single_pendulum_45")
    plan = patient_plan(model, (0.1, 0.05), ("gauss5",), repeats=1)
    measured, true = study(plan), study(plan, reference=recognise(model))
    for one, other in zip(measured.runs, true.runs, strict=True):
        for key in (*STATE, "instantaneous_reaction"):
            # Of 5 m, m/s, N: the solutions differ by 2e-12, and a study measures down to 1e-10.
            assert one.largest(key) == pytest.approx(other.largest(key), abs=2e-11), key


def test_stored_run_as_reference(tmp_path):
    name = DECKS / "thesis" / "double_pendulum_45.xml"
    settings = ["--t-final", "2", "-q"]
    stored = ["run", str(name), "--dt", "0.0005", *settings, "-o", str(tmp_path / "fine")]
    assert CliRunner().invoke(main, stored).exit_code == 0
    plan = patient_plan(deck("thesis/double_pendulum_45"), HALVED, ("preserving",), repeats=1)
    by_run = study(replace(plan, reference=str(tmp_path / "fine")))
    by_ode = study(plan)
    one, other = (result.runs[0].largest("position") for result in (by_run, by_ode))
    # The stored run's own error is (0.0005/0.02)^2 of the one measured.
    assert one == pytest.approx(other, rel=2e-3)
    # Mid-steps of 0.0025 s are not among its rows; those of 0.02 and 0.01 s are.
    assert by_run.runs[0].largest("mean_reaction") is not None


def test_horizon_of_a_chaotic_model():
    model = deck("thesis/double_pendulum_135", 60.0)
    times = np.linspace(0.0, 60.0, 601)
    reference = independent(model, times, 1e-6)
    # It parts from 1e-10 by five decades and more; by 60 s nothing is left of either.
    assert 10.0 < reference.horizon < 50.0
    assert "not reported" in reference.description
    result = study(patient_plan(model, (0.04, 0.02, 0.01), ("preserving",), repeats=1))
    assert result.reference.horizon < 50.0
    point = result.runs[0]
    assert point.largest("position") is not None
    assert point.trial.run.time[-1] == pytest.approx(60.0)
    assert point.largest("energy_over_kinetic") < 1e-10  # over all of the run
    kept = [p.errors.within_until("position", 0.1) for p in result.runs]
    assert kept == sorted(kept)  # finer steps follow it longer
    assert 1.0 < kept[0] < kept[-1] < result.reference.horizon


def test_reference_is_cached(monkeypatch):
    model, times = deck("thesis/double_pendulum_45"), np.linspace(0.0, 1.0, 11)
    first = independent(model, times, 1e-6)
    monkeypatch.setattr(independent_module, "_compared", None)
    second = independent(with_step(model, 0.5), times, 1e-6)
    np.testing.assert_array_equal(first.states(times), second.states(times))


def test_a_damaged_reference_is_computed_again():
    model, times = deck("thesis/double_pendulum_45"), np.linspace(0.0, 0.2, 3)
    first = independent(model, times, 1e-6)
    (file,) = reference_cache.cache_folder().iterdir()
    content = bytearray(file.read_bytes())
    content[-200] ^= 1  # one bit of a number
    file.write_bytes(content)
    assert reference_cache.load(model, times, 1e-6) is None
    second = independent(model, times, 1e-6)
    np.testing.assert_array_equal(first.states(times), second.states(times))
    assert reference_cache.load(model, times, 1e-6) is not None


def test_no_run_meets_the_target():
    plan = patient_plan(
        deck("thesis/single_pendulum_45"), (0.1, 0.05), ("preserving",), target=1e-9
    )
    result = study(plan)
    assert result.fastest is None
    assert "No run of this study" in recommendation(result)


def test_errors_of_a_rotated_body():
    # Small angles keep their digits; p and its shadow parameters are one orientation.
    p = np.array([[0.5, 0.1, -0.2]])
    assert angles(p + np.array([1e-9, 0, 0]), p)[0] == pytest.approx(1e-9, rel=0.1)
    assert angles(p, -16.0 * p / (p @ p.T))[0] == pytest.approx(0.0, abs=1e-7)


def test_pictures_can_be_read():
    plan = patient_plan(
        deck("thesis/single_pendulum_45"), HALVED, ("preserving", "decaying"), repeats=1
    )
    result = study(replace(plan, target=1e-4))
    with style():
        for name, caption, figure in pictures(result):
            assert name
            assert caption
            figure.canvas.draw()
            legend = figure.legends[0].get_window_extent()
            shown = [axes for axes in figure.axes if axes.axison]
            for axes in shown:
                assert axes.get_xlabel().endswith(("[s]", "seconds of the loop"))
                assert axes.get_ylabel()
                assert not legend.overlaps(axes.get_window_extent())
            if name == "error-step":
                # A triangle with its slope at position, orientation, velocities, reactions.
                texts = [t.get_text() for axes in shown for t in axes.texts]
                assert sum(t.startswith(("1.9", "2.0")) for t in texts) >= 6


def test_a_target_far_outside_leaves_space_for_the_axes():
    plan = patient_plan(deck("thesis/single_pendulum_45"), HALVED, ("preserving",), repeats=1)
    with style():
        _, _, figure = next(iter(pictures(study(replace(plan, target=1e20)))))
        figure.canvas.draw()  # warns, which is an error in tests, if words leave no space
        legend = figure.legends[0].get_window_extent()
        assert not legend.overlaps(figure.axes[0].get_window_extent())


@pytest.mark.parametrize("arguments", [["--reference", "nowhere"], ["--dt", "99"]])
def test_faults_are_reported(arguments, tmp_path):
    name = str(DECKS / "thesis" / "double_pendulum_45.xml")
    result = CliRunner().invoke(command, [name, *arguments, "-o", str(tmp_path)])
    assert result.exit_code == 2
    assert result.stderr


def test_a_run_does_not_import_the_study():
    code = (
        "import sys, msahl.cli.main, msahl.run.loop\n"
        "print([m for m in sys.modules if 'study' in m])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout.replace("'", '"')) == []


def test_forces_of_states_beyond_all_numbers_are_nan():
    """A diverged run is judged, not a fault; Bricard's joints are redundant."""
    dynamics = Dynamics(deck("mechanisms/bricard"))
    table = np.repeat(dynamics.table, 2, axis=0)
    table[1] = np.nan
    forces = dynamics.forces(np.array([0.0, 0.1]), table)
    assert np.isfinite(forces[0]).all()
    assert np.isnan(forces[1]).any()
