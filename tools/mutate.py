"""Falsify lines of the program one by one and check that a test of ``make test`` fails for each.

    python tools/mutate.py                 every line
    python tools/mutate.py NAME...         the lines whose names contain one of the words
    python tools/mutate.py --list          print the names

Each change is made in a copy of the checkout. The tests run as plain Python, so nothing has to be
compiled: first the tests that should fail, then ``GENERAL``. Prints a table in Markdown; the exit
status is the number of changes that no test noticed.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPIED = ("msahl", "tests", "tools", "schemas", "decks", "docs", "benchmarks", "pyproject.toml")

LAWS = "tests/elements/test_laws.py"
GAUSS = "tests/schemes/collocation/test_gauss.py"
RADAU = "tests/schemes/collocation/test_radau.py"
DENSE = "tests/schemes/collocation/test_dense_output.py"
CONTROL = "tests/schemes/collocation/test_step_control.py"
DECAYING = "tests/schemes/midpoint/test_decaying.py"
UPDATE = "tests/schemes/midpoint/test_rotation_update.py"
LOADS = "tests/elements/test_time_dependent_loads.py"
KNOWN = "tests/physics/test_closed_forms.py"
START = "tests/start"
ROTATION = "tests/algebra/test_rotation.py"
JOINTS = "tests/joints/test_degrees_of_freedom.py"
INSTANT = "tests/schemes/test_instantaneous_reactions.py"
MECHANISMS = "tests/physics/test_mechanisms.py"
FORCES = "tests/elements/test_forces.py"
EVALUATE = "tests/system/test_evaluate.py"
SHORT = "tests/schemes/test_short_runs.py"
DERIVATIVE = f"{LAWS}::test_the_jacobian_is_the_derivative_of_the_residual"
WORK = f"{LAWS}::test_published_work_and_elastic_energy_are_what_the_elements_do"
FRAME = f"{LAWS}::test_a_rigid_motion_of_the_model_moves_the_answer"
IDEAL = f"{LAWS}::test_ideal_reactions_work_on_what_opens_alone"
ENGINE = "tests/validation/test_error_table.py::test_accelerations_are_those_of_the_engine"
STAGES = f"{GAUSS}::test_the_derivative_of_every_element"
ORDERS = f"{GAUSS}::test_orders_against_closed_forms"
MOMENTUM = f"{GAUSS}::test_momentum_of_free_bodies_is_kept"
ENERGY = f"{GAUSS}::test_the_energy_error_does_not_grow"
ROUNDED = f"{SHORT}::test_rounding_errors_of_positions_do_not_add_up"
BEAM_STEP = "tests/elements/beams/test_midpoint.py"
BEAM_ENERGY = f"{BEAM_STEP}::test_energy_and_momenta_stay_at_any_stiffness"
BEAM_STAGE = "tests/elements/beams/test_stage.py"
COMPLIANCE = "tests/elements/test_compliance.py"
BOTH_FORMS = f"{COMPLIANCE}::test_the_motion_is_that_of_the_stiffness_form"
ACTUATORS = "tests/physics/test_actuators.py::test_orders_with_auxiliary_states"
ESTIMATE = "tests/run/test_error_estimate.py"
SMALL_STEPS = "test_with_small_steps_the_estimate_is_the_safety_factor_times_the_error"
EVEN_DEGREE = "test_what_gauss_of_even_degree_keeps_is_estimated_by_the_displacement_of_a_step"
STORE = "tests/sweep/test_store.py"
INVERSE = "tests/analysis/inverse/test_inverse.py"
MODES = "tests/analysis/modes/test_sparse_eigenvalues.py"
GRADIENTS = "tests/api/test_gradients.py"
GENERAL = (SHORT, ROTATION, DERIVATIVE, FRAME, EVALUATE, ENGINE, FORCES, STAGES, MOMENTUM, DECAYING)
"""Tests for a change that those named with it did not notice."""
SECONDS = 300
"""Time limit for one run of tests. A run that exceeds it has noticed nothing."""


@dataclass(frozen=True)
class Mutant:
    """Text that stands once in the package, what to put in its place, and the tests that should
    notice it.
    """

    name: str
    right: str
    wrong: str
    tests: tuple[str, ...]


MUTANTS = (
    Mutant("midpoint: angular velocity in inertial axes",
           "times(transpose(matrix_at(start.frames.R, b)), gained_angle)",
           "times(matrix_at(start.frames.R, b), gained_angle)", (FRAME,)),
    Mutant("midpoint: joint force without the step's factor",
           "* system.unit[k, i] / dt2(system, h)", "* system.unit[k, i] / (h * h)", (SHORT, KNOWN)),
    Mutant("midpoint: rotations composed in the wrong order",
           "put(state.p, b, compose(from_increment(Q), at(state.p, b)))\n    put(state.v",
           "put(state.p, b, compose(at(state.p, b), from_increment(Q)))\n    put(state.v",
           (FRAME,)),
    Mutant("midpoint: exponential update takes the increment for the angle",
           "scale(angle_share(Q)[0], Q) if", "Q if", (UPDATE,)),
    Mutant("midpoint: gyroscopic moment of twice the spin",
           "L = times(J, axpy(dt2 / h, at(motion.W, f), forced))\n        change",
           "L = times(J, axpy(h, at(motion.W, f), forced))\n        change", (DERIVATIVE, FRAME)),
    Mutant("midpoint: gyroscopic moment at rest has the wrong sign",
           "cross(times(matrix_at(start.J, b), W), W)",
           "cross(W, times(matrix_at(start.J, b), W))", (EVALUATE, ENGINE)),
    Mutant("decaying: energy taken counted twice",
           "0.5 * decay.chi * (dot(y_v", "decay.chi * (dot(y_v", (DECAYING,)),
    Mutant("decaying: spring damps the smoothed stretch the wrong way",
           "group.decay[s] * (dq - stretch[s])\n        lag",
           "group.decay[s] * (dq + stretch[s])\n        lag", (DERIVATIVE, DECAYING)),
    Mutant("collocation: gyroscopic force not transposed",
           "times(transpose(local_rotation.rate_slope(c, c_dot)), z)",
           "times(local_rotation.rate_slope(c, c_dot), z)", (ORDERS, STAGES)),
    Mutant("collocation: term that keeps the step symplectic",
           "outer(-tableau.basis_rate[i, k], c_k", "outer(tableau.basis_rate[i, k], c_k",
           (STAGES, MOMENTUM, ENERGY)),
    Mutant("collocation: joint forces at the end of a step",
           "2.0 / (h * h) * force", "1.0 / (h * h) * force", (SHORT,)),
    Mutant("collocation: Jacobian of the joint forces",
           "+= share * chi[j, k]", "+= 0.5 * share * chi[j, k]", (STAGES,)),
    Mutant("collocation: second derivative of the kinetic energy",
           "outer(24.0 * n * k**4", "outer(12.0 * n * k**4", (STAGES,)),
    Mutant("dense output: rotation at the end of the step",
           "compose(at(end.p, b), inverse(at(begin.p, b)))",
           "compose(inverse(at(begin.p, b)), at(end.p, b))", (SHORT, DENSE)),
    Mutant("step control: Richardson's divisor",
           "error / (2.0 ** convergence", "error / (4.0 ** convergence", (CONTROL,)),
    Mutant("step control: exponent of the step size",
           "(share / error) ** (1.0 / order)", "(error / share) ** (1.0 / order)",
           (SHORT, CONTROL)),
    Mutant("load: moment without its arm",
           "return add(cross(r, f), m)", "return m", (EVALUATE, ENGINE)),
    Mutant("load: first moment of a law has the wrong sign",
           "-0.5 * values[1]", "0.5 * values[1]", (LOADS,)),
    Mutant("drag: linear in the velocity",
           "scale(-c[0] * math.sqrt(dot(V, V)), V)", "scale(-c[0], V)", (FORCES, ENGINE)),
    Mutant("drag: derivative by the velocity",
           "scale(V[1] / speed, V)", "scale(-V[1] / speed, V)", (EVALUATE, FORCES)),
    Mutant("friction: derivative by the rate",
           "limit * (1.0 - t * t) / c[2]", "limit * (1.0 + t * t) / c[2]",
           (EVALUATE, DERIVATIVE)),
    Mutant("spring: mean of its tension",
           "(q + 0.5 * dq - free), 0.5", "(q + dq - free), 0.5",
           (WORK, FORCES)),
    Mutant("constraint: moment of a sliding direction's owner",
           "t_a = add(t_a, cross(n, D))", "t_a = add(t_a, cross(D, n))", (IDEAL, DERIVATIVE)),
    Mutant("constraint: lowest point of a rolling disk",
           "scale(-1.0 / math.sqrt(1.0 - c * c / r2), axpy(-c, e, up))",
           "scale(-1.0 / math.sqrt(1.0 - c * c / r2), up)", (IDEAL, DERIVATIVE, KNOWN)),
    Mutant("constraint: joint force acts at the start of the step",
           "cross(axpy(0.5, dr_b, r_b), force)", "cross(r_b, force)", (IDEAL,)),
    Mutant("constraint: work of a prescribed motion",
           "lam * law_rate(scalar, r, t) * dt", "lam * law_rate(scalar, r, t + dt) * dt",
           (SHORT, FORCES, GAUSS, KNOWN)),
    Mutant("constraint: curvature of a function at one configuration",
           "curve = share * coefficients(", "curve = coefficients(", (STAGES, EVALUATE)),
    Mutant("multipliers: derivative by the unknown without the length",
           "return rows.mass[r] * rows.scale[r] / abs(factor)",
           "return rows.mass[r] / abs(factor)", (DERIVATIVE,)),
    Mutant("reactions: moment about the mass centre",
           "moment = sub(moment, cross(arm, force))", "moment = add(moment, cross(arm, force))",
           (SHORT, JOINTS, INSTANT)),
    Mutant("rotation: product of two",
           "add(axpy(q0, p, scale(p0, q)), cross(p, q))",
           "add(axpy(q0, p, scale(p0, q)), cross(q, p))", (ROTATION,)),
    Mutant("start: assembly rotates bodies the wrong way",
           "rotation_increment(frames, step, b)",
           "tuple(-q for q in rotation_increment(frames, step, b))",
           (MECHANISMS,)),
    Mutant("configuration: energy without that of springs",
           "return kinetic, potential + elastic", "return kinetic, potential", (WORK, EVALUATE)),
    Mutant("positions: midpoint without compensated sum",
           "state.x[b, i] + (u[i] + state.x_low[b, i])", "state.x[b, i] + u[i]", (ROUNDED,)),
    Mutant("positions: collocation without compensated sum",
           "state.x[f, i] + (u[i] + state.x_low[f, i])", "state.x[f, i] + u[i]", (ROUNDED,)),
    Mutant("positions: free bodies in joint coordinates without compensated sum",
           "begin[i] + (u[i] + low[i])", "begin[i] + u[i]", (ROUNDED,)),
    Mutant("loads: work of the first moments with the wrong sign",
           "work_done = -h * h * (dot(at(a, b), f)",
           "work_done = h * h * (dot(at(a, b), f)",
           (f"{LOADS}::test_loads_of_the_same_law_share_the_work_by_their_forces",)),
    Mutant("beams: strain at the end of the step for its mean",
           "before + 0.5 * change + lag)\n            for",
           "before + change + lag)\n            for", (BEAM_STEP,)),
    Mutant("beams: moment of the directors",
           "cross(d[1], on[1]), cross(d[2], on[2])", "cross(d[1], on[1]), cross(on[2], d[2])",
           (BEAM_STEP,)),
    Mutant("beams: bending about the second axis",
           "0.5 * (dot(d[0], d_slope[2]) - dot(d[2], d_slope[0]))",
           "0.5 * (dot(d[0], d_slope[2]) + dot(d[2], d_slope[0]))", (BEAM_ENERGY,)),
    Mutant("beams: damping of a collocation stage with the wrong sign",
           "node.strain[g, i] + group.damping[g, i] * rate[",
           "node.strain[g, i] - group.damping[g, i] * rate[",
           (f"{BEAM_STAGE}::test_the_work_of_damping_is_in_the_balance", BEAM_STAGE)),
    Mutant("beams: torsion constant of a rectangle",
           "(math.pi**5 * a)", "(math.pi**4 * a)",
           ("tests/beams/test_sections.py::test_torsion_of_rectangles",)),
    Mutant("compliance: preload has the wrong sign",
           "elongation + group.compliance[j] * springs.constants",
           "elongation - group.compliance[j] * springs.constants", (BOTH_FORMS,)),
    Mutant("compliance: retardation halved",
           "0.5 + retardation(group, springs, j) / h",
           "0.5 + 0.5 * retardation(group, springs, j) / h", (BOTH_FORMS,)),
    Mutant("compliance: smoothed stretch of the decaying scheme",
           "row -= group.compliance[j] * springs.decay[s]",
           "row += group.compliance[j] * springs.decay[s]", (BOTH_FORMS,)),
    Mutant("compliance: load at one configuration without its damper",
           "-T - springs.damping[s] * rate[q]", "-T",
           (f"{COMPLIANCE}::test_forces_at_one_configuration_and_their_derivatives_are_the_same",)),
    Mutant("signals: inputs at the nodes of the states",
           "value: float = spread[j, 0]", "value: float = 0.5 * spread[j, 0]",
           (ACTUATORS,)),
    Mutant("signals: mean of a state over the step",
           "    np.array([[0.75, 0.25]]),", "    np.array([[0.0, 1.0]]),",
           (ACTUATORS,)),
    Mutant("signals: stages of a state",
           "change += h * stages.nodes.integral[i, j]",
           "change += 0.5 * h * stages.nodes.integral[i, j]",
           (ACTUATORS,)),
    Mutant("signals: derivative of a square root",
           "0.5 / result if result > 0.0", "1.0 / result if result > 0.0",
           ("tests/expressions/test_tape.py::test_values_and_gradients_of_random_expressions",)),
    Mutant("error estimate: Richardson's factor dropped",
           "SAFETY / (1.0 - 0.5**settings.order)", "SAFETY",
           (f"{ESTIMATE}::{SMALL_STEPS}",)),
    Mutant("error estimate: hidden vibrations by h/4",
           "hidden = h[:, None] / np.pi", "hidden = h[:, None] / 4.0",
           (f"{ESTIMATE}::test_a_hidden_vibration_is_estimated_by_the_error_of_its_velocity",)),
    Mutant("error estimate: vibrations that gauss keeps by h/3",
           "displacement / np.pi if", "displacement / 3.0 if",
           (f"{ESTIMATE}::{EVEN_DEGREE}",)),
    Mutant("error estimate: damped energy of the companion alone",
           "hidden = 2.0 * of_companion - ", "hidden = of_companion - 0.0 * ",
           (f"{ESTIMATE}::test_a_damped_vibration_is_estimated_by_the_energy_that_both_runs_take",)),
    Mutant("step control: rotation of a pair not limited at its start",
           "h * speed > MAX_ROTATION:", "h * speed > 1e3 * MAX_ROTATION:",
           (f"{CONTROL}::test_a_step_rotates_bodies_by_less_than_counting_of_revolutions_needs",)),
    Mutant("step control: rotation of a pair not limited at its end",
           "h * speed > 2.0 * MAX_ROTATION:", "h * speed > 1e3 * MAX_ROTATION:",
           (f"{CONTROL}::test_a_step_in_which_a_body_begins_to_rotate_is_limited_as_well",)),
    Mutant("margins: friction is at its limit from one width on",
           "for widths in (1.0, FAST):", "for widths in (1.0,):",
           (f"{ESTIMATE}::test_auto_sees_the_friction_beyond_its_width",)),
    Mutant("steps: the part after the width of friction is as long as any",
           "self.resolving = math.inf, max(time, FINEST * self.h)",
           "self.resolving = math.inf, math.inf",
           (f"{ESTIMATE}::test_steps_are_divided_where_friction_changes_fast",)),
    Mutant("steps: a companion takes the same part up to an event",
           "return self.halves_parts and not halves and not self.half_taken", "return False",
           (f"{ESTIMATE}::test_friction_that_steps_end_at_is_not_unseen",)),
    Mutant("curves: beside a corner round-off chooses the foot",
           "nearer = distance < least - even or", "nearer = distance < least or",
           ("tests/elements/test_curves.py",)),
    Mutant("amplitudes: rates without the rotation of the frame",
           "rate - cross(motion.w[:, self.frame], away)", "rate",
           ("tests/physics/test_elastic_bodies.py::"
            "test_the_table_of_amplitudes_has_the_elastic_energy_and_its_own_rates",)),
    Mutant("sweep: outcomes of other software adopted",
           ' and row.get("software") == self.software', "",
           (f"{STORE}::test_outcomes_of_other_software_are_computed_again",)),
    Mutant("sweep: options are no part of a point's id",
           "digest_of([job.digest, options, numeric_versions()])",
           "digest_of([job.digest, numeric_versions()])",
           (f"{STORE}::test_other_options_are_other_points",)),
    Mutant("sweep: failed points replace good ones",
           "if not self.usable(row):", "if False:",
           (f"{STORE}::test_failed_points_are_tried_again_only_by_retry_or_with_more_time",)),
    Mutant("inverse: one round of friction",
           "range(MOST_ROUNDS if self.by_reactions else 1)", "range(1)",
           (f"{INVERSE}::test_friction_of_an_arm_is_by_the_reactions_of_the_same_time",)),
    Mutant("inverse: loads by their weights",
           "Loads(u / self.weights", "Loads(u * self.weights",
           (f"{INVERSE}::test_two_motors_on_a_four_bar_share_the_load_at_the_least_norm",)),
    Mutant("modes: condition number of a damped vibration",
           "float(x_size * y_size / np.abs(product))", "1.0",
           (f"{MODES}::test_condition_numbers_of_sparse_eigenvalues",)),
    Mutant("modes: round-off of a damped vibration",
           "float((eps * rounding + residual) / np.abs(product))",
           "float(residual / np.abs(product))",
           (f"{MODES}::test_the_error_of_sparse_eigenvalues_is_the_largest_by_rounded_entries",)),
    Mutant("gradients: share of the last pair in the end of a run",
           "return 0.5 if k >= len(steps) - 2", "return 1.0 if k >= len(steps) - 2",
           (f"{GRADIENTS}::test_all_of_the_end_of_a_run_is_in_its_last_step_or_pair",)),
    Mutant("gradients: share of the last step in the end of a run",
           "return 1.0 if k == len(steps) - 1", "return 0.5 if k == len(steps) - 1",
           (f"{GRADIENTS}::test_all_of_the_end_of_a_run_is_in_its_last_step_or_pair",)),
    Mutant("gradients: weights of differences",
           "8.0 if k == 2 else -1.0) / 12.0", "8.0 if k == 2 else -1.0) / 11.0",
           (f"{GRADIENTS}::test_differences_are_exact_for_polynomials_of_degree_four",)),
)  # fmt: skip


def runs(folder: Path, tests: tuple[str, ...]) -> str:
    """The first test that fails in the copy ``folder``, empty if all pass."""
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(folder)}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-m",
        "not slow",
        "-p",
        "no:cacheprovider",
    ]
    try:
        ran = subprocess.run(
            [*command, *tests], cwd=folder, env=environment, capture_output=True, text=True,
            timeout=SECONDS, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return ""
    if ran.returncode == 0:
        return ""
    failed = [line for line in ran.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    if not failed:
        return ran.stdout[-200:]
    return failed[0].split(" - ")[0].removeprefix("FAILED ").removeprefix("ERROR ")


def file_of(folder: Path, mutant: Mutant) -> Path:
    """The module in the copy ``folder`` that has the text of the ``mutant``."""
    paths = sorted((folder / "msahl").rglob("*.py"))
    found = [path for path in paths for _ in range(path.read_text().count(mutant.right))]
    if len(found) != 1:
        raise SystemExit(f"{mutant.name}: its text stands at {len(found)} places")
    return found[0]


def try_out(folder: Path, mutant: Mutant) -> str:
    """What notices the ``mutant``; empty if nothing does."""
    path = file_of(folder, mutant)
    text = path.read_text()
    path.write_text(text.replace(mutant.right, mutant.wrong))
    rest = tuple(test for test in GENERAL if test not in mutant.tests)
    for tests in (*mutant.tests, *rest):
        failed = runs(folder, (tests,))
        path.write_text(text)
        # A module that cannot be collected has noticed nothing.
        if failed and ("::" in failed or failed.endswith(".py")) and runs(folder, (failed,)):
            raise SystemExit(f"{failed} fails without any change")
        if failed:
            return failed
        path.write_text(text.replace(mutant.right, mutant.wrong))
    path.write_text(text)
    return ""


def main() -> int:
    """Try out the mutants that the arguments name; return how many nothing noticed."""
    words = sys.argv[1:]
    chosen = [m for m in MUTANTS if not words or any(word in m.name for word in words)]
    if words == ["--list"]:
        print(*(mutant.name for mutant in MUTANTS), sep="\n")
        return 0
    unnoticed = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for item in COPIED:
            source, target = ROOT / item, folder / item
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(source, target, ignore=ignored) if source.is_dir() else shutil.copy(
                source, target
            )
        for name in ("schemas", "decks"):  # as they are installed
            shutil.copytree(ROOT / name, folder / "msahl" / name)
        print("| line made wrong | file | noticed by | seconds |\n| --- | --- | --- | --- |")
        for mutant in chosen:
            began = time.monotonic()
            path = file_of(folder, mutant).relative_to(folder / "msahl")
            test = try_out(folder, mutant)
            unnoticed += not test
            took = time.monotonic() - began
            print(f"| {mutant.name} | {path} | {test or 'NOTHING'} | {took:.0f} |", flush=True)
    return unnoticed


if __name__ == "__main__":
    sys.exit(main())
