"""Where the thesis's convergence errors come from, by experiment: every weakness alone.

    python benchmarks/convergence/experiment.py            run all, keep results, write the page
    python benchmarks/convergence/experiment.py --page     write the page from results.json

Writes docs/validation/convergence.md and its figure.
"""

import json
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from benchmarks.convergence.printed import PROBLEMS, STEPS
from benchmarks.convergence.stepping import Program, condition, reach

HERE = Path(__file__).parent
RESULTS = HERE / "results.json"
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


def one(case):
    """Outcome of a program on a problem with a step."""
    program, t_final, problem, h = case
    reached, why, error, residual = reach(problem, h, t_final, program)
    return {
        "program": program.name,
        "t_final": t_final,
        "problem": problem,
        "h": h,
        "reached": reached,
        "why": why,
        "energy": error,
        "residual": residual,
    }


def measure():
    """All outcomes and condition numbers."""
    cases = [(p, 10.0, problem, h) for p in SHORT + ABSOLUTE for problem in PROBLEMS for h in STEPS]
    cases += [(p, 100.0, problem, h) for p in LONG for problem in PROBLEMS for h in STEPS]
    with ProcessPoolExecutor(2) as pool:
        outcomes = []
        for outcome in pool.map(one, cases):
            outcomes.append(outcome)
            print(*outcome.values(), flush=True)
    conditions = [
        {"problem": problem, "h": h, "scaled": scaled, "condition": condition(problem, h, scaled)}
        for problem in CONDITION_PROBLEMS
        for h in CONDITION_STEPS
        for scaled in (False, True)
    ]
    return {"outcomes": outcomes, "conditions": conditions}


if __name__ == "__main__":
    if "--page" not in sys.argv:
        RESULTS.write_text(json.dumps(measure(), indent=1) + "\n")
    from benchmarks.convergence.page import write_page

    write_page(json.loads(RESULTS.read_text()))
