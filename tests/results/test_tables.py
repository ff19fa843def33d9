"""Tables on disk: every number as it was, complete or visibly partial, never of two runs."""

import os

import numpy as np
import pytest

from msahl.results.read import read_table
from msahl.results.write import RunFolder, replace_file, write_json
from msahl.system.build import build_system
from msahl.system.names import describe_row, reaction_columns, state_columns, work_columns
from tests.support.models import loaded, pendulum

NASTY = [
    *(0.0, -0.0, 0.1, 1.0 / 3.0, 1e22, 5e-324, 2.2250738585072014e-308, 1.7976931348623157e308),
    *(9007199254740993.0, 1e16, 123456789.123456789, -1e-7, np.nextafter(1.0, 2.0), np.pi),
]


def folder_of(path, model=None):
    return RunFolder(path, model or pendulum(), b"<deck/>")


def rows_of(states):
    """Rows for a pendulum's tables, in their widths of 13 and 4."""
    states = np.asarray(states, dtype=float)
    return {"states": states, "reactions": states[:, :4], "work": states[:, :1]}


def bits(table):
    return table.to_numpy().view(np.int64)


def test_numbers_read_back_bit_for_bit(tmp_path):
    rng = np.random.default_rng(0)
    # Every exponent and sign a double can have, and the cases that formatters get wrong.
    random = rng.integers(-(2**63), 2**63 - 1, size=(2000, 13)).view(np.float64)
    random = np.where(np.isfinite(random), random, 1.0)
    states = np.vstack([random, np.resize(NASTY, (20, 13))])
    with folder_of(tmp_path) as results:
        results.write(rows_of(states))
        results.complete = True
    table = read_table(tmp_path / "states.csv")
    assert list(table.columns) == state_columns(pendulum())
    assert np.array_equal(bits(table), states.view(np.int64))


def test_a_table_has_its_name_only_when_it_is_complete(tmp_path):
    rows = rows_of(np.ones((3, 13)))
    with folder_of(tmp_path) as results:
        results.write(rows)
        assert {p.name for p in tmp_path.iterdir()} == {
            "deck.xml",
            "states.csv.part",
            "reactions.csv.part",
        }
        # Rows are on disk as soon as they are written.
        assert (tmp_path / "states.csv.part").read_text().count("\n") == 4
        results.complete = True
    assert {p.name for p in tmp_path.iterdir()} == {"deck.xml", "states.csv", "reactions.csv"}


def test_an_error_leaves_the_tables_partial(tmp_path):
    def fail():
        with folder_of(tmp_path) as results:
            results.write(rows_of(np.ones((3, 13))))
            results.complete = True
            raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        fail()
    assert (tmp_path / "states.csv.part").exists()
    assert not (tmp_path / "states.csv").exists()


def test_a_new_run_leaves_nothing_of_the_old_one(tmp_path):
    names = ("states.csv", "states.csv.part", "reactions.csv", "work.csv", "run.json")
    for name in names:
        (tmp_path / name).write_text("old")
    (tmp_path / "notes.txt").write_text("mine")
    with folder_of(tmp_path):
        pass
    left = {p.name for p in tmp_path.iterdir()}
    assert left == {"deck.xml", "states.csv.part", "reactions.csv.part", "notes.txt"}


def test_columns_are_named_by_bodies_joints_and_loads():
    model = loaded(np.random.default_rng(0))
    assert state_columns(model)[:13] == [
        *("time", "B0.x", "B0.y", "B0.z", "B0.P1", "B0.P2", "B0.P3"),
        *("B0.vx", "B0.vy", "B0.vz", "B0.wx", "B0.wy", "B0.wz"),
    ]
    assert reaction_columns(model)[:5] == ["time", "J0.Fx", "J0.Fy", "J0.Fz", "J1.Fx"]
    assert work_columns(model)[:3] == ["time", "L00.work", "L01.work"]


def test_rows_of_the_equations_have_words():
    model = pendulum()
    system = build_system(model)
    assert describe_row(model, system, 2) == "body 'Bob', force along z"
    assert describe_row(model, system, 4) == "body 'Bob', moment about y"
    assert describe_row(model, system, 12) == "joint 'Pivot', violation along x"


def test_json_is_written_complete(tmp_path):
    write_json(tmp_path / "run.json", {"a": 1.5, "b": None})
    assert (tmp_path / "run.json").read_text() == '{\n  "a": 1.5,\n  "b": null\n}\n'
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.skipif(os.name != "posix", reason="pipes of Unix")
def test_a_pipe_is_written_into_and_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    end = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    replace_file(tmp_path / "pipe", b"<html>")
    assert (tmp_path / "pipe").is_fifo()
    assert os.read(end, 100) == b"<html>"
    os.close(end)
