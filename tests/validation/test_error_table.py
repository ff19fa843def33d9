"""The table of error estimates in small, and the reference solutions that it stands on."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.model.settings import OFF
from msahl.run.loop import run
from msahl.run.tables import SIGNALS, STATES, MemorySink
from msahl.study.dynamics import SIZE, Dynamics
from tests.support.element_samples import ELEMENTS
from tests.support.reference_motions import pendulum_path
from tools.validation import error, error_models, error_page, reference
from tools.validation.error_scenes import SCENES


@pytest.fixture(scope="module")
def tools():
    return {"error": error, "page": error_page, "models": error_models, "reference": reference}


WITHOUT_CONTACTS = [
    name for name, make in ELEMENTS.items() if not make(np.random.default_rng(7)).contacts
]
"""The elements of which the reference has equations."""


@pytest.mark.parametrize("name", WITHOUT_CONTACTS)
def test_accelerations_are_those_of_the_engine(tools, name):
    """Two derivations of every element's equations that share no code."""
    model = ELEMENTS[name](np.random.default_rng(7))
    dynamics = Dynamics(model)
    equations = tools["reference"].Equations(model)
    first = equations.first(dynamics.table[0])
    own = equations.rates(0.0, first)[: SIZE * len(model.bodies)]
    known = dynamics.rates(0.0, dynamics.first)
    auxiliary = dynamics.state.auxiliary.size
    if auxiliary:
        rates = equations.rates(0.0, first)[-auxiliary:]
        assert rates == pytest.approx(known[-auxiliary:], rel=1e-9)
        known = known[:-auxiliary]
    # Round-off of matrices of random inertias and arms, of condition 1e3 or so.
    assert own == pytest.approx(known, rel=1e-9, abs=1e-9 * np.abs(known).max())


def test_a_breakpoint_in_a_displacement_is_located(tools):
    """A ball falls on a one-sided spring and leaves it: free fall, half an oscillation, rise."""
    case = next(s for s in tools["models"].CASES if s.name == "bouncing ball")
    g, k, height = 9.80665, 4000.0, 0.4
    touch, speed, omega = np.sqrt(2.0 * height / g), np.sqrt(2.0 * g * height), np.sqrt(k)
    amplitude, sag = np.hypot(speed / omega, g / k), g / k
    phase = np.arctan2(sag, speed / omega)  # below touch: -sag - amplitude sin(omega t - phase)
    leave = touch + (np.pi + 2.0 * phase) / omega
    times = np.linspace(0.0, 0.6, 61)
    fall, rise = times <= touch, times > leave
    z = -sag - amplitude * np.sin(omega * (times - touch) - phase)
    z[fall] = height - 0.5 * g * times[fall] ** 2
    z[rise] = speed * (times[rise] - leave) - 0.5 * g * (times[rise] - leave) ** 2
    equations = tools["reference"].Equations(case.model)
    start = np.zeros(12)
    start[2] = 0.5
    ys = tools["reference"].solve(equations, equations.first(start), times, 1e-12)
    # A hundred times the tolerance: the breakpoint multiplies errors by the jump of the stiffness.
    assert equations.publish(ys)[:, 2] - 0.1 == pytest.approx(z, abs=1e-10)


def test_a_pendulum_by_elliptic_functions(tools):
    times = np.linspace(0.0, 1.0, 11)
    model = tools["models"].pendulum(45.0)
    equations = tools["reference"].Equations(model)
    (bob,) = model.bodies
    first = equations.first(np.concatenate([bob.position, bob.orientation, np.zeros(6)]))
    ys = tools["reference"].solve(equations, first, times, 1e-12)
    # Ten times the tolerance, of a path of 5 m.
    assert equations.publish(ys)[:, :3] == pytest.approx(pendulum_path(times, np.pi / 4), abs=5e-11)


def test_estimates_of_a_few_cells(tools):
    """Of a regular motion the estimate is above the true error and below twice that."""
    error, case = tools["error"], tools["models"].CASES[0]
    short = tools["models"].Case("short", "pendulum", case.build, 0.8, 10)
    cells = error.run_cells(short, only=("preserving", "decaying"), tolerances=())
    assert [cell.step for cell in cells[:3]] == pytest.approx([0.08, 0.02, 0.005])
    found = list(error.comparisons(cells))
    assert len(found) == 3 * len(cells)  # no signals
    assert all(c.clear and 1.0 < c.ratio < 2.0 for c in found), found


def test_every_scheme_has_cells_of_a_model_that_joint_coordinates_do_not_serve(tools):
    """Friction that depends on reactions: steps of explicit schemes refuse it."""
    (case,) = (case for case in error.CASES if case.name == "friction hinge")
    cells = tools["error"].run_cells(case, tolerances=())
    assert {cell.scheme for cell in cells} == set(error.SCHEMES)
    assert all(cell.status == "completed" for cell in cells)


@pytest.mark.parametrize("name", ["square-wave motor", "screw press", "switching pendulum"])
def test_scenes_by_hand_are_those_of_the_engine(name):
    """The first output times, by a scheme of order 10, of three ways to publish; the table itself
    has all scenes."""
    (case,) = (case for case in SCENES if case.name == name)
    short = replace(case, t_final=2.0 * case.t_final / case.outputs, outputs=2)
    truth = error.solve_truth(short)
    model, options = error.at_steps(short, "gauss5", 1)
    memory = MemorySink(only=(STATES, SIGNALS))
    report = run(model, replace(options, error=OFF, solver="newton"), memory)
    assert report.status == "completed"
    lengths = error.build_system(model).frames.length[:-1]
    true = error.true_errors(short, memory, truth, lengths)
    floors = error.floors_of(truth, lengths)
    # Ten times what the reference is known to, and what these steps leave.
    assert all(true[name] < max(10.0 * floors[name], 1e-9) for name in true), true


def cell_of(error, **changes):
    """A cell of errors of 1e-3 that are estimated as 2e-3, but for ``changes``."""
    numbers = {}
    for name in error.QUANTITIES:
        numbers |= {name: 1e-3, f"{name}_estimate": 2e-3, f"{name}_floor": 1e-9}
    text = ("planet", "gauss3", 0.1, None, "", "completed", "PASS", "PASS", 3)
    first = dict(zip(error.Cell.__dataclass_fields__, text, strict=False))
    return error.Cell(**(first | numbers | changes))


def test_cells_are_read_as_they_were_written(tools, tmp_path):
    error = tools["error"]
    auto = {"scheme": "auto", "step": None, "kind": "global", "position_estimate": None}
    cells = [cell_of(error), cell_of(error, tolerance=1e-6, seconds=0.25, **auto)]
    error.write_cells(tmp_path / "cells.csv", cells)
    assert error.read_cells(tmp_path / "cells.csv") == cells


def test_the_page_reports_what_is_outside(tools):
    """Too small an estimate, one of an error that nobody has, a run without one, a failed one."""
    error, page = tools["error"], tools["page"]
    nothing = {name: None for q in error.QUANTITIES for name in (q, f"{q}_estimate")}
    local = {"scheme": "auto", "step": None, "tolerance": 1e-6, "kind": "local"}
    cells = [
        cell_of(error),
        cell_of(error, step=0.025, position_estimate=5e-5),
        cell_of(error, scheme="gauss5", position=1e-12, position_estimate=1e-11),
        cell_of(error, scheme="gauss1", **{f"{q}_estimate": None for q in error.QUANTITIES}),
        cell_of(error, scheme="gauss2", status="not converged", **nothing),
        cell_of(error, **local, seconds=0.25),
        cell_of(
            error,
            **(local | {"kind": "global", "seconds": 0.5, "position": 3e-7}),
            orientation=9e-7,
            orientation_estimate=2e-6,
        ),
    ]
    told = dict(page.summary(cells))
    # Position and orientation of 1, 2, the global run; of the third the orientation alone.
    assert told["Estimated over true position and orientation error within 0.3 to 10"].startswith(
        "5 of 7"
    )
    least = told["Smallest ratio of position and orientation with PASS"]
    assert least.startswith("0.05: planet, gauss3, 0.025 s")
    assert least.endswith("1 of 7 are below 0.1")
    assert told["Runs that did not complete"] == "1 of 7"
    assert "in 1 of 1 models" in told["--tolerance 1e-06"]
    assert "largest 2.0" in told["--tolerance 1e-06"]
    (planet,) = (row for row in page.fixed_table(cells).rows if row[0] == "planet")
    shown = dict(zip(("", *error.SCHEMES), planet, strict=True))
    # Of gauss5 the position is not known: the orientation is shown.
    assert [shown[f"gauss{k}"] for k in (1, 2, 3, 5)] == ["-", "x", "2 0.05", "2"]
