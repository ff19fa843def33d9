"""Falsify lines of physics one by one and check that a test of ``make test`` fails for each.

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
GENERAL = (SHORT, ROTATION, DERIVATIVE, FRAME, EVALUATE, ENGINE, FORCES, STAGES, MOMENTUM, DECAYING)
"""Tests for a change that those named with it did not notice."""
SECONDS = 300
"""Time limit for one run of tests. A run that exceeds it has noticed nothing."""


@dataclass(frozen=True)
class Mutant:
    """One line that is made wrong, and the tests that should notice it."""

    name: str
    path: str
    right: str
    wrong: str
    tests: tuple[str, ...]


MIDPOINT = "schemes/midpoint/equations.py"
BODY = "elements/rigid_body.py"
EQUATIONS = "schemes/collocation/equations.py"
JACOBIAN = "schemes/collocation/jacobian.py"
OUTPUT = "schemes/collocation/dense_output.py"
STEPS = "schemes/collocation/step_control.py"
LOCAL = "schemes/collocation/local_rotation.py"
TABLEAU = "schemes/collocation/tableau.py"
CONCENTRATED = "ports/concentrated.py"
DRAG, POINT = "laws/drag.py", "ports/point.py"
FRICTION = "ports/friction.py"
SPRING = "ports/spring.py"
PRODUCTS = "elements/constraints/products.py"
COINCIDE = "elements/constraints/coincide.py"
ROWS = "elements/constraints/equations.py"
REACTIONS = "elements/reactions.py"
ROTATION = "algebra/rotation.py"
FUNCTIONS = "algebra/functions.py"
VELOCITIES = "start/velocities.py"
POSITIONS = "start/positions.py"
CONFIGURATION = "system/evaluate.py"

MUTANTS = (
    Mutant("midpoint: angular velocity in inertial axes", MIDPOINT,
           "times(transpose(matrix_at(start.frames.R, b)), gained_angle)",
           "times(matrix_at(start.frames.R, b), gained_angle)", (FRAME,)),
    Mutant("midpoint: joint force without the step's factor", MIDPOINT,
           "* system.unit[k, i] / dt2(system, h)", "* system.unit[k, i] / (h * h)", (SHORT, KNOWN)),
    Mutant("midpoint: rotations composed in the wrong order", MIDPOINT,
           "compose(from_increment(Q), at(state.p, b))",
           "compose(at(state.p, b), from_increment(Q))", (FRAME,)),
    Mutant("midpoint: exponential update takes the increment for the angle", MIDPOINT,
           "scale(angle_share(Q)[0], Q) if", "Q if", (UPDATE,)),
    Mutant("midpoint: gyroscopic moment of twice the spin", BODY,
           "L = times(J, axpy(dt2 / h, at(motion.W, f), forced))\n        change",
           "L = times(J, axpy(h, at(motion.W, f), forced))\n        change", (DERIVATIVE, FRAME)),
    Mutant("midpoint: Jacobian of the gyroscopic moment", BODY,
           "sub(add(Jj, rotation_change(Q, Jj)), times(K, Dj))",
           "add(add(Jj, rotation_change(Q, Jj)), times(K, Dj))", (DERIVATIVE,)),
    Mutant("midpoint: gyroscopic moment at rest has the wrong sign", BODY,
           "cross(times(matrix_at(start.J, b), W), W)",
           "cross(W, times(matrix_at(start.J, b), W))", (EVALUATE, ENGINE)),
    Mutant("decaying: energy taken counted twice", BODY,
           "0.5 * decay.chi * (dot(y_v", "decay.chi * (dot(y_v", (DECAYING,)),
    Mutant("decaying: pole of the smoothed changes", "model/scheme.py",
           "(1.0 - 3.0 * rho) / (3.0 - rho)", "(1.0 - 2.0 * rho) / (3.0 - rho)", (DECAYING,)),
    Mutant("decaying: spring damps the smoothed stretch the wrong way", SPRING,
           "group.decay[s] * (dq - stretch[s])\n        start.load",
           "group.decay[s] * (dq + stretch[s])\n        start.load", (DERIVATIVE, DECAYING)),
    Mutant("collocation: gyroscopic force not transposed", EQUATIONS,
           "times(transpose(local_rotation.rate_slope(c, c_dot)), z)",
           "times(local_rotation.rate_slope(c, c_dot), z)", (ORDERS, STAGES)),
    Mutant("collocation: term that keeps the step symplectic", EQUATIONS,
           "outer(-tableau.basis_rate[i, k], c_k", "outer(tableau.basis_rate[i, k], c_k",
           (STAGES, MOMENTUM, ENERGY)),
    Mutant("collocation: joint forces at the end of a step", EQUATIONS,
           "2.0 / (h * h) * force", "1.0 / (h * h) * force", (SHORT,)),
    Mutant("collocation: angular momentum at the end", EQUATIONS,
           "local_rotation.moment(c, pi) if", "pi if", (SHORT, ORDERS, MOMENTUM)),
    Mutant("collocation: weights of the impulses", EQUATIONS,
           "tableau.alpha[:, i], h * tableau.force_weight[i]",
           "tableau.alpha[:, i], h / tableau.force_weight.size", (FORCES, ORDERS)),
    Mutant("collocation: Jacobian of the joint forces", JACOBIAN,
           "+= share * chi[j, k]", "+= 0.5 * share * chi[j, k]", (STAGES,)),
    Mutant("collocation: Jacobian by the rates", JACOBIAN,
           "basis[i, k], h * tableau.basis_rate", "basis[i, k], 0.5 * h * tableau.basis_rate",
           (STAGES,)),
    Mutant("collocation: second derivative of the kinetic energy", LOCAL,
           "outer(24.0 * n * k**4", "outer(12.0 * n * k**4", (STAGES,)),
    Mutant("collocation: rate of the rotation parameters", LOCAL,
           "moment(scale(-1.0, c), W)", "moment(c, W)", (SHORT, DENSE, GAUSS)),
    Mutant("dense output: rotation at the end of the step", OUTPUT,
           "compose(at(end.p, b), inverse(at(begin.p, b)))",
           "compose(inverse(at(begin.p, b)), at(end.p, b))", (SHORT, DENSE)),
    Mutant("dense output: weights of the work", OUTPUT,
           "weight=0.5 * b", "weight=b", (SHORT, DENSE)),
    Mutant("step control: Richardson's divisor", STEPS,
           "error / (2.0**order - 1.0)", "error / (4.0**order - 1.0)", (CONTROL,)),
    Mutant("step control: exponent of the step size", STEPS,
           "(share / error) ** (1.0 / order)", "(error / share) ** (1.0 / order)",
           (SHORT, CONTROL)),
    Mutant("load: moment without its arm", CONCENTRATED,
           "return add(cross(r, f), m)", "return m", (EVALUATE, ENGINE)),
    Mutant("load: first moment of a law has the wrong sign", CONCENTRATED,
           "-0.5 * values[1]", "0.5 * values[1]", (LOADS,)),
    Mutant("load: power without that of the moment", CONCENTRATED,
           " + dot(at(start.m, k), W)", "", (FORCES, LOADS)),
    Mutant("drag: linear in the velocity", DRAG,
           "scale(-c[0] * math.sqrt(dot(V, V)), V)", "scale(-c[0], V)", (FORCES, ENGINE)),
    Mutant("drag: derivative by the velocity", DRAG,
           "scale(V[1] / speed, V)", "scale(-V[1] / speed, V)", (EVALUATE, FORCES)),
    Mutant("force at a point: work over a step halved", POINT,
           "+= dot(f, moved)", "+= 0.5 * dot(f, moved)", (WORK,)),
    Mutant("friction: derivative by the rate", FRICTION,
           "-limit * (1.0 - t * t) / group.width[f]", "-limit * (1.0 + t * t) / group.width[f]",
           (EVALUATE, DERIVATIVE)),
    Mutant("friction: reaction without one component", FRICTION,
           " + reactions[joint, 2] ** 2", "", (ENGINE, FORCES)),
    Mutant("spring: mean of a table's tension", SPRING,
           "tension(group, laws, s, q0 + 0.5 * dq)", "tension(group, laws, s, q0 + dq)",
           (WORK, FORCES)),
    Mutant("spring: power of the damper", SPRING,
           "rate[group.coordinate[s]] ** 2 * dt", "abs(rate[group.coordinate[s]]) * dt",
           (FORCES, WORK)),
    Mutant("constraint: moment of a sliding direction's owner", PRODUCTS,
           "t_a = add(t_a, cross(n, D))", "t_a = add(t_a, cross(D, n))", (IDEAL, DERIVATIVE)),
    Mutant("constraint: lowest point of a rolling disk", PRODUCTS,
           "scale(-1.0 / math.sqrt(1.0 - c * c / r2), axpy(-c, e, up))",
           "scale(-1.0 / math.sqrt(1.0 - c * c / r2), up)", (IDEAL, DERIVATIVE, KNOWN)),
    Mutant("constraint: joint force acts at the start of the step", COINCIDE,
           "cross(axpy(0.5, dr_b, r_b), force)", "cross(r_b, force)", (IDEAL,)),
    Mutant("constraint: work of a prescribed motion", ROWS,
           "lam * law_rate(rows, laws, r, t) * dt", "lam * law_rate(rows, laws, r, t + dt) * dt",
           (SHORT, FORCES, GAUSS, KNOWN)),
    Mutant("reactions: moment about the mass centre", REACTIONS,
           "moment = sub(moment, cross(arm, force))", "moment = add(moment, cross(arm, force))",
           (SHORT, JOINTS, INSTANT)),
    Mutant("rotation: product of two", ROTATION,
           "add(axpy(q0, p, scale(p0, q)), cross(p, q))",
           "add(axpy(q0, p, scale(p0, q)), cross(q, p))", (ROTATION,)),
    Mutant("rotation: series of the angle for small increments", ROTATION,
           "q * (1.0 / 80.0 - q * rest)", "q * (1.0 / 60.0 - q * rest)", (ROTATION, UPDATE)),
    Mutant("rotation: change of a vector", ROTATION,
           "axpy(0.5, cross(Q, Qa), Qa)", "axpy(-0.5, cross(Q, Qa), Qa)", (ROTATION,)),
    Mutant("start: angular velocities in the wrong axes", VELOCITIES,
           '"bji,bj->bi", start.frames.R, dW', '"bij,bj->bi", start.frames.R, dW',
           (START, MECHANISMS)),
    Mutant("start: angular velocities changed against the deck", VELOCITIES,
           "choose(system, _translations(system, free))", "choose(system, free)",
           (MECHANISMS, KNOWN, START)),
    Mutant("start: angular accelerations not divided by the length", VELOCITIES,
           "solution[frames.rotation] / frames.length[:, None]", "solution[frames.rotation]",
           (START, KNOWN, INSTANT)),
    Mutant("start: assembly rotates bodies the wrong way", POSITIONS,
           "scale(1.0 / frames.length[b], at(step", "scale(-1.0 / frames.length[b], at(step",
           (MECHANISMS,)),
    Mutant("configuration: forces not prepared", CONFIGURATION,
           "forces.prepare(system.forces, start.forces, system.scalar, state.reaction, "
           "state.reaction_trend)", "pass", (EVALUATE, ENGINE)),
    Mutant("configuration: laws of time not set", CONFIGURATION,
           "forces.set_time(system.forces, start.forces, t)", "pass", (EVALUATE, ENGINE, LOADS)),
    Mutant("configuration: no forces", CONFIGURATION,
           "forces.add_forces(system.forces, start.forces, system.scalar, frames, "
           "state.reaction, F)", "pass", (EVALUATE, ENGINE)),
    Mutant("configuration: no derivatives of forces", CONFIGURATION,
           "forces.add_derivatives(system.forces, start.forces, system.scalar, frames, "
           "state.reaction, out)", "pass", (EVALUATE,)),
    Mutant("configuration: energy without that of springs", CONFIGURATION,
           "return kinetic, potential + elastic", "return kinetic, potential", (WORK, EVALUATE)),
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


def try_out(folder: Path, mutant: Mutant) -> str:
    """What notices the ``mutant``; empty if nothing does."""
    path = folder / "msahl" / mutant.path
    text = path.read_text()
    if text.count(mutant.right) != 1:
        raise SystemExit(f"{mutant.name}: found {text.count(mutant.right)} times in {mutant.path}")
    path.write_text(text.replace(mutant.right, mutant.wrong))
    rest = tuple(test for test in GENERAL if test not in mutant.tests)
    for tests in (*mutant.tests, *rest):
        failed = runs(folder, (tests,))
        path.write_text(text)
        if failed and "::" in failed and runs(folder, (failed,)):
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
            test = try_out(folder, mutant)
            unnoticed += not test
            took = time.monotonic() - began
            print(
                f"| {mutant.name} | {mutant.path} | {test or 'NOTHING'} | {took:.0f} |", flush=True
            )
    return unnoticed


if __name__ == "__main__":
    sys.exit(main())
