"""Build a wheel that contains machine code for the processors of its platform, without numba.

    python -m tools.build_wheel                 all kernels (make wheel)
    python -m tools.build_wheel -o DIR DECK...  only the kernels that these decks need

The kernels are compiled in a process of its own with an empty cache, for the levels of processors
that ``msahl.jit.files`` names (x86-64: two) instead of for this machine. What numba translates is
linked for every level; it is taken over from the user's folder of kernels as far as it is there.
(It differs with the processor only in how wide some vectors are, which LLVM divides as needed.) The
wheel is built from a copy of the sources, in a temporary folder that no build leaves behind: one
that was killed has lost its lock, and the next build removes its folder.
"""

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from msahl.jit import building, compiled
from msahl.jit.files import PORTABLE, Files, portable_name
from msahl.jit.kernel_store import HEAD, Store, digest_of
from msahl.jit.object_file import Name, ObjectFile
from msahl.locks import lock

ROOT = Path(__file__).parents[1]
SOURCES = ("msahl", "decks", "schemas", "LICENSE", "README.md", "pyproject.toml", "setup.py")
"""What an installation is made from."""
PREFIX = "msahl-wheel-"


def copy_sources(target: Path) -> None:
    """Copy the sources into a new folder, without anything that was built."""
    target.mkdir(parents=True)
    ignored = shutil.ignore_patterns("__pycache__", "kernels")
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, target / name, ignore=ignored)
        else:
            shutil.copy(ROOT / name, target / name)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Lend a folder that is removed in the end, also by a signal, or by the next build."""
    remove_abandoned()
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    with (
        tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True) as name,
        (Path(name) / "lock").open("wb") as file,
    ):
        lock(file.fileno())
        yield Path(name)


def remove_abandoned() -> None:
    """Remove the folders of builds that were killed: nobody holds their locks."""
    for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
        try:
            with (folder / "lock").open("r+b") as file:
                abandoned = lock(file.fileno())
        except OSError:  # it has just begun, or belongs to another user
            continue
        if abandoned:
            shutil.rmtree(folder, ignore_errors=True)


def compile_into(target: Path, decks: list[str], folder: Path) -> None:
    """Compile the kernels of some decks, or all, into a folder for each level of ``target``."""
    levels = list(PORTABLE)
    # The name of the level implies its features; those of this machine must not be added.
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(folder / "cache"),
        "NUMBA_CPU_NAME": levels[0],
        "NUMBA_CPU_FEATURES": "",
        "PYTHONPATH": str(ROOT),
        "TMPDIR": str(folder),
    }
    given = str(target), levels, str(compiled.STORE.folder), Files(compiled.STORE).machine
    begin = f"from tools.build_wheel import compile_levels; compile_levels(*{given!r})"
    subprocess.run([sys.executable, "-c", begin, *decks], env=environment, check=True)


def compile_levels(target: str, levels: list[str], known: str, machine: str) -> None:
    """Compile for the first of the ``levels``, and link the same for the others; ``known`` is the
    user's folder of kernels and ``machine`` what the names in it end with.
    """
    from msahl.cli.compile import compile_

    files = Files(compiled.STORE)
    _take_over(Store(Path(known)), machine, files.machine)
    compile_.main(sys.argv[1:] or ["--all"], standalone_mode=False)
    _copy(compiled.STORE.folder, Path(target) / levels[0])
    for level in levels[1:]:
        os.environ["NUMBA_CPU_NAME"] = level
        building.end_team()
        folder = Path(target) / level
        folder.mkdir(parents=True)

        def write(name: Name, code: ObjectFile, folder: Path = folder) -> None:
            _write(folder / portable_name(name), code.as_bytes())

        work = building.Build(files, lambda name: None, write)
        building.build(work, compiled.LOADED)
        _tell(level, folder)


def _take_over(known: Store, machine: str, wanted: str) -> None:
    """Take over what was translated for this machine already."""
    for path in known.folder.glob(f"*-{machine}.bc"):
        content = known.load(path.name)
        if content:
            name = path.name.removesuffix(f"{machine}.bc")
            compiled.STORE.save(f"{name}{wanted}.bc", content)


def _copy(kernels: Path, target: Path) -> None:
    """Copy the object files of a cache into the folder of a level."""
    target.mkdir(parents=True)
    for path in kernels.iterdir():
        name, _, _ = path.name.rpartition("-")  # without compiler and processor
        if path.suffix != ".bc" and name:
            _write(target / name, path.read_bytes()[HEAD:])
    _tell(target.name, target)


def _write(path: Path, content: bytes) -> None:
    path.write_bytes(digest_of(path.name, content) + content)


def _tell(level: str, folder: Path) -> None:
    sizes = [path.stat().st_size for path in folder.iterdir()]
    print(f"{level}: {len(sizes)} files, {sum(sizes) / 1e6:.1f} MB", flush=True)


def build_wheel(output: str, decks: list[str]) -> None:
    """Write the wheel into the folder ``output``."""
    with temporary_folder() as folder:
        sources = folder / "sources"
        copy_sources(sources)
        compile_into(sources / "msahl" / "kernels", decks, folder)
        pip = [sys.executable, "-m", "pip", "wheel", "-q", "--disable-pip-version-check"]
        environment = os.environ | {"TMPDIR": str(folder)}
        command = [*pip, "--no-deps", "-w", output, str(sources)]
        subprocess.run(command, env=environment, check=True)


def main() -> None:
    """Write the wheel."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", default="dist", help="folder of the wheel")
    parser.add_argument("decks", nargs="*", help="decks to compile for (default: all kernels)")
    given = parser.parse_args()
    if not PORTABLE:
        sys.exit("machine code in wheels is made for x86-64 and 64-bit ARM only")
    build_wheel(given.o, given.decks)


if __name__ == "__main__":
    main()
