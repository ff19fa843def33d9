"""Key poses, their interpolation and their packing."""

import base64
import math
import zlib

import numpy as np
import pytest

from msahl.algebra.rotation_arrays import quaternions
from msahl.post.view.columns import Columns, columns_of_run, pack_columns
from msahl.post.view.packing import pack_integers
from msahl.post.view.poses import Poses, choose_keys, interpolate, pack_poses, poses_of_run
from msahl.results.info import ResultError
from msahl.results.sample import read_sample
from tests.support import run_folders


def unpacked(packed) -> np.ndarray:
    """Integers as ``packing.js`` reads them."""
    data = zlib.decompress(base64.b64decode(packed["data"]))
    rows, columns = packed["rows"], packed["columns"]
    planes = np.frombuffer(data[1:], dtype=np.uint8).reshape(data[0], columns, rows)
    folded = sum(planes[i].astype(np.int64) << (8 * i) for i in range(data[0]))
    values = (folded >> 1) ^ -(folded & 1)
    for done in reversed(range(min(packed["order"], rows))):
        values[:, done:] = np.cumsum(values[:, done:], axis=1)
    return values.T


def spinning(rows: int = 2001, rate: float = 20.0, bodies: int = 2) -> Poses:
    """Bodies that circle at 1 and 3 rad/s and rotate about z."""
    t = np.linspace(0.0, 10.0, rows)
    values = np.zeros((rows, bodies, 7))
    for i in range(bodies):
        values[:, i, 0], values[:, i, 1] = np.cos((1 + 2 * i) * t), np.sin((1 + 2 * i) * t)
        values[:, i, 3], values[:, i, 6] = np.cos(0.5 * rate * t), np.sin(0.5 * rate * t)
    return Poses(t, values)


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (5, 2), (700, 4)])
def test_integers_come_back(shape) -> None:
    numbers = np.random.default_rng(1).integers(-(2**30), 2**30, shape)
    assert (unpacked(pack_integers(numbers)) == numbers).all()


def test_cubics_are_interpolated_exactly() -> None:
    t = np.array([0.0, 0.1, 0.4, 0.5, 1.0, 1.2])
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 3.0])
    at = np.linspace(0.0, 1.2, 50)
    found = interpolate(t, cubic(t)[:, None], at)[:, 0]
    assert np.abs(found - cubic(at)).max() < 1e-13  # rounding of weights and sums


@pytest.mark.parametrize("rows", [1, 2, 3, 4])
def test_few_rows_are_all_key_poses(rows: int) -> None:
    poses = spinning(rows)
    keys = choose_keys(poses, 2.0, 1000)
    assert list(keys.rows) == list(range(rows))
    assert keys.position < 1e-15


def test_key_poses_are_fewer_and_within_the_tolerance() -> None:
    poses = spinning(20001)
    keys = choose_keys(poses, 2.0, 10_000)
    assert len(keys.rows) < 4000  # of 20001
    assert keys.position <= 1e-6 * 2.0
    assert keys.orientation <= 1e-6


def test_too_many_key_poses_make_the_error_larger_and_say_so() -> None:
    poses = spinning(20001)
    few = choose_keys(poses, 2.0, 500)
    assert len(few.rows) <= 500
    assert few.orientation > choose_keys(poses, 2.0, 10_000).orientation


def test_key_poses_gather_at_a_corner() -> None:
    t = np.linspace(0.0, 1.0, 1001)
    values = np.zeros((1001, 1, 7))
    values[:, 0, 0] = np.abs(t - 0.3)
    values[:, 0, 3] = 1.0
    keys = choose_keys(Poses(t, values), 1.0, 1000)
    near = np.abs(t[keys.rows] - 0.3) < 0.05
    assert near.sum() > 0.4 * len(keys.rows)  # in a tenth of the time
    assert len(keys.rows) < 100
    assert keys.position < 1e-6


def test_packed_poses_are_within_a_millionth_of_the_size() -> None:
    poses = spinning(2001)
    rows = np.arange(2001)
    packed = pack_poses(poses, rows)
    found = unpacked(packed["values"]).reshape(2001, 2, 7).astype(float)
    found[..., :3] = packed["middle"] + packed["lengthUnit"] * found[..., :3]
    found[..., 3:] *= packed["eulerUnit"]
    assert np.abs(found - poses.values)[..., :3].max() < 2.5e-7  # half of 2**-22 of the reach, 1 m
    assert np.abs(found - poses.values)[..., 3:].max() < 1e-7


def test_poses_of_a_run_have_quaternions_that_do_not_jump(tmp_path) -> None:
    run_folders.write(tmp_path / "run")
    sample = read_sample(tmp_path / "run", 10_000, 1000)
    poses = poses_of_run(sample)
    states, _ = run_folders.conical_rows()
    assert (poses.values[:, 0, :3] == states[:, 1:4]).all()
    same = np.abs((poses.values[:, 0, 3:] * quaternions(states[:, 4:7])).sum(axis=1))
    assert np.abs(same - 1.0).max() < 1e-14
    assert ((poses.values[1:, 0, 3:] * poses.values[:-1, 0, 3:]).sum(axis=1) > 0.9).all()


def test_columns_keep_their_extremes() -> None:
    t = np.linspace(0.0, 1.0, 100_001)
    values = np.zeros((100_001, 2))
    values[777, 0], values[50_123, 1] = 5.0, -3.0
    packed = pack_columns(
        Columns(["a.x", "b.Fx"], ["states", "reactions"], ["m", "N"], t, values), 1000
    )
    found = packed["least"] + np.array(packed["step"]) * unpacked(packed["values"])
    assert not packed["every"]
    assert len(found) <= 1000
    assert math.isclose(found[:, 0].max(), 5.0)
    assert math.isclose(found[:, 1].min(), -3.0)
    assert packed["units"] == ["m", "N"]


def test_constant_columns_come_back() -> None:
    t = np.linspace(0.0, 1.0, 5)
    packed = pack_columns(Columns(["a.x"], ["states"], ["m"], t, np.full((5, 1), 2.5)), 1000)
    assert packed["least"] == [2.5]
    assert packed["step"] == [0.0]
    assert packed["every"]


def test_columns_of_a_run(tmp_path) -> None:
    run_folders.write(tmp_path / "run")
    sample = read_sample(tmp_path / "run", 10_000, 1000)
    columns = columns_of_run(sample, ("Bob.?", "*.Fz"))
    assert columns.names == ["Pivot.Fz", "Bob.x", "Bob.y", "Bob.z"]
    assert columns.units == ["N", "m", "m", "m"]
    assert (columns.values[:, 1] == run_folders.conical_rows()[0][:, 1]).all()
    with pytest.raises(ResultError, match=r"no column matches 'Bo\.\*'"):
        columns_of_run(sample, ("Bo.*",))
