"""Seconds from the shell to the results: commands of a double pendulum, one after the other.

    python -m benchmarks.startup [--repeats 10] [-o DIR]

Writes startup.md: medians and minima of all commands, which alternate, so that what else the
machine does meets all of them alike. Of the peers those are measured that are installed.
"""

import argparse
import statistics
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from benchmarks.machine import describe
from benchmarks.problems import THESIS
from benchmarks.process import MSAHL, Ended, run
from benchmarks.speed import RESULTS, tell

DECK = THESIS / "double_pendulum_89.xml"
MUJOCO_SCRIPT = Path(__file__).with_name("mujoco_script.py")
EXUDYN_SCRIPT = Path(__file__).with_name("exudyn_script.py")
NUMPY, SCIPY = "import numpy", "import numpy, scipy.optimize"
PACKAGE, NEWTON, AUTO = "import msahl", "msahl run --solver newton", "msahl run"
MUJOCO, EXUDYN = "script with MuJoCo", "script with Exudyn"
PEER_RATIO, SOLVER_SECONDS = 1.1, 0.02
"""What is asked for: the most that a run takes relative to the script with MuJoCo, and the most by
which the default solver takes longer than newton."""


class Cost(NamedTuple):
    """Seconds of one command over all its repetitions."""

    wall: float  # median
    least: float  # by the wall
    cpu: float  # median of user and system time
    least_cpu: float


def commands(folder: Path) -> dict[str, list[str]]:
    """What is measured, by the name it has on the page."""
    of_run = [*MSAHL, "run", str(DECK), "--dt", "0.01", "-q", "-o", str(folder / "results")]
    found = {words: [sys.executable, "-c", words] for words in (NUMPY, SCIPY, PACKAGE)}
    found |= {NEWTON: [*of_run, "--solver", "newton"], AUTO: of_run}
    found[MUJOCO] = [sys.executable, str(MUJOCO_SCRIPT), str(folder / "states.csv")]
    found[EXUDYN] = [sys.executable, str(EXUDYN_SCRIPT), str(folder / "states.txt")]
    return found


def measure(repeats: int) -> dict[str, Cost]:
    """What each command takes; without those that fail."""
    ended: dict[str, list[Ended]] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        everything = commands(folder)
        for words, command in list(everything.items()):
            try:
                run(command, folder / "cache")  # which compiles, and imports for the first time
            except Exception as error:
                tell(f"{words}: omitted ({error})")
                del everything[words]
        for k in range(repeats):
            tell(f"{k + 1} of {repeats}")
            for words, command in everything.items():
                ended.setdefault(words, []).append(run(command, folder / "cache"))
    return {words: _cost(runs) for words, runs in ended.items()}


def _cost(runs: list[Ended]) -> Cost:
    wall, cpu = [one.seconds for one in runs], [one.cpu for one in runs]
    return Cost(statistics.median(wall), min(wall), statistics.median(cpu), min(cpu))


def page(costs: dict[str, Cost], repeats: int, machine: list[str]) -> str:
    """The page of results."""
    rows = [f"| `{w}` | {' | '.join(f'{s:.3f}' for s in cost)} |" for w, cost in costs.items()]
    head = "| command | median, s | least, s | CPU median, s | CPU least, s |"
    return "\n".join(
        [
            "# Start-up\n",
            f"The double pendulum of `{DECK.name}`, 10 s in 1000 steps, as complete processes; "
            f"{repeats} of each command, all commands in turn. Compiled code is there. msahl "
            "writes states, reactions, estimated errors and its record of the run; the scripts "
            "with other programs, `benchmarks/*_script.py`, write the states.\n",
            *[f"- {line}" for line in machine],
            f"\n{head}\n|---|---|---|---|---|",
            *rows,
            "\n| asked for, of the least CPU times | at most | measured | |\n|---|---|---|---|",
            *_judged(costs),
            "",
        ]
    )


def _judged(costs: dict[str, Cost]) -> list[str]:
    """Lines on what is asked for, as far as it was measured."""
    least = {words: cost.least_cpu for words, cost in costs.items()}
    gap = least[AUTO] - least[NEWTON]
    lines = [_asked(f"{AUTO} after {NEWTON}, s", SOLVER_SECONDS, gap)]
    for words in (NEWTON, AUTO):
        if MUJOCO in least:
            ratio = least[words] / least[MUJOCO]
            lines.append(_asked(f"{words}, relative to the {MUJOCO}", PEER_RATIO, ratio))
    return lines


def _asked(what: str, limit: float, found: float) -> str:
    return f"| {what} | {limit:.3f} | {found:.3f} | {'yes' if found <= limit else '**no**'} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=10, metavar="N")
    parser.add_argument("-o", "--output", type=Path, default=RESULTS, metavar="DIR")
    options = parser.parse_args()
    machine = describe()
    text = page(measure(options.repeats), options.repeats, machine)
    (options.output / "startup.md").write_text(text)


if __name__ == "__main__":
    main()
