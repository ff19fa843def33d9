"""Run the cases of tests/regression/cases.csv and compare them with stored results, or store them.

    python tools/regress.py check      compare with the stored results; exit 1 on a difference
    python tools/regress.py update     store the results, and print what changed
    python tools/regress.py horizon    print the time up to which each deck can be trusted

A chaotic motion is stored only as long as the positions of a run at half the step size stay within
``PARTED`` of it. Until then an error of h^2 (some 1e-5 m) has grown by less than 1e4, and so have
rounding errors: results of another machine or compiler stay within the tolerances.
"""

import csv
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from msahl.results.read import read_table

ROOT = Path(__file__).parents[1]
STORED = ROOT / "tests" / "regression"
BIN = Path(sys.executable).parent
TABLES = ("states.csv", "reactions.csv", "work.csv")

PARTED = 0.05
"""Distance [m] at which two runs have diverged: a hundredth of the pendulums' arms."""
TOLERANCES = ("--rtol", "1e-7", "--atol", "1e-7")
"""Rounding errors of 1e-13 times 1e4, times a margin of 100; those of forces are 1e-9 N."""
LARGEST = 200_000
"""Largest size of a stored table in bytes."""


@dataclass(frozen=True)
class Case:
    """A stored run of a deck at a step size, thinned."""

    name: str
    deck: str
    dt: str
    t_final: str
    every: str

    def run(self, folder: Path, dt: float | None = None, t_final: str | None = None) -> None:
        """Run the case, at its own step or at ``dt`` with the rows at the same times."""
        halved = round(float(self.dt) / dt) if dt else 1
        words = ["--dt", str(dt or self.dt), "--t-final", t_final or self.t_final]
        words += ["--every", str(int(self.every) * halved), "-q", "-o", str(folder)]
        subprocess.run([BIN / "msahl", "run", ROOT / "decks" / self.deck, *words], check=True)

    def horizon(self, folder: Path, t_final: str | None = None) -> float:
        """Time to which this step and half of it agree."""
        h = float(self.dt)
        for name, dt in (("h", h), ("half", h / 2)):
            self.run(folder / name, dt, t_final)
        a, b = (read_table(folder / name / "states.csv") for name in ("h", "half"))
        places = [c for c in a.columns if str(c).rsplit(".", 1)[-1] in ("x", "y", "z")]
        parted = np.abs(a[places].to_numpy() - b[places].to_numpy()).max(axis=1) > PARTED
        time = a["time"].to_numpy()
        return float(time[parted.argmax() - 1] if parted.any() else time[-1])


def cases() -> list[Case]:
    """Return the cases of the table."""
    with (STORED / "cases.csv").open(newline="") as file:
        return [Case(**row) for row in csv.DictReader(file)]


def compare(case: Case, folder: Path) -> int:
    """Return the exit status of ``msahl-post compare``, which prints the differences."""
    print(f"{case.name}:", flush=True)
    paths = str(folder), str(STORED / case.name)
    command = [str(BIN / "msahl-post"), "compare", *paths, *TOLERANCES]
    return subprocess.run(command, check=False).returncode


def check(case: Case, folder: Path) -> bool:
    """Run the case and return whether its results are the stored ones."""
    case.run(folder)
    return compare(case, folder) == 0


def update(case: Case, folder: Path) -> bool:
    """Store the case anew, unless it is too wild or too large to be stored."""
    case.run(folder / "run")
    if (STORED / case.name).is_dir():
        compare(case, folder / "run")
    else:
        print(f"{case.name}: new")
    horizon = case.horizon(folder)
    if horizon < float(case.t_final):
        print(f"{case.name}: runs of another step part after {horizon} s; store no more than that")
        return False
    tables = [path for name in TABLES if (path := folder / "run" / name).is_file()]
    if any(path.stat().st_size > LARGEST for path in tables):
        print(f"{case.name}: more than {LARGEST} bytes; keep fewer rows")
        return False
    shutil.rmtree(STORED / case.name, ignore_errors=True)
    (STORED / case.name).mkdir()
    for path in tables:
        shutil.copy(path, STORED / case.name)
    return True


def horizon(case: Case, folder: Path) -> bool:
    """Print how far the deck can be trusted within 20 s."""
    print(f"{case.name}: {case.horizon(folder, '20')} s")
    return True


ACTIONS = {"check": check, "update": update, "horizon": horizon}


def main() -> int:
    """Do what the first argument says with every case; exit status."""
    action = ACTIONS[sys.argv[1]]
    good = True
    for case in cases():
        with tempfile.TemporaryDirectory() as folder:
            good &= action(case, Path(folder))
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
