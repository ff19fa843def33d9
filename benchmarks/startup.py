"""Seconds from the shell to the results: commands of a double pendulum, one after the other.

    python -m benchmarks.startup [--repeats 10] [-o DIR]

Writes startup.md: medians of all commands, which alternate, with what each takes above importing
numpy. MuJoCo needs an installation of its own package.
"""

import argparse
import statistics
import sys
import tempfile
from pathlib import Path

from benchmarks.machine import describe
from benchmarks.problems import THESIS
from benchmarks.process import MSAHL, run
from benchmarks.speed import RESULTS, tell

DECK = THESIS / "double_pendulum_89.xml"
MUJOCO_SCRIPT = Path(__file__).with_name("mujoco_script.py")
NUMPY, SCIPY = "import numpy", "import numpy, scipy.optimize"
PACKAGE, NEWTON, AUTO = "import msahl", "msahl run --solver newton", "msahl run"
MUJOCO = "script with MuJoCo"


def commands(folder: Path) -> dict[str, list[str]]:
    """What is measured, by the name it has on the page."""
    of_run = [*MSAHL, "run", str(DECK), "--dt", "0.01", "-q", "-o", str(folder / "results")]
    found = {words: [sys.executable, "-c", words] for words in (NUMPY, SCIPY, PACKAGE)}
    found |= {NEWTON: [*of_run, "--solver", "newton"], AUTO: of_run}
    found[MUJOCO] = [sys.executable, str(MUJOCO_SCRIPT), str(folder / "states.csv")]
    return found


def measure(repeats: int) -> dict[str, float]:
    """Medians of the seconds of each command, by the wall; without those that fail."""
    seconds: dict[str, list[float]] = {}
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
                seconds.setdefault(words, []).append(run(command, folder / "cache").seconds)
    return {words: statistics.median(values) for words, values in seconds.items()}


def page(seconds: dict[str, float], repeats: int, machine: list[str]) -> str:
    """The page of results."""
    numpy, scipy, newton = seconds[NUMPY], seconds[SCIPY] - seconds[NUMPY], seconds[NEWTON]
    rows = [f"| `{w}` | {s:.3f} | {s - numpy:.3f} |" for w, s in seconds.items()]
    asked = [
        _asked(f"{NEWTON}, above {NUMPY}", 0.20, newton - numpy),
        _asked(
            f"{AUTO}, above {NEWTON} and {SCIPY}", 0.15, seconds[AUTO] - seconds[NEWTON] - scipy
        ),
        _asked(f"{PACKAGE}, above {NUMPY}", 0.02, seconds[PACKAGE] - numpy),
    ]
    if MUJOCO in seconds:
        asked.append(_asked(f"{NEWTON}, not slower than MuJoCo", seconds[MUJOCO], newton))
    return "\n".join(
        [
            "# Start-up\n",
            f"The double pendulum of `{DECK.name}`, 10 s in 1000 steps with all tables, as "
            f"complete processes; medians of {repeats}, all commands in turn. Compiled code is "
            "there. The script with MuJoCo, `benchmarks/mujoco_script.py`, writes the same "
            "states.\n",
            *[f"- {line}" for line in machine],
            "\n| command | s | above numpy, s |\n|---|---|---|",
            *rows,
            "\n| asked for | at most, s | measured, s | |\n|---|---|---|---|",
            *asked,
            "",
        ]
    )


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
