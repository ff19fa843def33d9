"""Skins of reduced bodies: closed surfaces of the mesh, which move as its nodes do."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msahl.reduction.body import body_bytes, read_body_bytes
from msahl.reduction.faults import ReductionError
from msahl.reduction.interfaces import interface_of
from msahl.reduction.mesh.reduce import reduce_mesh
from msahl.reduction.normal_modes import Wanted
from msahl.reduction.read import Files
from msahl.reduction.reduce import Wishes
from msahl.reduction.skin import MOST_NUMBERS, Skin, thinned
from tests.support.models import ROOT

pytest.importorskip("skfem")
pytest.importorskip("meshio")
STEEL = "E=210e9, nu=0.3, rho=7850"
LINK, ROD = ROOT / "examples" / "link.inp", ROOT / "examples" / "rod.bdf"


def reduced(path, names, units="m-kg", section=""):
    files = Files(Path(path), material=STEEL, units=units, section=section)
    interfaces = tuple(map(interface_of, names))
    return reduce_mesh(files, Wishes(interfaces, Wanted(2)))


@pytest.fixture(scope="module")
def link():
    return reduced(LINK, ["Root=ROOT", "Tip=TIP"])


@pytest.fixture(scope="module")
def rod():
    section = "width=0.008, height=0.005, d3=0:1:0"
    return reduced(ROD, ["Pin=1", "Wrist=13"], section=section)


def edges(triangles):
    return np.concatenate([triangles[:, [i, (i + 1) % 3]] for i in range(3)])


def volume(skin):
    """By Gauss's theorem, positive if triangles are counterclockwise from outside."""
    a, b, c = (skin.places[skin.triangles[:, i]] for i in range(3))
    return np.einsum("ti,ti->", a, np.cross(b, c)) / 6.0


def test_the_skin_of_solids_is_their_closed_surface(link):
    found, summary = link
    skin = found.body.skin
    own = {tuple(edge) for edge in edges(skin.triangles).tolist()}
    assert len(own) == 3 * len(skin.triangles)  # no edge twice in one direction
    assert {(b, a) for a, b in own} == own
    # The corners of straight elements bound the volume that scikit-fem integrates, to round-off.
    assert volume(skin) == pytest.approx(summary.volume, rel=1e-12)


def test_the_skin_of_solids_moves_as_its_nodes(link):
    body = link[0].body
    skin = body.skin
    for place, shape in zip(skin.places, skin.shapes, strict=True):
        node = np.argmin(np.linalg.norm(body.node_places - place, axis=1))
        assert (body.node_places[node] == place).all()
        assert (body.node_shapes[node] == shape).all()


def test_the_skin_of_beams_is_a_rectangle_that_rotates_with_the_nodes(rod):
    """At both ends: the corners of the section, moved by translation and rotation of the node."""
    body = rod[0].body
    skin = body.skin
    assert volume(skin) == pytest.approx(0.3 * 0.008 * 0.005, rel=1e-12)
    for k in range(2):
        arms = skin.places - body.interface_places[k]
        corners = np.flatnonzero(np.abs(arms[:, 0]) < 1e-9)
        assert np.abs(arms[corners, 1]) == pytest.approx(0.0025)  # the height is along y
        assert np.abs(arms[corners, 2]) == pytest.approx(0.004)
        moved, rotated = body.interface_shapes[k, :3], body.interface_shapes[k, 3:]
        assert np.abs(rotated).max() > 1.0
        for corner in corners:
            expected = moved + np.cross(rotated.T, arms[corner]).T
            # Round-off of shapes whose largest entry is some 1/sqrt(mass).
            assert skin.shapes[corner] == pytest.approx(expected, abs=1e-12)


def test_the_section_has_the_unit_of_the_mesh():
    """The same numbers in millimetres: the rod is a thousandth of its size."""
    section = "width=0.008, height=0.005, d3=0:1:0"
    found, _ = reduced(ROD, ["Pin=1", "Wrist=13"], units="mm-t", section=section)
    assert volume(found.body.skin) == pytest.approx(1e-9 * 0.3 * 0.008 * 0.005, rel=1e-12)


@pytest.mark.slow
def test_large_skins_are_thinned():
    """A grid of a plane with a shape that is linear in the place stays so; no triangle is lost to
    another place."""
    n = 400
    x, y = (a.ravel() for a in np.meshgrid(np.arange(n) / n, np.arange(n) / n))
    places = np.column_stack([x, y, 0.0 * x])
    slope = np.arange(18.0).reshape(3, 3, 2)
    shapes = np.einsum("ni,iaq->naq", places, slope)
    a = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    triangles = np.concatenate(
        [np.column_stack([a, a + 1, a + n + 1]), np.column_stack([a, a + n + 1, a + n])]
    )
    found = thinned(Skin(places, shapes, triangles))
    assert 0.5 * MOST_NUMBERS < found.shapes.size <= MOST_NUMBERS
    expected = np.einsum("ni,iaq->naq", found.places, slope)
    assert found.shapes == pytest.approx(expected, abs=1e-12)
    p, q, r = (found.places[found.triangles[:, i]] for i in range(3))
    areas = 0.5 * np.cross(q - p, r - p)[:, 2]
    assert (areas > 0.0).all()
    # Means of cells lie half a cell inside of the border: 1/140 of the width on each side.
    assert areas.sum() == pytest.approx(1.0, abs=0.03)


def test_the_file_keeps_the_skin(link):
    body = link[0].body
    again = read_body_bytes("link.npz", body_bytes(body)).skin
    for name in ("places", "shapes", "triangles"):
        assert (getattr(again, name) == getattr(body.skin, name)).all()
    assert read_body_bytes("link.npz", body_bytes(replace(body, skin=None))).skin is None


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("triangles", lambda a: a + len(a)),
        ("triangles", lambda a: -a),
        ("triangles", lambda a: a.astype(float)),
        ("triangles", lambda a: a[:, :2]),
        ("shapes", lambda a: a[:, :, :1]),
        ("shapes", lambda a: np.full_like(a, np.nan)),
        ("places", lambda a: a[0, 0]),
    ],
)
def test_a_damaged_skin_is_a_message(link, name, change):
    skin = link[0].body.skin
    body = replace(link[0].body, skin=replace(skin, **{name: change(getattr(skin, name))}))
    with pytest.raises(ReductionError, match="skin do not fit together; make it again"):
        read_body_bytes("link.npz", body_bytes(body))


def test_a_file_with_part_of_a_skin_has_none(link):
    arrays = dict(np.load(io.BytesIO(body_bytes(link[0].body))))
    del arrays["skin_triangles"]
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    assert read_body_bytes("link.npz", stream.getvalue()).skin is None
