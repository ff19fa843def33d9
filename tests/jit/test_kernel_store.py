"""Compiled code on disk: damaged files are never loaded, nor any that another user could write."""

import os

import pytest

from msahl.jit import compiled
from msahl.jit.kernel_store import Store

NAME, CONTENT = "msahl.schemes.midpoint.newton.take_steps-1", bytes(range(256)) * 8


@pytest.fixture
def store(tmp_path):
    kept = Store(tmp_path / "root" / "sources")
    kept.save(NAME, CONTENT)
    return kept


def test_what_is_saved_is_loaded(store):
    assert store.load(NAME) == CONTENT
    assert store.load("another") is None
    store.save(NAME, b"")
    assert store.load(NAME) == b""
    assert [path.name for path in store.folder.iterdir()] == [NAME]
    store.discard(NAME)
    assert store.load(NAME) is None
    assert store.trouble == ""


def damaged():
    """Every kind of place: the digest, its end, the first and the last byte, and the middle."""
    size = 32 + len(CONTENT)
    for place in (0, 17, 31, 32, 1000, size - 1):
        yield f"flip-{place}", lambda data, k=place: data[:k] + bytes([data[k] ^ 1]) + data[k + 1 :]
    for end in (0, 1, 31, 32, 33, 1000, size - 1):
        yield f"cut-{end}", lambda data, k=end: data[:k]
    yield "longer", lambda data: data + b"\0"
    yield "zeros", lambda data: bytes(len(data))


@pytest.mark.parametrize("damage", [d for _, d in damaged()], ids=[name for name, _ in damaged()])
def test_a_damaged_file_is_removed_and_saved_anew(store, damage):
    path = store.folder / NAME
    path.write_bytes(damage(path.read_bytes()))
    assert store.load(NAME) is None
    assert not path.exists()
    store.save(NAME, CONTENT)
    assert store.load(NAME) == CONTENT


def test_a_file_under_the_name_of_another_is_not_loaded(store):
    (store.folder / NAME).rename(store.folder / "other")
    assert store.load("other") is None


@pytest.mark.parametrize(
    "planted",
    [
        lambda path: path.chmod(0o666),
        lambda path: (path.rename(path.with_name("away")), path.symlink_to("away")),
        lambda path: (path.unlink(), os.mkfifo(path)),
        lambda path: (path.unlink(), path.mkdir()),
    ],
    ids=["writable by others", "link", "pipe", "folder"],
)
def test_only_regular_files_of_the_user_are_loaded(store, planted):
    planted(store.folder / NAME)
    assert store.load(NAME) is None


@pytest.mark.parametrize("which", ["folder", "parent"])
@pytest.mark.parametrize("mode", [0o777, 0o775, 0o707])
def test_nothing_is_loaded_from_a_folder_that_others_can_write_to(store, which, mode):
    folder = store.folder if which == "folder" else store.folder.parent
    folder.chmod(mode)
    assert store.load(NAME) is None
    assert store.trouble == f"{folder} can be written to by other users"
    before = (store.folder / NAME).stat()
    store.save(NAME, b"other")
    assert (store.folder / NAME).stat() == before
    folder.chmod(0o700)
    assert store.load(NAME) == CONTENT


def test_a_parent_like_tmp_is_good(store):
    """Everyone writes to it, but nobody can replace a folder of another user's."""
    store.folder.parent.chmod(0o1777)
    assert store.load(NAME) == CONTENT


@pytest.mark.parametrize("which", ["folder", "parent"])
def test_nothing_is_loaded_from_a_folder_of_another_user(store, monkeypatch, which):
    other = os.getuid() + 1
    if os.getuid() == 0:  # only root can give a folder away
        os.chown(store.folder if which == "folder" else store.folder.parent, other, -1)
    else:
        monkeypatch.setattr(os, "getuid", lambda: other)
    assert store.load(NAME) is None
    assert "belongs to another user" in store.trouble


def test_a_link_in_the_place_of_the_folder_is_not_followed(store):
    store.folder.rename(store.folder.with_name("elsewhere"))
    store.folder.symlink_to("elsewhere")
    assert store.load(NAME) is None
    assert store.trouble


def test_a_folder_that_cannot_be_made_is_reported(tmp_path):
    (tmp_path / "file").write_text("a file")
    store = Store(tmp_path / "file" / "sources")
    store.save(NAME, CONTENT)
    assert store.load(NAME) is None
    assert str(tmp_path / "file") in store.trouble


def test_a_full_disk_leaves_no_part_behind(store, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    store.save("new", CONTENT)
    assert store.trouble == f"{store.folder}: No space left on device"
    assert [path.name for path in store.folder.iterdir()] == [NAME]


def test_an_unsafe_folder_is_reported_with_a_remedy(store, monkeypatch):
    monkeypatch.setattr(compiled, "STORE", store)
    store.folder.chmod(0o777)
    assert store.load(NAME) is None
    assert "can be written to by other users" in compiled.trouble()
    assert "NUMBA_CACHE_DIR" in compiled.trouble()
