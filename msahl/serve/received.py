"""A request as the server reads it."""

import os
import socket
from typing import NamedTuple

MOST_BYTES = 16_000_000
"""Longest request: words and environment of a process are shorter on Linux."""
MOST_FILES = 4
SECONDS = 2.0
"""Time in which a client sends its request."""


class Request(NamedTuple):
    """What a client asks for, and what its process has; see ``request``."""

    installation: list[bytes]
    umask: int
    ignored: list[int]  # signals
    files: list[int]  # which of stdin, stdout and stderr are open
    words: list[str]
    environment: dict[bytes, bytes]
    descriptors: list[int]  # of these files, and of the working folder


def receive(connection: socket.socket) -> Request | None:
    """Read the request that a client sends; None if it sends none."""
    connection.settimeout(SECONDS)
    content, descriptors, _, _ = socket.recv_fds(connection, 1 << 20, MOST_FILES)
    try:
        size = 4 + int.from_bytes(content[:4], "little")
        while 4 <= len(content) < size <= MOST_BYTES:
            part = connection.recv(size - len(content))
            if not part:
                break
            content += part
        if 4 < len(content) == size:
            return _unpacked(content[4:], descriptors)
    except (ValueError, LookupError, StopIteration, OSError):
        pass
    for descriptor in descriptors:
        os.close(descriptor)
    return None


def _unpacked(content: bytes, descriptors: list[int]) -> Request:
    """Return a request from its fields, without its length."""
    fields = iter(content.split(b"\0"))
    groups = []
    for _ in Request._fields[:-1]:
        count = int(next(fields))
        groups.append([next(fields) for _ in range(count)])
    known, umask, ignored, files, words, variables = groups
    pairs = (variable.partition(b"=") for variable in variables)
    return Request(
        known, int(umask[0]), [*map(int, ignored)], [*map(int, files)],
        [*map(os.fsdecode, words)], {name: value for name, _, value in pairs}, descriptors,
    )  # fmt: skip
