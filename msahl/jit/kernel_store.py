"""Keeps compiled code in files, in a folder that only the user can write to.

The content of these files is executed. A folder that another user owns or can write to is therefore
not used at all, and every file begins with the SHA-256 of its name and content: a damaged file is
removed, and its code is compiled again. Each entry is one file, written under a temporary name and
renamed, so processes that save at the same time do not disturb each other.
"""

import hashlib
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

OTHERS = stat.S_IWGRP | stat.S_IWOTH
"""Permission of group or others to write."""
HEAD = hashlib.sha256().digest_size
NEVER_LINKS = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
"""Neither a symbolic link nor a pipe is opened in place of a file."""
BINARY = getattr(os, "O_BINARY", 0)


class Store:
    """Reads and writes the files in ``folder``; ``trouble`` says why none are kept there, or is
    empty.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.trouble = ""

    def load(self, name: str) -> bytes | None:
        """Return the content saved under ``name``; None if there is none that can be trusted."""
        with self._opened() as at:
            if at is None:
                return None
            try:
                with open(name, "rb", opener=partial(_open_at, at)) as file:
                    content = file.read() if _is_own(os.fstat(file.fileno())) else b""
            except OSError:
                return None
            if content[:HEAD] != digest_of(name, content[HEAD:]):
                self._remove(at, name)
                return None
            return content[HEAD:]

    def save(self, name: str, content: bytes) -> None:
        """Save ``content`` under ``name``, if that is possible."""
        part = f"{name}.{os.urandom(8).hex()}"
        with self._opened() as at:
            if at is None:
                return
            try:
                with open(part, "xb", opener=partial(_open_at, at)) as file:
                    file.write(digest_of(name, content) + content)
                os.replace(at.path(part), at.path(name), src_dir_fd=at.fd, dst_dir_fd=at.fd)
            except OSError as error:
                self._remove(at, part)
                self.trouble = f"{self.folder}: {error.strerror or error}"

    def discard(self, name: str) -> None:
        """Remove the file ``name``."""
        with self._opened() as at:
            if at is not None:
                self._remove(at, name)

    def _remove(self, at: "_Folder", name: str) -> None:
        with suppress(OSError):
            os.unlink(at.path(name), dir_fd=at.fd)

    @contextmanager
    def _opened(self) -> Iterator["_Folder | None"]:
        """Open the folder, creating it if needed; None where its content must not be trusted."""
        try:
            self.folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            self.folder.mkdir(exist_ok=True, mode=0o700)
            at = _Folder(self.folder)
        except OSError as error:
            self.trouble = f"{error.filename or self.folder}: {error.strerror or error}"
            yield None
            return
        try:
            self.trouble = at.fault() or self.trouble
            yield None if at.fault() else at
        finally:
            at.close()


class _Folder:
    """An open folder. Files are opened in this folder even if its path is changed meanwhile."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.fd: int | None = None
        if os.open in os.supports_dir_fd:
            self.fd = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)

    def path(self, name: str) -> str:
        """Return the path of a file, for calls that are given ``fd`` as well."""
        return name if self.fd is not None else str(self._path / name)

    def fault(self) -> str:
        """Return why its content must not be trusted; empty if it may be."""
        if self.fd is None:  # a system without owners in this sense
            return ""
        parent = self._path.parent
        return _fault(self._path, os.fstat(self.fd)) or _fault(parent, parent.stat(), sticky=True)

    def close(self) -> None:
        """Close the descriptor."""
        if self.fd is not None:
            os.close(self.fd)


def _open_at(at: _Folder, name: str, flags: int) -> int:
    """Open a file in the folder ``at``, as ``os.open``."""
    return os.open(at.path(name), flags | NEVER_LINKS | BINARY, 0o600, dir_fd=at.fd)


def _fault(path: Path, found: os.stat_result, sticky: bool = False) -> str:
    """Return how another user could have written there; in ``sticky`` folders, such as /tmp, nobody
    can replace files of others.
    """
    if sticky and found.st_mode & stat.S_ISVTX:
        return ""
    if found.st_uid != os.getuid():
        return f"{path} belongs to another user"
    return f"{path} can be written to by other users" if found.st_mode & OTHERS else ""


def _is_own(found: os.stat_result) -> bool:
    """Whether it is a regular file that only this user can have written."""
    if not stat.S_ISREG(found.st_mode):
        return False
    return not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & OTHERS)


def digest_of(name: str, content: bytes) -> bytes:
    """Return the SHA-256 with which a file begins."""
    return hashlib.sha256(name.encode() + b"\n" + content).digest()
