"""Build a wheel that contains machine code for two levels of x86-64, so that it needs no numba.

    python -m tools.build_wheel                 all kernels (make wheel)
    python -m tools.build_wheel -o DIR DECK...  only the kernels that these decks need

The kernels of each level are compiled in a process of its own with an empty cache, for that level
instead of for this machine. Names and digests of the files are those that ``msahl.jit.files`` looks
for in an installed package. The wheel is built from a copy of the sources.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from msahl.jit.files import PORTABLE
from msahl.jit.kernel_store import HEAD, digest_of

ROOT = Path(__file__).parents[1]
SOURCES = ("msahl", "decks", "schemas", "LICENSE", "README.md", "pyproject.toml", "setup.py")
"""What an installation is made from."""


def copy_sources(target: Path) -> None:
    """Copy the sources into a new folder, without anything that was built."""
    target.mkdir(parents=True)
    ignored = shutil.ignore_patterns("__pycache__", "kernels")
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, target / name, ignore=ignored)
        else:
            shutil.copy(ROOT / name, target / name)


def compile_for(level: str, cache: Path, decks: list[str]) -> None:
    """Compile the kernels of some decks, or all, for one level of x86-64 into a cache."""
    # The name of the level implies its features; those of this machine must not be added.
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(cache),
        "NUMBA_CPU_NAME": level,
        "NUMBA_CPU_FEATURES": "",
    }
    program = "from msahl.cli.main import main; main()"
    command = [sys.executable, "-c", program, "compile", *(decks or ["--all"])]
    subprocess.run(command, env=environment, check=True)


def package(cache: Path, target: Path) -> int:
    """Copy the object files of a cache into the package; return their size in bytes."""
    target.mkdir(parents=True)
    size = 0
    for path in (cache / "kernels").iterdir():
        name, _, _ = path.name.rpartition("-")  # without compiler and processor
        if path.suffix == ".bc" or not name:
            continue
        content = path.read_bytes()[HEAD:]
        (target / name).write_bytes(digest_of(name, content) + content)
        size += len(content)
    return size


def main() -> None:
    """Write the wheel."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", default="dist", help="folder of the wheel")
    parser.add_argument("decks", nargs="*", help="decks to compile for (default: all kernels)")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sources = Path(folder) / "sources"
        copy_sources(sources)
        for level in PORTABLE:
            compile_for(level, Path(folder) / level, given.decks)
            target = sources / "msahl" / "kernels" / level
            size = package(Path(folder) / level, target)
            print(f"{level}: {len(list(target.iterdir()))} files, {size / 1e6:.1f} MB")
        pip = [sys.executable, "-m", "pip", "wheel", "-q", "--disable-pip-version-check"]
        subprocess.run([*pip, "--no-deps", "-w", given.o, str(sources)], check=True)


if __name__ == "__main__":
    main()
