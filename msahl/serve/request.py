"""What a client sends to a server: the command line, and what a process inherits from its caller.

A request is its length in four bytes and fields that end with a zero byte, which neither words nor
variables of the environment can contain. Open files and the working folder come beside it, as
descriptors.
"""

import os
import sys

AT_IMPORT = (
    b"COVERAGE", b"GOTO", b"HOME", b"LANG", b"LC_", b"LD_", b"MALLOC_", b"MKL_", b"MSAHL_",
    b"NUMBA_", b"OMP_", b"OPENBLAS_", b"PYTHON", b"XDG_CACHE_HOME",
)  # fmt: skip
"""Begins of the names of variables that count when Python, numpy or this program are loaded."""
ONE_THREAD = [
    (name, b"1") for name in (b"OMP_NUM_THREADS", b"OPENBLAS_NUM_THREADS", b"MKL_NUM_THREADS")
]


def packed(words: list[str], ignored: list[int], files: list[int]) -> bytes:
    """Return the request of this process for a command line."""
    umask = os.umask(0o77)
    os.umask(umask)
    groups: list[list[bytes]] = [
        installation(),
        [b"%d" % umask],
        [b"%d" % number for number in ignored],
        [b"%d" % number for number in files],
        [os.fsencode(word) for word in words],
        [name + b"=" + value for name, value in os.environb.items()],
    ]
    fields = [field for group in groups for field in (b"%d" % len(group), *group)]
    content = b"".join(field + b"\0" for field in fields)
    return len(content).to_bytes(4, "little") + content


def installation() -> list[bytes]:
    """Return what decides how the program is loaded: Python, its options, and the environment,
    where the commands that are served set one thread themselves.
    """
    flags = sys.flags
    options = f"{sys.version} {flags.optimize} {flags.dev_mode} {flags.utf8_mode} {sys.warnoptions}"
    variables = [
        name + b"=" + value
        for name, value in os.environb.items()
        if name.startswith(AT_IMPORT)
        and name != b"MSAHL_SERVER"
        and (name, value) not in ONE_THREAD
    ]
    return [os.fsencode(sys.executable), options.encode(), *sorted(variables)]
