"""Files of meshes: the same body through all formats, sets, and what their faults say."""

import subprocess
import sys

import numpy as np
import pytest

from msahl.reduction import Files, ReductionError, Wishes
from msahl.reduction.interfaces import interface_of
from msahl.reduction.mesh.material import material_of
from msahl.reduction.mesh.reduce import is_mesh, mesh_model, of_sets, reduce_mesh
from msahl.reduction.normal_modes import Wanted
from tests.reduction.meshes import box_cells, box_mesh

meshio = pytest.importorskip("meshio")
pytest.importorskip("skfem")

STEEL = "E=210e9, nu=0.3, rho=7850"
KIND, COUNTS, SIZES = "hexahedron20", (4, 1, 1), (0.4, 0.05, 0.05)
FORMATS = {
    "box.msh": {"file_format": "gmsh"},
    "old.msh": {"file_format": "gmsh22", "binary": False},
    "box.inp": {"file_format": "abaqus"},
    "box.bdf": {"file_format": "nastran"},
    "box.vtk": {"file_format": "vtk"},
    "box.vtu": {"file_format": "vtu"},
}


def write(path, kind=KIND, places=None, cells=None, **options):
    """A box with the sets Root and Tip, as far as the format has sets."""
    if places is None:
        places, cells = box_cells(kind, COUNTS, SIZES)
    ends = {"Root": places[:, 0] == 0.0, "Tip": places[:, 0] == places[:, 0].max()}
    mesh = meshio.Mesh(places, [(kind, cells)])
    if path.suffix in (".vtk", ".vtu"):
        mesh.point_data = {name: one.astype(int) for name, one in ends.items()}
    elif path.suffix == ".inp":
        mesh.point_sets = {name: np.flatnonzero(one) for name, one in ends.items()}
    meshio.write(path, mesh, **{**FORMATS.get(path.name, {}), **options})
    return path


def reduced(path, interfaces, material=STEEL, section=""):
    files = Files(path, material=material, section=section)
    assert is_mesh(files)
    return reduce_mesh(files, Wishes(tuple(map(interface_of, interfaces)), Wanted(6)))


@pytest.fixture(scope="module")
def expected():
    mesh = box_mesh(KIND, COUNTS, SIZES)
    return mesh_model(mesh, material_of(STEEL), None, "m-kg").model


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_body(name, tmp_path, expected):
    path = write(tmp_path / name)
    if name.endswith((".inp", ".vtk", ".vtu")):
        ends = ["Root=Root", "Tip=Tip"]
    else:  # meshio writes no sets
        places = box_cells(KIND, COUNTS, SIZES)[0][:, 0]
        ends = [f"{end}=" + ",".join(map(str, 1 + np.flatnonzero(places == at)))
                for end, at in (("Root", 0.0), ("Tip", places.max()))]  # fmt: skip
    found, mesh = reduced(path, ends)
    assert mesh.elements == {KIND: 4}
    assert mesh.volume == pytest.approx(1e-3)
    assert found.body.invariants.mass == pytest.approx(7.85)
    direct, _ = reduced(write(tmp_path / "direct.vtu"), ["Root=Root", "Tip=Tip"])
    # Nastran's fields have 16 characters.
    assert found.body.frequencies == pytest.approx(direct.body.frequencies, rel=1e-9)
    assert found.body.interface_places == pytest.approx(direct.body.interface_places, abs=1e-9)


def test_physical_groups_of_gmsh_are_sets(tmp_path):
    lines = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
2 7 "Root"
2 9 "Tip"
3 7 "Body"
$EndPhysicalNames
$Nodes
5
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
5 1 1 1
$EndNodes
$Elements
4
1 2 2 7 1 1 2 3
2 2 2 9 2 2 3 5
3 4 2 7 1 1 2 3 4
4 4 2 7 1 4 2 3 5
$EndElements
"""
    path = tmp_path / "two.msh"
    path.write_text(lines)
    found, mesh = reduced(path, ["Root", "End=5"])
    assert mesh.elements == {"tetra": 2}
    assert mesh.notes == ("elements that only serve as sets: 2 triangle",)
    assert found.body.interface_names.tolist() == ["Root", "End"]
    place = found.body.interface_places[0] + found.body.centre
    assert place == pytest.approx([1 / 3, 1 / 3, 0.0])
    with pytest.raises(ReductionError, match="no set 'Hub'; sets of the mesh: Root, Tip, Body"):
        reduced(path, ["Hub"])
    with pytest.raises(ReductionError, match="node 2 belongs to the interfaces Root and Tip"):
        reduced(path, ["Root", "Tip"])


def test_physical_groups_of_gmsh_4_are_sets(tmp_path):
    path = tmp_path / "one.msh"
    path.write_text(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"
        '$PhysicalNames\n2\n2 1 "Root"\n3 2 "Body"\n$EndPhysicalNames\n'
        "$Entities\n0 0 1 1\n5 0 0 0 1 1 0 1 1 0\n8 0 0 0 1 1 1 1 2 0\n$EndEntities\n"
        "$Nodes\n1 4 1 4\n3 8 0 4\n1\n2\n3\n4\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n"
        "$Elements\n2 2 1 2\n2 5 2 1\n1 1 2 3\n3 8 4 1\n2 1 2 3 4\n$EndElements\n"
    )
    found, mesh = reduced(path, ["Root", "Tip=4"])
    assert mesh.elements == {"tetra": 1}
    place = found.body.interface_places[0] + found.body.centre
    assert place == pytest.approx([1 / 3, 1 / 3, 0.0])


def test_inputs_keep_their_numbers_of_nodes_and_their_sets(tmp_path):
    path = tmp_path / "tet.inp"
    path.write_text(
        "*HEADING\na tetrahedron\n*NODE\n10, 0, 0, 0\n7, 1, 0, 0\n30, 0, 1, 0\n12, 0, 0, 1\n"
        "*ELEMENT, TYPE=C3D4, ELSET=All\n1, 10, 7, 30, 12\n*NSET, NSET=Base\n10, 7, 30\n"
    )
    found, _ = reduced(path, ["Base", "Top=12"])
    assert found.body.node_labels.tolist()[:4] == [7, 10, 12, 30]
    at = found.body.node_places[:4] + found.body.centre
    assert at == pytest.approx(np.array([[1, 0, 0], [0, 0, 0], [0, 0, 1], [0, 1, 0]]))
    assert found.body.interface_places[0] + found.body.centre == pytest.approx([1 / 3, 1 / 3, 0])


def test_beams_are_read_from_bars_of_nastran(tmp_path):
    path = tmp_path / "bars.bdf"
    grids = [f"GRID,{n},,{0.1 * n:.1f},0.,0." for n in range(1, 6)]
    bars = [f"CBAR    {n:<8d}1       {n:<8d}{n + 1:<8d}0.0     0.0     1.0" for n in range(1, 5)]
    path.write_text("\n".join(["BEGIN BULK", *grids, *bars, "ENDDATA", ""]))
    found, mesh = reduced(path, ["A=1", "B=5"], section="radius=0.01")
    assert mesh.elements == {"line": 4}
    assert mesh.volume == pytest.approx(0.4 * np.pi * 1e-4)
    assert found.body.interface_rotates.all()


def test_a_file_of_properties(tmp_path):
    path = tmp_path / "steel.txt"
    path.write_text("# steel\nE = 210e9  # Pa\nnu = 0.3\nrho = 7850\n")
    assert material_of(str(path)) == material_of(STEEL)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("E=1, nu=0.5, rho=1", "between -1 and 0.5; a material that keeps its volume"),
        ("E=1, nu=-1, rho=1", "between -1 and 0.5"),
        ("E=0, nu=0, rho=1", "both are positive"),
        ("E=1, nu=0, rho=-1", "both are positive"),
        ("E=1, nu=0", "no rho; expected E="),
        ("E=1, nu=0, rho=1, G=3", "unknown property 'G'"),
        ("E=nan, nu=0, rho=1", "E=nan is no number"),
        ("steel", "or their file"),
    ],
)
def test_faults_of_materials(text, message):
    with pytest.raises(ReductionError, match=message):
        material_of(text)


def box(kind="tetra"):
    places, cells = box_cells(kind, (2, 1, 1))
    return places.copy(), cells.copy()


def flat():
    places, cells = box()
    places[cells[0, 0]] = places[cells[0, 1:]].mean(axis=0)
    return places, cells, "tetra"


def twice():
    places, cells = box("hexahedron")
    cells[0, 7] = cells[0, 6]
    return places, cells, "hexahedron"


def folded():
    places, cells = box("hexahedron")
    places[cells[0, 0]] += 0.9
    return places, cells, "hexahedron"


def other_order():
    places, cells = box("tetra10")
    return places, cells[:, [0, 1, 2, 3, 5, 4, 6, 7, 8, 9]], "tetra10"


def apart():
    places, cells = box_cells("tetra", (1, 1, 1))
    return np.vstack([places, places + 3]), np.vstack([cells, cells + len(places)]), "tetra"


def wedge():
    return np.eye(6, 3), np.arange(6)[None, :], "wedge"


def shell():
    return np.eye(3), np.arange(3)[None, :], "triangle"


def infinite():
    places, cells = box()
    places[0, 0] = np.inf
    return places, cells, "tetra"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (flat, r"element 1 of the tetra elements \(nodes .*\) has no volume"),
        (twice, "has a node twice"),
        (folded, "has parts folded inside out"),
        (other_order, "has a middle node, .*, far from the middle"),
        (apart, "2 parts that share no nodes: node 1 belongs to one, node 9 to another"),
        (wedge, "elements 'wedge' are not read; make the mesh of tetra"),
        (shell, "no solid elements"),
        (infinite, "node 1: its place is not finite"),
    ],
)
def test_faults_of_meshes(make, message, tmp_path):
    places, cells, kind = make()
    path = write(tmp_path / "box.vtu", kind, places, cells)
    with pytest.raises(ReductionError, match=message):
        reduced(path, ["Root"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("*NODE\n1,0,0,0\n*INCLUDE, INPUT=/etc/passwd\n*ELEMENT, TYPE=C3D4\n", ":3: files that a"),
        ("*PART, NAME=A\n*NODE\n1,0,0,0\n*ELEMENT, TYPE=C3D4\n1,1,1,1,1\n", ":1: parts and inst"),
        ("*NODE\n1,0,0,0\n*ELEMENT, TYPE=XYZ\n1,1\n", "meshio cannot read it as abaqus"),
        ("*NODE\n1,0,0,0\n*NODE\n2,0,0,0\n*ELEMENT, TYPE=C3D4\n1,2,2,2,2\n", "reads 1 of its 2"),
        ("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n", "meshio cannot read it as gmsh"),
        ("BEGIN BULK\nGRID,1,,0.,0.,0.\nCTETRA,1,1,1,2,3,4\n", "meshio cannot read it as nastran"),
        ("<VTKFile type='UnstructuredGrid'>", "meshio cannot read it as vtu"),
        ("# vtk DataFile Version 3.0\n", "meshio cannot read it as vtk"),
        ("1 2 3\n", "is no mesh of Gmsh"),
    ],
)
def test_faults_of_files(text, message, tmp_path):
    path = tmp_path / "mesh.txt"
    path.write_text(text)
    with pytest.raises(ReductionError, match=message):
        reduced(path, ["1"])


def test_damaged_files_are_messages(tmp_path):
    random = np.random.default_rng(1)
    complete = {name: write(tmp_path / name, "tetra").read_bytes() for name in FORMATS}
    path = tmp_path / "damaged"
    outcomes = {"read": 0, "refused": 0}
    for data in complete.values():
        for _ in range(40):
            mutant = bytearray(data)
            for _ in range(random.integers(1, 4)):
                at = int(random.integers(len(mutant)))
                mutant[at : at + int(random.integers(0, 20))] = random.bytes(random.integers(0, 3))
            path.write_bytes(mutant)
            try:
                reduce_mesh(Files(path, material=STEEL), Wishes((interface_of("A=1:3"),)))
                outcomes["read"] += 1
            except ReductionError:
                outcomes["refused"] += 1
    # Nothing else is raised. Damage within an unused number leaves a mesh.
    assert min(outcomes.values()) > 10, outcomes


def test_a_mesh_needs_its_material_and_matrices_have_none(tmp_path):
    path = write(tmp_path / "box.inp")
    with pytest.raises(ReductionError, match="it is a mesh; give its material: --material 'E="):
        is_mesh(Files(path))
    with pytest.raises(ReductionError, match="a mesh has no --mass"):
        is_mesh(Files(path, mass=path, material=STEEL))
    with pytest.raises(ReductionError, match=r"no interface is chosen; .* --interface Hub=Root"):
        reduced(path, [])
    with pytest.raises(ReductionError, match="a mesh of solids; omit --section"):
        reduced(path, ["Root"], section="radius=1")
    dmig = tmp_path / "body.pch"
    dmig.write_text("GRID,1,,0.,0.,0.\nCTETRA,1,1,1,1,1,1\nDMIG,KAAX,0,6,1,0,,,3\n")
    assert not is_mesh(Files(dmig))
    with pytest.raises(ReductionError, match="matrices have no --section"):
        is_mesh(Files(dmig, section="radius=1"))


def test_wrong_units_are_noticed(tmp_path):
    _, mesh = reduced(write(tmp_path / "box.inp"), ["Root", "Tip"], "E=210e3, nu=0.3, rho=7.85e-9")
    assert mesh.notes == (
        "the density 7.85e-09 kg/m^3 is that of no solid: is rho in --units m-kg?",
    )


def test_sets_are_ranges_of_nodes():
    mesh = box_mesh("tetra", (1, 1, 1))
    assert of_sets(mesh, interface_of("A=Root,8")).nodes == (range(8, 9), range(1, 5))


@pytest.mark.parametrize("name", ["meshio", "skfem"])
def test_without_the_extra_a_message_says_how_to_install_it(name, tmp_path, monkeypatch):
    path = write(tmp_path / "box.inp")
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ReductionError, match=r"pip install 'msahl\[mesh\]'"):
        reduced(path, ["Root"])


@pytest.mark.slow
def test_other_commands_import_neither_library():
    code = (
        "import sys, msahl.cli.main, msahl.cli.reduce, msahl.reduction.mesh.reduce\n"
        "assert not {'skfem', 'meshio'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
