"""Seconds of complete processes: interpreter, imports, building, and one run.

python -m benchmarks.beams.processes PROGRAM PROBLEM FAMILY ELEMENTS [STEP]
"""

import statistics
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

from benchmarks.beams.problems import PROBLEMS
from benchmarks.beams.setting import Setting
from benchmarks.beams.store import Run, front

MODULES = {"msahl": "benchmarks.beams.ours", "Exudyn": "benchmarks.beams.exudyn_models"}
TARGET = 1e-3
"""Error, over the length, of the runs that are measured."""
PROCESSES = "beams_processes.txt"
SAMPLES = 3


def measure_processes(runs: list[Run], folder: Path) -> None:
    """Write how long complete processes take that solve each problem to 1e-3."""
    lines = []
    for problem in PROBLEMS:
        for program in MODULES:
            own = [r for r in runs if (r.problem, r.program) == (problem, program)]
            good = [run for run in front(own) if run.error <= TARGET]
            if good:
                seconds = statistics.median(_process(good[0]) for _ in range(SAMPLES))
                lines.append(f"{problem},{program},{seconds:.3g}\n")
    (folder / PROCESSES).write_text("".join(lines))


def _process(run: Run) -> float:
    """Seconds of the wall."""
    family, elements, step = run.setting
    command = [
        sys.executable,
        "-m",
        "benchmarks.beams.processes",
        run.program,
        run.problem,
        family,
        str(elements),
    ]
    began = time.perf_counter()
    subprocess.run(command + ([] if step is None else [repr(step)]), check=True)
    return time.perf_counter() - began


def main() -> None:
    program, problem, family, elements, *step = sys.argv[1:]
    setting = Setting(family, int(elements), float(step[0]) if step else None)
    import_module(MODULES[program]).solve(PROBLEMS[problem], setting)


if __name__ == "__main__":
    main()
