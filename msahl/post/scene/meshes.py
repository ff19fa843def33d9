"""Read triangles from STL and OBJ files: vertices (n, 3) in the units of the file, faces (m, 3).

A file is below one of the given folders, of bounded size, and holds triangles or polygons, which
are cut into triangles. Raises ``DeckError`` with the file and the line of a fault.

``trimesh`` 5.2 reads these formats as well, but takes a text that ends early for an empty mesh, NaN
for a number, and corner 0 of a face for the last vertex, and its errors have no lines: all checks
would stand here beside it.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np

from msahl.deck.faults import DeckError, Fault

MOST_BYTES = 64 * 2**20
MOST_TRIANGLES = 200_000
"""Triangles of one file: the page or file that shows them has to hold them."""
HEADER, RECORD = 84, 50
"""Bytes of a binary STL file before its triangles, and of each triangle."""
LONGEST = 60
"""Characters of a line that a message repeats."""

STL_GRAMMAR = (
    ("facet", 5),
    ("outer", 2),
    ("vertex", 4),
    ("vertex", 4),
    ("vertex", 4),
    ("endloop", 1),
    ("endfacet", 1),
)
"""First words of the lines of one triangle, and how many words each line has."""


class Mesh(NamedTuple):
    """Triangles: ``vertices`` (n, 3) and ``faces`` (m, 3), indices of vertices."""

    vertices: np.ndarray
    faces: np.ndarray


def find_mesh(file: str, folders: Iterable[Path]) -> Path:
    """Return the path of a mesh from the first of the ``folders`` that has it; raise ``DeckError``
    if none has, or if it leads out of the folder."""
    tried = []
    for folder in folders:
        path = folder.joinpath(*file.split("/"))
        tried.append(str(folder))
        try:
            real = path.resolve(strict=True)
            if not real.is_relative_to(folder.resolve()):
                _stop(path, 0, "leads out of the folder of the deck; copy it there")
            if real.is_file():
                return path
        except (OSError, RuntimeError, ValueError):
            continue
    where = " or ".join(dict.fromkeys(tried)) or "the folder of the deck"
    _stop(Path(file), 0, f"not found in {where}; put it there, or correct href")


def read_mesh(path: Path) -> Mesh:
    """Return the triangles of an STL or OBJ file."""
    try:
        with path.open("rb") as stream:
            data = stream.read(MOST_BYTES + 1)
    except OSError as error:
        _stop(path, 0, f"cannot be read: {error.strerror or error}; name another file")
    if len(data) > MOST_BYTES:
        _stop(path, 0, f"larger than {MOST_BYTES // 2**20} MiB; simplify the mesh")
    if path.suffix.lower() == ".obj":
        mesh = _obj(path, data)
    elif _is_binary(data):
        mesh = _binary_stl(path, data)
    else:
        mesh = _text_stl(path, data)
    if not len(mesh.faces):
        _stop(path, 0, "has no triangles; name another file")
    if len(mesh.faces) > MOST_TRIANGLES:
        message = f"has {len(mesh.faces)} triangles, more than {MOST_TRIANGLES}; simplify the mesh"
        _stop(path, 0, message)
    return mesh


def _stop(path: Path, line: int, message: str) -> NoReturn:
    raise DeckError((Fault(str(path), line, "", message),))


def _is_binary(data: bytes) -> bool:
    """Return whether an STL file is binary: its size fits, or it does not begin like text."""
    if len(data) < HEADER:
        return not _begins_as_text(data)
    count = int.from_bytes(data[HEADER - 4 : HEADER], "little")
    return len(data) == HEADER + RECORD * count or not _begins_as_text(data)


def _begins_as_text(data: bytes) -> bool:
    return data[:HEADER].lstrip()[:5].lower() == b"solid"


def _binary_stl(path: Path, data: bytes) -> Mesh:
    if len(data) < HEADER:
        _stop(path, 0, "not an STL file: it ends within the header; export it again")
    count = int.from_bytes(data[HEADER - 4 : HEADER], "little")
    if len(data) < HEADER + RECORD * count:
        found = (len(data) - HEADER) // RECORD
        message = f"ends after {found} of {count} triangles; export it again"
        _stop(path, 0, message)
    kinds = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    table = np.frombuffer(data, kinds, count=count, offset=HEADER)
    corners = table["corners"].reshape(-1, 3).astype(float)
    bad = np.flatnonzero(~np.isfinite(corners).all(axis=1))
    if bad.size:
        _stop(path, 0, f"triangle {bad[0] // 3 + 1} has a corner that is not finite; correct it")
    return _merged(corners)


def _merged(corners: np.ndarray) -> Mesh:
    """Return a mesh of the corners (3m, 3) of triangles, equal ones once."""
    if not len(corners):
        return Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))
    vertices, places = np.unique(corners, axis=0, return_inverse=True)
    return Mesh(vertices, places.reshape(-1, 3))


def _lines(path: Path, data: bytes) -> Iterator[tuple[int, list[str]]]:
    """Yield number and words of each line that is not empty."""
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        _stop(path, line, "not text; export the file again")
    for number, one in enumerate(text.split("\n"), start=1):
        words = one.split("#", 1)[0].split()
        if words:
            yield number, words


def _text_stl(path: Path, data: bytes) -> Mesh:
    corners: list[tuple[float, ...]] = []
    place, last, ended = 0, 1, False
    for number, words in _lines(path, data):
        last, word = number, words[0].lower()
        if place == 0 and word in ("solid", "endsolid"):
            ended = word == "endsolid"
            continue
        expected, count = STL_GRAMMAR[place]
        if word != expected or len(words) != count:
            message = f"'{_shown(words)}' where a line '{expected} ...' is expected"
            _stop(path, number, f"{message}; export the file again")
        if word == "vertex":
            corners.append(_numbers(path, number, words[1:]))
        place = (place + 1) % len(STL_GRAMMAR)
    if place or not ended:
        _stop(path, last, "the file ends within a solid; export it again")
    return _merged(np.array(corners).reshape(-1, 3))


def _obj(path: Path, data: bytes) -> Mesh:
    vertices: list[tuple[float, ...]] = []
    faces: list[tuple[int, int, int]] = []
    for number, words in _lines(path, data):
        if words[0] == "v":
            if len(words) < 4:
                _stop(path, number, f"'{_shown(words)}' has fewer than three coordinates")
            vertices.append(_numbers(path, number, words[1:4]))
        elif words[0] == "f":
            corners = [_corner(path, number, word, len(vertices)) for word in words[1:]]
            if len(corners) < 3:
                _stop(path, number, f"'{_shown(words)}' has fewer than three corners; correct it")
            first = corners[0]
            faces += [(first, *pair) for pair in pairwise(corners[1:])]
    used = np.array(faces, dtype=int).reshape(-1, 3)
    # Vertices without faces, as of helper lines, would enlarge the box of the mesh.
    kept, places = np.unique(used, return_inverse=True)
    return Mesh(np.array(vertices).reshape(-1, 3)[kept], places.reshape(-1, 3))


def _corner(path: Path, line: int, word: str, known: int) -> int:
    """Return the index of a corner such as 3, 3/1/2 or -1, counted from 0."""
    try:
        index = int(word.split("/")[0])
    except ValueError:
        _stop(path, line, f"'{word[:LONGEST]}' is not the number of a vertex; correct it")
    index = index - 1 if index > 0 else known + index
    if not 0 <= index < known or word.startswith("0"):
        _stop(path, line, f"there is no vertex {word[:LONGEST]} before this line; correct it")
    return index


def _numbers(path: Path, line: int, words: Sequence[str]) -> tuple[float, ...]:
    """Return three finite coordinates."""
    try:
        values = tuple(map(float, words))
    except ValueError:
        values = (math.nan,)
    if not all(map(math.isfinite, values)):
        _stop(path, line, f"'{_shown(words)}' are not three finite numbers; correct them")
    return values


def _shown(words: Sequence[str]) -> str:
    return " ".join(words)[:LONGEST]
