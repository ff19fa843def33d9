"""Animated glTF of a run, read back by pygltflib and checked by the validator of Khronos."""

import json
import math
import shutil
import subprocess

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.algebra.rotation_arrays import matrices, rotations
from msahl.cli.main import main as msahl
from msahl.model import JointSpring, SpringDamper
from msahl.post.cli import main as post
from msahl.post.glb.animation import TOLERANCE, choose_keys, interpolate
from msahl.post.glb.gltf import linear
from msahl.post.glb.springs import motion, surfaces
from msahl.results.read import read_run
from tests.support import run_folders
from tests.support.models import ROOT

pygltflib = pytest.importorskip("pygltflib")
KINDS = {5126: "<f4", 5123: "<u2", 5125: "<u4"}
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}
TIMES = 50
VALIDATE = """
const validator = require("gltf-validator");
const bytes = new Uint8Array(require("fs").readFileSync(process.argv[1]));
validator.validateBytes(bytes).then((report) => console.log(JSON.stringify(report)));
"""


def call(program, *words):
    return CliRunner().invoke(program, [str(word) for word in words])


@pytest.fixture(scope="module", params=["mechanisms/four_bar", "machines/robot", "basics/shapes"])
def run(request, tmp_path_factory):
    """The folder of a run of a second, with its GLB file."""
    folder = tmp_path_factory.mktemp("runs") / request.param.replace("/", "_")
    deck = ROOT / "decks" / f"{request.param}.xml"
    made = call(msahl, "run", deck, "-q", "-o", folder, "--t-final", 1)
    assert made.exit_code in (0, 1), made.output
    made = call(post, "export", folder, "--glb")
    assert made.exit_code == 0, made.output
    assert made.stdout.strip() == str(folder / f"{folder.name}.glb")
    return folder


class Reader:
    """A GLB file as an independent reader has it."""

    def __init__(self, path):
        self.file = pygltflib.GLTF2().load_binary(str(path))
        self.blob = self.file.binary_blob()

    def array(self, index):
        accessor = self.file.accessors[index]
        view = self.file.bufferViews[accessor.bufferView]
        start = (view.byteOffset or 0) + (accessor.byteOffset or 0)
        width = WIDTHS[accessor.type]
        kind = np.dtype(KINDS[accessor.componentType])
        values = np.frombuffer(self.blob, kind, accessor.count * width, start)
        return values.reshape(-1, width).astype(float)

    def node(self, name):
        names = [node.name for node in self.file.nodes]
        return names.index(name)

    def value(self, node, path, t):
        """Translation or rotation [x, y, z, w] of a node at a time, by linear interpolation."""
        (animation,) = self.file.animations or [None]
        for channel in animation.channels if animation else ():
            if (channel.target.node, channel.target.path) == (node, path):
                sampler = animation.samplers[channel.sampler]
                assert sampler.interpolation == "LINEAR"
                return between(*map(self.array, (sampler.input, sampler.output)), t)
        return np.array(getattr(self.file.nodes[node], path))

    def matrix(self, node, t):
        """Matrix (4, 4) of a node in the axes of its parent."""
        M = np.eye(4)
        x, y, z, w = self.value(node, "rotation", t)
        M[:3, :3] = matrices([w, x, y, z])
        if self.file.nodes[node].translation:
            M[:3, 3] = self.value(node, "translation", t)
        return M


def between(times, values, t):
    """Linear interpolation of vectors; spherical linear interpolation of quaternions."""
    k = min(max(int(np.searchsorted(times[:, 0], t, side="right")) - 1, 0), len(times) - 2)
    s = min(max((t - times[k, 0]) / (times[k + 1, 0] - times[k, 0]), 0.0), 1.0)
    a, b = values[k], values[k + 1]
    if values.shape[1] == 3:
        return (1 - s) * a + s * b
    angle = math.acos(min(max(a @ b, -1.0), 1.0))
    if angle < 1e-7:
        return (1 - s) * a + s * b
    return (math.sin((1 - s) * angle) * a + math.sin(s * angle) * b) / math.sin(angle)


def test_poses_are_those_of_the_run(run):
    result, reader = read_run(run), Reader(run / f"{run.name}.glb")
    root = reader.matrix(0, 0.0)
    names = [body.name for body in result.model.bodies]
    states = result.states.to_numpy()[:, 1:].reshape(len(result.time), len(names), 12)
    random = np.random.default_rng(21)
    rows = random.choice(len(result.time), TIMES, replace=len(result.time) < TIMES)
    for b, name in enumerate(names):
        for row in rows:
            M = reader.matrix(reader.node(name), result.time[row])
            assert np.allclose(M[:3, 3], states[row, b, :3], rtol=0, atol=1e-5)
            assert np.allclose(M[:3, :3], rotations(states[row, b, 3:6]), rtol=0, atol=1e-5)
    # z of the inertial axes is up, which glTF calls y.
    assert np.allclose(root @ [0, 0, 1, 0], [0, 1, 0, 0], rtol=0, atol=1e-7)


def test_shapes_have_meshes_and_materials(run):
    reader = Reader(run / f"{run.name}.glb")
    root = reader.file.nodes[0]
    for place in root.children:
        body = reader.file.nodes[place]
        assert body.children
        for child in body.children:
            (primitive,) = reader.file.meshes[reader.file.nodes[child].mesh].primitives
            vertices = reader.array(primitive.attributes.POSITION)
            faces = reader.array(primitive.indices)
            assert faces.max() < len(vertices)
            material = reader.file.materials[primitive.material]
            assert material.name.startswith("#")
    if run.name.endswith("robot"):
        assert "Base" in [reader.file.nodes[place].name for place in root.children]


def assert_valid(path, tmp_path):
    """Ask the validator of Khronos, if it is there."""
    node, modules = shutil.which("node"), ROOT / "tools" / "web" / "node_modules"
    if node is None or not (modules / "gltf-validator").is_dir():
        pytest.skip("needs node and its package gltf-validator: run npm ci in tools/web")
    script = tmp_path / "validate.cjs"
    script.write_text(VALIDATE.replace("argv[1]", "argv[2]"))
    done = subprocess.run(
        [node, str(script), str(path)],
        env={"NODE_PATH": str(modules)},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    )
    issues = json.loads(done.stdout)["issues"]
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


def test_the_validator_of_khronos_finds_no_fault(run, tmp_path):
    assert_valid(run / f"{run.name}.glb", tmp_path)


def test_springs_reach_from_end_to_end(tmp_path):
    folder, deck = tmp_path / "car", ROOT / "decks" / "machines" / "quarter_car.xml"
    call(msahl, "run", deck, "-q", "-o", folder, "--t-final", 0.5)
    assert call(post, "export", folder, "--glb").exit_code == 0
    result, reader = read_run(folder), Reader(folder / "car.glb")
    springs = [load for load in result.model.loads if isinstance(load, JointSpring | SpringDamper)]
    assert springs
    for spring in springs:
        node = reader.node(spring.name)
        lengths = []
        for t in (0.0, 0.137, 0.5):
            M = reader.matrix(node, t)
            lengths.append(reader.value(node, "scale", t)[2])
            assert np.allclose(M[:3, :3] @ M[:3, :3].T, np.eye(3), rtol=0, atol=1e-5)
        assert max(lengths) > min(lengths) > 0.0
    assert_valid(folder / "car.glb", tmp_path)


@pytest.mark.parametrize("seed", range(3))
def test_a_spring_follows_its_ends(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(40, 2, 3))
    points[7, 1] = points[7, 0]
    found = motion(points, 1.0)
    for (a, b), pose, length in zip(points, found.poses, found.lengths, strict=True):
        end = pose[:3] + matrices(pose[3:]) @ (0.0, 0.0, length)
        # 1e-6: the least length, where both ends coincide.
        assert np.allclose(pose[:3], a)
        assert np.allclose(end, b, rtol=0, atol=2e-6)
    for glyph in ("coil", "strut", "damper"):
        for surface in surfaces(glyph, 1.0, 2.0):
            assert surface.faces.max() < len(surface.vertices) == len(surface.normals)
            assert surface.vertices[:, 2].max() == pytest.approx(1.0, abs=0.01)  # the wire
    assert surfaces("spiral", 1.0, 1.0) == []


def test_a_run_of_one_row_has_no_animation(tmp_path):
    states, reactions = run_folders.conical_rows()
    run_folders.write(tmp_path / "run", states[:1], reactions[:1])
    result = call(post, "export", tmp_path / "run", "--glb", "-o", tmp_path / "sub" / "a.glb")
    assert result.exit_code == 0, result.output
    reader = Reader(tmp_path / "sub" / "a.glb")
    assert not reader.file.animations
    assert reader.file.scenes[0].name == "Conical & <calm>"


def test_a_format_is_needed_and_a_run(tmp_path):
    result = call(post, "export", tmp_path)
    assert result.exit_code == 2
    assert "no format is given; add --glb" in result.stderr
    result = call(post, "export", tmp_path, "--glb")
    assert result.exit_code == 2
    assert "not the folder of a run" in result.stderr


def test_a_missing_mesh_is_reported(tmp_path):
    deck = tmp_path / "shapes.xml"
    shutil.copy(ROOT / "decks" / "basics" / "shapes.xml", deck)
    assert call(msahl, "run", deck, "-q", "-o", tmp_path / "r", "--t-final", 0.1).exit_code == 0
    result = call(post, "export", tmp_path / "r", "--glb")
    assert result.exit_code == 0
    assert "meshes/dish.obj: body 'Probe', mesh: not found in" in result.stderr
    assert "the shape is omitted" in result.stderr


def test_key_poses_are_within_the_tolerance():
    time = np.linspace(0, 10, 4001)
    a = 0.5 * np.sin(time)
    poses = np.zeros((len(time), 7))
    poses[:, 0], poses[:, 3], poses[:, 6] = np.cos(time), np.cos(0.5 * a), np.sin(0.5 * a)
    keys = choose_keys(time, poses, 2.0)
    assert keys.position <= 2 * TOLERANCE
    assert keys.orientation <= TOLERANCE
    # A straight line misses a circle by (rate step)^2 / 8, so about 1800 poses are needed.
    assert 1000 < len(keys.rows) < 4001
    found = interpolate(time[keys.rows], poses[keys.rows], time)
    assert np.abs(found[:, 0] - poses[:, 0]).max() <= 2 * TOLERANCE
    steady = poses.copy()
    steady[:, 0], steady[:, 3], steady[:, 6] = time, np.cos(time / 40), np.sin(time / 40)
    assert len(choose_keys(time, steady, 10.0).rows) == -(-4000 // 64) + 1
    assert len(choose_keys(time, np.tile(poses[0], (4001, 1)), 2.0).rows) == 1


def test_colours_are_linear():
    assert linear("#ffffff") == [1, 1, 1]
    assert linear("#000000") == [0, 0, 0]
    assert linear("#808080")[0] == pytest.approx(0.2159, abs=1e-4)  # IEC 61966-2-1
