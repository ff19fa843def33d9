"""STL and OBJ files: triangles, faults with file and line, files outside the folder."""

import struct

import numpy as np
import pytest

from msahl.deck import DeckError, read_deck
from msahl.post.scene import build_scene, meshes
from msahl.post.scene.meshes import find_mesh, read_mesh
from tests.support.models import ROOT

CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
TETRAHEDRON = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


def text_stl(name="solid"):
    lines = [name]
    for face in TETRAHEDRON:
        lines += ["  facet normal 0 0 0", "    outer loop"]
        lines += ["      vertex {} {} {}".format(*CORNERS[i]) for i in face]
        lines += ["    endloop", "  endfacet"]
    return "\n".join([*lines, "endsolid", ""]).encode()


def binary_stl(head=b""):
    data = head.ljust(80, b" ") + struct.pack("<I", len(TETRAHEDRON))
    for face in TETRAHEDRON:
        data += struct.pack("<12fH", 0, 0, 0, *(c for i in face for c in CORNERS[i]), 0)
    return data


OBJ = b"""# a tetrahedron
mtllib paint.mtl
o first
v 9 9 9
v 0 0 0 1.0
v 1 0 0
v 0 1 0
v 0 0 1
vn 0 0 1
vt 0 0
usemtl red
f 2/1/1 4/1/1 3/1/1
f 2 3 5
f -4//1 -1//1 -2//1
f 3 4 5
"""
GOOD = {
    "text.stl": text_stl(),
    "UPPER.STL": text_stl().upper(),
    "binary.stl": binary_stl(),
    "solid.stl": binary_stl(b"solid, but binary"),
    "crlf.stl": text_stl().replace(b"\n", b"\r\n"),
    "thing.obj": OBJ,
}


def volume(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


@pytest.mark.parametrize("name", GOOD)
def test_a_tetrahedron(tmp_path, name):
    (tmp_path / name).write_bytes(GOOD[name])
    mesh = read_mesh(tmp_path / name)
    assert mesh.vertices.shape == (4, 3)  # a vertex without faces is omitted, equal ones are one
    assert mesh.faces.shape == (4, 3)
    assert volume(mesh) == pytest.approx(1 / 6, rel=1e-14)


def test_polygons_become_triangles(tmp_path):
    square = b"v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nf 1 2 3 4\n"
    (tmp_path / "square.obj").write_bytes(square)
    mesh = read_mesh(tmp_path / "square.obj")
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


TEXT = text_stl()
BAD = {
    "ends.stl": (binary_stl()[:-30], 0, "ends after 3 of 4 triangles; export it again"),
    "short.stl": (b"\0" * 40, 0, "ends within the header"),
    "nan.stl": (binary_stl()[:96] + struct.pack("<f", np.nan) + binary_stl()[100:], 0,
                "triangle 1 has a corner that is not finite"),
    "cut.stl": (TEXT[: TEXT.index(b"endloop") + 7], 7, "the file ends within a solid"),
    "word.stl": (TEXT.replace(b"outer loop", b"inner loop", 1), 3,
                 "'inner loop' where a line 'outer ...' is expected"),
    "number.stl": (TEXT.replace(b"vertex 0 0 0", b"vertex 0 O 0", 1), 4,
                   "'0 O 0' are not three finite numbers"),
    "infinite.stl": (TEXT.replace(b"vertex 0 0 0", b"vertex 0 1e999 0", 1), 4, "finite numbers"),
    "two.stl": (TEXT.replace(b"vertex 0 0 0", b"vertex 0 0", 1), 4, "a line 'vertex ...'"),
    "empty.stl": (b"solid\nendsolid\n", 0, "has no triangles"),
    "nothing.stl": (b"", 0, "not an STL file"),
    "bytes.stl": (b"solid\n\xff\xfe\n", 2, "not text"),
    "corner.obj": (OBJ.replace(b"f 3 4 5", b"f 3 4 6"), 15, "there is no vertex 6 before"),
    "zero.obj": (OBJ.replace(b"f 3 4 5", b"f 3 4 0"), 15, "there is no vertex 0 before"),
    "far.obj": (OBJ.replace(b"f 3 4 5", b"f 3 4 -6"), 15, "there is no vertex -6 before"),
    "letter.obj": (OBJ.replace(b"f 3 4 5", b"f 3 4 x"), 15, "'x' is not the number of a vertex"),
    "edge.obj": (OBJ.replace(b"f 3 4 5", b"f 3 4"), 15, "has fewer than three corners"),
    "plane.obj": (OBJ.replace(b"v 1 0 0", b"v 1 0"), 6, "has fewer than three coordinates"),
    "points.obj": (b"v 1 0 0\n", 0, "has no triangles"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_damaged_files(tmp_path, name):
    data, line, message = BAD[name]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(DeckError) as caught:
        read_mesh(tmp_path / name)
    (fault,) = caught.value.faults
    assert (fault.file, fault.line) == (str(tmp_path / name), line)
    assert message in fault.message


def test_bounds(tmp_path, monkeypatch):
    path = tmp_path / "a.stl"
    path.write_bytes(binary_stl())
    monkeypatch.setattr(meshes, "MOST_TRIANGLES", 3)
    with pytest.raises(DeckError, match="4 triangles, more than 3"):
        read_mesh(path)
    monkeypatch.setattr(meshes, "MOST_BYTES", 50)
    with pytest.raises(DeckError, match="larger than 0 MiB"):
        read_mesh(path)


def test_files_outside_the_folder_are_not_read(tmp_path):
    folder = tmp_path / "deck"
    folder.mkdir()
    (tmp_path / "secret.stl").write_bytes(text_stl())
    (folder / "link.stl").symlink_to(tmp_path / "secret.stl")
    with pytest.raises(DeckError, match="leads out of the folder"):
        find_mesh("link.stl", [folder])
    with pytest.raises(DeckError, match=r"missing\.stl: not found in .*deck"):
        find_mesh("missing.stl", [folder])
    (folder / "a").mkdir()
    with pytest.raises(DeckError, match="not found in"):
        find_mesh("a", [folder])


def test_shapes_of_a_deck_replace_the_derived_ones():
    path = ROOT / "decks" / "basics" / "shapes.xml"
    model = read_deck(path)
    scene = build_scene(model, folders=[path.parent])
    assert scene["notes"] == []
    shapes = scene["bodies"][0]["shapes"]
    assert [s["kind"] for s in shapes][:3] == ["box", "mesh", "cylinder"]
    assert not any(s["derived"] for s in shapes)
    dish = shapes[1]
    assert dish["name"] == "dish.obj"
    assert dish["size"] == pytest.approx([0.5, 0.5, 0.086])  # given in mm
    assert max(dish["faces"]) < len(dish["vertices"]) / 3
    assert scene["ground"]["shapes"][0]["colour"] == "#9aa3ad"
    _, high = scene["extent"]
    assert high[0] == pytest.approx(0.25 + 1.2 + 0.045)


def test_a_missing_mesh_is_omitted_with_a_note(tmp_path):
    model = read_deck(ROOT / "decks" / "basics" / "shapes.xml")
    scene = build_scene(model, folders=[tmp_path])
    assert "meshes/dish.obj: body 'Probe', mesh: not found in" in scene["notes"][0]
    assert "mesh" not in [s["kind"] for s in scene["bodies"][0]["shapes"]]
