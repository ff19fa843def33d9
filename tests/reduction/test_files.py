"""The same body through all formats of files, and what their faults say."""

import numpy as np
import pytest
from scipy import sparse

from msahl.reduction import Files, ReductionError, Wishes, read_body, read_model, reduce_model
from msahl.reduction.body import body_bytes
from msahl.reduction.elastic_model import Matrices, build_model
from msahl.reduction.interfaces import interface_of
from msahl.reduction.normal_modes import Wanted
from tests.reduction.bodies import beam_parts, box_parts

WISHES = Wishes(tuple(map(interface_of, ("A=1", "B=7"))), Wanted(8))


@pytest.fixture(scope="module")
def parts():
    return beam_parts(count=6)


@pytest.fixture(scope="module")
def expected(parts):
    return reduce_model(build_model("beam", *parts), WISHES).body


def upper(A):
    return zip(*(part.tolist() for part in sparse.find(sparse.triu(A))), strict=True)


def write_input(path, nodes):
    lines = [f"{n}, {p[0]!r}, {p[1]!r}, {p[2]!r}" for n, p in rows_of(nodes)]
    path.write_text("\n".join(["*HEADING", "a beam", "** nodes", "*Node", *lines, "*END STEP"]))


def rows_of(nodes):
    return zip(nodes.labels.tolist(), nodes.places.tolist(), strict=True)


def write_npz(folder, nodes, given):
    np.savez(
        folder / "beam.npz", nodes=nodes.places, labels=nodes.labels, mass=given.mass.toarray(),
        stiffness=given.stiffness.toarray(), interface=[1, 7],
    )  # fmt: skip
    return folder / "beam.npz"


def write_triplets(folder, nodes, given):
    arrays = {}
    for name, A in (("mass", given.mass), ("stiffness", given.stiffness)):
        rows, columns, values = sparse.find(sparse.tril(A))
        arrays |= {f"{name}_rows": rows, f"{name}_columns": columns, f"{name}_values": values}
    dofs = np.column_stack([given.labels, given.components + 1])
    np.savez_compressed(folder / "beam.npz", nodes=nodes.places, dofs=dofs, **arrays)
    return folder / "beam.npz"


def write_abaqus(folder, nodes, given):
    write_input(folder / "job.inp", nodes)
    names = list(zip(given.labels.tolist(), (given.components + 1).tolist(), strict=True))
    for name, A in (("STIF2", given.stiffness), ("MASS2", given.mass)):
        lines = [
            f"{names[i][0]},{names[i][1]}, {names[j][0]},{names[j][1]}, {v!r}"
            for i, j, v in upper(A)
        ]
        (folder / f"job_{name}.mtx").write_text("\n".join(lines))
    return folder / "job_STIF2.mtx"


def write_calculix(folder, nodes, given):
    write_input(folder / "job.inp", nodes)
    for end, A in (("sti", given.stiffness), ("mas", given.mass)):
        lines = [f"{i + 1} {j + 1} {v!r}" for i, j, v in upper(A)]
        (folder / f"job.{end}").write_text("\n".join(lines))
    pairs = zip(given.labels.tolist(), (given.components + 1).tolist(), strict=True)
    (folder / "job.dof").write_text("".join(f"{n}.{c}\n" for n, c in pairs))
    return folder / "job.sti"


def write_market(folder, nodes, given):
    lines = [f"{n} {p[0]!r} {p[1]!r} {p[2]!r}" for n, p in rows_of(nodes)]
    (folder / "K.csv").write_text("\n".join(["number x y z", *lines]))
    for name, A in (("K", given.stiffness), ("M", given.mass)):
        entries = [f"{i + 1} {j + 1} {v!r}" for j, i, v in upper(A)]
        head = ["%%MatrixMarket matrix coordinate real symmetric", "% a beam"]
        size = f"{A.shape[0]} {A.shape[1]} {len(entries)}"
        (folder / f"{name}.mtx").write_text("\n".join([*head, size, *entries]))
    return folder / "K.mtx"


def write_punch(folder, nodes, given):
    lines = ["$TITLE = BEAM"]
    for name, A in (("KAAX", given.stiffness), ("MAAX", given.mass)):
        size = A.shape[0]
        lines.append(f"DMIG    {name:8}{0:8d}{6:8d}{2:8d}{0:8d}{'':16}{size:8d}")
        A = A.toarray()
        for j in range(size):
            lines.append(f"DMIG*   {name:16}{given.labels[j]:16d}{given.components[j] + 1:16d}")
            lines += [
                f"*       {given.labels[i]:16d}{given.components[i] + 1:16d}"
                + f"{A[i, j]:16.9E}".replace("E", "D")
                for i in range(j, size)
                if A[i, j]
            ]
    grids = [f"GRID,{n},,{p[0]!r},{p[1]!r},{p[2]!r}" for n, p in rows_of(nodes)]
    (folder / "beam.pch").write_text("\n".join(lines))
    (folder / "beam.bdf").write_text("\n".join(["$ nodes", "BEGIN BULK", *grids]))
    return folder / "beam.pch"


WRITERS = {
    "npz": (write_npz, 1e-12),
    "triplets": (write_triplets, 1e-12),
    "abaqus": (write_abaqus, 1e-12),
    "calculix": (write_calculix, 1e-12),
    "market": (write_market, 1e-12),
    # Ten digits of entries that are 1e3 times the stiffness of the beam.
    "punch": (write_punch, 1e-6),
}


@pytest.mark.parametrize("name", WRITERS)
def test_the_same_body_through_each_format(name, tmp_path, parts, expected):
    write, digits = WRITERS[name]
    body = reduce_model(read_model(Files(write(tmp_path, *parts))), WISHES).body
    # Sums of the same entries in another order: round-off, and that of the frequencies is larger.
    assert body.frequencies == pytest.approx(expected.frequencies, rel=max(digits, 1e-9))
    assert body.invariants.inertia == pytest.approx(
        expected.invariants.inertia, rel=digits, abs=1e-12
    )
    assert body.interface_places == pytest.approx(expected.interface_places, abs=digits)


def test_a_modal_file_of_mbdyn(tmp_path):
    """Modes of a beam with lumped masses, of which the file has all."""
    nodes, given = beam_parts(count=6)
    lumped = np.tile([0.2, 0.2, 0.2, 1e-3, 1e-3, 1e-3], 7)
    given = Matrices(
        given.labels,
        given.components,
        sparse.csr_array(sparse.diags_array(lumped)),
        given.stiffness,
    )
    model = build_model("beam", nodes, given)
    complete = reduce_model(model, Wishes(WISHES.interfaces, Wanted(36))).body
    # As amplitudes all displacements of the nodes: 42 shapes, with the rigid ones.
    K = given.stiffness.toarray()
    (tmp_path / "beam.fem").write_text(modal_text(nodes, np.eye(42), np.diag(lumped), K, lumped))
    body = reduce_model(read_model(Files(tmp_path / "beam.fem")), WISHES).body
    assert len(body.eigenvalues) == 36
    assert body.frequencies == pytest.approx(complete.frequencies, rel=1e-7)  # round-off, as above
    assert body.invariants.inertia == pytest.approx(complete.invariants.inertia, abs=1e-10)
    assert np.isnan(body.frequency_errors).all()
    # Elastic modes alone, without the rigid ones, as programs write of free bodies.
    shapes = np.zeros((42, 36))
    shapes[model.owners * 6 + model.components] = spread(model)
    text = modal_text(nodes, shapes, np.eye(36), np.diag(complete.eigenvalues), lumped)
    (tmp_path / "free.fem").write_text(text)
    again = reduce_model(read_model(Files(tmp_path / "free.fem")), WISHES).body
    assert again.frequencies == pytest.approx(complete.frequencies, rel=1e-7)


def spread(model):
    """Return the shapes (42, q) of all modes, with rotations of all nodes."""
    from msahl.reduction.craig_bampton import craig_bampton
    from msahl.reduction.floating import floating_modes

    basis, _ = craig_bampton(model, np.r_[:6, 36:42], Wanted(36))
    return floating_modes(basis).shapes


def modal_text(nodes, shapes, mass, stiffness, lumped):
    def rows(A):
        return [" ".join(repr(float(x)) for x in row) for row in np.atleast_2d(A)]

    count = shapes.shape[1]
    lines = ["** MBDyn MODAL DATA FILE", "** RECORD GROUP 1, HEADER", "** REVISION, NODE, NORMAL"]
    lines += [f"REV0 {len(nodes.labels)} {count} 0 0 0", "**", "** RECORD GROUP 2, NODE LIST"]
    lines += rows(nodes.labels)[0].replace(".0", "").split()
    for k, axis in enumerate("XYZ"):
        lines += [f"** RECORD GROUP {5 + k}, NODAL {axis} COORDINATES", *rows(nodes.places[:, k])]
    lines.append("** RECORD GROUP 8, MODE SHAPES")
    for k in range(count):
        lines += [f"**    NORMAL MODE SHAPE #  {k + 1}", *rows(shapes[:, k].reshape(-1, 6))]
    lines += ["** RECORD GROUP 9, MODAL MASS MATRIX", *rows(mass)]
    lines += ["** RECORD GROUP 10, MODAL STIFFNESS MATRIX", *rows(stiffness)]
    lines += ["** RECORD GROUP 11, DIAGONAL OF LUMPED MASS MATRIX", *rows(lumped.reshape(-1, 6))]
    return "\n".join(lines)


def test_units_of_length_and_mass(tmp_path, parts, expected):
    nodes, given = parts
    scale = sparse.diags_array(np.where(given.components < 3, 1.0, 1e3))
    mass, stiffness = (1e-3 * (scale @ A @ scale).toarray() for A in (given.mass, given.stiffness))
    path = tmp_path / "beam.npz"
    np.savez(path, nodes=1e3 * nodes.places, mass=mass, stiffness=stiffness)
    body = reduce_model(read_model(Files(path, units="mm-t")), WISHES).body
    assert body.frequencies == pytest.approx(expected.frequencies, rel=1e-9)  # round-off
    assert body.invariants.mass == pytest.approx(expected.invariants.mass)
    assert body.invariants.inertia == pytest.approx(expected.invariants.inertia, abs=1e-12)


def test_a_body_is_read_back(tmp_path, expected):
    path = tmp_path / "body.npz"
    path.write_bytes(body_bytes(expected))
    again = read_body(path)
    assert (again.invariants.inertia_curve == expected.invariants.inertia_curve).all()
    assert (again.interface_shapes == expected.interface_shapes).all()
    assert again.frame == "mean"
    assert body_bytes(again) == path.read_bytes()
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ReductionError, match=r"no \.npz"):
        read_body(path)


def fault(files, wishes=WISHES):
    with pytest.raises(ReductionError) as caught:
        reduce_model(read_model(files), wishes)
    return str(caught.value)


def test_faults_of_matrices_name_file_and_line(tmp_path, parts):
    path = write_abaqus(tmp_path, *parts)
    text = path.read_text().splitlines()
    for row, expected in (
        ("1,1,1,x,2.0", ":4: 'x' is not a number"),
        ("1,1,1,1", ":4: 4 numbers, expected 5"),
        ("1,8,1,1,2.0", ":4: expected 'node, component"),
        ("1,1,1,1,nan", ":4: 'nan' is not a number"),
    ):
        path.write_text("\n".join([*text[:3], row, *text[3:]]))
        assert f"{path}{expected}" in fault(Files(path))
    path.write_text("\n".join([*text, "9,1,9,1,1.0"]))
    assert "node 9 has no place; give the file that has, by --nodes" in fault(Files(path))
    (tmp_path / "job.inp").unlink()
    assert "no file of its nodes is beside it" in fault(Files(path))
    (tmp_path / "job_MASS2.mtx").unlink()
    assert "give it by --mass" in fault(Files(path))


def test_other_files_are_not_followed(tmp_path, parts):
    path = write_abaqus(tmp_path, *parts)
    (tmp_path / "job.inp").write_text("*NODE, INPUT=/etc/passwd\n")
    assert "job.inp:1: the nodes are in another file; give that by --nodes" in fault(Files(path))
    (tmp_path / "job.inp").write_text("*INCLUDE, INPUT=/etc/passwd\n*STEP\n")
    assert "files that it includes are not read" in fault(Files(path))


def test_faults_of_punched_cards(tmp_path, parts):
    path = write_punch(tmp_path, *parts)
    text = path.read_text()
    column = f"DMIG*   KAAX            {1:16d}{1:16d}"
    scalar = f"DMIG*   KAAX            {900:16d}{0:16d}\n*       {900:16d}{0:16d} 1.0D+00"
    for change, expected in (
        (("KAAX", "XAAX"), "there is no matrix of stiffness; punch KAAX and MAAX"),
        ((column, f"{scalar}\n{column}"), ":3: point 900 is a scalar"),
        (("       6       2", "       6       4"), ":2: KAAX has form 6 and type 4"),
    ):
        path.write_text(text.replace(*change))
        assert expected in fault(Files(path))
    path.write_text(text)
    (tmp_path / "beam.bdf").write_text("GRID,1,7,0.,0.,0.")
    assert "beam.bdf:1: GRID 1 refers to coordinate system 7" in fault(Files(path))


def test_faults_of_arrays(tmp_path, parts):
    nodes, given = parts
    good = {
        "nodes": nodes.places,
        "mass": given.mass.toarray(),
        "stiffness": given.stiffness.toarray(),
    }
    path = tmp_path / "beam.npz"
    held, skew = good["stiffness"].copy(), good["stiffness"].copy()
    held[0, 0] *= 2.0
    skew[0, 6] *= 1.001
    for change, expected in (
        ({"nodes": nodes.places[:, :2]}, "expected numbers (any, 3)"),
        ({"mass": np.ones(3)}, "mass is float64 (3,); expected numbers (42, 42)"),
        ({"masses": np.ones(3)}, "array 'masses' is none of an elastic model"),
        ({"mass": 0.0 * good["mass"]}, "its mass is zero; give the matrix of mass"),
        ({"mass": -good["mass"]}, "is -"),
        ({"stiffness": held}, "resists a rigid translation along x, most at node 1, component x"),
        ({"stiffness": skew}, "differs by"),
        ({"nodes": nodes.places * np.nan}, "node 1: its place is not finite"),
        ({"nodes": np.array([[{}] * 3], dtype=object)}, "has no numbers"),
        ({"labels": np.ones(7, int)}, "node 1 appears twice"),
    ):
        np.savez(path, **{**good, **change})
        assert expected in fault(Files(path))
    np.savez(path, **good)
    assert "no interface is chosen" in fault(Files(path), Wishes())
    for text, expected in (("C=1,99", "there is no node 99"), ("Q=1:7", "belongs to")):
        wishes = Wishes((interface_of("A=1"), interface_of(text)))
        assert expected in fault(Files(path), wishes)


def test_interfaces_that_do_not_hold_the_body(tmp_path):
    nodes, given = box_parts(counts=(2, 1, 1))
    model = build_model("box", nodes, given)
    for texts in (["1"], ["1", "2"]):
        with pytest.raises(ReductionError, match="can move rigidly"):
            reduce_model(model, Wishes(tuple(map(interface_of, texts))))
    with pytest.raises(ReductionError, match="no frame is fixed to it"):
        reduce_model(model, Wishes(tuple(map(interface_of, "124")), Wanted(2), "1"))
    with pytest.raises(ReductionError, match="--frame 9: expected mean or an interface: 1, 2"):
        reduce_model(model, Wishes(tuple(map(interface_of, "124")), Wanted(2), "9"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("9x", "expected a node"),
        ("my set", "expected a node"),
        ("Hub=", "expected a node"),
        ("1,2", "a set of nodes has a name, as in Hub=1,2"),
        ("Hub=5:3", "a range begins with its lower number"),
        ("9=3", "expected a node"),
    ],
)
def test_texts_of_interfaces(text, message):
    with pytest.raises(ReductionError, match=message):
        interface_of(text)


def test_matrices_have_no_named_sets(parts):
    with pytest.raises(ReductionError, match="'BOLTS' is no number of a node; only meshes have"):
        reduce_model(build_model("beam", *parts), Wishes((interface_of("Hub=BOLTS,3"),)))


BYTES = b"0123456789-+.,eE* \n$%xX\xff\x00"
PIECES = (b"1e999", b"nan", b"1e300", b"99999999999", b"\n", b",,,", b"*NODE\n", b"DMIG")


def mutated(data, rng):
    data = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        at, kind = int(rng.integers(len(data))), rng.integers(4)
        if kind == 0:
            data[at] = BYTES[rng.integers(len(BYTES))]
        elif kind == 1:
            del data[at : at + int(rng.integers(1, 30))]
        elif kind == 2:
            data[at:at] = PIECES[rng.integers(len(PIECES))]
        else:
            del data[at + 1 :]
        data = data or bytearray(b" ")
    return bytes(data)


@pytest.mark.parametrize("name", WRITERS)
def test_mutated_files_are_read_or_refused(name, tmp_path):
    path = WRITERS[name][0](tmp_path, *beam_parts(count=2))
    wishes = Wishes((interface_of("A=1"), interface_of("B=3")), Wanted(2))
    files = {file: file.read_bytes() for file in sorted(tmp_path.iterdir())}
    rng = np.random.default_rng(7)
    refused = []
    for k in range(60):
        file = list(files)[k % len(files)]
        file.write_bytes(mutated(files[file], rng))
        try:
            body_bytes(reduce_model(read_model(Files(path)), wishes).body)
        except ReductionError as error:
            refused.append(str(error))
        file.write_bytes(files[file])
    assert len(refused) > 30
    assert all(message.startswith(str(tmp_path)) for message in refused)


def test_a_header_cannot_claim_more_than_the_file_has(tmp_path):
    import zipfile

    path = tmp_path / "bomb.npz"
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000,), }"
    header += b" " * (117 - len(header)) + b"\n"
    data = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("nodes.npy", data)
    assert "nodes.npy is shorter than its header says" in fault(Files(path))
