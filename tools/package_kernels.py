"""Compile all kernels for the processors that a wheel supports, and put them into the package.

    python tools/package_kernels.py          compile, write msahl/kernels
    python tools/package_kernels.py --clean  remove msahl/kernels

``make wheel`` calls it. The kernels of each level are compiled in a process of its own with an
empty cache, for that level instead of for this machine. Names and digests of the files are those
that ``msahl.jit.files`` looks for in an installed package.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from msahl.jit.files import PORTABLE
from msahl.jit.kernel_store import HEAD, digest_of

TARGET = Path(__file__).parents[1] / "msahl" / "kernels"


def compile_for(level: str, cache: Path) -> None:
    """Compile everything for one level of x86-64 into the folder ``cache``."""
    # The name of the level implies its features; those of this machine must not be added.
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(cache),
        "NUMBA_CPU_NAME": level,
        "NUMBA_CPU_FEATURES": "",
    }
    program = "from msahl.cli.main import main; main()"
    command = [sys.executable, "-c", program, "compile", "--all"]
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
    """Write the folder ``msahl/kernels``, or remove it."""
    shutil.rmtree(TARGET, ignore_errors=True)
    if "--clean" in sys.argv:
        return
    with tempfile.TemporaryDirectory() as folder:
        # Nothing is packaged before all is compiled: what the package has is not compiled again.
        for level in PORTABLE:
            compile_for(level, Path(folder) / level)
        for level in PORTABLE:
            size = package(Path(folder) / level, TARGET / level)
            print(f"{level}: {len(list((TARGET / level).iterdir()))} files, {size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
