"""Finds object files: those of the installed package first, then those in the user's folder.

The name of a file lists everything its content depends on: the kernel and its types of arguments,
its sources (``reach``), the processor, and in the user's folder the compiler. Files of the package
are made for a few levels of processors (``PORTABLE``), and can be loaded without any compiler.
"""

import hashlib
import os
import platform
import sys
from functools import cache, cached_property
from importlib.util import find_spec
from pathlib import Path

from msahl.jit.kernel_store import HEAD, Store, digest_of
from msahl.jit.object_file import Name, ObjectFile
from msahl.jit.reach import PACKAGE, changed, own_digest, resolve, source_digest
from msahl.jit.source_table import SourceTable

LAYOUT = 3
"""Version of the format of object files."""
SETTINGS = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_OPT")
"""Variables of the environment that change what the compiler makes."""
FEATURES_V3 = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
X86, ARM = ("x86_64", "amd64"), ("aarch64", "arm64")


def portable_levels(machine: str, system: str) -> dict[str, tuple[str, ...]]:
    """Return the processors that the files of a package are made for, the fastest first, and what
    they need; empty if there are none for such a machine.
    """
    if machine.lower() in X86:
        return {"x86-64-v3": FEATURES_V3, "x86-64": ()}
    if machine.lower() in ARM:
        return {"apple-m1" if system == "darwin" else "generic": ()}
    return {}


PORTABLE = portable_levels(platform.machine(), sys.platform)
"""The processors of this machine's platform."""


def user_folder() -> Path:
    """Return the folder of the user's object files."""
    kept = os.environ.get("NUMBA_CACHE_DIR")
    return Path(kept or _cache_folder()) / "kernels"


def _cache_folder() -> str:
    """Return the program's folder for what can be made again, where the system has it.

    ``platformdirs`` serves all systems. Its usual answer on Linux is given here: to import it takes
    longer than to find and load the code of a model.
    """
    chosen, home = os.environ.get("XDG_CACHE_HOME"), os.environ.get("HOME", "")
    base = chosen if chosen is not None else f"{home.rstrip('/')}/.cache"
    usual = sys.platform == "linux" and "ANDROID_DATA" not in os.environ
    if usual and base.startswith("/") and (chosen or home.startswith("/")):
        return f"{base}/msahl"
    import platformdirs

    return platformdirs.user_cache_dir("msahl", appauthor=False)


class Files:
    """Object files by kernel and types of arguments."""

    def __init__(self, store: Store) -> None:
        self.store = store

    def find(self, name: Name) -> ObjectFile | None:
        """Return the machine code of a kernel; None if there is none that can be trusted."""
        portable = portable_name(name)
        content = _packaged(portable) or self.store.load(self._own_name(portable))
        if not content:
            return None
        try:
            return ObjectFile.from_bytes(content)
        except (ValueError, TypeError, KeyError):
            self.store.discard(self._own_name(portable))
            return None

    def save(self, name: Name, compiled: ObjectFile) -> None:
        """Keep the machine code of a kernel, if that is possible."""
        file = self._own_name(portable_name(name))
        if not changed:
            self.store.save(file, compiled.as_bytes())

    def find_code(self, name: Name) -> ObjectFile | None:
        """Return the intermediate code of a function; None if there is none."""
        content = self.store.load(self._code_name(name))
        return ObjectFile.from_bytes(content) if content else None

    def save_code(self, name: Name, code: ObjectFile) -> None:
        """Keep the intermediate code of a function, if that is possible."""
        file = self._code_name(name)
        if not changed:
            self.store.save(file, code.as_bytes())

    def _code_name(self, name: Name) -> str:
        module, function, symbol = name
        return f"{symbol}-{_own_sources(module, function)}-{self.machine}.bc"

    def _own_name(self, portable: str) -> str:
        return f"{portable}-{self.machine}"

    @cached_property
    def machine(self) -> str:
        """A short name for the compiler and the processor."""
        from llvmlite import binding as llvm

        machine = [llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten(), sys.platform]
        machine += [version_of("numba"), version_of("llvmlite"), sys.implementation.cache_tag]
        machine += [os.environ.get(name, "") for name in SETTINGS]
        return hashlib.sha256(repr((LAYOUT, machine)).encode()).hexdigest()[:12]


def portable_name(name: Name) -> str:
    """Return the file name of a kernel, its types of arguments and its sources."""
    module, function, symbol = name
    return f"{symbol}-{_sources(module, function)}"


@cache
def source_table() -> SourceTable:
    """Return the table of the digests of this process."""
    return SourceTable(user_folder())


@cache
def _sources(module: str, name: str) -> str:
    return source_table().digest(module, name, lambda: source_digest(resolve(module, name)))[:24]


@cache
def _own_sources(module: str, name: str) -> str:
    return own_digest(resolve(module, name))[:24]


@cache
def version_of(package: str) -> str:
    """Return the version of an installed package; empty if there is none.

    It is in the name of the folder PACKAGE-VERSION.dist-info beside the package. Only packages that
    have none are looked up by ``importlib.metadata``, which takes 15 ms to import.
    """
    spec = find_spec(package)
    if spec is None:
        return ""
    for path in spec.submodule_search_locations or ():
        for found in Path(path).parent.glob(f"{package}-*.dist-info"):
            return found.name.removeprefix(f"{package}-").removesuffix(".dist-info")
    from importlib import metadata

    return metadata.version(package)


@cache
def packaged_folder() -> Path | None:
    """Return the folder of the package's files for this processor; None if there is none."""
    folder = PACKAGE / "kernels"
    if not folder.is_dir():
        return None
    from llvmlite import binding as llvm

    found = llvm.get_host_cpu_features()
    fitting = (level for level, needed in PORTABLE.items() if all(map(found.get, needed)))
    return next((folder / level for level in fitting if (folder / level).is_dir()), None)


def _packaged(name: str) -> bytes | None:
    """Return a file of the package; None if there is none, or if it is damaged."""
    folder = packaged_folder()
    if folder is None:
        return None
    try:
        content = (folder / name).read_bytes()
    except OSError:
        return None
    return content[HEAD:] if content[:HEAD] == digest_of(name, content[HEAD:]) else None
