"""Compiled code does what its Python does, is kept on disk, and needs a compiler only once."""

import os
import subprocess
import sys
from importlib import metadata

import numpy as np
import pytest

from msahl.jit import compiled, files, reach
from msahl.jit.arguments import describe, symbol_of
from msahl.jit.compiled import STOPWATCH, Compiled, prepare
from msahl.jit.files import Files, portable_name, version_of
from msahl.jit.kernel_store import Store, digest_of
from msahl.jit.object_file import ObjectFile, name_of
from msahl.jit.progress import CompileError
from tests.jit import kernels

pytestmark = pytest.mark.skipif(compiled.DISABLED, reason="nothing is compiled")


PAIR = (np.ones(2), 0.25, kernels.outer().inner)


@pytest.fixture
def store(tmp_path, monkeypatch):
    """An empty store, and no memory of what was loaded."""
    empty = Store(tmp_path / "root" / "kernels")
    monkeypatch.setattr(compiled, "STORE", empty)
    monkeypatch.setattr(compiled, "_loaded", {})
    return empty


def test_every_kind_of_argument_arrives():
    fast, group = Compiled(kernels.everything), kernels.outer()
    for x, wanted, size in ((0.5, True, 3), (-1.5, False, 5), (0.0, True, 0)):
        mine, theirs = np.zeros(size), np.zeros(size)
        assert fast(group, x, mine, wanted, PAIR) == kernels.everything(
            group, x, theirs, wanted, PAIR
        )
        assert mine.tobytes() == theirs.tobytes()


def test_a_kernel_is_chosen_by_a_number():
    kind, table = np.array([1, 0, 1]), np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]])
    mine, theirs = np.zeros(3), np.zeros(3)
    Compiled(kernels.chosen)(kind, table, mine)
    kernels.chosen(kind, table, theirs)
    assert mine.tolist() == theirs.tolist() == [18.0, 4.5, 54.0]


def test_arrays_are_seen_as_they_are_at_each_call():
    fast, group, out = Compiled(kernels.everything), kernels.outer(), np.zeros(2)
    for value in (1.0, 7.0):
        group.inner.table[:] = value
        fast(group, 1.0, out, True, PAIR)
        assert out[0] == kernels.weigh(group.inner, 1.0) + 0.125
    other = kernels.outer(rows=9)
    assert fast(other, 1.0, out, True, PAIR)[1] == 10


def test_types_have_different_descriptions():
    known = [1.0, 1, True, None, np.zeros(2), np.zeros((2, 2)), np.zeros((2, 3)).T, kernels.outer()]
    assert len({describe(value) for value in known}) == len(known)
    assert describe(np.float64(1.0)) == describe(1.0)
    with pytest.raises(TypeError, match="no str"):
        describe("text")
    with pytest.raises(TypeError, match="byte order"):
        describe(np.zeros(2).astype(np.dtype(float).newbyteorder()))


@pytest.mark.slow
def test_a_unit_has_a_file_of_its_own(store):
    group = kernels.outer()
    Compiled(kernels.everything)(group, 1.0, np.zeros(1), True, PAIR)
    objects = {path.name.split("-")[0] for path in store.folder.iterdir() if path.suffix != ".bc"}
    assert objects == {"tests.jit.kernels.everything", "tests.jit.kernels.weigh"}


def test_compiling_reports_its_progress(store, monkeypatch):
    told = []
    monkeypatch.setattr(STOPWATCH, "listen", told.append)
    before = STOPWATCH.seconds
    Compiled(kernels.everything)(kernels.outer(), 1.0, np.zeros(1), True, PAIR)
    done = [progress.done for progress in told]
    assert done == sorted(done)
    assert told[-1].done == told[-1].known
    # Six functions (with None, scaled is another one), and the objects of an entry and a unit.
    assert told[-1].known == 8
    assert STOPWATCH.seconds > before


def test_what_is_on_disk_is_not_compiled_again(store, monkeypatch):
    Compiled(kernels.twice)(3.0)
    monkeypatch.setattr(compiled, "_loaded", {})
    monkeypatch.setattr(compiled, "_build", lambda *_: pytest.fail("compiled again"))
    assert compiled.on_disk([(Compiled(kernels.twice), (3.0,))])
    prepare([(Compiled(kernels.twice), (3.0,))])


def test_damaged_code_is_compiled_again_without_a_word(store, monkeypatch):
    """Machine code with flipped bits would kill the process."""
    unit = Compiled(kernels.twice).unit((3.0,))
    prepare([(Compiled(kernels.twice), (3.0,))])
    (path,) = (path for path in store.folder.iterdir() if path.suffix != ".bc")
    complete = path.read_bytes()
    chance = np.random.default_rng(0)
    for place in chance.integers(0, len(complete), 4):
        path.write_bytes(complete[:place] + bytes([complete[place] ^ 0x40]) + complete[place + 1 :])
        assert Files(store).find(name_of(unit)) is None
        path.write_bytes(complete[:place])
        assert Files(store).find(name_of(unit)) is None
    # Complete, and yet no object file.
    store.save(path.name, b"no object")
    assert Files(store).find(name_of(unit)) is None
    monkeypatch.setattr(compiled, "_loaded", {})
    prepare([(Compiled(kernels.twice), (3.0,))])
    assert path.read_bytes() == complete
    assert compiled.trouble() == ""


def test_files_of_the_package_come_first(store, tmp_path, monkeypatch):
    unit = Compiled(kernels.twice).unit((3.0,))
    name = portable_name(name_of(unit))
    content = ObjectFile.of(b"machine code", "float", []).as_bytes()
    monkeypatch.setattr(files, "packaged_folder", lambda: tmp_path)
    (tmp_path / name).write_bytes(digest_of(name, content) + content)
    found = Files(store).find(name_of(unit))
    assert found is not None
    assert found.code == b"machine code"
    (tmp_path / name).write_bytes(digest_of(name, content) + content[:-1])
    assert Files(store).find(name_of(unit)) is None


@pytest.mark.slow
def test_a_kernel_that_cannot_be_compiled_is_named(store):
    with pytest.raises(CompileError, match="hopeless"):
        Compiled(kernels.hopeless)(1.0)


def test_a_request_to_stop_ends_compiling(store):
    arguments = (kernels.outer(), 1.0, np.zeros(1), True, PAIR)
    with pytest.raises(KeyboardInterrupt):
        prepare([(Compiled(kernels.everything), arguments)], stopped=lambda: True)
    assert not any(path.suffix != ".bc" for path in store.folder.glob("*everything*"))


def test_without_a_compiler_the_message_says_what_to_install(store, monkeypatch):
    monkeypatch.setattr("msahl.jit.compiled.version_of", lambda package: "")
    with pytest.raises(CompileError, match="pip install numba"):
        Compiled(kernels.twice)(1.0)


def test_versions_are_those_of_the_packages():
    for package in ("numba", "llvmlite", "numpy", "scipy"):
        assert version_of(package) == metadata.version(package)
    assert version_of("no_such_package") == ""


PROGRAM = """
import numpy as np
from msahl.jit.compiled import compiled
from tests.jit import kernels
out = np.zeros(3)
pair = (np.ones(2), 0.25, kernels.outer().inner)
results = compiled(kernels.everything)(kernels.outer(), 0.7, out, True, pair)
print([*map(float, results), *out.tolist()])
"""


def run_program(folder, **environment):
    """What another process prints whose object files are in ``folder``."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder)} | environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def uncompiled_program():
    out = np.zeros(3)
    results = kernels.everything(kernels.outer(), 0.7, out, True, PAIR)
    return f"{[*map(float, results), *out.tolist()]}\n"


@pytest.mark.slow
def test_a_file_that_is_missing_is_made_and_linked_with_the_others(tmp_path):
    """Where only a unit, or only the entry, is on disk, the other one finds it."""
    assert run_program(tmp_path) == uncompiled_program()
    for name in ("everything", "weigh"):
        (path,) = (p for p in tmp_path.glob(f"kernels/*{name}*") if p.suffix != ".bc")
        path.unlink()
        assert run_program(tmp_path) == uncompiled_program()
        assert path.exists()


@pytest.mark.slow
def test_plain_numba_gives_the_same_digits(tmp_path):
    """Where numba's insides differ from what is extended, it compiles everything itself."""
    assert run_program(tmp_path, MSAHL_PLAIN_NUMBA="1") == uncompiled_program()


def test_symbols_tell_module_name_and_types():
    symbol = symbol_of("package.module", "function", (describe(1.0),))
    assert symbol.startswith("package.module.function-")
    assert symbol != symbol_of("package.module", "function", (describe(1),))


@pytest.mark.slow
def test_nothing_is_kept_of_sources_that_changed_meanwhile(store, monkeypatch):
    """The key is that of the file, the code that of the module as it was imported."""
    monkeypatch.setattr(reach, "changed", {"tests.jit.kernels"})
    monkeypatch.setattr(files, "changed", reach.changed)
    assert Compiled(kernels.twice)(3.0) == 6.0
    assert not store.folder.exists() or not list(store.folder.iterdir())
