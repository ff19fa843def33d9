"""Every command refuses decks, tables and values that make no sense: exit status 2, the place, the
remedy, and nothing of Python."""

import os
import select
import subprocess

import pytest
from click.testing import CliRunner

from msahl.cli.main import COMMANDS, main
from tests.support.models import ROOT

FOUR_BAR = ROOT / "decks" / "machines" / "motor_four_bar.xml"
MORE = {
    "sweep": ("--set", "Bob.mass=1,2"),
    "inverse": ("--motion", "nowhere.csv"),
    "show": ("-o", "page.html"),
}
"""What a command needs besides a deck."""
WITHOUT_DECK = {"compile", "new", "schema"}
ROD = (
    "<data><system><gravity><g3>-9.81</g3></gravity><bodies><ground><name>G</name></ground>"
    "<rigidBody><name>A</name><mass>{mass}</mass><moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>"
    "</rigidBody></bodies></system><simulation><deltaT>0.1</deltaT><tFinal>1</tFinal></simulation>"
    "</data>"
)
DECKS = {
    "empty": b"",
    "blank": b"\n\n",
    "binary": bytes(range(256)),
    "cut": FOUR_BAR.read_bytes()[:900],
    "text": b"time,Shaft.angle\n0,1\n",
    "html": b"<html><body>404</body></html>",
    "nan": ROD.replace("{mass}", "nan").encode(),
    "negative": ROD.replace("{mass}", "-1").encode(),
    "utf16": ROD.replace("{mass}", "kg").encode("utf-16"),
    "entity": b'<!DOCTYPE a [<!ENTITY b "c">]><data>&b;</data>',
    "folder": None,
}


def refused(words, place):
    """Call a command that has to refuse its input; return what it says."""
    result = CliRunner().invoke(main, [str(word) for word in words])
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code == 2, result.output
    assert place in result.stderr
    assert "Traceback" not in result.stderr
    assert "Warning" not in result.stderr
    assert max(map(len, result.stderr.splitlines())) < 1000
    return result.stderr


@pytest.mark.parametrize("command", sorted({*COMMANDS} - WITHOUT_DECK))
def test_decks_that_are_none(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, data in DECKS.items():
        path = tmp_path / f"{name}.xml"
        path.mkdir() if data is None else path.write_bytes(data)
        refused((command, path.name, *MORE.get(command, ())), path.name)
    refused((command, "nowhere.xml", *MORE.get(command, ())), "nowhere.xml")
    assert not (tmp_path / "results").exists()


ROWS = [f"{0.004 * k:g},{0.1 * k:g}" for k in range(13)]
HEAD = "time,Shaft.angle"
TABLES = {
    "nan": ([HEAD, *ROWS[:5], "0.02,nan", *ROWS[6:]], "row 6: Shaft.angle is nan"),
    "infinite": ([HEAD, *ROWS[:5], "inf,0.5", *ROWS[6:]], "row 6: time is inf"),
    "backwards": ([HEAD, *ROWS[:9], ROWS[2]], "row 10: time 0.008 s follows 0.032 s"),
    "late": ([HEAD, *ROWS[3:]], "the first time is 0.012 s"),
    "twice": ([f"{HEAD},Shaft.angle", *(f"{row},1" for row in ROWS)], "appears twice"),
    "unknown": ([f"{HEAD},Shift.angle", *(f"{row},1" for row in ROWS)], "did you mean Shaft.angle"),
    "longer head": ([f"{HEAD},Rocker pin.angle", *ROWS], ":2: 2 numbers under 3 columns"),
    "shorter head": (["time", *ROWS], ":2: 2 numbers under 1 columns"),
    "ragged": ([HEAD, *ROWS[:4], "0.016"], ":6: 1 numbers under 2 columns"),
    "words": ([HEAD, *ROWS[:4], "0.016,x"], ":6: 'x' is not a number"),
    "underscore": ([HEAD, *ROWS[:4], "0.016,1_0"], ":6: '1_0' is not a number"),
    "nul": ([HEAD, "0,0\x00"], ":2: '0\\x00' is not a number"),
    "semicolons": ([HEAD, "0;0"], ":2: 1 numbers under 2 columns"),
    "deck": (FOUR_BAR.read_text().splitlines(), "correct the table"),
    "tiny": (
        [HEAD, *(f"{1e-300 * k:g},{0.1 * k:g}" for k in range(13))],
        "numbers become infinite",
    ),
    "huge": ([HEAD, *(f"{1e300 * k:g},{0.1 * k:g}" for k in range(13))], "numbers become infinite"),
}


@pytest.mark.parametrize("name", TABLES)
def test_tables_that_are_none(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines, expected = TABLES[name]
    (tmp_path / "table.csv").write_text("\n".join(lines))
    said = refused(("inverse", FOUR_BAR, "--motion", "table.csv"), "table.csv")
    assert expected in said


@pytest.mark.skipif(os.name != "posix", reason="devices of Unix")
def test_a_device_is_no_table():
    assert "a device" in refused(("inverse", FOUR_BAR, "--motion", "/dev/zero"), "/dev/zero")


@pytest.fixture
def endless(tmp_path):
    """A pipe to which lines are written as long as somebody reads."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    end = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    writer = subprocess.Popen(("sh", "-c", f"exec yes 1,2 > '{pipe}'"), stderr=subprocess.DEVNULL)
    select.select([end], [], [])  # somebody writes
    yield pipe
    writer.kill()
    writer.wait()
    os.close(end)


@pytest.mark.skipif(os.name != "posix", reason="pipes of Unix")
@pytest.mark.parametrize(
    ("words", "limit", "expected"),
    [
        (("check",), "msahl.deck.parse.MAX_BYTES", "larger than 1 MiB"),
        (("inverse", FOUR_BAR, "--motion"), "msahl.analysis.inverse.table.MOST_BYTES", "1 MiB"),
        (("sweep", FOUR_BAR, "--plan"), None, "a pipe; a plan is read again"),
    ],
)
def test_a_pipe_without_end_is_read_up_to_a_limit(words, limit, expected, endless, monkeypatch):
    if limit is not None:
        monkeypatch.setattr(limit, 2**20)
    assert expected in refused((*words, endless), endless.name)


@pytest.mark.skipif(os.name != "posix", reason="pipes of Unix")
def test_a_table_may_come_from_a_pipe():
    """As from a shell's <(...): its lines are judged as those of a file, also with ends \\r\\n."""
    end, begin = os.pipe()
    os.write(begin, b"time,nothing\r\n0,1\r\n")
    os.close(begin)
    said = refused(("inverse", FOUR_BAR, "--motion", f"/dev/fd/{end}"), f"/dev/fd/{end}")
    os.close(end)
    assert "no coordinate 'nothing'" in said


@pytest.mark.skipif(os.name != "posix", reason="pipes of Unix")
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("run",), "the file is empty"),
        (("show",), "the file is empty"),
        (("inverse", FOUR_BAR, "--motion"), "no column 'time'"),
    ],
)
def test_a_pipe_into_which_nobody_writes_is_empty(words, expected, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    assert expected in refused((*words, tmp_path / "pipe"), "pipe")


PENDULUM = ROOT / "decks" / "basics" / "pendulum_by_angle.xml"
CRANK = ROOT / "decks" / "mechanisms" / "slider_crank.xml"
VALUES = [
    ("kinematics", CRANK, "--step", "nan"),
    ("kinematics", CRANK, "--step", "0"),
    ("kinematics", CRANK, "--t-final", "1e400"),
    ("kinematics", CRANK, "--every", "0"),
    ("kinematics", CRANK, "--set", "Nobody.mass=1"),
    ("kinematics", PENDULUM),
    ("equilibrium", PENDULUM, "--starts", "-1"),
    ("equilibrium", PENDULUM, "--set", "Rod.mass=nan"),
    ("modes", PENDULUM, "--at", "nan"),
    ("modes", PENDULUM, "--at", "-1"),
    ("modes", PENDULUM, "--number", "0"),
    ("modes", PENDULUM, "--over", "Nobody.mass=1:2:3"),
    ("modes", PENDULUM, "--over", "Rod.mass"),
    ("linearize", PENDULUM, "--inputs", "Nobody"),
    ("linearize", PENDULUM, "--outputs", "Nobody.angle"),
    ("linearize", PENDULUM, "--at", "inf"),
    ("run", PENDULUM, "--gradient", "Rod.x", "--wrt", "Rod.mass"),
    ("run", PENDULUM, "--gradient", "Rod.x final", "--wrt", "Nobody.mass"),
    ("run", PENDULUM, "--gradient", "Rod.x final"),
    ("run", PENDULUM, "--wrt", "Rod.mass"),
]


@pytest.mark.parametrize(
    "words", VALUES, ids=lambda words: " ".join(map(str, (words[0], *words[2:])))
)
def test_values_that_make_no_sense(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused(words, "")
    assert not (tmp_path / "results").exists()
