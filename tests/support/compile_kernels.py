"""Compile the kernels that the tests need, unless they are on disk already.

    python -m tests.support.compile_kernels

Processes that run tests side by side would each compile the kernels that they meet first.
"""

import hashlib
from pathlib import Path

import msahl
from msahl.cli.kernels import compile_everything
from msahl.jit.compiled import DISABLED, STORE


def digest() -> str:
    """Return a name for the state of the package's sources."""
    found = hashlib.sha256()
    for source in sorted(Path(msahl.__file__).parent.rglob("*.py")):
        found.update(source.read_bytes())
    return found.hexdigest()[:16]


def main() -> None:
    """Compile everything, and remember it."""
    done = f"tests-{digest()}"
    if DISABLED or STORE.load(done) is not None:
        return
    compile_everything(print)
    STORE.save(done, b"")


if __name__ == "__main__":
    main()
