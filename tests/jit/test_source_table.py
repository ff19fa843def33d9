"""Digests of sources are taken from the table only while no source has changed."""

import os

import platformdirs
import pytest

from msahl.jit import source_table
from msahl.jit.files import user_folder
from msahl.jit.source_table import SourceTable

SETTLED = source_table.SETTLED


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package of two files, in the process of a command; files may be as new as they are."""
    folder = tmp_path / "package"
    folder.mkdir()
    for name in ("a.py", "b.py"):
        (folder / name).write_text(f"NAME = '{name}'\n")
    monkeypatch.setattr(source_table, "PACKAGE", folder)
    monkeypatch.setattr(source_table, "_imported", lambda: {"a.py", "b.py"})
    monkeypatch.setattr(source_table, "is_command", lambda: True)
    monkeypatch.setattr(source_table, "SETTLED", -1e9)
    return folder


@pytest.fixture
def cache(tmp_path):
    return tmp_path / "cache"


def computed(cache, digest="d" * 64):
    """Whether a new process computes the digest of a function; it keeps what it computed."""
    calls = []
    table = SourceTable(cache)
    found = table.digest("a", "f", lambda: calls.append(1) or digest)
    assert found == digest
    assert table.digest("a", "f", lambda: pytest.fail("computed twice")) == digest
    table.save()
    return bool(calls)


def test_a_digest_is_computed_once(package, cache):
    assert computed(cache)
    assert not computed(cache)


@pytest.mark.parametrize("changed", ["a.py", "b.py"])
def test_an_edited_file_is_noticed_though_size_and_date_are_the_same(package, cache, changed):
    """As from an archive, or by an editor that sets the date back."""
    assert computed(cache)
    path = package / changed
    before = path.stat()
    path.write_text(path.read_text().replace("NAME", "MANE"))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    while path.stat().st_ctime_ns == before.st_ctime_ns:  # some systems' clocks tick slowly
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert path.stat().st_size == before.st_size
    assert path.stat().st_mtime_ns == before.st_mtime_ns
    assert computed(cache, "e" * 64)
    assert not computed(cache, "e" * 64)


def test_a_replaced_file_and_a_missing_one_are_noticed(package, cache):
    assert computed(cache)
    other = package / "new.py"
    other.write_text((package / "a.py").read_text())
    other.replace(package / "a.py")
    assert computed(cache)
    (package / "b.py").unlink()
    assert computed(cache)
    assert computed(cache), "nothing is kept of a file that is not there"


def test_nothing_is_kept_of_files_that_changed_a_moment_ago(package, cache, monkeypatch):
    monkeypatch.setattr(source_table, "SETTLED", SETTLED)
    assert computed(cache)
    assert computed(cache)
    assert not cache.exists() or not list(cache.iterdir())


def test_nothing_is_kept_of_imported_files_that_changed_since(package, cache, monkeypatch):
    monkeypatch.setattr(source_table, "changed", {"msahl.a"})
    assert computed(cache)
    assert computed(cache)


def test_only_commands_use_tables(package, cache, monkeypatch):
    assert computed(cache)
    monkeypatch.setattr(source_table, "is_command", lambda: False)
    assert computed(cache)
    assert computed(cache)


def test_a_damaged_table_and_a_folder_that_cannot_be_written_are_no_fault(package, cache):
    assert computed(cache)
    (path,) = cache.iterdir()
    path.write_bytes(path.read_bytes()[:-1])
    assert computed(cache)
    assert not computed(cache)
    blocked = package / "a.py" / "cache"
    assert computed(blocked)
    assert computed(blocked)


def test_digests_of_other_processes_stay_in_the_table(package, cache):
    assert computed(cache)
    table = SourceTable(cache)
    table.digest("b", "g", lambda: "e" * 64)
    table.save()
    assert not computed(cache)
    assert SourceTable(cache).digest("b", "g", lambda: "") == "e" * 64


@pytest.mark.parametrize("chosen", [None, "", "relative", "/tmp/cache", "/tmp/cache/", " /x"])
@pytest.mark.parametrize("home", ["/home/someone", "/home/someone/", "relative", None])
def test_the_cache_is_where_platformdirs_has_it(monkeypatch, chosen, home):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    for name, value in (("XDG_CACHE_HOME", chosen), ("HOME", home)):
        if value is None:
            monkeypatch.delenv(name, raising=False)
        else:
            monkeypatch.setenv(name, value)
    known = platformdirs.user_cache_path("msahl", appauthor=False)
    assert user_folder() == known / "kernels"
