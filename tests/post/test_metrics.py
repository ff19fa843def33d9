"""Measures of hand-made runs whose energies, violations and works are known in closed form."""

import json
import math

import numpy as np
import pytest

from msahl.algebra.rotation import matrix
from msahl.formulations.absolute import rigid_body
from msahl.post.compare import compare
from msahl.post.metrics import Energy, Statistics, compute_metrics
from msahl.post.summary import energy_table, no_work_note, partial_note, work_table
from msahl.post.table import as_csv, as_json, as_text
from msahl.post.tolerance import Tolerance
from msahl.results.read import ResultError, read_run, read_table
from msahl.system import evaluate
from msahl.system.arrays import new_system_workspace
from msahl.system.build import build_system
from msahl.system.state import build_state
from tests.support.run_folders import (
    ALPHA,
    DT,
    FORCE,
    GRAVITY,
    INERTIA,
    LENGTH,
    MASS,
    OMEGA,
    RADIUS,
    conical_rows,
)
from tests.support.run_folders import read as read_conical
from tests.support.run_folders import write as write_conical

ROUND_OFF = 1e-14
"""A few dozen operations on doubles of size one; results are compared in units of their size."""


def test_the_conical_pendulum_has_no_error(tmp_path):
    metrics = compute_metrics(read_conical(tmp_path))
    energy, joints = metrics.energy, metrics.constraints
    assert energy.absolute_error.max < ROUND_OFF * abs(energy.total[0])
    assert np.nanmax(joints.violation) < ROUND_OFF * LENGTH
    assert np.nanmax(joints.rate) < ROUND_OFF * joints.speed
    assert np.abs(metrics.work.reaction).max() < ROUND_OFF * LENGTH * MASS * GRAVITY
    assert joints.speed == pytest.approx(OMEGA * RADIUS, rel=ROUND_OFF)
    assert joints.length == LENGTH


def test_energies_are_those_of_the_formulas(tmp_path):
    energy = compute_metrics(read_conical(tmp_path)).energy
    assert energy.linear == pytest.approx(0.5 * MASS * (OMEGA * RADIUS) ** 2, rel=ROUND_OFF)
    assert energy.rotational == pytest.approx(0.5 * INERTIA * OMEGA**2, rel=ROUND_OFF)
    depth = LENGTH * math.cos(ALPHA)
    assert energy.potential == pytest.approx(-MASS * GRAVITY * depth, rel=ROUND_OFF)


def test_a_moved_row_shows_its_violation_its_energy_and_its_work(tmp_path):
    states, reactions = conical_rows()
    move = np.array([1e-3, -2e-3, 4e-3])
    states[3, 1:4] += move
    metrics = compute_metrics(read_conical(tmp_path, states, reactions))
    violation = metrics.constraints.violation[:, 0, 0]
    assert violation[3] == pytest.approx(
        np.linalg.norm(move), rel=1e-11
    )  # cancelled from lengths of 5 m
    assert np.delete(violation, 3).max() < ROUND_OFF * LENGTH
    assert metrics.energy.error[3] == pytest.approx(-MASS * GRAVITY * move[2], rel=1e-11)
    # The joint opens over step 3 and closes over step 4.
    force, sharp = reactions[:, 1:], metrics.work.reaction[:, 0]
    assert sharp[2] == pytest.approx(force[3] @ move, rel=1e-10)
    assert sharp[3] == pytest.approx(-force[4] @ move, rel=1e-10)


def test_a_row_with_another_velocity_shows_its_violation_rate(tmp_path):
    states, reactions = conical_rows()
    kick = np.array([0.1, 0.2, -0.3])
    states[5, 7:10] += kick  # body axes: the size is the same in any
    rate = compute_metrics(read_conical(tmp_path, states, reactions)).constraints.rate[:, 0, 0]
    assert rate[5] == pytest.approx(np.linalg.norm(kick), rel=1e-12)
    assert np.delete(rate, 5).max() < ROUND_OFF * OMEGA * LENGTH


def test_hainges_measure_by_hand(tmp_path):
    # The true mean force over a step points along its middle, the velocity carried to the end of
    # the step lies half a step's rotation ahead: lam . C V dt = m Omega^3 r^2 sin(Omega dt / 2) dt.
    states, reactions = conical_rows(force_at=-0.5 * DT)
    work = compute_metrics(read_conical(tmp_path, states, reactions)).work
    expected = MASS * OMEGA**3 * RADIUS**2 * math.sin(0.5 * OMEGA * DT) * DT
    assert work.hainge[:, 0] == pytest.approx(expected, rel=1e-11)
    assert Statistics.of(work.hainge[:, 0]).mean == pytest.approx(expected, rel=1e-11)


def test_hainges_measure_takes_the_velocity_of_rows_before_and_after(tmp_path):
    states, reactions = conical_rows()
    states[2, 7:10] = (1.0, 2.0, 3.0)
    work = compute_metrics(read_conical(tmp_path, states, reactions)).work
    for end in (2, 3):
        C = np.array(matrix(tuple(states[end, 4:7])))
        mean = 0.5 * (states[end - 1, 7:10] + states[end, 7:10])
        assert work.hainge[end - 1, 0] == pytest.approx(reactions[end, 1:] @ C @ mean * DT)


def test_recall_undoes_publish(tmp_path):
    run = read_conical(tmp_path)
    system = build_system(run.model)
    system.bodies.r_BG[0] = (0.1, -0.2, 0.3)
    state, found = build_state(run.model, system), build_state(run.model, system)
    rng = np.random.default_rng(5)
    for array in (state.x, state.p, state.v, state.w):
        array[0] = rng.normal(size=3)
    start, table = new_system_workspace(system, state), np.zeros((1, 12))
    evaluate.prepare(system, state, start)
    rigid_body.write_states(system.bodies, state.x, state.p, start.frames, state.w, table, 0)
    rigid_body.read_states(system.bodies, table, 0, found.x, found.p, found.v, found.w)
    for name in ("x", "p", "v", "w"):
        assert getattr(found, name)[0] == pytest.approx(getattr(state, name)[0], rel=1e-13)


def energy_of(kinetic, potential, work=0.0, elastic=0.0):
    kinetic, potential = (np.array(series, dtype=float)[:, None] for series in (kinetic, potential))
    work, elastic = (np.zeros(len(kinetic)) + series for series in (work, elastic))
    time = np.arange(len(kinetic)) * 1.0
    return Energy(time, ("Bob",), kinetic, 0.0 * kinetic, potential, work, elastic)


def test_the_error_is_measured_by_both_energies():
    energy = energy_of([0.0, 4.0, 2.0], [-2.0, -6.0, -3.9])
    assert energy.error == pytest.approx([0.0, 0.0, 0.1])
    assert energy.error_over_first == Statistics(
        *map(pytest.approx, (0.05 / math.sqrt(3.0), 0.05 / 3.0, 0.05))
    )
    assert energy.error_over_kinetic.max == pytest.approx(0.025)


def test_work_of_loads_is_no_error():
    energy = energy_of([0.0, 1.0, 3.0], [0.0, 0.0, 0.0], work=[0.0, 1.0, 3.0])
    assert energy.absolute_error == Statistics(0.0, 0.0, 0.0)


@pytest.mark.parametrize("rest", [0.0, 1e-15])
def test_an_error_over_no_energy_is_undefined(rest):
    energy = energy_of([0.0, 4.0, 2.0], [rest, -4.0, -1.9])
    assert energy.first is None
    assert energy.error_over_first is None
    assert energy.error_over_kinetic.max == pytest.approx(0.025)


def test_a_model_at_rest_has_no_kinetic_energy_to_compare_with():
    assert energy_of([0.0, 0.0], [1.0, 1.0]).error_over_kinetic is None


@pytest.mark.parametrize("size", [1.0, 1e-200, 1e200])
def test_spread_at_any_size(size):
    spread = Statistics.of(size * np.array([3.0, -4.0, 0.0, 0.0]))
    assert spread == Statistics(*(pytest.approx(size * value) for value in (2.5, -0.25, 4.0)))


def test_spread_of_nothing():
    assert Statistics.of(np.array([])) == Statistics(0.0, 0.0, 0.0)


@pytest.mark.parametrize("told", [True, False])
def test_a_thinned_run_has_no_virtual_work(tmp_path, told):
    states, reactions = conical_rows()
    info = {"options": {"every": 10}} if told else None
    run = read_conical(tmp_path, states[::10], reactions[::10], info=info)
    metrics = compute_metrics(run)
    assert run.every == 10
    assert metrics.work is None
    assert metrics.energy.absolute_error.max < ROUND_OFF * abs(metrics.energy.total[0])
    assert "one of 10 steps" in no_work_note(run)
    assert "n/a" in as_text(work_table([("run", metrics)]))


def test_a_run_cut_off_is_read_to_its_last_complete_row(tmp_path):
    write_conical(tmp_path, complete=False)
    part = tmp_path / "states.csv.part"
    text = part.read_text()
    part.write_text(text[: text.rstrip("\n").rfind("\n") + 25])  # the last row, cut short
    run = read_run(tmp_path)
    assert run.partial
    assert len(run.time) == len(run.reactions) == text.count("\n") - 2
    assert "incomplete" in partial_note(run)
    assert compute_metrics(run).constraints.violation[:, 0, 0].max() < ROUND_OFF * LENGTH


def test_a_run_without_rows_is_no_run(tmp_path):
    write_conical(tmp_path, *(rows[:0] for rows in conical_rows()), complete=False)
    with pytest.raises(ResultError, match="no rows yet"):
        read_run(tmp_path)


def test_columns_are_those_of_the_deck(tmp_path):
    write_conical(tmp_path)
    states = tmp_path / "states.csv"
    states.write_text(states.read_text().replace("Bob.x", "Bub.x"))
    with pytest.raises(ResultError, match=r"columns are not those of .*deck\.xml"):
        read_run(tmp_path)


def test_tables_read_back_every_double(tmp_path):
    numbers = np.random.default_rng(3).normal(size=(200, 2)) * 10.0 ** np.arange(-100, 100)[:, None]
    path = tmp_path / "numbers.csv"
    path.write_text("a,b\n" + "".join(f"{a!r},{b!r}\n" for a, b in numbers.tolist()))
    assert (read_table(path).to_numpy() == numbers).all()


def test_forms_of_a_table(tmp_path):
    measured = [("one", compute_metrics(read_conical(tmp_path)))]
    lines = as_text(energy_table(measured)).splitlines()
    assert len(lines) == 3
    assert lines[0].rstrip().endswith("-balance error over max KE--")
    assert lines[1].rstrip().endswith("work at end [J]")
    (row,) = json.loads(as_json(energy_table(measured)))
    header, values = as_csv(energy_table(measured)).splitlines()
    assert header.split(",") == list(row)
    numbers = [float(value) if value else None for value in values.split(",")[1:]]
    assert numbers == list(row.values())[1:]
    assert row["elastic_energy_max"] is row["work_at_end"] is None


def test_an_undefined_figure_is_null(tmp_path):
    metrics = compute_metrics(read_conical(tmp_path))
    object.__setattr__(metrics, "energy", energy_of([0.0, 4.0], [0.0, -4.0]))
    table = energy_table([("run", metrics)])
    assert json.loads(as_json(table))[0]["error_over_start_max"] is None
    assert as_text(table).count("undefined") == 3


class TestCompare:
    @pytest.fixture
    def pair(self, tmp_path):
        for name in ("run", "reference"):
            write_conical(tmp_path / name)
        return tmp_path / "run", tmp_path / "reference"

    def rewrite(self, folder, states=None, reactions=None):
        given = conical_rows()
        write_conical(
            folder,
            given[0] if states is None else states,
            given[1] if reactions is None else reactions,
        )

    def test_same(self, pair):
        found = compare(*pair, Tolerance())
        assert [c.name for c in found] == ["states.csv", "reactions.csv"]
        assert all(c.first is None and c.largest == 0.0 for c in found)

    def test_first_and_worst(self, pair):
        states, _ = conical_rows()
        states[4, 1] += 1e-6
        states[9, 12] -= 1e-3
        self.rewrite(pair[0], states)
        found, reactions = compare(*pair, Tolerance())
        assert reactions.first is None
        assert found.differing == 2
        assert (found.first.column, found.first.time) == ("Bob.x", pytest.approx(4 * DT))
        assert (found.worst.column, found.worst.time) == ("Bob.wz", pytest.approx(9 * DT))
        assert found.worst.value - found.worst.reference == pytest.approx(-1e-3, rel=1e-9)

    def test_tolerances_and_columns_and_until(self, pair):
        states, _ = conical_rows()
        states[4, 1] += 1e-6
        self.rewrite(pair[0], states)
        assert compare(*pair, Tolerance(atol=1e-5))[0].first is None
        assert compare(*pair, Tolerance(), ("Bob.[yz]",))[0].columns == 2
        assert compare(*pair, Tolerance(), until=3.5 * DT)[0].rows == 4
        assert compare(*pair, Tolerance(), ("Bob.?",))[0].first is not None

    def test_a_thinned_reference(self, pair):
        states, reactions = conical_rows()
        self.rewrite(pair[1], states[::5], reactions[::5])
        assert all(c.rows == len(states[::5]) for c in compare(*pair, Tolerance()))
        with pytest.raises(ResultError, match="different output times"):
            compare(pair[1], pair[0], Tolerance())

    def test_files_and_folders_mix(self, pair):
        run, reference = pair
        stored = reference.parent / "reactions.csv"
        stored.write_text((reference / "reactions.csv").read_text())
        for a, b in ((run, stored), (stored, run), (stored, stored)):
            assert [c.name for c in compare(a, b, Tolerance())] == ["reactions.csv"]

    def test_different_columns(self, pair):
        run, _ = pair
        with pytest.raises(ResultError, match="different columns"):
            compare(run / "states.csv", run / "reactions.csv", Tolerance())
        (run / "reactions.csv").unlink()
        with pytest.raises(ResultError, match=r"no reactions\.csv"):
            compare(*pair, Tolerance())
        with pytest.raises(ResultError, match=r"no reactions\.csv"):
            compare(pair[1], pair[0], Tolerance())

    def test_nothing_to_compare(self, pair):
        with pytest.raises(ResultError, match="no column matches"):
            compare(*pair, Tolerance(), ("Nobody.*",))
        with pytest.raises(ResultError, match="no such file"):
            compare(pair[0], pair[0] / "elsewhere", Tolerance())
        with pytest.raises(ResultError, match="no output times"):
            compare(*pair, Tolerance(), until=-1.0)

    def test_an_orientation_and_its_shadow_parameters_are_the_same(self, pair):
        states, _ = conical_rows()
        p = np.array([3.9, 0.5, -0.7])
        states[6, 4:7] = p
        self.rewrite(pair[1], states)
        states[6, 4:7] = -16.0 * p / (p @ p)
        self.rewrite(pair[0], states)
        assert compare(*pair, Tolerance())[0].first is None

    def test_what_is_no_number_differs(self, pair):
        path = pair[0] / "reactions.csv"
        lines = path.read_text().splitlines()
        lines[4] = lines[4].rsplit(",", 1)[0] + ",nan"
        path.write_text("\n".join(lines) + "\n")
        found = compare(*pair, Tolerance())[1]
        assert (found.first.column, found.differing) == ("Pivot.Fz", 1)


def test_the_reaction_of_the_helper_balances_the_bob():
    # Guards the fixture: m a = m g + F at the start, where the bob stands at (r, 0).
    acceleration = np.array([-(OMEGA**2) * RADIUS, 0.0, 0.0])
    assert MASS * acceleration == pytest.approx(MASS * np.array([0.0, 0.0, GRAVITY]) + FORCE)
