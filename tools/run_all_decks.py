"""Run every deck of an installed package without compiling, in the environment that this runs in.

    python run_all_decks.py [OPTION...]

It imports nothing of the package, so it shows what a user has. Options are those of ``msahl run``.
Fails if numba can be imported, if a run ends by other than a verdict, or if it compiled anything:
the folder of kernels that it is given must remain without a file.
"""

import os
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path


def main() -> None:
    """Run all decks; print those that failed."""
    if find_spec("numba"):
        sys.exit("numba is installed: this would not show that nothing needs it")
    package = find_spec("msahl")
    assert package is not None
    decks = sorted((Path(str(package.origin)).parent / "decks").glob("*/*.xml"))
    with tempfile.TemporaryDirectory() as place:
        failed = [deck for deck in decks if not _runs(deck, Path(place))]
        compiled = list(Path(place).glob("cache/kernels/*"))
    print(f"{len(decks) - len(failed)} of {len(decks)} decks ran, {len(compiled)} kernels compiled")
    sys.exit(1 if failed or compiled or not decks else 0)


def _runs(deck: Path, place: Path) -> bool:
    """Run a deck for a moment of its time; whether that ends with a verdict."""
    command = [sys.executable, "-c", "from msahl.entry import main; main()", "run", str(deck), "-q"]
    folder = place / deck.parent.name / deck.stem
    options = ["--t-final", "0.05", "-o", str(folder), *sys.argv[1:]]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(place / "cache")}
    done = subprocess.run([*command, *options], env=environment, cwd=place, check=False)
    if done.returncode not in (0, 1):  # PASS or WARN, FAIL
        print(f"{deck}: exit status {done.returncode}", flush=True)
    return done.returncode in (0, 1)


if __name__ == "__main__":
    main()
