"""Compile the kernels that the tests need, unless they are on disk already.

    python -m tests.support.compile_kernels

Processes that run tests side by side would each compile the kernels that they meet first.
"""

from msahl.cli.kernels import compile_everything
from msahl.jit.compiled import DISABLED, STORE
from msahl.jit.reach import package_digest


def main() -> None:
    """Compile everything, and remember it."""
    done = f"tests-{package_digest()[:16]}"
    if DISABLED or STORE.load(done) is not None:
        return
    compile_everything(print)
    STORE.save(done, b"")


if __name__ == "__main__":
    main()
