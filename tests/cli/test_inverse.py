"""The command ``msahl inverse``: its folder, what it refuses, and the commands of its page."""

import json
import re
import shlex

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import msahl
from msahl import terminal
from msahl.cli.main import main
from msahl.post.cli import main as post
from tests.support.models import ROOT

PAGE = (ROOT / "docs" / "inverse.md").read_text()
FOUR_BAR = ROOT / "decks" / "machines" / "motor_four_bar.xml"
COMMANDS = [line.strip() for line in re.findall(r"^    (msahl.*)$", PAGE, re.M)]


def call(*words, of=main):
    return CliRunner().invoke(of, [str(word) for word in words])


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A run and the loads of its motion."""
    root = tmp_path_factory.mktemp("inverse")
    model = msahl.load(FOUR_BAR)
    model.run(scheme="gauss3", dt=0.004, t_final=0.048, error="off").write(root / "run")
    result = call("inverse", FOUR_BAR, "--motion", root / "run", "-o", root / "loads")
    assert result.exit_code == 0, result.output
    return root


def test_the_folder_has_the_loads_and_the_tables_of_a_run(folders):
    drives = pd.read_csv(folders / "loads/drives.csv")
    signals = pd.read_csv(folders / "run/signals.csv")
    assert list(drives) == [
        "time", "Motor.load", "Motor.error", "Motor.power", "Motor.work", "missingForce",
    ]  # fmt: skip
    wrong = np.abs(drives["Motor.load"] - signals["Motor.load"])
    assert np.all(wrong <= drives["Motor.error"])
    told = json.loads((folders / "loads/run.json").read_text())
    assert told["inverse"]["drives"]["Motor"]["unique"] is True
    assert told["verdict"]["word"] in ("PASS", "WARN")
    read = msahl.read(folders / "loads")
    assert read["Motor.load"] == pytest.approx(drives["Motor.load"].to_numpy(), abs=0.0)


@pytest.mark.parametrize(
    "kind",
    [
        *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("plot", "report")),
        *("view", "energy", "reactions"),
    ],
)
def test_the_folder_can_be_evaluated(folders, kind):
    result = call(kind, folders / "loads", of=post)
    assert result.exit_code == 0, result.output


@pytest.mark.slow
def test_long_tables_have_lines_in_a_pipe(folders, monkeypatch):
    """They count both tables, and -q prints none."""
    for name in ("FIRST", "LONGEST"):
        monkeypatch.setattr(terminal, name, 0.0)
    words = ("inverse", FOUR_BAR, "--motion", folders / "run", "--companion", folders / "run")
    lines = call(*words).stderr.splitlines()
    assert any(line.startswith("  inverse: 13 of 26 rows, about") for line in lines)
    assert any(line.startswith("  inverse: 26 of 26 rows") for line in lines)
    assert "of 26 rows" not in call(*words, "-q").stderr


@pytest.mark.slow
def test_motions_by_a_table_and_as_what_the_command_wrote(folders, tmp_path):
    columns = pd.read_csv(folders / "run/joints.csv")[["time", "Shaft.angle", "Shaft.angleRate"]]
    columns.to_csv(tmp_path / "motion.csv", index=False)
    by_table = call("inverse", FOUR_BAR, "--motion", tmp_path / "motion.csv")
    assert by_table.exit_code == 0, by_table.output
    assert "given: Shaft.angle, with rates" in by_table.output
    # The command writes accelerations, of which the loads follow without a spline.
    again = call("inverse", FOUR_BAR, "--motion", folders / "loads", "-o", tmp_path / "again")
    assert "rates and accelerations" in again.output
    first, second = (
        pd.read_csv(folder / "drives.csv")["Motor.load"]
        for folder in (folders / "loads", tmp_path / "again")
    )
    assert second.to_numpy() == pytest.approx(first.to_numpy(), abs=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,Shaft.angle\n0,1\n0.1,x\n", "'x' is not a number"),
        ("time,Shaft.angle\n0,1\n0.1\n", "1 numbers under 2 columns"),
        ("time,Shaft.angle,Shaft.angle\n0,1,1\n", "appears twice"),
        ("time,Shaft.angle\n", "0 rows"),
        ("t,Shaft.angle\n0,1\n", "no column 'time'"),
        ("", "no column 'time'"),
    ],
)
def test_tables_that_cannot_be_read(tmp_path, text, message):
    (tmp_path / "motion.csv").write_text(text)
    result = call("inverse", FOUR_BAR, "--motion", tmp_path / "motion.csv")
    assert result.exit_code == 2
    assert message in result.output
    assert "Traceback" not in result.output


def test_what_the_command_refuses(folders, tmp_path):
    motion = ("--motion", folders / "run")
    for words, message in (
        ((), "Missing option '--motion'"),
        (("--motion", tmp_path / "no.csv"), "cannot be read"),
        (("--motion", tmp_path), "not the folder of a run"),
        ((*motion, "-o", folders / "run"), "it holds the motion"),
        ((*motion, "--weight", "Motor"), "such as Motor=2"),
        ((*motion, "--loads", "Motr"), "did you mean Motor"),
        ((*motion, "--smooth", "-1"), "--smooth"),
    ):
        result = call("inverse", FOUR_BAR, *words)
        assert result.exit_code == 2, result.output
        assert message in result.output
    other = call("inverse", ROOT / "decks/machines/cart_pole.xml", *motion)
    assert other.exit_code == 2
    assert "the run is of another model" in other.output


def test_a_failed_verdict_is_an_exit_status(tmp_path):
    rows = [f"{0.01 * k},0,0.2" for k in range(10)]
    (tmp_path / "held.csv").write_text("\n".join(["time,Slide.slide,Hinge.angle", *rows]))
    deck = ROOT / "decks/machines/cart_pole.xml"
    result = call("inverse", deck, "--motion", tmp_path / "held.csv", "-q")
    assert result.exit_code == 1
    assert "cannot be produced" in result.output


def without_numbers(text):
    return re.sub(r"[-+]?\d[\d.]*(e[-+]\d+)?", "#", re.sub(r" +", " ", text)).strip()


@pytest.mark.slow
def test_the_commands_of_the_page_print_what_it_says(tmp_path, monkeypatch):
    """But for numbers, which are as exact as the machine's round-off lets them be."""
    (tmp_path / "decks").symlink_to(ROOT / "decks")
    monkeypatch.chdir(tmp_path)
    told = []
    for command in COMMANDS:
        program, *words = shlex.split(command)
        result = call(*words, of={"msahl": main, "msahl-post": post}[program])
        assert result.exit_code == 0, result.output
        told.append(result.output)
    (listing,) = re.findall(r"^```\n(.*?)^```", PAGE, re.M | re.S)
    assert without_numbers(told[1]).startswith(without_numbers(listing))
    assert "5.633043" in told[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("head", "words"),
    [
        ('"time [s]","Shaft.angle [deg]"', ()),
        ("time (ms),Shaft.angle [deg]", ()),
        ("t,q1,torque", ("--map", "t=time:ms, q1=Shaft.angle:deg")),
        ("t [ms],q1 [rad],voltage [V]", ("--map", "t=time", "--map", "q1=Shaft.angle:deg")),
    ],
)
def test_tables_name_columns_and_units_as_they_come(folders, tmp_path, head, words):
    joints = pd.read_csv(folders / "run/joints.csv")
    time = joints["time"] * (1e3 if "ms" in head or words else 1.0)
    columns = [time, np.degrees(joints["Shaft.angle"])]
    columns += [0.0 * time] if head.count(",") > 1 else []
    path, plain = tmp_path / "measured.csv", tmp_path / "plain.csv"
    np.savetxt(path, np.stack(columns, 1), "%.17g", ",", header=head, comments="")
    joints[["time", "Shaft.angle"]].to_csv(plain, index=False)
    for table, more in ((path, words), (plain, ())):
        result = call("inverse", FOUR_BAR, "--motion", table, *more, "-o", tmp_path / table.stem)
        assert result.exit_code == 0, result.output
    found, expected = (
        pd.read_csv(tmp_path / name / "drives.csv")["Motor.load"] for name in ("measured", "plain")
    )
    # Degrees and milliseconds change the last digit of values that are differentiated twice.
    assert np.abs(found - expected).max() <= 1e-8 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("head", "words", "expected"),
    [
        ("time,Shaft.angle [kg]", (), "the unit 'kg' of Shaft.angle is none of its own; give one"),
        ("time,q1", ("--map", "q2=Shaft.angle"), "no column 'q2' to map; the table has time, q1"),
        ("time,q1", ("--map", "Shaft.angle"), "map a column of the table to a coordinate"),
        ("time", (), "measured.csv:2:"),
    ],
)
def test_faults_of_columns(folders, tmp_path, head, words, expected):
    path = tmp_path / "measured.csv"
    path.write_text(f"{head}\n" + "".join(f"{0.1 * k},{k}\n" for k in range(9)))
    result = call("inverse", FOUR_BAR, "--motion", path, *words)
    assert result.exit_code == 2
    assert expected in result.output


def test_motors_at_the_coordinates_of_the_table_are_the_default(tmp_path):
    """A pendulum without any drive."""
    deck = ROOT / "decks/basics/parameters.xml"
    name = msahl.load(deck).records.joints[0].name
    time = np.linspace(0.0, 1.0, 11)
    angle = 0.1 * time**3
    path = tmp_path / "measured.csv"
    head = f"time,{name}.angle"
    np.savetxt(path, np.stack([time, angle], 1), "%.17g", ",", header=head, comments="")
    result = call("inverse", deck, "--motion", path)
    assert result.exit_code in (0, 1), result.output
    assert re.search(rf"{name}.angle +N m", result.output)
