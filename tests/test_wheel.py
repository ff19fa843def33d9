"""What a wheel contains, and that building one leaves nothing behind."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from msahl.jit import files
from tests.support.models import ROOT
from tools import build_wheel

BUILD = """
import sys, time
from tools import build_wheel
with build_wheel.temporary_folder() as folder:
    (folder / "large").write_bytes(bytes(1000))
    print(folder, flush=True)
    time.sleep(600)
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder for temporary folders, here and in other processes."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


def killed_build(number):
    """The folder of a build that was ended by a signal while it was under way."""
    command = [sys.executable, "-c", BUILD]
    build = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    folder = Path(build.stdout.readline().strip())
    assert (folder / "large").is_file()
    build.send_signal(number)
    build.communicate(timeout=120)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_an_interrupted_build_removes_its_folder(place, number):
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip("the tests ignore it, as under nohup, and so does what they start")
    assert not killed_build(number).exists()


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_the_folder_of_a_killed_build_is_removed_by_the_next(place):
    left = killed_build(signal.SIGKILL)
    assert left.exists()
    build_wheel.remove_abandoned()
    assert not left.exists()


def test_the_folder_of_a_build_under_way_is_left_alone(place):
    folder = place / f"{build_wheel.PREFIX}other"
    folder.mkdir()
    command = [sys.executable, "-c", HOLD, str(folder / "lock")]
    other = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE)
    other.stdout.readline()
    build_wheel.remove_abandoned()
    assert folder.exists()
    other.kill()
    other.communicate()
    build_wheel.remove_abandoned()
    assert not folder.exists()


HOLD = """
import sys, time
from msahl.locks import lock
with open(sys.argv[1], "wb") as file:
    lock(file.fileno())
    print(flush=True)
    time.sleep(600)
"""


@pytest.mark.parametrize(
    ("machine", "system", "levels"),
    [
        ("x86_64", "linux", ["x86-64-v3", "x86-64"]),
        ("AMD64", "win32", ["x86-64-v3", "x86-64"]),
        ("aarch64", "linux", ["generic"]),
        ("arm64", "darwin", ["apple-m1"]),
        ("riscv64", "linux", []),
    ],
)
def test_each_platform_has_its_processors(machine, system, levels):
    """The last one needs nothing, so that the wheel runs on every machine of its platform."""
    found = files.portable_levels(machine, system)
    assert list(found) == levels
    assert not levels or found[levels[-1]] == ()


def test_translated_code_is_taken_over_and_named_for_the_wheel(tmp_path, monkeypatch):
    from msahl.jit import compiled
    from msahl.jit.kernel_store import Store

    known, own = Store(tmp_path / "a" / "kernels"), Store(tmp_path / "b" / "kernels")
    monkeypatch.setattr(compiled, "STORE", own)
    known.save("f-1234-host.bc", b"code")
    known.save("g-1234-host.bc", b"damaged")
    (known.folder / "g-1234-host.bc").write_bytes(b"x" * 100)
    known.save("f-1234-other.bc", b"of another machine")
    build_wheel._take_over(known, "host", "level")
    assert [path.name for path in own.folder.iterdir()] == ["f-1234-level.bc"]
    assert own.load("f-1234-level.bc") == b"code"
