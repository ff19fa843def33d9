"""Find the cause of the thesis's convergence errors by experiment: each weakness separately.

    python -m benchmarks.convergence.experiment            run all, store results, write the page
    python -m benchmarks.convergence.experiment --page     write the page from the stored results

Writes outcomes.csv, conditions.csv, docs/validation/convergence.md and its figure.
"""

import sys
from concurrent.futures import ProcessPoolExecutor

from benchmarks.convergence.printed import PROBLEMS, STEPS
from benchmarks.convergence.results import Condition, Outcome, Results, read, write
from benchmarks.convergence.stepping import Program, condition, reach

CONDITION_STEPS = (0.1, 0.04, 0.01, 0.004, 0.002, 1e-3, 1e-4, 1e-5)
CONDITION_PROBLEMS = (
    "single_pendulum_89",
    "double_pendulum_89",
    "triple_pendulum_89",
    "top_1",
)

SHORT = (
    Program("none", tolerance=1e-12),
    Program("unscaled", scaled=False, tolerance=1e-12),
    Program("differences", differences=True, tolerance=1e-12),
    Program("total", total=True, tolerance=1e-12),
    Program("velocities", as_given=True, tolerance=1e-12),
    Program("both 1e-8", scaled=False, differences=True, tolerance=1e-8),
    Program("both 1e-10", scaled=False, differences=True, tolerance=1e-10),
    Program("both 1e-11", scaled=False, differences=True, tolerance=1e-11),
    Program("both 1e-12", scaled=False, differences=True, tolerance=1e-12),
    Program("both 1e-13", scaled=False, differences=True, tolerance=1e-13),
)
ABSOLUTE = tuple(
    Program(f"absolute {bound:.0e}", False, True, tolerance=1e-12, absolute=bound)
    for bound in (1e-10, 1e-12, 1e-14)
)
LONG = tuple(p for p in SHORT if p.name in ("none", "both 1e-11", "both 1e-12"))


def run_program(case: tuple[Program, float, str, float]) -> Outcome:
    """Return the outcome of a program for a problem and step size."""
    program, t_final, problem, h = case
    reached, why, error, residual = reach(problem, h, t_final, program)
    return Outcome(program.name, t_final, problem, h, reached, why or None, error, residual)


def run_all() -> Results:
    """Return all outcomes and condition numbers."""
    cases = [(p, 10.0, problem, h) for p in SHORT + ABSOLUTE for problem in PROBLEMS for h in STEPS]
    cases += [(p, 100.0, problem, h) for p in LONG for problem in PROBLEMS for h in STEPS]
    outcomes = []
    with ProcessPoolExecutor(2) as pool:
        for outcome in pool.map(run_program, cases):
            outcomes.append(outcome)
            print(outcome, flush=True)
    conditions = [
        Condition(problem, h, scaled, condition(problem, h, bool(scaled)))
        for problem in CONDITION_PROBLEMS
        for h in CONDITION_STEPS
        for scaled in (0, 1)
    ]
    return Results(outcomes, conditions)


def main() -> None:
    """Run the experiment, unless only the page is asked for, and write the page."""
    from benchmarks.convergence.page import write_page

    if "--page" not in sys.argv:
        write(run_all())
    write_page(read())


if __name__ == "__main__":
    main()
